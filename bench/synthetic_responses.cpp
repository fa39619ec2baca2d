#include "bench/synthetic_responses.h"

#include "core/random.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace insitu::bench {

namespace {

constexpr int kFrames = 11;

/// The exposure that gives a code (of 255, may be fractional).
double exposureOf(const Response& response, std::size_t channel, double code)
{
    double low = 0.0;
    double high = 1.0;
    for (int i = 0; i < 60; ++i) {
        const double half = 0.5 * (low + high);
        (response(channel, half) * 255.0 < code ? low : high) = half;
    }
    return high;
}

}  // namespace

std::vector<NamedResponse> responses()
{
    return {
        {"gamma and contrast",
         [](std::size_t c, double e) {
             const double y = std::pow(e, 0.42 + 0.03 * static_cast<double>(c));
             const double k = 0.45 + 0.1 * static_cast<double>(c);
             return y + k * y * (1.0 - y) * (2.0 * y - 1.0);
         }},
        {"sigmoid of ln exposure",
         [](std::size_t c, double e) {
             const double power = std::pow(e, 0.85 + 0.05 * static_cast<double>(c));
             const double half = std::pow(0.16 + 0.03 * static_cast<double>(c),
                                          0.85 + 0.05 * static_cast<double>(c));
             return std::pow(power / (power + half) * (1.0 + half), 0.85);
         }},
        {"filmic, a long toe",  // J. Hable's curve
         [](std::size_t c, double e) {
             const auto curve = [](double x) {
                 constexpr double kToe = 0.01 / 0.30;
                 return (x * (0.22 * x + 0.03) + 0.002) / (x * (0.22 * x + 0.3) + 0.06) - kToe;
             };
             const double white = 8.0 + 2.0 * static_cast<double>(c);
             return std::pow(std::max(curve(white * e), 0.0) / curve(white),
                             0.5 + 0.03 * static_cast<double>(c));
         }},
        {"toe and shoulder of a film",
         [](std::size_t c, double e) {
             const double t = 2.0 + 0.5 * static_cast<double>(c);
             const double y = (1.0 - std::exp(-t * std::pow(e, 0.6))) / (1.0 - std::exp(-t));
             return 0.35 * y * y * (3.0 - 2.0 * y) + 0.65 * y;
         }},
    };
}

Bracket photograph(const Image<Rgb>& scene,
                   const Response& response,
                   Sensor sensor,
                   std::uint64_t seed)
{
    std::vector<float> green;
    for (const Rgb pixel : scene.pixels())
        green.push_back(pixel.g);
    std::ranges::nth_element(green, green.begin() + green.size() / 2);
    const double middle = 0.18 / static_cast<double>(green[green.size() / 2]);
    constexpr std::size_t kSteps = 1 << 18;
    std::array<std::vector<double>, 3> code;  // of exposure squared: fine where curves are steep
    for (std::size_t c = 0; c < 3; ++c)
        for (std::size_t i = 0; i <= kSteps; ++i)
            code[c].push_back(
                255.0 *
                response(c, std::pow(static_cast<double>(i) / static_cast<double>(kSteps), 2)));
    std::vector<BracketFrame> frames;
    for (int k = 0; k < kFrames; ++k) {
        BracketFrame frame;
        frame.name = fmt::format("frame_{}", k);
        frame.relative_exposure = middle * std::pow(2.0, kFrames / 2 - k);
        frame.image.codes = Image<glm::u16vec3>(scene.width(), scene.height());
        for (int y = 0; y < scene.height(); ++y) {
            RandomStream random(seed, static_cast<std::uint64_t>(y), static_cast<std::uint64_t>(k));
            for (int x = 0; x < scene.width(); ++x) {
                for (int c = 0; c < 3; ++c) {
                    const double electrons = static_cast<double>(scene(x, y)[c]) *
                                             frame.relative_exposure * sensor.full_well;
                    const double noise =
                        random.normal() *
                        std::sqrt(electrons + sensor.read_noise * sensor.read_noise);
                    const double e = std::clamp((electrons + noise) / sensor.full_well, 0.0, 1.0);
                    const double place = std::sqrt(e) * static_cast<double>(kSteps);
                    frame.image.codes(x, y)[c] = static_cast<std::uint16_t>(
                        std::lround(code[static_cast<std::size_t>(c)]
                                        [static_cast<std::size_t>(std::lround(place))]));
                }
            }
        }
        frames.push_back(std::move(frame));
    }
    return makeBracket(std::move(frames));
}

double errorEv(const ResponseCurve& curve, const Response& response, std::size_t channel)
{
    double sum = 0.0;
    double squares = 0.0;
    double count = 0.0;
    for (std::size_t z = 5; z <= 250; ++z) {
        const double value = curve.exposure[channel][z];
        if (!(value > 0.0)) return std::numeric_limits<double>::infinity();
        const double e = std::log2(value / exposureOf(response, channel, static_cast<double>(z)));
        sum += e;
        squares += e * e;
        count += 1.0;
    }
    return std::sqrt(std::max(squares / count - sum * sum / (count * count), 0.0));
}

double knownRadianceBound(const Bracket& bracket, const Response& response, Sensor sensor)
{
    double worst = 0.0;
    for (std::size_t c = 0; c < 3; ++c) {
        std::array<double, 256> seen{};
        for (const BracketFrame& frame : bracket.frames)
            for (const glm::u16vec3 codes : frame.image.codes.pixels())
                seen[codes[static_cast<int>(c)]] += 1.0;
        double sum = 0.0;
        for (std::size_t z = 5; z <= 250; ++z) {
            std::array<double, 3> e{};  // exposures of z - 1/2, z, z + 1/2
            for (std::size_t i = 0; i < 3; ++i)
                e[i] = exposureOf(
                    response, c, static_cast<double>(z) + 0.5 * static_cast<double>(i) - 0.5);
            const double electrons = e[1] * sensor.full_well;
            const double relative =
                (electrons + sensor.read_noise * sensor.read_noise) / (electrons * electrons) +
                std::pow((e[2] - e[0]) / e[1], 2) / 12.0;
            sum += relative / std::max(seen[z], 1.0);
        }
        worst = std::max(worst, std::sqrt(sum / 246.0) / std::log(2.0));
    }
    return worst;
}

}  // namespace insitu::bench
