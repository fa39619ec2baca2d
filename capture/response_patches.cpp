#include "capture/response_patches.h"

#include "capture/response_samples.h"
#include "core/parallel.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace insitu::detail {

namespace {

/// Exposures nearer than this are no two exposures.
constexpr double kLeastRatio = 1.01;

PatchObservation observe(const BracketFrame& frame, ResponseSample sample, int channel)
{
    PatchObservation observation;
    observation.log_exposure = std::log(frame.relative_exposure);
    std::array<double, 256> shares{};
    double squares = 0.0;
    constexpr double kShare = 1.0 / (kPatchSide * kPatchSide);
    for (int y = sample.y; y < sample.y + kPatchSide; ++y) {
        for (int x = sample.x; x < sample.x + kPatchSide; ++x) {
            const double code = codeOn255(frame.image, x, y, channel);
            const auto low = std::min<std::size_t>(static_cast<std::size_t>(code), 254);
            const double t = code - static_cast<double>(low);
            shares[low] += (1.0 - t) * kShare;
            shares[low + 1] += t * kShare;
            observation.mean_code += code * kShare;
            squares += code * code * kShare;
        }
    }
    observation.code_variance =
        std::max(squares - observation.mean_code * observation.mean_code, 0.0);
    for (std::size_t z = 0; z < shares.size(); ++z)
        if (shares[z] > 0.0) observation.histogram.emplace_back(static_cast<int>(z), shares[z]);
    return observation;
}

/// The patches of one channel that are useful in two different exposures or more.
std::vector<PatchObservations> observeChannel(const Bracket& bracket,
                                              const std::vector<ResponseSample>& samples,
                                              int channel)
{
    std::vector<PatchObservations> patches;
    for (const ResponseSample sample : samples) {
        PatchObservations patch;
        double longest = 0.0;
        double shortest = std::numeric_limits<double>::infinity();
        for (const BracketFrame& frame : bracket.frames) {
            patch.push_back(observe(frame, sample, channel));
            patch.back().clean = usefulMeanCode(frame.image, sample, channel) >= 0.0;
            if (!patch.back().clean) continue;
            longest = std::max(longest, frame.relative_exposure);
            shortest = std::min(shortest, frame.relative_exposure);
        }
        if (longest < kLeastRatio * shortest) continue;
        patches.push_back(std::move(patch));
    }
    return patches;
}

}  // namespace

std::array<std::vector<PatchObservations>, 3> observePatches(const Bracket& bracket, int count)
{
    const std::vector<ResponseSample> samples = selectResponseSamples(bracket, count);
    std::array<std::vector<PatchObservations>, 3> channels;
    parallelFor(0, 3, [&](std::int64_t channel) {
        channels[static_cast<std::size_t>(channel)] =
            observeChannel(bracket, samples, static_cast<int>(channel));
    });
    return channels;
}

}  // namespace insitu::detail
