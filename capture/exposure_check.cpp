#include "capture/exposure_check.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace insitu {

namespace {

constexpr std::size_t kMostSamples = 60'000;
constexpr std::size_t kFewestSamples = 200;
/// As for exposures that are refined while a response is recovered (ln): beyond rounding of times.
constexpr double kMismatch = 0.15;

/// ln of longer / shorter; nothing when too few pixels tell.
std::optional<double> logRatio(const BracketFrame& longer,
                               const BracketFrame& shorter,
                               const ResponseCurve& response,
                               const ExposureCheckOptions& options)
{
    const std::size_t pixels = longer.image.codes.pixelCount();
    const std::size_t step = std::max<std::size_t>(1, 3 * pixels / kMostSamples);
    const auto usable = [&](const BracketFrame& frame, std::size_t pixel, int channel) {
        const double level =
            static_cast<double>(frame.image.codes.pixels()[pixel][channel]) / frame.image.max_code;
        return level >= options.lowest_fraction && level <= options.highest_fraction &&
               (frame.excluded.empty() || frame.excluded.pixels()[pixel] == 0);
    };
    const auto decoded = [&](const BracketFrame& frame, std::size_t pixel, int channel) {
        return response.decode(
            channel, frame.image.codes.pixels()[pixel][channel] * 255.0 / frame.image.max_code);
    };
    std::vector<double> ratios;
    for (std::size_t i = step / 2; i < pixels; i += step)
        for (int c = 0; c < 3; ++c) {
            if (!usable(longer, i, c) || !usable(shorter, i, c)) continue;
            const double ratio = decoded(longer, i, c) / decoded(shorter, i, c);
            if (std::isfinite(ratio) && ratio > 0.0) ratios.push_back(std::log(ratio));
        }
    if (ratios.size() < kFewestSamples) return std::nullopt;
    const auto middle = ratios.begin() + static_cast<std::ptrdiff_t>(ratios.size() / 2);
    std::ranges::nth_element(ratios, middle);
    return *middle;
}

}  // namespace

std::vector<std::optional<double>> measureExposures(const Bracket& bracket,
                                                    const ResponseCurve& response,
                                                    const ExposureCheckOptions& options)
{
    const std::size_t count = bracket.frames.size();
    // Runs of frames that are linked; the longest run is measured.
    std::vector<double> chain(count, 0.0);
    std::size_t best_first = 0;
    std::size_t best_size = count == 0 ? 0 : 1;
    std::size_t first = 0;
    for (std::size_t k = 1; k < count; ++k) {
        const auto ratio = logRatio(bracket.frames[k - 1], bracket.frames[k], response, options);
        if (ratio)
            chain[k] = chain[k - 1] - *ratio;
        else
            first = k;
        if (k + 1 - first > best_size) {
            best_first = first;
            best_size = k + 1 - first;
        }
    }
    std::vector<std::optional<double>> measured(count);
    if (best_size < 2) return measured;
    double offset = 0.0;
    for (std::size_t k = best_first; k < best_first + best_size; ++k)
        offset += std::log(bracket.frames[k].relative_exposure) - chain[k];
    offset /= static_cast<double>(best_size);
    for (std::size_t k = best_first; k < best_first + best_size; ++k)
        measured[k] = std::exp(chain[k] + offset);
    return measured;
}

Findings exposureMismatches(const Bracket& bracket,
                            const std::vector<std::optional<double>>& measured)
{
    Findings findings;
    for (std::size_t k = 0; k < measured.size(); ++k) {
        if (!measured[k]) continue;
        const double given = bracket.frames[k].relative_exposure;
        const double difference = std::log(*measured[k] / given);
        if (std::abs(difference) <= kMismatch) continue;
        findings.push_back({Severity::Warning,
                            "bracket-exposure-mismatch",
                            fmt::format("{}: given {:.4g}, measured {:.4g} ({:+.2f} EV): check the "
                                        "list of exposures",
                                        bracket.frames[k].name,
                                        given,
                                        *measured[k],
                                        difference / std::log(2.0))});
    }
    return findings;
}

}  // namespace insitu
