#pragma once

#include "core/layers.h"
#include "render/fiv/receiver_light.h"

#include <optional>
#include <vector>

namespace insitu {

/// Fills the layers' irradiances (and what the probe saw) for the receivers, one a pixel or none.
///
/// Light is computed for every fourth pixel, and for all pixels of a square of these where linear
/// interpolation may be off by more than `tolerance` (of with/without), that holds an edge, or that
/// is near an object; the rest is interpolated. The light of spots has squares of its own.
/// Returns how many pixels were computed, as a share of all receivers.
double renderReceiverPixels(const FivScene& scene,
                            const std::vector<std::optional<ReceiverPlace>>& receivers,
                            ReceiverLight& light,
                            double tolerance,
                            RenderLayers& layers,
                            Progress& progress);

}  // namespace insitu
