#pragma once

#include "core/environment_map.h"
#include "lighting/room_light.h"

#include <glm/glm.hpp>

#include <cstdint>
#include <filesystem>
#include <optional>
#include <vector>

namespace insitu {

struct RadianceMeshOptions {
    /// Size of a patch, metres, > 0. Grown for very large rooms.
    double patch_m = 0.1;
    /// Pixels of the photograph that are looked at for reflectance, at most, > 0.
    int max_pixels = 1'000'000;

    [[nodiscard]] Findings validate() const;
};

/// Who told a patch's radiance.
enum class PatchSource : std::uint8_t {
    Probe,       ///< the light probe saw it
    Photograph,  ///< only the photograph saw it, or nobody: RoomLight's answer
    Opening,     ///< part of a window or door: what the probe saw through it
};

/// A triangle of the room's surface.
struct RadiancePatch {
    glm::uvec3 corners{0};   ///< of RadianceMesh::vertices, counter-clockwise from where it is seen
    std::uint32_t face = 0;  ///< of the proxy
    PatchSource source = PatchSource::Photograph;
    double area_m2 = 0.0;
    Rgb radiance{0.0f};
    Rgb irradiance{0.0f};   ///< 0 for openings
    Rgb reflectance{0.0f};  ///< Lambert; 0 for openings
};

/// The mean of the patches around it, weighted by their areas. Faces share no vertices.
struct RadianceVertex {
    glm::dvec3 position_m{0.0};
    glm::dvec3 normal{0.0};
    Rgb radiance{0.0f};
    Rgb reflectance{0.0f};
};

/// The room as triangles that shine, for other programs and for methods that need patches.
struct RadianceMesh {
    std::vector<RadianceVertex> vertices;
    std::vector<RadiancePatch> patches;
};

/// The captured light as a mesh.
///
/// The probe's radiance is projected outwards from its place: a patch takes the mean over the
/// directions in which it is seen, so that the mesh sends the probe as much light as came (what is
/// clipped in every exposure is as strong as `room` found it). Patches that the probe did not see
/// have the radiance that `room` gives them: the photograph's, or gathered light times the
/// reflectance of their face, 0.5 where nothing of it was seen. Reflectance is radiance over
/// irradiance: for each pixel of the photograph that of the surface seen there, averaged over the
/// patch; elsewhere that of the room's cells.
///
/// probe, photograph   those that `room` was made with
/// Source: [GibCha03] section 4.2.
[[nodiscard]] RadianceMesh makeRadianceMesh(const RoomLight& room,
                                            const EnvironmentMap& probe,
                                            glm::dvec3 probe_center_m,
                                            const std::optional<PhotographedRadiance>& photograph,
                                            const RadianceMeshOptions& options);

/// Irradiance that the mesh sends to a point: the exact integral over each triangle above the
/// horizon (Lambert's formula), times the share of it that the room's surfaces leave visible.
/// Source: [BauRusWin89].
[[nodiscard]] glm::dvec3 irradianceFromMesh(const RadianceMesh& mesh,
                                            const RoomLight& room,
                                            glm::dvec3 x,
                                            glm::dvec3 unit_normal);

/// By extension. .ply (binary, little endian): vertices with x y z, nx ny nz, radiance_r _g _b and
/// reflectance_r _g _b as float; faces with vertex_indices, radiance and reflectance. .json: the
/// same as lists. Another extension is an InputError.
void writeRadianceMesh(const std::filesystem::path& path, const RadianceMesh& mesh);

}  // namespace insitu
