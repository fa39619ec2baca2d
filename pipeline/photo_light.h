#pragma once

#include "lighting/room_light.h"
#include "pipeline/insert.h"
#include "reconstruct/scene_proxy.h"

#include <glm/glm.hpp>

#include <optional>
#include <vector>

namespace insitu {

// What insertObjects and projectRadianceMesh share of the photograph: each reads what the stages
// before it left in `result` and adds its findings to it.

/// The photograph is a single exposure: its response is the probe's when one camera took both. Or
/// it holds radiance, in a unit of its own.
/// Else it is the picture's profile's, unless surfaces that the probe sees too tell another one.
/// Findings: "photo-response-assumed-srgb", "photo-response-estimated". InputError: no exposure
/// time where the probe's is known, or one of an HDR photograph.
void choosePhotoResponse(const Project& project, const SceneProxy& proxy, InsertResult& result);

/// The photograph's light, and the same in the light probe's exposure and white balance for the
/// stages that make the room's light from both: nothing where their units cannot be compared.
struct PhotoLight {
    Image<Rgb> taken;
    std::optional<PhotographedRadiance> in_probe_unit;
};

/// Measures and chooses `result.balance` on the way.
[[nodiscard]] PhotoLight photoLight(const Project& project,
                                    const SceneProxy& proxy,
                                    const glm::dmat3& primaries,
                                    InsertResult& result);

/// What probe, numbers and photograph tell of the light; the last where both share a unit.
[[nodiscard]] std::vector<ReferenceGroup> allReferences(
    const Project& project,
    const std::optional<PhotographedRadiance>& photographed,
    InsertResult& result);

}  // namespace insitu
