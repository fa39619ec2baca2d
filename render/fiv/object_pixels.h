#pragma once

#include "core/camera.h"
#include "core/layers.h"
#include "render/fiv/object_light.h"
#include "render/fiv/receiver_light.h"

#include <optional>
#include <vector>

namespace insitu {

/// What the camera sees: the objects go into the layers (object, alpha, depth), the room's surfaces
/// into `receivers`, a pixel each; none where objects cover the whole pixel, or where there is no
/// surface. A pixel is an object's by the share of 4 rays, 16 at edges.
[[nodiscard]] std::vector<std::optional<ReceiverPlace>> renderObjectPixels(
    const Camera& camera,
    const FivScene& scene,
    const ObjectShading& shading,
    RenderLayers& layers,
    Progress& progress);

}  // namespace insitu
