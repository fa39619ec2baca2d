#pragma once

#include "lighting/cell_light.h"
#include "lighting/visibility_atlas.h"

#include <glm/glm.hpp>

#include <array>
#include <span>
#include <vector>

namespace insitu {

/// An object under a light: its atlas, what comes from each direction, and silhouettes of its own
/// for the directions of concentrated light. A new environment, a turned object or a changed lamp
/// is a new ObjectLight of the same atlas.
struct ObjectLight {
    const VisibilityAtlas* atlas = nullptr;  ///< outlives this
    CellLight light;
    SilhouetteSet fine;  ///< one a fine direction

    [[nodiscard]] const LocalFrame& local() const { return atlas->silhouettes.local; }
};

/// Silhouettes of concentrated light: its shadows have sharp edges.
struct FineSilhouetteOptions {
    /// Texels along a side, [16, 2048].
    int resolution = 256;
    /// Samples along a texel's side, [1, 8].
    int samples = 2;

    [[nodiscard]] Findings validate() const;
};

/// `mesh` is what the atlas was made from (LogicError when light and atlas do not belong together).
[[nodiscard]] ObjectLight lightObject(const TriangleMesh& mesh,
                                      const VisibilityAtlas& atlas,
                                      CellLight light,
                                      const FineSilhouetteOptions& options,
                                      Progress& progress);

/// What an object hides from places, exactly up to the silhouettes' texels: no field in between.
///
/// Common rules: places and normals are in the object's axes, places local (LocalFrame). Neighbours
/// in a span should be neighbours in space: runs of 32 places are summed together, and cost less
/// the smaller the ball around them. `bias_texels` as in hiddenShares(). Sums run in float in a
/// fixed order: the same bytes for any number of threads and any processor. Non-finite places are
/// a LogicError.

/// FIV of the hidden light.
void hiddenVectors(const ObjectLight& object,
                   std::span<const glm::vec3> places_local,
                   std::span<IrradianceVector> hidden,
                   float bias_texels = 0.0f);
/// Irradiance of the hidden light that lies above the horizon of each place's own unit normal.
void hiddenIrradiance(const ObjectLight& object,
                      std::span<const glm::vec3> places_local,
                      std::span<const glm::vec3> unit_normals,
                      std::span<Rgb> hidden,
                      float bias_texels = 0.0f);
/// The same for one common normal: a floor, a wall, a table top. Three times as quick.
void hiddenIrradiance(const ObjectLight& object,
                      std::span<const glm::vec3> places_local,
                      glm::vec3 unit_normal,
                      std::span<Rgb> hidden,
                      float bias_texels = 0.0f);

/// What objects hide from a place.
struct HiddenIrradiance {
    Rgb light{0.0f};
    float sky = 0.0f;  ///< of a sky of radiance 1: π times the form factor from place to objects
};
/// Irradiance that the cells of an atlas give surfaces of one normal, in four lights at once: those
/// seen from the corners of a square of receivers, in which light is bilinear.
struct CornerIrradiance {
    using Corners = std::array<Rgb, 4>;
    /// Of the cells of side 0 and of side 1, one a pair; 0 below the horizon. May be negative,
    /// where the room lost more than was there.
    std::vector<Corners> along, against;
    std::vector<float> sky_along, sky_against;  ///< cosine times solid angle, 0 below the horizon
};
/// Irradiance of the hidden light, the corners mixed by each place's weights. What a place does not
/// see is the same for all four, so this costs little more than one of them.
void hiddenIrradiance(const VisibilityAtlas& atlas,
                      const CornerIrradiance& light,
                      std::span<const glm::vec3> places_local,
                      std::span<const std::array<float, 4>> weights,
                      std::span<HiddenIrradiance> hidden,
                      float bias_texels = 0.0f);

}  // namespace insitu
