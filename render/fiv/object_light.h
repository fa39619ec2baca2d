#pragma once

#include "render/fiv/fiv_scene.h"
#include "render/fiv/irradiance_cube.h"
#include "render/fiv/object_gloss.h"

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
/// What hides shines with what a few rays from the place meet of it. What is nearer than the atlas
/// can tell from the surface itself (`bias_texels`: creases, seams) is hidden by the same rays.
class ObjectShading {
public:
    ObjectShading(const FivScene& scene, const ObjectLightOptions& options);
    /// To be called when the scene's room_change has changed.
    void update();

    /// A point of an object that is to be lit.
    struct Place {
        glm::dvec3 position{0.0};
        glm::dvec3 normal{0.0};            ///< for shading
        glm::dvec3 geometric_normal{0.0};  ///< same side
    };
    [[nodiscard]] static Place placeOf(const SurfacePoint& point);
    struct Received {
        Rgb smooth{0.0f};  ///< irradiance without that of spots
        Rgb spots{0.0f};   ///< irradiance of spots
    };
    [[nodiscard]] std::vector<Received> receive(std::span<const Place> places) const;

    /// Radiance of a surface point towards `wo`: all that needs no smoothing is in `sharp`.
    [[nodiscard]] Gloss radiance(const SurfacePoint& point,
                                 glm::dvec3 wo,
                                 const Received& received,
                                 const LobeDraw& draw) const;

private:
    void lookFromNodes(double spacing_m);
    [[nodiscard]] Rgb openIrradiance(const Place& place) const;
    [[nodiscard]] Rgb spotIrradiance(const Place& place) const;
    /// What objects are to a place on them, by a few rays.
    struct Around {
        Rgb sent{0.0f};  ///< mean radiance of what hides light
        Rgb sent_nearby{0.0f};
        float hidden_nearby = 0.0f;  ///< share of even light that is hidden nearer than the atlas
                                     ///< tells, of what it leaves
    };
    [[nodiscard]] Around lookAtObjects(const Place& place) const;

    const FivScene& scene_;
    ObjectLightOptions options_;
    double near_m_ = 0.0;  ///< mean depth of the bias
    BoundingBox box_;
    glm::ivec3 node_count_{1};
    std::vector<PlaceLight> lights_;     ///< one a node
    std::vector<DirectionTable> nodes_;  ///< their irradiance
    DirectionTable mean_irradiance_;
    CellRadiance hideable_;  ///< mean light of the nodes
};

/// What of even light the surface reflects in all.
[[nodiscard]] Rgb evenReflectance(const SurfaceMaterial& material);

}  // namespace insitu
