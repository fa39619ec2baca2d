#pragma once

#include "render/fiv/fiv_scene.h"
#include "render/fiv/irradiance_cube.h"

#include <span>
#include <vector>

namespace insitu {

struct ObjectLightOptions {
    /// Distance of the places from which the room is looked at around the objects, metres, > 0.
    double node_spacing_m = 0.3;
    /// How far behind a surface a place must lie to be hidden by it, texels of a silhouette, >= 0.
    float bias_texels = 1.5f;
};

/// The light on the objects' own surfaces.
///
/// Irradiance as if nothing of the objects hid anything comes from a grid of places around them;
/// the share of it that they hide from themselves from the atlas, under the mean of that light.
/// What hides shines with its own mean radiance (FivScene::glow). What is nearer than the atlas can
/// tell from the surface itself (`bias_texels`: creases, seams) is met by short rays.
class ObjectShading {
public:
    ObjectShading(const FivScene& scene, const ObjectLightOptions& options);
    /// To be called when the scene's glow (and, with `room_too`, its room_change) has changed.
    void update(bool room_too);

    /// A point of an object that is to be lit.
    struct Place {
        glm::dvec3 position{0.0};
        glm::dvec3 normal{0.0};            ///< for shading
        glm::dvec3 geometric_normal{0.0};  ///< same side
        Rgb reflectance{0.0f};             ///< of even light, in all
    };
    [[nodiscard]] static Place placeOf(const SurfacePoint& point);
    struct Received {
        Rgb smooth{0.0f};   ///< irradiance without that of spots
        Rgb spots{0.0f};    ///< irradiance of spots
        float open = 1.0f;  ///< share of the smooth light that is not hidden
    };
    [[nodiscard]] std::vector<Received> receive(std::span<const Place> places) const;

    /// Radiance of a surface point towards `wo`.
    [[nodiscard]] Rgb radiance(const SurfacePoint& point,
                               glm::dvec3 wo,
                               const Received& received) const;

private:
    void lookFromNodes(double spacing_m);
    [[nodiscard]] Rgb openIrradiance(const Place& place) const;
    [[nodiscard]] Rgb spotIrradiance(const Place& place) const;
    /// Share of even light that surfaces nearer than the atlas tells hide.
    [[nodiscard]] float hiddenNearby(const Place& place) const;
    [[nodiscard]] Rgb glossy(const SurfacePoint& point,
                             glm::dvec3 wo,
                             const Received& received) const;
    [[nodiscard]] Rgb mirrored(const SurfacePoint& point, glm::dvec3 direction) const;

    const FivScene& scene_;
    ObjectLightOptions options_;
    double near_m_ = 0.0;  ///< mean depth of the bias
    BoundingBox box_;
    glm::ivec3 node_count_{1};
    std::vector<PlaceLight> lights_;     ///< one a node
    std::vector<DirectionTable> nodes_;  ///< their irradiance
    bool any_glossy_ = false;
    PlaceLight mean_;
    DirectionTable mean_irradiance_;
    CellRadiance hideable_;
    std::vector<DirectionTable> glossy_;  ///< of evenly spaced roughnesses, the last is 1
};

/// What of even light the surface reflects in all.
[[nodiscard]] Rgb evenReflectance(const SurfaceMaterial& material);

}  // namespace insitu
