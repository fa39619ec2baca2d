#pragma once

#include "render/renderer.h"

#include <span>
#include <vector>

namespace insitu {

/// renderInsertion() by technique reference; options are valid.
[[nodiscard]] InsertionResult renderReference(const Camera& camera,
                                              const RoomLight& room,
                                              const ObjectScene& objects,
                                              const InsertionOptions& options,
                                              Progress& progress);

/// What the reference says of one pixel, with the variance of the mean of its own samples.
struct PixelEstimate {
    double object = 0.0;  ///< luminance of the object's radiance, of the covered part of the pixel
    double object_variance = 0.0;
    double change = 0.0;  ///< luminance of with − without, over that of without
    double change_variance = 0.0;
};
/// Unfiltered, `samples` a pixel, with options.interreflection.
[[nodiscard]] std::vector<PixelEstimate> referencePixels(const Camera& camera,
                                                         const RoomLight& room,
                                                         const ObjectScene& objects,
                                                         const InsertionOptions& options,
                                                         std::span<const glm::ivec2> pixels,
                                                         int samples,
                                                         Progress& progress);

}  // namespace insitu
