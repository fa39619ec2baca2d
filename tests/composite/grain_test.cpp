#include "composite/match/grain.h"

#include "core/parallel.h"
#include "tests/composite/simulated_photo.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>

namespace insitu {
namespace {

constexpr int kWidth = 640;
constexpr int kHeight = 480;
constexpr int kPatch = 80;

/// Patches of many levels, half of them with a texture no plane removes.
Image<Rgb> patches()
{
    return picture(kWidth, kHeight, [](double x, double y) {
        const int i = static_cast<int>(x) / kPatch;
        const int k = static_cast<int>(y) / kPatch;
        const float level = 0.02f + 0.9f * static_cast<float>((i * 5 + k * 3) % 16) / 16.0f;
        const float weave =
            k % 2 == 1 ? 0.3f * static_cast<float>(std::sin(0.9 * x) * std::sin(0.7 * y)) : 0.0f;
        return Rgb(level, 0.9f * level, 0.7f * level) * (1.0f + weave);
    });
}

/// Variance over shots, 8-bit steps squared, of a flat patch's inside: what nobody had to estimate.
struct ShotTruth {
    std::vector<glm::dvec3> level;
    std::vector<glm::dvec3> variance;
};

ShotTruth truthOverShots(const SimulatedPhoto& camera, const Image<Rgb>& light)
{
    constexpr int kShots = 8;
    std::vector<EncodedImage> shots;
    for (int s = 0; s < kShots; ++s)
        shots.push_back(camera.take(light, 100 + static_cast<std::uint64_t>(s)));
    ShotTruth truth;
    for (int k = 0; k < kHeight / kPatch; k += 2)
        for (int i = 0; i < kWidth / kPatch; ++i) {
            glm::dvec3 level(0.0);
            glm::dvec3 variance(0.0);
            double count = 0.0;
            for (int y = k * kPatch + 20; y < k * kPatch + 60; ++y)
                for (int x = i * kPatch + 20; x < i * kPatch + 60; ++x) {
                    glm::dvec3 mean(0.0);
                    for (const EncodedImage& shot : shots)
                        mean += glm::dvec3(shot.codes(x, y)) / double(kShots);
                    for (const EncodedImage& shot : shots) {
                        const glm::dvec3 d = glm::dvec3(shot.codes(x, y)) - mean;
                        variance += d * d * (kShots / (kShots - 1.0));
                        level += glm::dvec3(shot.codes(x, y));
                        count += 1.0;
                    }
                }
            truth.level.push_back(level / count);
            truth.variance.push_back(variance / count);
        }
    return truth;
}

class GrainOfCameras : public testing::TestWithParam<SimulatedPhoto> {};

TEST_P(GrainOfCameras, SigmaWithinTenPercentAtEveryLevel)
{
    const SimulatedPhoto camera = GetParam();
    const Image<Rgb> light = patches();
    const GrainEstimate estimate = estimateGrain(camera.take(light, 1), ResponseCurve::srgb());
    ASSERT_TRUE(estimate.findings.empty());
    const ShotTruth truth = truthOverShots(camera, light);
    double squares = 0.0;
    double count = 0.0;
    for (std::size_t i = 0; i < truth.level.size(); ++i)
        for (int c = 0; c < 3; ++c) {
            if (truth.level[i][c] < 12.0 || truth.level[i][c] > 235.0) continue;
            const double sigma = std::sqrt(truth.variance[i][c] - 1.0 / 12.0);
            const double error = estimate.model.sigmaAt(c, truth.level[i][c]) / sigma - 1.0;
            // Ten percent is what is asked; a single patch's own truth is known to about one.
            EXPECT_LT(std::abs(error), 0.12)
                << "level " << truth.level[i][c] << " channel " << c << " sigma " << sigma;
            squares += error * error;
            count += 1.0;
        }
    EXPECT_LT(std::sqrt(squares / count), 0.06);
    RecordProperty("rms_percent", static_cast<int>(1000.0 * std::sqrt(squares / count)));
}

INSTANTIATE_TEST_SUITE_P(Cameras,
                         GrainOfCameras,
                         testing::Values(SimulatedPhoto{0.002, 0.0004, false, 0},
                                         SimulatedPhoto{0.004, 0.0020, false, 0},
                                         SimulatedPhoto{0.002, 0.0010, true, 0},
                                         SimulatedPhoto{0.002, 0.0010, true, 95}));

/// Mean, deviation and correlation of neighbours of the noise in windows of a texture.
std::vector<std::array<double, 6>> windowFeatures(const Image<Rgb>& noise)
{
    constexpr int kWindow = 16;
    std::vector<std::array<double, 6>> features;
    for (int y0 = 0; y0 + kWindow <= noise.height(); y0 += kWindow)
        for (int x0 = 0; x0 + kWindow <= noise.width(); x0 += kWindow) {
            glm::dvec3 mean(0.0);
            for (int y = y0; y < y0 + kWindow; ++y)
                for (int x = x0; x < x0 + kWindow; ++x)
                    mean += glm::dvec3(noise(x, y)) / double(kWindow * kWindow);
            glm::dvec3 square(0.0);
            glm::dvec3 beside(0.0);
            double green_red = 0.0;
            for (int y = y0; y < y0 + kWindow; ++y)
                for (int x = x0; x + 1 < x0 + kWindow; ++x) {
                    const glm::dvec3 a = glm::dvec3(noise(x, y)) - mean;
                    square += a * a;
                    beside += a * (glm::dvec3(noise(x + 1, y)) - mean);
                    green_red += a.g * a.r;
                }
            features.push_back({std::log(square.r),
                                std::log(square.g),
                                std::log(square.b),
                                beside.g / square.g,
                                beside.b / square.b,
                                green_red / std::sqrt(square.r * square.g)});
        }
    return features;
}

/// Share of the odd windows, held out, that a linear detector (per feature: mean and pooled
/// deviation, summed as likelihoods) puts on the right side; 0.5 is a guess.
double detectorAccuracy(const std::vector<std::array<double, 6>>& a,
                        const std::vector<std::array<double, 6>>& b)
{
    std::array<double, 6> mean_a{};
    std::array<double, 6> mean_b{};
    std::array<double, 6> spread{};
    const auto half = [](const auto& v) { return v.size() / 2; };
    for (std::size_t f = 0; f < 6; ++f) {
        for (std::size_t i = 0; i < half(a); ++i)
            mean_a[f] += a[2 * i][f] / static_cast<double>(half(a));
        for (std::size_t i = 0; i < half(b); ++i)
            mean_b[f] += b[2 * i][f] / static_cast<double>(half(b));
        for (std::size_t i = 0; i < half(a); ++i)
            spread[f] += (a[2 * i][f] - mean_a[f]) * (a[2 * i][f] - mean_a[f]);
        for (std::size_t i = 0; i < half(b); ++i)
            spread[f] += (b[2 * i][f] - mean_b[f]) * (b[2 * i][f] - mean_b[f]);
        spread[f] /= static_cast<double>(half(a) + half(b));
    }
    const auto score = [&](const std::array<double, 6>& v) {
        double sum = 0.0;
        for (std::size_t f = 0; f < 6; ++f)
            sum += ((v[f] - mean_b[f]) * (v[f] - mean_b[f]) -
                    (v[f] - mean_a[f]) * (v[f] - mean_a[f])) /
                   spread[f];
        return sum;
    };
    double right = 0.0;
    for (std::size_t i = 0; i < half(a); ++i)
        right += score(a[2 * i + 1]) > 0.0;
    for (std::size_t i = 0; i < half(b); ++i)
        right += score(b[2 * i + 1]) <= 0.0;
    return right / static_cast<double>(half(a) + half(b));
}

/// The same room of flat patches twice: photographed again, and made of the first photograph's
/// expectation and grain.
TEST(Grain, PatchDetectorCannotTellItFromTheCameras)
{
    const SimulatedPhoto camera{0.002, 0.0010, true, 95};
    const Image<Rgb> light = patches();
    const GrainModel model = estimateGrain(camera.take(light, 1), ResponseCurve::srgb()).model;
    const Image<Rgb> texture = grainTexture(model, 0, 0, kWidth, kHeight, 5);
    const EncodedImage photo = camera.take(light, 3);
    std::vector<std::array<double, 6>> real;
    std::vector<std::array<double, 6>> made;
    std::vector<std::array<double, 6>> white;
    for (int k = 0; k < kHeight / kPatch; k += 2)
        for (int i = 0; i < kWidth / kPatch; ++i) {
            constexpr int kInside = 64;
            const int x0 = i * kPatch + 8;
            const int y0 = k * kPatch + 8;
            glm::dvec3 mean(0.0);
            for (int y = 0; y < kInside; ++y)
                for (int x = 0; x < kInside; ++x)
                    mean += glm::dvec3(photo.codes(x0 + x, y0 + y)) / double(kInside * kInside);
            if (std::min(mean.g, mean.b) < 12.0 || std::max(mean.r, mean.g) > 235.0) continue;
            std::array<Image<Rgb>, 3> noise;
            noise.fill(Image<Rgb>(kInside, kInside));
            for (int y = 0; y < kInside; ++y)
                for (int x = 0; x < kInside; ++x) {
                    RandomStream random(
                        9, static_cast<std::uint64_t>((y0 + y) * kWidth + x0 + x), 0);
                    for (int c = 0; c < 3; ++c) {
                        const double sigma = model.sigmaAt(c, mean[c]);
                        const auto rounded = [&](double n) {
                            return static_cast<float>(std::round(mean[c] + sigma * n) - mean[c]);
                        };
                        noise[0](x, y)[c] =
                            static_cast<float>(photo.codes(x0 + x, y0 + y)[c] - mean[c]);
                        noise[1](x, y)[c] = rounded(texture(x0 + x, y0 + y)[c]);
                        noise[2](x, y)[c] = rounded(random.normal());
                    }
                }
            const auto add = [](std::vector<std::array<double, 6>>& to, const Image<Rgb>& from) {
                const auto features = windowFeatures(from);
                to.insert(to.end(), features.begin(), features.end());
            };
            add(real, noise[0]);
            add(made, noise[1]);
            add(white, noise[2]);
        }
    EXPECT_LT(detectorAccuracy(real, made), 0.60);
    EXPECT_GT(detectorAccuracy(real, white), 0.95)
        << "white noise of the right deviation must be told apart";
}

TEST(Grain, TextureHasUnitVarianceAndDoesNotDependOnTheRectangle)
{
    const SimulatedPhoto camera{0.002, 0.0010, true, 90};
    const GrainModel model = estimateGrain(camera.take(patches(), 1), ResponseCurve::srgb()).model;
    const Image<Rgb> whole = grainTexture(model, 0, 0, 300, 200, 7);
    const Image<Rgb> part = grainTexture(model, 100, 50, 40, 30, 7);
    for (int y = 0; y < 30; ++y)
        for (int x = 0; x < 40; ++x)
            ASSERT_EQ(part(x, y), whole(x + 100, y + 50));
    glm::dvec3 square(0.0);
    for (const Rgb& n : whole.pixels())
        square += glm::dvec3(n * n) / static_cast<double>(whole.pixelCount());
    // 60 000 correlated samples: a standard error of about 2 %.
    for (int c = 0; c < 3; ++c)
        EXPECT_NEAR(square[c], 1.0, 0.08);
    setThreadCount(1);
    const Image<Rgb> alone = grainTexture(model, 0, 0, 300, 200, 7);
    setThreadCount(0);
    EXPECT_EQ(alone, whole);
}

TEST(Grain, TexturedOrClippedPhotographsSaySo)
{
    const Image<Rgb> bright(640, 480, Rgb(1.5f));
    const SimulatedPhoto camera;
    const GrainEstimate clipped = estimateGrain(camera.take(bright, 1), ResponseCurve::srgb());
    EXPECT_TRUE(hasFinding(clipped.findings, "grain-unknown"));
    EXPECT_EQ(clipped.model.sigmaAt(0, 128.0), 0.0);
    const GrainEstimate tiny =
        estimateGrain(camera.take(Image<Rgb>(20, 20, Rgb(0.2f)), 1), ResponseCurve::srgb());
    EXPECT_TRUE(hasFinding(tiny.findings, "grain-unknown"));
}

TEST(Grain, PhotographWithoutNoiseGetsNone)
{
    SimulatedPhoto camera;
    camera.read_noise = camera.photon_noise = 0.0;
    const GrainEstimate estimate = estimateGrain(camera.take(patches(), 1), ResponseCurve::srgb());
    for (int c = 0; c < 3; ++c)
        EXPECT_LT(estimate.model.sigmaAt(c, 128.0), 0.1);
}

// Where the bracket does not show the response it may be as good as flat, and the sensor's law with
// it endless: levels that nothing flat shows get no more than twice the deviation of those it does.
TEST(Grain, OfLevelsThatNothingShowsIsBounded)
{
    ResponseCurve response = ResponseCurve::srgb();
    for (auto& table : response.exposure)
        for (std::size_t z = 200; z < table.size(); ++z)
            table[z] = table[z - 1] * (1.0 + 1e-6);
    const Image<Rgb> dark = picture(kWidth, kHeight, [](double x, double) {
        return Rgb(0.02f + 0.2f * static_cast<float>(static_cast<int>(x) / kPatch) / 8.0f);
    });
    const GrainModel model = estimateGrain(SimulatedPhoto{}.take(dark, 3), response).model;
    double seen = 0.0;
    for (double code = 40.0; code < 130.0; code += 1.0)
        seen = std::max(seen, model.sigmaAt(1, code));
    ASSERT_GT(seen, 0.5);
    for (const double code : {180.0, 210.0, 230.0, 255.0})
        EXPECT_LE(model.sigmaAt(1, code), 2.2 * seen) << code;  // rounding is taken off
}

}  // namespace
}  // namespace insitu
