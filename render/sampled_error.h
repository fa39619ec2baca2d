#pragma once

#include "render/renderer.h"

namespace insitu {

/// Compares layers with the reference at 256 random pixels (options.seed) among those that objects
/// cover wholly, those around them (as far as they are wide and high), and those whose light they
/// change by more than 1 %. Takes some percent of the time of a reference picture. No such pixel:
/// an error of 0 at 0 pixels.
[[nodiscard]] SampledError sampleError(const Camera& camera,
                                       const RoomLight& room,
                                       const ObjectScene& objects,
                                       const InsertionOptions& options,
                                       const RenderLayers& layers,
                                       Progress& progress);

}  // namespace insitu
