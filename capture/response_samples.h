#pragma once

#include "capture/bracket.h"

#include <array>
#include <vector>

namespace insitu::detail {

/// Code of one channel on the 8-bit scale: 16-bit codes become fractional.
[[nodiscard]] inline double codeOn255(const EncodedImage& image, int x, int y, int channel)
{
    return image.codes(x, y)[channel] * (255.0 / image.max_code);
}

/// Side of the square patches that serve as samples of the response. Pixels.
inline constexpr int kPatchSide = 5;
/// Neighbours that share a JPEG's colour with the patch. Pixels.
inline constexpr int kPatchMargin = 2;
/// A patch with a code above this (of 255) in some pixel or neighbour and in any channel says
/// nothing in that frame: JPEG mixes colours, so a clipped channel falsifies the others.
inline constexpr double kHighestUsefulCode = 251.0;
/// The same for a mean code below this: mostly noise and the sensor's floor.
inline constexpr double kLowestUsefulMean = 3.0;

/// A flat patch of the scene: top-left pixel.
struct ResponseSample {
    int x = 0;
    int y = 0;
};

/// Chooses about `count` flat patches so that, in every channel and every frame, the codes that
/// occur are covered evenly, and the picture's area too. Fewer when the picture has no more;
/// deterministic.
[[nodiscard]] std::vector<ResponseSample> selectResponseSamples(const Bracket& bracket, int count);

/// Mean code of the patch in one channel when the frame is useful there (see above), else < 0.
[[nodiscard]] double usefulMeanCode(const EncodedImage& image, ResponseSample sample, int channel);

}  // namespace insitu::detail
