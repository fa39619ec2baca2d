#include "capture/matched_pyramid.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace insitu::detail {

namespace {

/// Pictures larger than this are reduced first: their finest detail holds hardly any contrast.
constexpr std::size_t kLargestWorkingImage = 8'000'000;
/// The coarsest level: long side at most, short side at least.
constexpr int kCoarsestLongSide = 96;
constexpr int kCoarsestShortSide = 16;
/// Codes are sorted into this many bins at most.
constexpr int kMostBins = 4096;
/// Rows looked at for a histogram, about: enough for the ranks.
constexpr int kHistogramRows = 1000;
/// The common codes must span this many steps, or rounding is all one sees.
constexpr double kLeastRange = 4.0;

/// Green has the least noise, and most of what JPEG keeps. One channel, not a mean: only then do
/// equal codes mean equal exposure.
constexpr int kChannel = 1;

/// Code -> bin and back.
struct Bins {
    int shift = 0;
    int count = 256;

    explicit Bins(int max_code)
    {
        while (((max_code + 1) >> shift) > kMostBins)
            ++shift;
        count = ((max_code + 1) >> shift);
    }
    [[nodiscard]] std::size_t of(int code) const { return static_cast<std::size_t>(code >> shift); }
    [[nodiscard]] double on255(std::size_t bin) const
    {
        return static_cast<double>(bin) * 255.0 / (count - 1);
    }
};

/// Shares of the codes at places that lie in the other picture, too.
std::vector<double> histogramOf(const BracketFrame& frame,
                                const Bins& bins,
                                const glm::dmat3& other_from_frame)
{
    const Image<glm::u16vec3>& codes = frame.image.codes;
    std::vector<double> histogram(static_cast<std::size_t>(bins.count), 0.0);
    const int step = std::max(1, codes.height() / kHistogramRows);
    double total = 0.0;
    for (int y = 0; y < codes.height(); y += step) {
        for (int x = 0; x < codes.width(); ++x) {
            const glm::dvec3 at = other_from_frame * glm::dvec3(x + 0.5, y + 0.5, 1.0);
            if (!(at.x >= 0.0 && at.y >= 0.0 && at.x <= codes.width() * at.z &&
                  at.y <= codes.height() * at.z))
                continue;
            histogram[bins.of(codes(x, y)[kChannel])] += 1.0;
            total += 1.0;
        }
    }
    for (double& share : histogram)
        share /= std::max(total, 1.0);
    return histogram;
}

/// For each bin of `from` the mean of those values of `to` (on 255) that have the same ranks.
std::vector<float> matchRanks(const std::vector<double>& from,
                              const std::vector<double>& to,
                              const Bins& to_bins)
{
    std::vector<float> table(from.size());
    std::size_t j = 0;
    double left = to.front();
    for (std::size_t i = 0; i < from.size(); ++i) {
        double need = from[i];
        double sum = 0.0;
        while (need > left && j + 1 < to.size()) {
            sum += left * to_bins.on255(j);
            need -= left;
            left = to[++j];
        }
        sum += need * to_bins.on255(j);
        left -= need;
        table[i] = static_cast<float>(from[i] > 1e-12 ? sum / from[i] : to_bins.on255(j));
    }
    return table;
}

Image<float> reduced(const Image<glm::u16vec3>& codes,
                     const std::vector<float>& table,
                     const Bins& bins,
                     int factor)
{
    Image<float> result(codes.width() / factor, codes.height() / factor);
    const float share = 1.0f / static_cast<float>(factor * factor);
    for (int y = 0; y < result.height(); ++y) {
        const std::span<float> out = result.row(y);
        for (int j = 0; j < factor; ++j) {
            const std::span<const glm::u16vec3> in = codes.row(y * factor + j);
            for (std::size_t x = 0; x < out.size(); ++x)
                for (int i = 0; i < factor; ++i)
                    out[x] += share * table[bins.of(in[x * static_cast<std::size_t>(factor) +
                                                       static_cast<std::size_t>(i)][kChannel])];
        }
    }
    return result;
}

Image<float> halved(const Image<float>& fine)
{
    Image<float> result(fine.width() / 2, fine.height() / 2);
    for (int y = 0; y < result.height(); ++y) {
        const std::span<const float> upper = fine.row(2 * y);
        const std::span<const float> lower = fine.row(2 * y + 1);
        const std::span<float> out = result.row(y);
        for (std::size_t x = 0; x < out.size(); ++x)
            out[x] = 0.25f * (upper[2 * x] + upper[2 * x + 1] + lower[2 * x] + lower[2 * x + 1]);
    }
    return result;
}

std::vector<Image<float>> pyramidOf(Image<float> finest)
{
    std::vector<Image<float>> levels;
    levels.push_back(std::move(finest));
    while (std::max(levels.back().width(), levels.back().height()) > kCoarsestLongSide &&
           std::min(levels.back().width(), levels.back().height()) >= 2 * kCoarsestShortSide)
        levels.push_back(halved(levels.back()));
    return levels;
}

/// The rank-matching tables of two frames, clamped to what both tell apart.
struct CodeTables {
    std::vector<float> longer;
    std::vector<float> shorter;
    double low = 0.0;
    double high = 0.0;
};

CodeTables commonCodes(const BracketFrame& longer,
                       const BracketFrame& shorter,
                       const glm::dmat3& shorter_from_longer)
{
    const Bins longer_bins(longer.image.max_code);
    const Bins shorter_bins(shorter.image.max_code);
    CodeTables tables;
    tables.longer =
        matchRanks(histogramOf(longer, longer_bins, shorter_from_longer),
                   histogramOf(shorter, shorter_bins, glm::inverse(shorter_from_longer)),
                   shorter_bins);
    for (int bin = 0; bin < shorter_bins.count; ++bin)
        tables.shorter.push_back(
            static_cast<float>(shorter_bins.on255(static_cast<std::size_t>(bin))));

    const auto mapped = [&](double share) {
        return static_cast<double>(
            tables.longer[longer_bins.of(static_cast<int>(share * longer.image.max_code))]);
    };
    tables.low = std::max(255.0 * kBlackShare, mapped(kBlackShare));
    tables.high = std::min(255.0 * kClipShare, mapped(kClipShare));
    if (tables.high <= tables.low) return tables;
    for (std::vector<float>* table : {&tables.longer, &tables.shorter})
        for (float& value : *table)
            value =
                std::clamp(value, static_cast<float>(tables.low), static_cast<float>(tables.high));
    return tables;
}

double usableShare(const BracketFrame& frame)
{
    const Image<glm::u16vec3>& codes = frame.image.codes;
    const int step = std::max(1, codes.height() / kHistogramRows);
    const int black = static_cast<int>(std::ceil(2.0 * kBlackShare * frame.image.max_code));
    const int clipped = static_cast<int>(kClipShare * frame.image.max_code);
    std::size_t usable = 0;
    std::size_t all = 0;
    for (int y = 0; y < codes.height(); y += step) {
        for (const glm::u16vec3 code : codes.row(y)) {
            const int brightest = std::max({code.r, code.g, code.b});
            usable += brightest >= black && brightest <= clipped ? 1 : 0;
            ++all;
        }
    }
    return static_cast<double>(usable) / static_cast<double>(all);
}

}  // namespace

int bestExposedFrame(const Bracket& bracket)
{
    const int count = static_cast<int>(bracket.frames.size());
    int best = 0;
    double best_share = -1.0;
    for (int k = 0; k < count; ++k) {
        const double share = usableShare(bracket.frames[static_cast<std::size_t>(k)]);
        const bool more_central = std::abs(2 * k - count + 1) < std::abs(2 * best - count + 1);
        if (share > best_share || (share == best_share && more_central)) {
            best = k;
            best_share = share;
        }
    }
    return best;
}

std::optional<MatchedPyramids> matchPyramids(const BracketFrame& a,
                                             const BracketFrame& b,
                                             const glm::dmat3& b_from_a,
                                             int coarsening,
                                             std::string& reason)
{
    const bool a_is_longer = a.relative_exposure >= b.relative_exposure;
    const BracketFrame& longer = a_is_longer ? a : b;
    const BracketFrame& shorter = a_is_longer ? b : a;
    const CodeTables tables =
        commonCodes(longer, shorter, a_is_longer ? b_from_a : glm::inverse(b_from_a));
    if (tables.high - tables.low < kLeastRange) {
        reason = "what one of them shows is black or clipped in the other";
        return std::nullopt;
    }
    MatchedPyramids result;
    while (a.image.codes.pixelCount() / static_cast<std::size_t>(result.factor * result.factor) >
           kLargestWorkingImage)
        result.factor *= 2;
    result.factor *= coarsening;
    const auto pyramid = [&](const BracketFrame& frame, const std::vector<float>& table) {
        return pyramidOf(
            reduced(frame.image.codes, table, Bins(frame.image.max_code), result.factor));
    };
    result.a = pyramid(a, a_is_longer ? tables.longer : tables.shorter);
    result.b = pyramid(b, a_is_longer ? tables.shorter : tables.longer);
    return result;
}

}  // namespace insitu::detail
