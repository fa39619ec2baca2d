#pragma once

#include "render/fiv/fiv_scene.h"
#include "render/fiv/irradiance_cube.h"
#include "render/fiv/object_gloss.h"
#include "render/fiv/object_sharing.h"

#include <span>
#include <vector>

namespace insitu {

/// The light on the objects' own surfaces.
///
/// Irradiance as if nothing of the objects hid anything comes from a grid of places around them.
/// What share of it they hide from themselves, and what they send themselves, a few rays from each
/// place tell, aimed at the light and over the hemisphere. Silhouettes do not: on the object itself
/// they are off by a texel, which a chair's rails are as thin as.
class ObjectShading {
public:
    /// `node_spacing_m`: distance of the places from which the room is looked at, > 0.
    ObjectShading(const FivScene& scene, double node_spacing_m);
    /// To be called when the scene's room_change has changed.
    void update();

    /// A point of an object that is to be lit.
    struct Place {
        glm::dvec3 position{0.0};
        glm::dvec3 normal{0.0};            ///< for shading
        glm::dvec3 geometric_normal{0.0};  ///< same side
        glm::dvec2 shift{0.5};             ///< where its rays begin in their sequence
    };
    [[nodiscard]] static Place placeOf(const SurfacePoint& point);
    /// Irradiance.
    struct Received {
        Rgb open{0.0f};   ///< as if objects hid nothing, spots left out
        Rgb spots{0.0f};  ///< of spots past the objects
        RayLight rays;    ///< what of the open one is hidden, and what objects send

        /// All but that of spots, by these rays alone.
        [[nodiscard]] Rgb smooth() const { return open * rays.open() + rays.sent; }
    };
    /// `rays`: of each place, even.
    [[nodiscard]] std::vector<Received> receive(std::span<const Place> places, int rays) const;

    /// Adds to a pixel what one of its points sends towards `wo`: what waits for its neighbours to
    /// the pixel, the rest to `radiance`.
    void add(const SurfacePoint& point,
             glm::dvec3 wo,
             const Received& received,
             const LobeDraw& draw,
             ObjectPixel& pixel,
             Rgb& radiance) const;

private:
    void lookFromNodes(double spacing_m);
    [[nodiscard]] Rgb openIrradiance(const Place& place) const;
    [[nodiscard]] glm::dvec3 startOfRays(const Place& place) const;
    [[nodiscard]] Rgb spotIrradiance(const Place& place) const;
    [[nodiscard]] RayLight rayLight(const Place& place, int rays) const;

    const FivScene& scene_;
    BoundingBox box_;
    glm::ivec3 node_count_{1};
    std::vector<PlaceLight> lights_;     ///< one a node
    std::vector<DirectionTable> nodes_;  ///< their irradiance
};

/// What of even light the surface reflects in all.
[[nodiscard]] Rgb evenReflectance(const SurfaceMaterial& material);

}  // namespace insitu
