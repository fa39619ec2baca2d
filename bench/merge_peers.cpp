// The HDR merge beside OpenCV's, on brackets whose truth is known: each environment given (.exr,
// .hdr) is photographed eleven times, 1 EV apart, by a camera with an S-shaped response of its own
// per channel, Poisson and read noise and 8 bits; every program is given the true response.
//
// Errors are relative RMS over the values that are well exposed in some frame. "bound" is what the
// noise allows: the minimum variance of a mean of all frames that are neither clipped nor black
// (Granados et al. 2010). OpenCV's results are scaled per channel to fit best; ours are not.
//
// Physical limit of speed: a pixel-exposure is 6 bytes to read (16-bit codes), and a pixel of the
// result 26 bytes to write (radiance, variance, two masks), each line of which is read first: at
// eleven exposures 6 + 52/11 = 10.7 bytes a pixel-exposure. At 10 GB/s for one core's share of
// memory that is 0.9 gigapixel-exposures a second.

#include "capture/hdr_merge.h"
#include "core/check.h"
#include "core/io/image_io.h"
#include "core/random.h"

#include <fmt/format.h>
#include <opencv2/core.hpp>
#include <opencv2/photo.hpp>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <exception>
#include <functional>
#include <string>
#include <vector>

namespace {

using namespace insitu;
using Clock = std::chrono::steady_clock;

constexpr int kExposures = 11;
constexpr double kElectrons = 10'000.0;  ///< at full scale
constexpr double kReadElectrons = 5.0;
constexpr int kRuns = 13;  ///< of which the median counts

/// The median of the runs. Processor time counts all threads: what a busy machine changes little.
struct Seconds {
    double wall = 0.0;
    double processor = 0.0;
    double fastest_wall = 0.0;
};

Seconds secondsOf(const std::function<void()>& body, int runs)
{
    std::vector<double> walls;
    std::vector<double> processors;
    for (int i = 0; i < runs; ++i) {
        const auto start = Clock::now();
        const std::clock_t ticks = std::clock();
        body();
        walls.push_back(std::chrono::duration<double>(Clock::now() - start).count());
        processors.push_back(static_cast<double>(std::clock() - ticks) / CLOCKS_PER_SEC);
    }
    std::ranges::sort(walls);
    std::ranges::sort(processors);
    const std::size_t middle = walls.size() / 2;
    return {walls[middle], processors[middle], walls.front()};
}

/// z = (1 + a) e^g / (e^g + a): a toe and a shoulder, closed form both ways.
struct Curve {
    double power;
    double knee;

    [[nodiscard]] double code(double e) const
    {
        const double p = std::pow(std::clamp(e, 0.0, 1.0), power);
        return 255.0 * (1.0 + knee) * p / (p + knee);
    }
    [[nodiscard]] double exposure(double code255) const
    {
        const double z = code255 / 255.0;
        return std::pow(knee * z / (1.0 + knee - z), 1.0 / power);
    }
    /// Change of exposure per code.
    [[nodiscard]] double slope(double e) const
    {
        const double z = std::clamp(code(e), 0.5, 254.5);
        return exposure(z + 0.5) - exposure(z - 0.5);
    }
};

constexpr std::array<Curve, 3> kCurves = {Curve{0.75, 0.35}, Curve{0.80, 0.45}, Curve{0.70, 0.55}};

ResponseCurve trueResponse()
{
    ResponseCurve response;
    response.source = "truth";
    for (std::size_t c = 0; c < 3; ++c)
        for (std::size_t z = 0; z < 256; ++z)
            response.exposure[c][z] = kCurves[c].exposure(static_cast<double>(z));
    return response;
}

double electrons(double mean, RandomStream& random)
{
    constexpr double kNormalFrom = 60.0;
    if (mean > kNormalFrom)
        return std::max(0.0, std::round(mean + std::sqrt(mean) * random.normal()));
    double product = random.uniformDouble();
    int count = 0;
    for (const double least = std::exp(-mean); product > least; ++count)
        product *= random.uniformDouble();
    return count;
}

Bracket photographed(const Image<Rgb>& scene, double longest, std::uint64_t seed)
{
    std::vector<BracketFrame> frames;
    for (int k = 0; k < kExposures; ++k) {
        BracketFrame frame;
        frame.name = fmt::format("frame_{}", k);
        frame.relative_exposure = longest * std::exp2(-k);
        frame.image.codes = Image<glm::u16vec3>(scene.width(), scene.height());
        for (int y = 0; y < scene.height(); ++y) {
            RandomStream random(seed, static_cast<std::uint64_t>(y), static_cast<std::uint64_t>(k));
            for (int x = 0; x < scene.width(); ++x) {
                for (int c = 0; c < 3; ++c) {
                    const double light = static_cast<double>(scene(x, y)[c]);
                    // A full well holds no more; the excess changes nothing.
                    const double mean = std::min(light * frame.relative_exposure, 4.0) * kElectrons;
                    const double e =
                        (electrons(mean, random) + kReadElectrons * random.normal()) / kElectrons;
                    frame.image.codes(x, y)[c] = static_cast<std::uint16_t>(
                        std::lround(kCurves[static_cast<std::size_t>(c)].code(e)));
                }
            }
        }
        frames.push_back(std::move(frame));
    }
    return makeBracket(std::move(frames));
}

/// Minimum variance of the radiance of one value; 0 where no frame shows it well.
double boundOf(std::size_t c, double light, const Bracket& bracket, const MergeOptions& options)
{
    const Curve& curve = kCurves[c];
    double information = 0.0;
    for (const BracketFrame& frame : bracket.frames) {
        const double e = light * frame.relative_exposure;
        if (e >= 1.0) continue;
        const double z = curve.code(e) / 255.0;
        if (z > options.clip_fraction || z < options.black_fraction) continue;
        const double slope = curve.slope(e);
        constexpr double kRead = kReadElectrons / kElectrons;
        const double variance = kRead * kRead + e / kElectrons + slope * slope / 12.0;
        information += frame.relative_exposure * frame.relative_exposure / variance;
    }
    const double brightest = light * bracket.frames.front().relative_exposure;
    const bool well_exposed = curve.code(brightest) >= 2.0 * 255.0 * options.black_fraction;
    return information > 0.0 && well_exposed ? 1.0 / information : 0.0;
}

struct Errors {
    double rms = 0.0;
    double bound = 0.0;
    double within_1 = 0.0;  ///< shares of values within 1 and 1.96 stated deviations
    double within_2 = 0.0;
};

using RadianceAt = std::function<double(int x, int y, int c)>;

/// `scaled`: after the scale per channel that fits best.
Errors errorsOf(const Image<Rgb>& scene,
                const Image<Rgb>& bound,
                const RadianceAt& radiance,
                bool scaled,
                const Image<Rgb>* variance)
{
    Errors errors;
    double values = 0.0;
    for (int c = 0; c < 3; ++c) {
        std::vector<double> relative;
        for (int y = 0; y < scene.height(); ++y) {
            for (int x = 0; x < scene.width(); ++x) {
                const double limit = static_cast<double>(bound(x, y)[c]);
                if (!(limit > 0.0)) continue;
                const double truth = static_cast<double>(scene(x, y)[c]);
                const double found = radiance(x, y, c);
                relative.push_back(found / truth);
                errors.bound += limit / (truth * truth);
                if (variance == nullptr) continue;
                const double deviation =
                    std::abs(found - truth) / std::sqrt(static_cast<double>((*variance)(x, y)[c]));
                errors.within_1 += deviation <= 1.0 ? 1.0 : 0.0;
                errors.within_2 += deviation <= 1.96 ? 1.0 : 0.0;
            }
        }
        double sum = 0.0;
        double squares = 0.0;
        for (const double r : relative) {
            sum += r;
            squares += r * r;
        }
        const double scale = scaled ? sum / squares : 1.0;
        for (const double r : relative)
            errors.rms += (scale * r - 1.0) * (scale * r - 1.0);
        values += static_cast<double>(relative.size());
    }
    return {std::sqrt(errors.rms / values),
            std::sqrt(errors.bound / values),
            errors.within_1 / values,
            errors.within_2 / values};
}

/// Codes and response as OpenCV takes them.
struct OpenCvInput {
    std::vector<cv::Mat> frames;
    std::vector<float> seconds;
    cv::Mat response;
};

OpenCvInput openCvInput(const Bracket& bracket, const ResponseCurve& response)
{
    OpenCvInput input;
    for (const BracketFrame& frame : bracket.frames) {
        const auto& codes = frame.image.codes;
        cv::Mat mat(codes.height(), codes.width(), CV_8UC3);
        for (int y = 0; y < codes.height(); ++y)
            for (int x = 0; x < codes.width(); ++x)
                for (int c = 0; c < 3; ++c)
                    mat.at<cv::Vec3b>(y, x)[c] = static_cast<std::uint8_t>(codes(x, y)[c]);
        input.frames.push_back(mat);
        input.seconds.push_back(static_cast<float>(frame.relative_exposure));
    }
    input.response = cv::Mat(256, 1, CV_32FC3);
    for (int z = 0; z < 256; ++z)
        for (int c = 0; c < 3; ++c)
            // Its Debevec takes logarithms: code 0 must not mean nothing at all.
            input.response.at<cv::Vec3f>(z)[c] = static_cast<float>(std::max(
                response.exposure[static_cast<std::size_t>(c)][static_cast<std::size_t>(z)], 1e-6));
    return input;
}

void printLine(const std::string& name,
               const Errors& errors,
               const Seconds& seconds,
               double pixel_exposures)
{
    fmt::print(
        "  {:<18} error {:.4f} % ({:+.1f} % over the bound {:.4f} %), {:.4f} s, {:.0f} "
        "megapixel-exposures/s (fastest run {:.0f}; {:.0f} per second of one processor)",
        name,
        100.0 * errors.rms,
        100.0 * (errors.rms / errors.bound - 1.0),
        100.0 * errors.bound,
        seconds.wall,
        1e-6 * pixel_exposures / seconds.wall,
        1e-6 * pixel_exposures / seconds.fastest_wall,
        1e-6 * pixel_exposures / seconds.processor);
    if (errors.within_1 > 0.0)
        fmt::print("; within 1 sigma {:.1f} %, 1.96 sigma {:.1f} %",
                   100.0 * errors.within_1,
                   100.0 * errors.within_2);
    fmt::print("\n");
}

void judgePeers(const Bracket& bracket,
                const ResponseCurve& response,
                const Image<Rgb>& scene,
                const Image<Rgb>& bound,
                double pixel_exposures)
{
    const OpenCvInput input = openCvInput(bracket, response);
    const auto judge = [&](const std::string& name, auto merger) {
        cv::Mat merged;
        const Seconds seconds = secondsOf(
            [&] { merger->process(input.frames, merged, input.seconds, input.response); }, 1);
        const Errors errors = errorsOf(
            scene,
            bound,
            [&](int x, int y, int c) { return static_cast<double>(merged.at<cv::Vec3f>(y, x)[c]); },
            true,
            nullptr);
        printLine(name, errors, seconds, pixel_exposures);
    };
    judge("OpenCV Debevec", cv::createMergeDebevec());
    judge("OpenCV Robertson", cv::createMergeRobertson());
}

void printNoise(const NoiseModel& noise)
{
    fmt::print("  noise found / true, gain and read deviation:");
    for (const ChannelNoise& channel : noise.channels)
        fmt::print(" {:.3f} {:.3f}",
                   channel.gain * kElectrons,
                   std::sqrt(channel.read_variance) * kElectrons / kReadElectrons);
    fmt::print("\n");
}

void judge(const std::string& file, std::uint64_t seed, bool with_peers)
{
    const Image<Rgb> scene = readRadiance(file).pixels;
    // The brightest thousandth is a little below full scale in the shortest frame.
    std::vector<float> sorted;
    for (const Rgb& pixel : scene.pixels())
        sorted.push_back(std::max({pixel.r, pixel.g, pixel.b}));
    const auto place = sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() * 999 / 1000);
    std::ranges::nth_element(sorted, place);
    const double shortest = 0.7 / static_cast<double>(*place);
    const Bracket bracket = photographed(scene, shortest * std::exp2(kExposures - 1), seed);
    const ResponseCurve response = trueResponse();
    const double pixel_exposures = static_cast<double>(scene.pixelCount()) * kExposures;

    MergeOptions options;
    Image<Rgb> bound(scene.width(), scene.height());
    for (std::size_t i = 0; i < scene.pixelCount(); ++i)
        for (int c = 0; c < 3; ++c)
            bound.pixels()[i][c] =
                static_cast<float>(boundOf(static_cast<std::size_t>(c),
                                           static_cast<double>(scene.pixels()[i][c]),
                                           bracket,
                                           options));

    fmt::print("{}, seed {}\n", file.substr(file.rfind('/') + 1), seed);
    NoiseEstimate estimate;
    const Seconds noise_seconds =
        secondsOf([&] { estimate = estimateNoise(bracket, response); }, kRuns);
    printNoise(estimate.model);
    options.noise = estimate.model;
    MergeResult merged;
    const Seconds seconds =
        secondsOf([&] { merged = mergeBracket(bracket, response, options); }, kRuns);
    const Errors errors = errorsOf(
        scene,
        bound,
        [&](int x, int y, int c) { return static_cast<double>(merged.radiance.pixels(x, y)[c]); },
        false,
        &merged.variance);
    printLine("ours", errors, seconds, pixel_exposures);
    fmt::print("  estimate of the noise: {:.4f} s, {:.4f} s of one processor\n",
               noise_seconds.wall,
               noise_seconds.processor);
    if (with_peers) judgePeers(bracket, response, scene, bound, pixel_exposures);
}

}  // namespace

int main(int argc, char** argv)
{
    if (argc < 2) {
        fmt::print(stderr, "usage: merge_peers ENVIRONMENT... (.exr, .hdr)\n");
        return 2;
    }
    try {
        constexpr std::uint64_t kSeeds = 3;
        for (int i = 1; i < argc; ++i)
            for (std::uint64_t seed = 1; seed <= kSeeds; ++seed)
                judge(argv[i], seed, seed == 1);
    } catch (const std::exception& error) {
        fmt::print(stderr, "{}\n", error.what());
        return 1;
    }
    return 0;
}
