#include "capture/response_groups.h"

#include "core/check.h"
#include "core/parallel.h"

#include <algorithm>
#include <cmath>
#include <optional>

// Why groups. If G is the decoder that is right on average, E[G(Z_k)] = t_k L for a pixel of
// radiance L, then for any set of pixels chosen without a look at frames a and b
//
//     mean G(Z_a) / t_a  =  mean G(Z_b) / t_b
//
// however noisy the pixels are: noise is independent from frame to frame, and what it does to the
// choice it does to both sides alike. So we choose the pixels by their code in a third frame m: one
// group for each code, as in regression with an instrument [Reiersol45]. Of each group only the
// histograms of codes in its two views matter, and those are rows and columns of joint counts of
// pairs of frames, the comparagrams of [Mann00]: all pixels inform the response for the price of
// counting. Both views must count the same pixels, whatever is rejected near clipped ones: so the
// pairs of three frames in a row are counted where the longest, which clips most, is clean.
//
// A view counts only when hardly any of its pixels is at an end of the codes: there the decoder
// cannot be right on average.

namespace insitu::detail {

namespace {

/// Reach of what clipping falsifies. Pixels.
constexpr int kCleanMargin = 2;
/// A code above this (of 255) is clipped, or nearly, in a JPEG. See response_samples.h.
constexpr int kNearClip = 251;
/// Pixels that are read at most; more would not lower the error that is left.
constexpr double kMostPixels = 600'000.0;
constexpr int kTileSide = 64;
/// Fewer pixels than this make no mean.
constexpr double kFewestPixels = 40.0;
/// Largest share of a view's pixels at an end of the codes.
constexpr double kEndShare = 1e-3;
/// Share of the pixels of like brightness that are taken as flat, and the brightness steps.
constexpr double kFlatShare = 0.7;
constexpr std::size_t kBrightnessSteps = 64;
/// Share of a frame's pixels that are surely dark, if any is, for the level of black (half of them
/// is tried first); the codes at which it may lie; how much they may differ in two frames whose
/// exposures differ by kVisibleRatio.
constexpr double kDarkShare = 0.2;
constexpr int kLowestFloor = 4;
constexpr int kHighestFloor = 48;
constexpr double kSameBlack = 0.1;
constexpr double kVisibleRatio = 1.4;

/// Where a tile comes from: its top-left pixel in the bracket's frames.
struct Tile {
    int x = 0;
    int y = 0;
};

/// The picture as it is, or the tiles of a large one side by side, spread evenly.
struct Layout {
    std::vector<Tile> tiles;
    int tile_width = 0;
    int tile_height = 0;
};

Layout layOut(int width, int height)
{
    Layout layout;
    const double area = static_cast<double>(width) * height;
    if (area <= kMostPixels || width < 2 * kTileSide || height < 2 * kTileSide) {
        layout.tiles.push_back({0, 0});
        layout.tile_width = width;
        layout.tile_height = height;
        return layout;
    }
    layout.tile_width = kTileSide;
    layout.tile_height = kTileSide;
    const int columns = width / kTileSide;
    const int rows = height / kTileSide;
    const double fraction = kMostPixels / area;
    double due = 0.0;
    for (int row = 0; row < rows; ++row) {
        for (int i = 0; i < columns; ++i) {
            // Every other row runs backwards, so that the tiles of a row lie between the last's.
            const int column = row % 2 == 0 ? i : columns - 1 - i;
            due += fraction;
            if (due < 1.0) continue;
            due -= 1.0;
            layout.tiles.push_back({column * kTileSide, row * kTileSide});
        }
    }
    return layout;
}

/// 1 wherever some pixel within kCleanMargin is 1.
void spread(std::vector<std::uint8_t>& mask, std::size_t width, std::size_t height)
{
    std::vector<std::uint8_t> wide = mask;
    for (std::size_t y = 0; y < height; ++y) {
        const std::uint8_t* in = &mask[y * width];
        std::uint8_t* out = &wide[y * width];
        for (std::size_t d = 1; d <= kCleanMargin && d < width; ++d) {
            for (std::size_t x = d; x < width; ++x)
                out[x] |= in[x - d];
            for (std::size_t x = 0; x + d < width; ++x)
                out[x] |= in[x + d];
        }
    }
    for (std::size_t y = 0; y < height; ++y) {
        std::uint8_t* out = &mask[y * width];
        const std::size_t low = y < kCleanMargin ? 0 : y - kCleanMargin;
        const std::size_t high = std::min(y + kCleanMargin, height - 1);
        for (std::size_t j = low; j <= high; ++j)
            for (std::size_t x = 0; x < width; ++x)
                out[x] |= wide[j * width + x];
    }
}

/// 16-bit codes are dithered, so that their finer steps are not lost on average: the share of
/// pixels that gets the next code is the fraction of the step.
class EightBits {
public:
    explicit EightBits(int max_code) : fine_(max_code != 255) {}

    std::uint8_t operator()(std::uint16_t code)
    {
        if (!fine_) return static_cast<std::uint8_t>(code);
        state_ = state_ * 1664525u + 1013904223u;  // [Knuth97] 3.3.4
        return static_cast<std::uint8_t>((code + (state_ >> 16) % 257u) / 257u);
    }

private:
    bool fine_;
    std::uint32_t state_ = 1;
};

CodePlanes readTiles(const EncodedImage& image, const Layout& layout)
{
    const auto width = static_cast<std::size_t>(layout.tile_width);
    const auto height = static_cast<std::size_t>(layout.tile_height);
    const std::size_t count = layout.tiles.size() * width * height;
    CodePlanes planes;
    for (auto& plane : planes.codes)
        plane.resize(count);
    planes.clean.resize(count);
    std::vector<std::uint8_t> clipped(width * height);
    EightBits on_eight_bits(image.max_code);
    std::size_t at = 0;
    for (const Tile tile : layout.tiles) {
        const std::size_t start = at;
        for (int y = 0; y < layout.tile_height; ++y) {
            const glm::u16vec3* in = &image.codes(tile.x, tile.y + y);
            for (std::size_t x = 0; x < width; ++x, ++at) {
                const std::uint8_t r = on_eight_bits(in[x].r);
                const std::uint8_t g = on_eight_bits(in[x].g);
                const std::uint8_t b = on_eight_bits(in[x].b);
                planes.codes[0][at] = r;
                planes.codes[1][at] = g;
                planes.codes[2][at] = b;
                clipped[at - start] = std::max({r, g, b}) > kNearClip ? 1 : 0;
            }
        }
        spread(clipped, width, height);
        for (std::size_t i = 0; i < clipped.size(); ++i)
            planes.clean[start + i] = clipped[i] ^ 1;
    }
    return planes;
}

/// Sum of a pixel's green codes over the frames: a picture of the whole range in which noise is
/// averaged out.
std::vector<std::uint16_t> sumOfFrames(const BracketPixels& pixels)
{
    std::vector<std::uint16_t> sum(pixels.usable.size());
    for (const CodePlanes& frame : pixels.frames)
        for (std::size_t i = 0; i < sum.size(); ++i)
            sum[i] = static_cast<std::uint16_t>(sum[i] + frame.codes[1][i]);
    return sum;
}

/// Keeps the flattest pixels of every brightness. At edges misalignment, lens blur between frames
/// and JPEG would mix codes.
void rejectEdges(BracketPixels& pixels)
{
    const auto width = static_cast<std::size_t>(pixels.width);
    const auto height = static_cast<std::size_t>(pixels.height);
    if (width < 3 || height < 3) return;
    const std::vector<std::uint16_t> sum = sumOfFrames(pixels);
    const std::size_t top = 255 * pixels.frames.size() + 1;
    constexpr std::size_t kGradients = 512;
    std::vector<std::uint16_t> gradient(sum.size(), kGradients - 1);
    std::vector<std::array<std::uint32_t, kGradients>> histogram(kBrightnessSteps);
    for (std::size_t y = 1; y + 1 < height; ++y) {
        for (std::size_t x = 1; x + 1 < width; ++x) {
            const std::size_t i = y * width + x;
            const int across = std::abs(sum[i + 1] - sum[i - 1]);
            const int down = std::abs(sum[i + width] - sum[i - width]);
            const int steep = std::min(across + down, static_cast<int>(kGradients) - 1);
            gradient[i] = static_cast<std::uint16_t>(steep);
            ++histogram[sum[i] * kBrightnessSteps / top][gradient[i]];
        }
    }
    std::array<std::uint16_t, kBrightnessSteps> limit{};
    for (std::size_t b = 0; b < kBrightnessSteps; ++b) {
        double all = 0.0;
        for (const std::uint32_t n : histogram[b])
            all += n;
        double below = 0.0;
        for (std::size_t g = 0; g < kGradients && below < kFlatShare * all; ++g) {
            below += histogram[b][g];
            limit[b] = static_cast<std::uint16_t>(g);
        }
    }
    for (std::size_t i = 0; i < sum.size(); ++i)
        pixels.usable[i] = gradient[i] <= limit[sum[i] * kBrightnessSteps / top] ? 1 : 0;
}

/// Of the pixels that are clean in frame `longest`.
JointCounts countPair(
    const BracketPixels& pixels, std::size_t longest, std::size_t a, std::size_t b, std::size_t c)
{
    JointCounts counts(kCodes * kCodes);
    const std::uint8_t* clean = pixels.frames[longest].clean.data();
    const std::uint8_t* code_a = pixels.frames[a].codes[c].data();
    const std::uint8_t* code_b = pixels.frames[b].codes[c].data();
    for (std::size_t i = 0; i < pixels.usable.size(); ++i)
        counts[code_a[i] * std::size_t{kCodes} + code_b[i]] += pixels.usable[i] & clean[i];
    return counts;
}

/// Quantile of the codes of one channel of a frame.
int quantileOf(const std::vector<std::uint8_t>& codes, double share)
{
    std::array<std::size_t, kCodes> histogram{};
    for (const std::uint8_t code : codes)
        ++histogram[code];
    double left = share * static_cast<double>(codes.size());
    int z = 0;
    while (z + 1 < kCodes && left > static_cast<double>(histogram[static_cast<std::size_t>(z)]))
        left -= static_cast<double>(histogram[static_cast<std::size_t>(z++)]);
    return z;
}

/// The level of black: where the darkest pixels of the two shortest frames do not differ although
/// the exposures do.
int findFloor(const Bracket& bracket, const BracketPixels& pixels, std::size_t c)
{
    const std::size_t last = bracket.frames.size() - 1;
    const double ratio =
        bracket.frames[last - 1].relative_exposure / bracket.frames[last].relative_exposure;
    if (ratio < kVisibleRatio) return 0;
    for (const double share : {0.5, kDarkShare}) {
        const int dark = quantileOf(pixels.frames[last].codes[c], share);
        const int longer = quantileOf(pixels.frames[last - 1].codes[c], share);
        if (dark < kLowestFloor || dark > kHighestFloor) continue;
        if (longer - dark <= kSameBlack * dark) return dark;
    }
    return 0;
}

JointCounts transposed(const JointCounts& counts)
{
    JointCounts result(counts.size());
    for (std::size_t a = 0; a < kCodes; ++a)
        for (std::size_t b = 0; b < kCodes; ++b)
            result[b * kCodes + a] = counts[a * kCodes + b];
    return result;
}

/// The view of one frame; nothing when too few pixels remain or too many are at the ends.
std::optional<GroupView> viewOf(const std::uint32_t* counts, std::size_t frame, int floor)
{
    int low = -1;
    int high = -1;
    double total = 0.0;
    double bottom = 0.0;
    double top = 0.0;
    for (int z = 0; z < kCodes; ++z) {
        if (counts[z] == 0) continue;
        if (low < 0) low = z;
        high = z;
        total += counts[z];
        if (z <= floor) bottom += counts[z];
        if (z >= kNearClip) top += counts[z];
    }
    if (total < kFewestPixels) return std::nullopt;
    if (bottom > kEndShare * total || top > kEndShare * total) return std::nullopt;
    GroupView view;
    view.frame = static_cast<int>(frame);
    view.low = low;
    view.count = total;
    for (int z = low; z <= high; ++z)
        view.shares.push_back(static_cast<float>(counts[z] / total));
    return view;
}

/// Groups by the codes of one frame; `a` and `b` count its codes with those of the two others.
void addGroups(PixelGroups& groups,
               int floor,
               const JointCounts& a,
               std::size_t frame_a,
               const JointCounts& b,
               std::size_t frame_b)
{
    for (std::size_t code = 1; code + 1 < kCodes; ++code) {
        std::optional<GroupView> view_a = viewOf(&a[code * kCodes], frame_a, floor);
        if (!view_a) continue;
        std::optional<GroupView> view_b = viewOf(&b[code * kCodes], frame_b, floor);
        if (!view_b) continue;
        groups.push_back({{*std::move(view_a), *std::move(view_b)}});
    }
}

}  // namespace

BracketPixels readBracketPixels(const Bracket& bracket)
{
    const auto& first = bracket.frames.front().image.codes;
    const Layout layout = layOut(first.width(), first.height());
    BracketPixels pixels;
    pixels.width = layout.tile_width;
    pixels.height = layout.tile_height * static_cast<int>(layout.tiles.size());
    pixels.frames.resize(bracket.frames.size());
    parallelFor(0, static_cast<std::int64_t>(bracket.frames.size()), [&](std::int64_t frame) {
        const auto k = static_cast<std::size_t>(frame);
        pixels.frames[k] = readTiles(bracket.frames[k].image, layout);
    });
    pixels.usable.assign(pixels.frames.front().clean.size(), 1);
    pixels.rounding_variance =
        bracket.frames.front().image.max_code == 255 ? 1.0 / 12.0 : 1.0 / 6.0;
    rejectEdges(pixels);
    if (bracket.frames.size() >= 2)
        for (std::size_t c = 0; c < 3; ++c)
            pixels.floor[c] = findFloor(bracket, pixels, c);
    return pixels;
}

std::array<std::vector<FrameTriple>, 3> countTriples(const BracketPixels& pixels)
{
    INSITU_CHECK(pixels.frames.size() >= 3, "{} frames", pixels.frames.size());
    const std::size_t count = pixels.frames.size() - 2;
    std::array<std::vector<FrameTriple>, 3> triples;
    for (auto& channel : triples)
        channel.resize(count);
    parallelFor(0, static_cast<std::int64_t>(3 * count), [&](std::int64_t task) {
        const auto c = static_cast<std::size_t>(task) % 3;
        const auto k = static_cast<std::size_t>(task) / 3;
        triples[c][k] = {countPair(pixels, k, k, k + 1, c),
                         countPair(pixels, k, k, k + 2, c),
                         countPair(pixels, k, k + 1, k + 2, c)};
    });
    return triples;
}

PixelGroups groupByCode(const std::vector<FrameTriple>& triples, int floor)
{
    PixelGroups groups;
    for (std::size_t k = 0; k < triples.size(); ++k) {
        const FrameTriple& triple = triples[k];
        const JointCounts middle_first = transposed(triple.first_middle);
        addGroups(groups, floor, triple.first_middle, k + 1, triple.first_last, k + 2);
        addGroups(groups, floor, middle_first, k, triple.middle_last, k + 2);
        addGroups(
            groups, floor, transposed(triple.first_last), k, transposed(triple.middle_last), k + 1);
    }
    return groups;
}

}  // namespace insitu::detail
