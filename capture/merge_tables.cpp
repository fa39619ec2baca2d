#include "capture/merge_tables.h"

#include "core/check.h"
#include "core/parallel.h"

#include <algorithm>
#include <cmath>

// Frame k estimates the radiance L of a pixel as x_k / t_k, x the linearised exposure. The best
// linear mean has weights t_k^2 / var(x_k) [Granados10] section 3, [HasDurFre10]. The variance is
// taken at the exposure L t_k that the longest frame predicts, not at x_k itself: weights that
// depend on a frame's own noise prefer the dark deviations. So all weights of a pixel follow from
// the longest frame's code alone, and are looked up.

namespace insitu {

namespace {

/// Weights fall to zero over this share of the code range before the clipping limit: otherwise
/// steps in radiance show where a frame drops out, if the response is not quite right there.
constexpr double kFadeFraction = 0.015;
/// Shorter frames fade in between these multiples of the black limit.
constexpr double kFadeInFrom = 0.6;
constexpr double kFadeInTo = 1.2;
/// A frame in a fade is still better than none.
constexpr double kLeastFade = 1e-3;
/// A frame and those after it are left out when all together are worth less than this share of the
/// frames before them, going on as they fall.
constexpr double kLeastShare = 5e-3;
/// Beside a clipped channel, codes above this fraction count as clipped too.
constexpr double kSuspectFraction = 0.8;
/// Two codes agree within so many standard deviations, and what a response may be wrong.
constexpr double kAgreeDeviations = 3.5;
constexpr double kResponseSlack = 0.02;

double smoothRamp(double t)
{
    const double s = std::clamp(t, 0.0, 1.0);
    return s * s * (3.0 - 2.0 * s);
}

}  // namespace

MergeTables::MergeTables(const Bracket& bracket,
                         const ResponseCurve& response,
                         const NoiseModel& noise,
                         const MergeOptions& options)
    : response_(response), noise_(noise), options_(options)
{
    buildFrames(bracket);
    for (std::size_t c = 0; c < 3; ++c) {
        for (std::size_t z = 0; z < 256; ++z) {
            const double variance =
                noise.variance(response, static_cast<int>(c), static_cast<double>(z));
            const double slack = kResponseSlack * response.exposure[c][z];
            variance_[c][z] = variance;
            allowed_[c][z] = static_cast<float>(kAgreeDeviations * kAgreeDeviations * variance +
                                                0.5 * slack * slack);
        }
    }
    buildEntries();
}

void MergeTables::buildFrames(const Bracket& bracket)
{
    const int top = bracket.frames.front().image.max_code;
    INSITU_CHECK(top == 255 || top == 65535, "codes to {}", top);
    bin_shift_ = top == 255 ? 0 : 8;
    for (const BracketFrame& frame : bracket.frames) {
        INSITU_CHECK(frame.image.max_code == top, "{}: codes to {}", frame.name, top);
        MergeFrame merge_frame;
        merge_frame.image = &frame.image;
        merge_frame.excluded = &frame.excluded;
        merge_frame.exposure = frame.relative_exposure;
        merge_frame.inverse_exposure = static_cast<float>(1.0 / frame.relative_exposure);
        merge_frame.clip_code = static_cast<int>(std::floor(options_.clip_fraction * top));
        merge_frame.suspect_code = static_cast<int>(kSuspectFraction * top);
        merge_frame.black_code = static_cast<int>(std::ceil(options_.black_fraction * top));
        frames_.push_back(merge_frame);
    }
    count_ = static_cast<int>(frames_.size());
    for (int c = 0; c < 3; ++c)
        for (int z = 0; z <= top; ++z)
            exposures_[static_cast<std::size_t>(c)].push_back(
                static_cast<float>(response_.decode(c, z * 255.0 / top)));
}

double MergeTables::varianceAt(int c, double code) const
{
    const auto& table = variance_[static_cast<std::size_t>(c)];
    const auto low = static_cast<std::size_t>(std::clamp(code, 0.0, 254.0));
    const double t = std::clamp(code - static_cast<double>(low), 0.0, 1.0);
    return table[low] + t * (table[low + 1] - table[low]);
}

MergeTables::FrameWeight MergeTables::frameWeight(int c,
                                                  int k,
                                                  double radiance,
                                                  bool reference) const
{
    const double exposure = frames_[static_cast<std::size_t>(k)].exposure;
    const double code = response_.encode(c, radiance * exposure);
    const double black = 255.0 * std::max(options_.black_fraction, 1e-3);
    const double fade_out = smoothRamp((options_.clip_fraction - code / 255.0) / kFadeFraction);
    const double fade_in =
        reference ? 1.0 : smoothRamp((code / black - kFadeInFrom) / (kFadeInTo - kFadeInFrom));
    const double variance = varianceAt(c, code) / (exposure * exposure);
    return {std::max(fade_out, kLeastFade) * fade_in / variance, variance};
}

double MergeTables::weigh(int c,
                          std::span<const int> used,
                          double radiance,
                          bool black,
                          std::vector<double>& weights) const
{
    const std::size_t first = weights.size();
    double sum = 0.0;
    double variance = 0.0;
    for (const int k : used) {
        const bool reference = k == used.front();
        const FrameWeight frame = frameWeight(c, k, radiance, reference);
        if (frame.weight <= 0.0) break;
        if (!reference) {
            constexpr double kSlowestFall = 0.9;
            const double fall = std::min(frame.weight / weights.back(), kSlowestFall);
            if (frame.weight < kLeastShare * sum * (1.0 - fall)) break;
        }
        weights.push_back(frame.weight);
        sum += frame.weight;
        variance += frame.weight * frame.weight * frame.variance;
        if (black) break;
    }
    for (std::size_t i = first; i < weights.size(); ++i)
        weights[i] /= sum * frames_[static_cast<std::size_t>(used[i - first])].exposure;
    return variance / (sum * sum);
}

void MergeTables::buildEntries()
{
    const int count = frameCount();
    struct Row {
        std::vector<double> weights;
        double variance = 0.0;
    };
    std::vector<Row> rows(static_cast<std::size_t>(3 * count * 256));
    parallelFor(0, 3 * count, [&](std::int64_t item) {
        const int c = static_cast<int>(item) / count;
        const int k = static_cast<int>(item) % count;
        const MergeFrame& frame = frames_[static_cast<std::size_t>(k)];
        std::vector<int> used;
        for (int j = k; j < count; ++j)
            used.push_back(j);
        for (int bin = 0; bin < 256; ++bin) {
            Row& row = rows[static_cast<std::size_t>(item * 256 + bin)];
            const double radiance = response_.decode(c, bin) / frame.exposure;
            const bool black = bin < frame.black_code >> bin_shift_;
            row.variance = weigh(c, used, radiance, black, row.weights);
        }
    });

    std::size_t longest = 0;
    for (const Row& row : rows)
        longest = std::max(longest, row.weights.size());
    stride_ = kHeader + (longest + kGroup - 1) / kGroup * kGroup;
    entries_.assign(rows.size() * stride_, 0.0f);
    for (std::size_t i = 0; i < rows.size(); ++i) {
        float* entry = &entries_[i * stride_];
        entry[0] = static_cast<float>(rows[i].variance);
        entry[1] = std::bit_cast<float>(static_cast<std::int32_t>(rows[i].weights.size()));
        for (std::size_t j = 0; j < rows[i].weights.size(); ++j)
            entry[kHeader + j] = static_cast<float>(rows[i].weights[j]);
    }
}

}  // namespace insitu
