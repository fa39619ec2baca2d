// Response recovery beside its peers, in one process: error and seconds together.
//
//   response_peers synthetic [--seeds N] ENVIRONMENT.exr...
//                                     brackets of a known response: RMS error in EV
//   response_peers held-out DATA_FOLDER
//                                     real brackets: predicted codes of held-out frames
//
// Peers: OpenCV's CalibrateDebevec (70 and 300 samples) and CalibrateRobertson, and, when
// `pfshdrcalibrate` is on the PATH, pfstools' Robertson.

#include "bench/real_stacks.h"
#include "bench/response_entries.h"
#include "bench/synthetic_responses.h"
#include "capture/held_out.h"
#include "core/io/image_io.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <string>
#include <vector>

namespace {

using namespace insitu;
using namespace insitu::bench;
namespace fs = std::filesystem;

void runCase(const std::string& scene_name,
             const Image<Rgb>& scene,
             const NamedResponse& response,
             const Sensor& sensor,
             int seed)
{
    constexpr std::uint64_t kFirstSeed = 7;
    const Bracket bracket =
        photograph(scene, response.curve, sensor, kFirstSeed + static_cast<std::uint64_t>(seed));
    fmt::print(
        "{}, {}, full well {:.0f} e, read noise {:.0f} e, seed {}; bound with known radiances "
        "{:.5f} EV\n",
        scene_name,
        response.name,
        sensor.full_well,
        sensor.read_noise,
        seed,
        knownRadianceBound(bracket, response.curve, sensor));
    for (const Entry& entry : recoverWithAll(bracket)) {
        if (entry.curve.exposure[0][128] == 0.0) {
            fmt::print("  {:<26} {}\n", entry.name, entry.note);
            continue;
        }
        std::array<double, 3> errors{};
        for (std::size_t c = 0; c < 3; ++c)
            errors[c] = errorEv(entry.curve, response.curve, c);
        fmt::print("  {:<26} {:.5f} EV RMS worst ({:.5f} {:.5f} {:.5f}) {:6.3f} s {}\n",
                   entry.name,
                   *std::ranges::max_element(errors),
                   errors[0],
                   errors[1],
                   errors[2],
                   entry.seconds,
                   entry.note);
    }
    std::fflush(stdout);
}

/// Error of each method, with `seeds` brackets a case.
void runSynthetic(const std::vector<fs::path>& environments, int seeds)
{
    const std::array sensors = {Sensor{60'000.0, 3.0}, Sensor{16'000.0, 4.0}};
    for (const fs::path& path : environments) {
        const Image<Rgb> scene = readRadiance(path).pixels;
        for (const NamedResponse& response : responses())
            for (const Sensor& sensor : sensors)
                for (int seed = 0; seed < seeds; ++seed)
                    runCase(path.stem().string(), scene, response, sensor, seed);
    }
}

void runHeldOut(const fs::path& data)
{
    for (const Stack& stack : readStacks(data)) {
        fmt::print("{}, {} frames, {}x{}: mean error of predicted codes\n",
                   stack.name,
                   stack.bracket.frames.size(),
                   stack.bracket.frames.front().image.codes.width(),
                   stack.bracket.frames.front().image.codes.height());
        for (const Entry& entry : recoverWithAll(stack.bracket)) {
            if (entry.curve.exposure[0][128] == 0.0) {
                fmt::print("  {:<26} {}\n", entry.name, entry.note);
                continue;
            }
            HeldOutOptions options;
            options.mask = stack.mask;
            const double given = predictHeldOut(stack.bracket, entry.curve, options).mean_codes;
            options.exposure_scale = entry.scale;
            const HeldOutError error = predictHeldOut(stack.bracket, entry.curve, options);
            fmt::print(
                "  {:<26} {:.3f} codes ({:.3f} with the exposures as given), {} predictions, "
                "{:6.3f} s {}\n",
                entry.name,
                error.mean_codes,
                given,
                error.count,
                entry.seconds,
                entry.note);
        }
    }
}

}  // namespace

int main(int argc, char** argv)
{
    const std::string what = argc > 2 ? argv[1] : "";
    if (what != "synthetic" && what != "held-out") {
        fmt::print(stderr,
                   "usage: response_peers synthetic [--seeds N] ENVIRONMENT.exr... | held-out "
                   "DATA_FOLDER\n");
        return 2;
    }
    int seeds = 1;
    std::vector<fs::path> environments;
    for (int i = 2; i < argc; ++i) {
        if (std::string(argv[i]) == "--seeds" && i + 1 < argc)
            seeds = std::max(1, std::atoi(argv[++i]));
        else
            environments.emplace_back(argv[i]);
    }
    try {
        if (what == "synthetic")
            runSynthetic(environments, seeds);
        else
            runHeldOut(argv[2]);
    } catch (const std::exception& error) {
        fmt::print(stderr, "{}\n", error.what());
        return 1;
    }
    return 0;
}
