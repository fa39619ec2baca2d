#include "capture/response_methods.h"

#include <algorithm>
#include <cmath>

// A place where something moved shows different radiance in frames that all say they are well
// exposed. Blocks of pixels are compared, not single ones, so that noise does not matter, and the
// limit is set by how much the blocks of that pair of frames differ anyway (a slow change of the
// light, JPEG): outliers, not scatter, are dropped.

namespace insitu::detail {

namespace {

constexpr std::size_t kBlock = 16;
/// Every so many rows are looked at.
constexpr std::size_t kRowStep = 2;
constexpr int kDarkest = 20;
constexpr int kBrightest = 245;
constexpr std::size_t kFewestPixels = 24;
constexpr std::size_t kFewestBlocks = 8;
constexpr double kMostOutside = 0.02;
/// Limit: standard deviations of the blocks, and at least this much of ln exposure.
constexpr double kOutlier = 8.0;
constexpr double kLeastDifference = 0.15;

/// Sums of decoded exposure over a block, of the pixels that both frames show well, brought to one
/// exposure.
struct BlockSums {
    double longer = 0.0;
    double shorter = 0.0;
    double squares = 0.0;  ///< of the pixels' differences
    std::size_t count = 0;
    std::size_t outside = 0;  ///< pixels that one of the frames shows too dark or too bright

    /// Enough pixels, and hardly any left out: those would be left out by their noise.
    [[nodiscard]] bool counts() const
    {
        return count >= kFewestPixels &&
               static_cast<double>(outside) <= kMostOutside * static_cast<double>(count);
    }
    [[nodiscard]] double logRatio() const { return std::log(longer / shorter); }
    /// Standard error of logRatio(), from the scatter of the pixels themselves.
    [[nodiscard]] double logError() const
    {
        const auto n = static_cast<double>(count);
        const double mean = (longer - shorter) / n;
        return std::sqrt(std::max(squares / n - mean * mean, 0.0) / n) * n / shorter;
    }
};

std::vector<BlockSums> sumBlocks(const BracketPixels& pixels,
                                 std::size_t frame,
                                 const std::array<double, kCodes>& table,
                                 double ratio,
                                 std::size_t columns)
{
    const auto width = static_cast<std::size_t>(pixels.width);
    const auto height = static_cast<std::size_t>(pixels.height);
    const CodePlanes& a = pixels.frames[frame];
    const CodePlanes& b = pixels.frames[frame + 1];
    std::vector<BlockSums> blocks(columns * ((height + kBlock - 1) / kBlock));
    for (std::size_t y = 0; y < height; y += kRowStep) {
        for (std::size_t x = 0; x < width; ++x) {
            const std::size_t i = y * width + x;
            if ((pixels.usable[i] & a.clean[i] & b.clean[i]) == 0) continue;
            const int code_a = a.codes[1][i];
            const int code_b = b.codes[1][i];
            BlockSums& block = blocks[y / kBlock * columns + x / kBlock];
            if (std::min(code_a, code_b) < kDarkest || std::max(code_a, code_b) > kBrightest) {
                ++block.outside;
                continue;
            }
            const double longer = table[static_cast<std::size_t>(code_a)] / ratio;
            const double shorter = table[static_cast<std::size_t>(code_b)];
            block.longer += longer;
            block.shorter += shorter;
            block.squares += (longer - shorter) * (longer - shorter);
            ++block.count;
        }
    }
    return blocks;
}

double medianOf(std::vector<double> values)
{
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::ranges::nth_element(values, middle);
    return *middle;
}

/// Marks the blocks in which the pair of frames differs far more than in the others, and than their
/// noise explains.
void markOutliers(const std::vector<BlockSums>& blocks, std::vector<bool>& moved)
{
    std::vector<double> ratios;
    for (const BlockSums& block : blocks)
        if (block.counts()) ratios.push_back(block.logRatio());
    if (ratios.size() < kFewestBlocks) return;
    const double centre = medianOf(ratios);
    for (double& ratio : ratios)
        ratio = std::abs(ratio - centre);
    const double limit = std::max(kOutlier * 1.4826 * medianOf(ratios), kLeastDifference);
    for (std::size_t i = 0; i < blocks.size(); ++i) {
        if (!blocks[i].counts()) continue;
        const double off = std::abs(blocks[i].logRatio() - centre);
        if (off > limit && off > kOutlier * blocks[i].logError()) moved[i] = true;
    }
}

}  // namespace

double dropMovedBlocks(BracketPixels& pixels,
                       const std::array<LogCurve, 3>& decoders,
                       const std::vector<double>& log_exposures)
{
    const auto width = static_cast<std::size_t>(pixels.width);
    const auto height = static_cast<std::size_t>(pixels.height);
    const std::size_t columns = (width + kBlock - 1) / kBlock;
    std::array<double, kCodes> table{};
    for (std::size_t z = 0; z < table.size(); ++z)
        table[z] = std::exp(decoders[1][z]);
    std::vector<bool> moved(columns * ((height + kBlock - 1) / kBlock));
    for (std::size_t k = 0; k + 1 < pixels.frames.size(); ++k)
        markOutliers(
            sumBlocks(pixels, k, table, std::exp(log_exposures[k] - log_exposures[k + 1]), columns),
            moved);
    for (std::size_t y = 0; y < height; ++y)
        for (std::size_t x = 0; x < width; ++x)
            if (moved[y / kBlock * columns + x / kBlock]) pixels.usable[y * width + x] = 0;
    return static_cast<double>(std::ranges::count(moved, true)) / static_cast<double>(moved.size());
}

}  // namespace insitu::detail
