#include "capture/held_out.h"

#include "core/check.h"
#include "core/parallel.h"

#include <algorithm>
#include <cmath>

namespace insitu {

namespace {

constexpr double kLowest = 3.0;
constexpr double kHighest = 252.0;

struct Sum {
    double codes = 0.0;
    std::size_t count = 0;

    void add(const Sum& other)
    {
        codes += other.codes;
        count += other.count;
    }
    [[nodiscard]] double mean() const
    {
        return count > 0 ? codes / static_cast<double>(count) : 0.0;
    }
};

/// Sums of one row, [frame * 3 + channel].
using RowSums = std::vector<Sum>;

class Predictor {
public:
    Predictor(const Bracket& bracket, const ResponseCurve& curve, const HeldOutOptions& options)
        : bracket_(bracket), curve_(curve)
    {
        for (std::size_t k = 0; k < bracket.frames.size(); ++k)
            exposures_.push_back(
                bracket.frames[k].relative_exposure *
                (options.exposure_scale.empty() ? 1.0 : options.exposure_scale[k]));
    }

    void addPixel(int x, int y, RowSums& sums) const
    {
        const std::size_t frames = exposures_.size();
        for (std::size_t c = 0; c < 3; ++c) {
            const int channel = static_cast<int>(c);
            double light = 0.0;
            double weights = 0.0;
            const auto observe = [&](std::size_t k) {
                const EncodedImage& image = bracket_.frames[k].image;
                return image.codes(x, y)[channel] * (255.0 / image.max_code);
            };
            const auto weight = [&](std::size_t k, double code) {
                if (code < kLowest || code > kHighest) return 0.0;
                return std::min(code, 255.0 - code) * exposures_[k];
            };
            for (std::size_t k = 0; k < frames; ++k) {
                const double code = observe(k);
                const double w = weight(k, code);
                if (!(w > 0.0)) continue;
                light += w * curve_.decode(channel, code) / exposures_[k];
                weights += w;
            }
            for (std::size_t k = 1; k + 1 < frames; ++k) {
                const double code = observe(k);
                if (!(code > 0.0 && code < 255.0)) continue;
                const double w = weight(k, code);
                const double others = weights - w;
                if (!(others > 1e-9 * weights)) continue;
                const double own = w > 0.0 ? w * curve_.decode(channel, code) / exposures_[k] : 0.0;
                const double predicted =
                    curve_.encode(channel, (light - own) / others * exposures_[k]);
                sums[k * 3 + c].add({std::abs(predicted - code), 1});
            }
        }
    }

private:
    const Bracket& bracket_;
    const ResponseCurve& curve_;
    std::vector<double> exposures_;
};

void checkOptions(const Bracket& bracket, const HeldOutOptions& options)
{
    INSITU_CHECK(!bracket.frames.empty(), "empty bracket");
    const auto& first = bracket.frames.front().image.codes;
    if (!options.exposure_scale.empty() && options.exposure_scale.size() != bracket.frames.size())
        throw InputError("held-out options", "exposure_scale needs one number for each frame");
    for (const double scale : options.exposure_scale)
        if (!std::isfinite(scale) || !(scale > 0.0))
            throw InputError("held-out options", "exposure_scale must be positive numbers");
    if (!options.mask.empty() && !options.mask.sameSize(first))
        throw InputError("held-out options", "the mask has another size than the frames");
}

}  // namespace

HeldOutError predictHeldOut(const Bracket& bracket,
                            const ResponseCurve& curve,
                            const HeldOutOptions& options)
{
    checkOptions(bracket, options);
    const auto& first = bracket.frames.front().image.codes;
    const auto width = static_cast<std::size_t>(first.width());
    const std::size_t step =
        options.most_pixels > 0 ? std::max<std::size_t>(1, first.pixelCount() / options.most_pixels)
                                : 1;
    const Predictor predictor(bracket, curve, options);
    std::vector<RowSums> rows(static_cast<std::size_t>(first.height()));
    parallelFor(0, first.height(), [&](std::int64_t row) {
        const auto y = static_cast<std::size_t>(row);
        rows[y].resize(bracket.frames.size() * 3);
        // The first multiple of step in this row.
        for (std::size_t i = (y * width + step - 1) / step * step; i < (y + 1) * width; i += step) {
            const int x = static_cast<int>(i - y * width);
            if (!options.mask.empty() && options.mask(x, static_cast<int>(y)) == 0) continue;
            predictor.addPixel(x, static_cast<int>(y), rows[y]);
        }
    });
    Sum all;
    std::array<Sum, 3> by_channel{};
    std::vector<Sum> by_frame(bracket.frames.size());
    for (const RowSums& sums : rows) {
        for (std::size_t i = 0; i < sums.size(); ++i) {
            all.add(sums[i]);
            by_channel[i % 3].add(sums[i]);
            by_frame[i / 3].add(sums[i]);
        }
    }
    HeldOutError error;
    error.mean_codes = all.mean();
    error.count = all.count;
    for (std::size_t c = 0; c < 3; ++c)
        error.by_channel[c] = by_channel[c].mean();
    for (const Sum& sum : by_frame)
        error.by_frame.push_back(sum.mean());
    return error;
}

}  // namespace insitu
