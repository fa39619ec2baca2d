// What it costs to composite shadows in encoded intensities instead of radiance: figure 12 of
// [GibCha03] 6.3.1 remade, and the same on real shadows.
//
// intensity_transfers MODEL ENVIRONMENT
//
// First: fifty random sources and four responses (sRGB, two powers, a steep film-like one), P of
// them occluded at random, 10 000 trials each; root mean square error in 8-bit codes when the
// sources are taken to be occluded in sets of 50 and 50, 25 and 75, 10 and 90 %. Then: a floor
// under MODEL in the 50 brightest cells of 6x8x8 of the environment, by rays; errors of the pixels
// in shadow.
#include "composite/intensity_transfers.h"

#include "bench/fiv_lights.h"
#include "bench/fiv_stage.h"
#include "core/color.h"
#include "core/io/image_io.h"
#include "core/io/model_io.h"
#include "core/random.h"

#include <array>
#include <cmath>

namespace {

using namespace insitu;
using namespace fiv_bench;

constexpr std::size_t kSources = 50;
constexpr std::array<double, 3> kFirstSets = {0.5, 0.25, 0.1};

using Encode = double (*)(double);
struct Response {
    const char* name;
    Encode encode;  ///< radiance in [0, 1] to a code in [0, 255]
};
const std::array<Response, 4> kResponses = {
    Response{"sRGB", [](double x) { return 255.0 * srgbFromLinear(std::clamp(x, 0.0, 1.0)); }},
    Response{"power 1/2.2",
             [](double x) { return 255.0 * std::pow(std::clamp(x, 0.0, 1.0), 1.0 / 2.2); }},
    Response{"power 1/1.6",
             [](double x) { return 255.0 * std::pow(std::clamp(x, 0.0, 1.0), 1.0 / 1.6); }},
    Response{"film", [](double x) {
                 const double y = std::pow(std::clamp(x, 0.0, 1.0), 1.0 / 2.2);
                 return 255.0 * y * y * (3.0 - 2.0 * y);
             }}};

/// Members of the first set, drawn at random as the paper does.
std::vector<std::uint8_t> drawSet(std::size_t sources, double share, std::uint64_t seed)
{
    std::vector<std::uint8_t> set(sources, 0);
    std::vector<std::size_t> order(sources);
    std::iota(order.begin(), order.end(), std::size_t{0});
    RandomStream random(seed, 0, 1);
    for (std::size_t i = sources; i > 1; --i)
        std::swap(order[i - 1], order[random.below(static_cast<std::uint32_t>(i))]);
    for (std::size_t k = 0; k < static_cast<std::size_t>(std::lround(share * double(sources))); ++k)
        set[order[k]] = 1;
    return set;
}

void figure12()
{
    fmt::print(
        "sources occluded of 50, rms error in codes (response: sets 50/50, 25/75, 10/90 %)\n");
    constexpr int kTrials = 10'000;
    for (const Response& response : kResponses) {
        // A receiver at middle tones whose light is all from the sources.
        std::vector<double> transfers(kSources);
        for (std::size_t j = 0; j < kSources; ++j)
            transfers[j] = RandomStream(1, j, 0).uniformDouble();
        std::ranges::sort(transfers, std::greater{});
        const double sum = std::accumulate(transfers.begin(), transfers.end(), 0.0);
        const double radiance = 0.6;
        for (double& transfer : transfers)
            transfer *= radiance / sum;
        fmt::print("{:<12}", response.name);
        for (std::size_t occluded = 0; occluded <= kSources; occluded += 10) {
            fmt::print("  {:>2}:", occluded);
            for (const double share : kFirstSets) {
                double square = 0.0;
                for (int trial = 0; trial < kTrials; ++trial) {
                    const auto seed = static_cast<std::uint64_t>(trial);
                    const std::vector<double> steps = intensityTransfers(
                        radiance, transfers, drawSet(kSources, share, seed), response.encode);
                    const std::vector<std::uint8_t> mask =
                        drawSet(kSources, double(occluded) / double(kSources), seed + 1'000'000);
                    double intensity = response.encode(radiance);
                    double left = radiance;
                    for (std::size_t j = 0; j < kSources; ++j)
                        if (mask[j] != 0) {
                            intensity -= steps[j];
                            left -= transfers[j];
                        }
                    const double off = intensity - response.encode(left);
                    square += off * off;
                }
                fmt::print(" {:5.1f}", std::sqrt(square / kTrials));
            }
        }
        fmt::print("\n");
    }
}

void onAFloor(const TriangleMesh& mesh, const EnvironmentMap& environment)
{
    Stage stage;
    stage.mesh = mesh;
    const TriangleMesh* const pointer = &stage.mesh;
    stage.rays.emplace(std::span<const TriangleMesh* const>(&pointer, 1));
    stage.atlas.silhouettes.local = localFrame(mesh);
    stage.put(boundingBox(mesh).min.y, 0.0);
    const TexelLight light = baseline::texelLight(environment, 8);
    struct Source {
        glm::dvec3 direction{0.0};
        double transfer = 0.0;
    };
    std::vector<Source> sources;
    double total = 0.0;
    for (std::size_t k = 0; k < light.radiance.size(); ++k) {
        const glm::dvec3 d = light.direction(k);
        if (d.y <= 0.0) continue;
        const double transfer = luminance(light.radiance[k]) * light.cells.solidAngle(k / 2) * d.y;
        total += transfer;
        sources.push_back({d, transfer});
    }
    std::ranges::sort(sources, std::greater{}, &Source::transfer);
    sources.resize(kSources);
    std::vector<double> transfers;
    for (const Source& source : sources)
        transfers.push_back(0.6 * source.transfer / total);
    std::vector<double> occluded_shares;
    std::array<double, kResponses.size()> square{};
    std::array<double, kResponses.size()> change{};
    int pixels = 0;
    for (const glm::ivec2 p : stage.pixels) {
        const glm::dvec3 x = stage.floor.place(p.x, p.y);
        std::vector<std::uint8_t> mask(kSources);
        for (std::size_t j = 0; j < kSources; ++j)
            mask[j] = stage.rays->occluded(x, sources[j].direction) ? 1 : 0;
        const auto count = std::ranges::count(mask, std::uint8_t{1});
        if (count == 0) continue;
        ++pixels;
        occluded_shares.push_back(static_cast<double>(count) / double(kSources));
        for (std::size_t r = 0; r < kResponses.size(); ++r) {
            const Encode encode = kResponses[r].encode;
            const std::vector<double> steps = intensityTransfers(
                0.6, transfers, drawSet(kSources, 0.5, static_cast<std::uint64_t>(pixels)), encode);
            double intensity = encode(0.6);
            double left = 0.6;
            for (std::size_t j = 0; j < kSources; ++j)
                if (mask[j] != 0) {
                    intensity -= steps[j];
                    left -= transfers[j];
                }
            square[r] += std::pow(intensity - encode(left), 2.0);
            change[r] += std::pow(encode(0.6) - encode(left), 2.0);
        }
    }
    std::ranges::sort(occluded_shares);
    fmt::print("floor: {} pixels in shadow, half of them lose more than {:.0f} % of 50 sources\n",
               pixels,
               100.0 * occluded_shares[occluded_shares.size() / 2]);
    for (std::size_t r = 0; r < kResponses.size(); ++r)
        fmt::print("  {:<12} rms error {:.1f} codes, {:.1f} % of the shadow\n",
                   kResponses[r].name,
                   std::sqrt(square[r] / pixels),
                   100.0 * std::sqrt(square[r] / change[r]));
}

}  // namespace

int main(int argc, char** argv)
{
    if (argc != 3) {
        fmt::print(stderr, "usage: intensity_transfers MODEL ENVIRONMENT\n");
        return 2;
    }
    try {
        figure12();
        onAFloor(readModel(argv[1]).mesh, {readRadiance(argv[2]).pixels});
        return 0;
    } catch (const std::exception& error) {
        fmt::print(stderr, "{}\n", error.what());
        return 1;
    }
}
