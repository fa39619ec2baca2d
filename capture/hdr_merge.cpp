#include "capture/hdr_merge.h"

#include "core/check.h"
#include "core/parallel.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

// Every frame k that is good at a pixel estimates its radiance as x_k / t_k, x the linearised
// exposure. The best linear mean has weights t_k^2 / var(x_k) [Granados10], section 3. The variance
// is that of a common small sensor, in units of full scale, plus rounding to codes; only ratios
// between frames matter. It is taken at the exposure predicted from the longest good frame, not
// at x_k itself: weights that depend on a frame's own noise prefer the dark deviations.

namespace insitu {

namespace {

/// Shot noise: 4000 electrons at full scale; read noise: 5 electrons.
constexpr double kShotVariance = 1.0 / 4000.0;
constexpr double kReadVariance = 0.00125 * 0.00125;
/// Rounding to codes, variance.
constexpr double kCodeVariance = 1.0 / 12.0;
/// Weights fall to zero over this share of the code range before the clipping limit, and over
/// twice the black limit above it: otherwise steps in radiance show where a frame drops out.
constexpr double kFadeFraction = 0.06;

/// Codes above this fraction are never noise: read noise reaches a seventh at three sigma.
constexpr double kSureFraction = 0.25;
/// Beside a clipped channel, codes above this fraction count as clipped too.
constexpr double kSuspectFraction = 0.8;

/// One frame, ready for look-ups.
struct FrameView {
    const EncodedImage* image;
    double exposure;
    double to_255;
    int clip_code;
    int suspect_code;
    int sure_code;
    int black_code;
};

double smoothRamp(double t)
{
    const double s = std::clamp(t, 0.0, 1.0);
    return s * s * (3.0 - 2.0 * s);
}

class Merger {
public:
    Merger(const Bracket& bracket, const ResponseCurve& response, const MergeOptions& options)
        : response_(response), options_(options)
    {
        for (const BracketFrame& frame : bracket.frames) {
            const int top = frame.image.max_code;
            frames_.push_back({&frame.image,
                               frame.relative_exposure,
                               255.0 / top,
                               static_cast<int>(std::floor(options.clip_fraction * top)),
                               static_cast<int>(kSuspectFraction * top),
                               static_cast<int>(kSureFraction * top),
                               static_cast<int>(std::ceil(options.black_fraction * top))});
        }
    }

    /// Radiance of one pixel; `clipped` becomes true when a channel is only a lower bound.
    [[nodiscard]] Rgb merge(int x, int y, bool& clipped, bool& black) const
    {
        Rgb result(0.0f);
        black = true;
        for (int c = 0; c < 3; ++c) {
            bool channel_clipped = false;
            bool channel_black = false;
            result[c] = static_cast<float>(mergeChannel(x, y, c, channel_clipped, channel_black));
            clipped |= channel_clipped;
            black &= channel_black;
        }
        return result;
    }

private:
    [[nodiscard]] static int code(const FrameView& frame, int x, int y, int c)
    {
        return frame.image->codes(x, y)[c];
    }
    /// Where one channel is clipped, a JPEG may show another clipped one as somewhat less: it
    /// shares colour between neighbours. So the others count as clipped early.
    [[nodiscard]] static bool isClipped(const FrameView& frame, int x, int y, int c)
    {
        const glm::u16vec3 codes = frame.image->codes(x, y);
        if (codes[c] > frame.clip_code) return true;
        const int brightest = std::max({codes.r, codes.g, codes.b});
        return brightest > frame.clip_code && codes[c] > frame.suspect_code;
    }

    /// Beside a clipped pixel the codes may be off: ringing and shared colour of JPEG, blooming.
    [[nodiscard]] static bool besideClipped(const FrameView& frame, int x, int y)
    {
        const auto& codes = frame.image->codes;
        for (int ny = std::max(y - 1, 0); ny <= std::min(y + 1, codes.height() - 1); ++ny) {
            for (int nx = std::max(x - 1, 0); nx <= std::min(x + 1, codes.width() - 1); ++nx) {
                const glm::u16vec3 neighbour = codes(nx, ny);
                if (std::max({neighbour.r, neighbour.g, neighbour.b}) > frame.clip_code)
                    return true;
            }
        }
        return false;
    }

    [[nodiscard]] static bool isGood(const FrameView& frame, int x, int y, int c)
    {
        return !isClipped(frame, x, y, c) && code(frame, x, y, c) >= frame.black_code;
    }

    [[nodiscard]] double radianceOf(const FrameView& frame, int channel, int code_value) const
    {
        return response_.decode(channel, code_value * frame.to_255) / frame.exposure;
    }

    /// t^2 / var at the exposure that `predicted` radiance gives, faded at the ends of the codes.
    [[nodiscard]] double weight(const FrameView& frame,
                                int c,
                                int code_value,
                                double predicted) const
    {
        const auto& table = response_.exposure[static_cast<std::size_t>(c)];
        const double full = table[255];
        const double z = code_value * frame.to_255;
        const auto low = static_cast<std::size_t>(std::clamp(z - 0.5, 0.0, 254.0));
        const double slope = table[low + 1] - table[low];
        const double variance = kReadVariance * full * full +
                                kShotVariance * full * predicted * frame.exposure +
                                kCodeVariance * slope * slope;
        const double fraction = z / 255.0;
        const double black = std::max(options_.black_fraction, 1e-3);
        const double fade = smoothRamp((options_.clip_fraction - fraction) / kFadeFraction) *
                            smoothRamp((fraction - 0.5 * black) / (2.0 * black));
        return std::max(fade, 1e-6) * frame.exposure * frame.exposure / variance;
    }

    /// The longest frame that is not clipped here: the best evidence of all, good or black.
    [[nodiscard]] const FrameView* longestUnclipped(int x, int y, int c) const
    {
        for (const FrameView& frame : frames_)
            if (!isClipped(frame, x, y, c)) return &frame;
        return nullptr;
    }

    /// Is a code of `frame` more than noise, when the longest unclipped frame says `radiance`? A
    /// code just above black is believed only when that radiance could give it; a bright one always
    /// is (the longer frame may be wrong beside a lamp: a picture that was scaled down, blooming).
    [[nodiscard]] bool isSignal(const FrameView& frame,
                                int c,
                                int code_value,
                                double radiance) const
    {
        if (code_value > frame.sure_code) return true;
        const double least = response_.decode(c, 2.0 * frame.black_code * frame.to_255);
        return radiance * frame.exposure >= least;
    }

    [[nodiscard]] double mergeChannel(int x, int y, int c, bool& clipped, bool& black) const
    {
        const FrameView* longest = longestUnclipped(x, y, c);
        if (longest == nullptr) {
            clipped = true;
            return radianceOf(frames_.back(), c, code(frames_.back(), x, y, c));
        }
        const int longest_code = code(*longest, x, y, c);
        const double predicted = radianceOf(*longest, c, longest_code);
        if (!isGood(*longest, x, y, c)) {
            black = longest == &frames_.front();
            return predicted;
        }

        // Good frames away from clipped pixels; only when there is none, those beside them.
        for (const bool beside_allowed : {false, true}) {
            double sum = 0.0;
            double weights = 0.0;
            for (const FrameView& frame : frames_) {
                if (!isGood(frame, x, y, c)) continue;
                const int value = code(frame, x, y, c);
                if (&frame != longest && !isSignal(frame, c, value, predicted)) continue;
                if (!beside_allowed && besideClipped(frame, x, y)) continue;
                const double w = weight(frame, c, value, predicted);
                sum += w * radianceOf(frame, c, value);
                weights += w;
            }
            if (weights > 0.0) return sum / weights;
        }
        return predicted;
    }

    const ResponseCurve& response_;
    const MergeOptions& options_;
    std::vector<FrameView> frames_;
};

void reportClipping(MergeResult& result, std::size_t black_pixels)
{
    const std::size_t all = result.clipped.pixelCount();
    const auto clipped_pixels =
        static_cast<std::size_t>(std::ranges::count(result.clipped.pixels(), std::uint8_t{1}));
    result.clipped_fraction = static_cast<double>(clipped_pixels) / static_cast<double>(all);
    if (clipped_pixels == all)
        result.findings.push_back({Severity::Warning,
                                   "merge-all-clipped",
                                   "every pixel is overexposed even in the shortest exposure: the "
                                   "radiance is only a lower bound; add shorter exposures"});
    else if (clipped_pixels > 0)
        result.findings.push_back(
            {Severity::Warning,
             "merge-clipped",
             fmt::format("{:.3g} % of the pixels are overexposed even in the shortest exposure: "
                         "those lights are brighter than measured; add shorter exposures",
                         100.0 * result.clipped_fraction)});
    if (black_pixels == all)
        result.findings.push_back({Severity::Warning,
                                   "merge-all-black",
                                   "every pixel is black even in the longest exposure; add longer "
                                   "exposures"});
}

}  // namespace

Findings MergeOptions::validate() const
{
    Findings findings;
    if (!(clip_fraction > 0.5 && clip_fraction <= 1.0))
        findings.push_back(
            {Severity::Error,
             "merge-options",
             fmt::format("clip_fraction is {}, must be above 0.5 and at most 1", clip_fraction)});
    if (!(black_fraction >= 0.0 && black_fraction < 0.5))
        findings.push_back({Severity::Error,
                            "merge-options",
                            fmt::format("black_fraction is {}, must be at least 0 and below 0.5",
                                        black_fraction)});
    return findings;
}

MergeResult mergeBracket(const Bracket& bracket,
                         const ResponseCurve& response,
                         const MergeOptions& options)
{
    const Findings problems = options.validate();
    if (!problems.empty()) throw InputError("merge options", problems.front().message);
    INSITU_CHECK(!bracket.frames.empty(), "empty bracket");

    const int width = bracket.frames.front().image.codes.width();
    const int height = bracket.frames.front().image.codes.height();
    MergeResult result;
    result.radiance.pixels = Image<Rgb>(width, height);
    result.clipped = Image<std::uint8_t>(width, height);
    std::vector<std::size_t> black_in_row(static_cast<std::size_t>(height));
    const Merger merger(bracket, response, options);
    parallelFor(0, height, [&](std::int64_t row) {
        const int y = static_cast<int>(row);
        for (int x = 0; x < width; ++x) {
            bool clipped = false;
            bool black = false;
            result.radiance.pixels(x, y) = merger.merge(x, y, clipped, black);
            result.clipped(x, y) = clipped ? 1 : 0;
            black_in_row[static_cast<std::size_t>(y)] += black ? 1 : 0;
        }
    });
    std::size_t black_pixels = 0;
    for (const std::size_t count : black_in_row)
        black_pixels += count;
    reportClipping(result, black_pixels);
    return result;
}

}  // namespace insitu
