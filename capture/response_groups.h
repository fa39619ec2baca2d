#pragma once

#include "capture/bracket.h"

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace insitu::detail {

inline constexpr int kCodes = 256;

/// Codes of one frame on the 8-bit scale, by channel.
struct CodePlanes {
    std::array<std::vector<std::uint8_t>, 3> codes;
    /// 1 where no channel is clipped here or nearby: JPEG mixes colours, so a clipped channel
    /// falsifies the others and the neighbours.
    std::vector<std::uint8_t> clean;
};

/// The bracket's pixels that may inform the response: all of a small picture, tiles spread over a
/// large one.
struct BracketPixels {
    int width = 0;  ///< of the picture made of the tiles
    int height = 0;
    std::vector<CodePlanes> frames;
    std::vector<std::uint8_t> usable;  ///< 1: no edge, and nothing moved here
    /// Code by channel at and below which nothing is seen: 0, or the level at which a scan or a
    /// camera's black lies.
    std::array<int, 3> floor{};
    /// Variance of code - value, codes^2: rounding, or the dither that 16-bit codes get.
    double rounding_variance = 0.0;
};

[[nodiscard]] BracketPixels readBracketPixels(const Bracket& bracket);

/// The codes of one frame at the pixels of a group: `shares[i]` of them have code `low + i`.
struct GroupView {
    int frame = 0;
    int low = 0;
    double count = 0.0;         ///< pixels
    std::vector<float> shares;  ///< sum 1
};

/// Pixels that were chosen without a look at the frames in `views`: their mean decoded exposure
/// over a frame's own exposure is the same unknown number in every view. See response_groups.cpp.
struct PixelGroup {
    std::vector<GroupView> views;
};
using PixelGroups = std::vector<PixelGroup>;

/// How often the pixels have one code in one frame and another in the next: [longer * 256 +
/// shorter], for one channel.
using JointCounts = std::vector<std::uint32_t>;

/// Joint counts of three frames in a row, by one channel, of the pixels that are clean in the
/// longest of them (and so in all): all three count the same pixels.
struct FrameTriple {
    JointCounts first_middle;
    JointCounts first_last;
    JointCounts middle_last;
};

/// One triple for each frame but the last two, in order, by channel. The bracket has three frames
/// or more.
[[nodiscard]] std::array<std::vector<FrameTriple>, 3> countTriples(const BracketPixels& pixels);
/// `floor` of the channel as BracketPixels::floor.
[[nodiscard]] PixelGroups groupByCode(const std::vector<FrameTriple>& triples, int floor);

}  // namespace insitu::detail
