#include "capture/response_methods.h"
#include "core/parallel.h"

#include <algorithm>
#include <cmath>

// [Robertson03]: the likelihood of all pixels is maximised in turn over the radiances,
//
//     x_j = sum_k w(z_kj) t_k G(z_kj) / sum_k w(z_kj) t_k^2,
//
// and over the table, G(z) = mean of t_k x_j over the places where code z was seen (eqs. 8 and 11),
// with w a bell over the codes. No smoothness: codes that were not seen are interpolated in ln.

namespace insitu::detail {

namespace {

constexpr std::size_t kMostPixels = 12'000;
constexpr int kMostRounds = 40;
/// The rounds end when ln G changes less than this on average.
constexpr double kConverged = 2e-4;
/// A code seen less often than this counts as not seen.
constexpr double kFewest = 5.0;
/// Fewer codes carry no table; so many of them give the power law beyond the ends.
constexpr std::size_t kFewestCodes = 16;
constexpr std::size_t kEndCodes = 8;

std::array<double, kCodes> bell()
{
    std::array<double, kCodes> weights{};
    for (std::size_t z = 1; z + 1 < weights.size(); ++z) {
        const double t = (static_cast<double>(z) - 127.5) / 127.5;
        weights[z] = std::exp(-4.0 * t * t);
    }
    return weights;
}

/// Codes of chosen pixels, [pixel * frames + frame]; 0 where a frame is not clean.
std::vector<std::uint8_t> chooseCodes(const BracketPixels& pixels, std::size_t channel)
{
    const std::size_t count = pixels.usable.size();
    const std::size_t stride = std::max<std::size_t>(1, count / kMostPixels);
    std::vector<std::uint8_t> codes;
    for (std::size_t i = 0; i < count; i += stride) {
        if (pixels.usable[i] == 0) continue;
        for (const CodePlanes& frame : pixels.frames)
            codes.push_back(frame.clean[i] != 0 ? frame.codes[channel][i] : std::uint8_t{0});
    }
    return codes;
}

/// Fills what was not seen, along a line in ln between (or a power law beyond) the codes seen.
bool fillGaps(LogCurve& curve, const std::array<double, kCodes>& seen)
{
    std::vector<std::size_t> known;
    for (std::size_t z = 1; z + 1 < seen.size(); ++z)
        if (seen[z] >= kFewest) known.push_back(z);
    if (known.size() < kFewestCodes) return false;
    const auto place = [](std::size_t z) { return std::log(static_cast<double>(z) + 0.5); };
    std::size_t next = 1;
    for (std::size_t z = 0; z < curve.size(); ++z) {
        while (next + 1 < known.size() && known[next] <= z)
            ++next;
        if (seen[z] >= kFewest && z > 0 && z + 1 < seen.size()) continue;
        const bool beyond = z < known.front() || z > known.back();
        const std::size_t reach = std::min(known.size() - 1, kEndCodes);
        const std::size_t a = !beyond             ? known[next - 1]
                              : z < known.front() ? known.front()
                                                  : known[known.size() - 1 - reach];
        const std::size_t b = !beyond             ? known[next]
                              : z < known.front() ? known[reach]
                                                  : known.back();
        const double t = (place(z) - place(a)) / (place(b) - place(a));
        curve[z] = curve[a] + t * (curve[b] - curve[a]);
    }
    return true;
}

bool iterateTable(const std::vector<std::uint8_t>& codes,
                  const std::vector<double>& exposures,
                  LogCurve& curve)
{
    const std::size_t frames = exposures.size();
    const std::array<double, kCodes> weights = bell();
    std::array<double, kCodes> table{};
    for (std::size_t z = 0; z < table.size(); ++z)
        table[z] = std::pow((static_cast<double>(z) + 0.5) / 128.5, 2.2);
    std::array<double, kCodes> seen{};
    for (int round = 0; round < kMostRounds; ++round) {
        std::array<double, kCodes> sum{};
        seen.fill(0.0);
        for (std::size_t i = 0; i < codes.size(); i += frames) {
            double above = 0.0;
            double below = 0.0;
            for (std::size_t k = 0; k < frames; ++k) {
                const double w = weights[codes[i + k]];
                above += w * exposures[k] * table[codes[i + k]];
                below += w * exposures[k] * exposures[k];
            }
            if (!(below > 0.0)) continue;
            for (std::size_t k = 0; k < frames; ++k) {
                sum[codes[i + k]] += exposures[k] * above / below;
                seen[codes[i + k]] += 1.0;
            }
        }
        for (std::size_t z = 0; z < table.size(); ++z)
            curve[z] = std::log(seen[z] > 0.0 ? std::max(sum[z] / seen[z], 1e-12) : 1.0);
        if (!fillGaps(curve, seen)) return false;
        const double middle = curve[128];
        double change = 0.0;
        for (std::size_t z = 0; z < table.size(); ++z) {
            curve[z] -= middle;
            const double value = std::exp(curve[z]);
            change += std::abs(std::log(value / table[z])) / kCodes;
            table[z] = value;
        }
        if (change < kConverged) break;
    }
    return true;
}

}  // namespace

Decoders iterateTables(const BracketPixels& pixels, const std::vector<double>& log_exposures)
{
    std::vector<double> exposures;
    for (const double log_exposure : log_exposures)
        exposures.push_back(std::exp(log_exposure - log_exposures.front()));
    std::array<LogCurve, 3> decoders{};
    std::array<bool, 3> found{};
    parallelFor(0, 3, [&](std::int64_t channel) {
        const auto c = static_cast<std::size_t>(channel);
        found[c] = iterateTable(chooseCodes(pixels, c), exposures, decoders[c]);
    });
    if (!std::ranges::all_of(found, [](bool f) { return f; })) return std::nullopt;
    return decoders;
}

}  // namespace insitu::detail
