#pragma once

#include "core/camera.h"
#include "core/finding.h"
#include "core/image.h"
#include "core/photo.h"
#include "lighting/light_reference.h"
#include "pipeline/project.h"

#include <optional>
#include <string>
#include <vector>

namespace insitu {

/// A picture in the light's unit that shows a grey card or ball.
struct ReferencePicture {
    const Image<Rgb>& radiance;
    const Image<Rgb>& clipped;       ///< part of it that is a lower bound; empty: none
    glm::dvec2 crop_origin_px{0.0};  ///< pixel of the full frame that is its pixel (0, 0)
    const Camera* camera = nullptr;  ///< of the full frame; needed for a ball
    std::string name;                ///< for messages
};

/// Irradiance that a card or a ball shows: π L / reflectance, of a card the median over its area,
/// of a ball for some hundred normals over nine tenths of its radius (nothing is taken from where
/// it is clipped). Errors of the reflectance are common to a group. `position_m` defaults to
/// `probe_center_m`.
///
/// Ball: seen by the camera as the outline says, a sphere's cone of sight; its size in metres does
/// not matter.
///
/// Finding "light-reference-uneven": a card's area varies by more than 15 % (half the interdecile
/// range): something lies on it, or its outline is off. InputError: the area is not in the picture,
/// is clipped, or is black.
[[nodiscard]] ReferenceGroup measureReference(const ProjectReference& reference,
                                              const ReferencePicture& picture,
                                              glm::dvec3 probe_center_m,
                                              Findings& findings);

/// Cards and balls that the project's photograph shows. `radiance` is the photograph's in the
/// light's unit. InputError as above.
[[nodiscard]] std::vector<ReferenceGroup> photographedReferences(const ProjectProbe& probe,
                                                                 const EncodedImage& photo,
                                                                 const Image<Rgb>& radiance,
                                                                 const Camera& camera,
                                                                 const std::string& name,
                                                                 Findings& findings);

/// The groups of numbers that were given: irradiance each by itself, all readings in lux together,
/// as the unit they share is not the camera's.
[[nodiscard]] std::vector<ReferenceGroup> givenReferences(
    const std::vector<ProjectReference>& references, glm::dvec3 probe_center_m);

}  // namespace insitu
