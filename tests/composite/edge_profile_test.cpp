#include "composite/match/edge_profile.h"

#include "composite/differential.h"
#include "core/parallel.h"
#include "tests/composite/simulated_photo.h"

#include <gtest/gtest.h>

#include <cmath>

namespace insitu {
namespace {

constexpr int kWidth = 480;
constexpr int kHeight = 360;

/// Turned squares of many greys through a lens: blurred by a Gaussian of `sigma` pixels, averaged
/// over pixels; `magnification` is that of each channel.
Image<Rgb> squares(double sigma, glm::dvec3 magnification = glm::dvec3(0.0))
{
    constexpr int kFine = 4;
    const glm::dvec2 centre(kWidth / 2.0, kHeight / 2.0);
    cv::Mat fine(kHeight * kFine, kWidth * kFine, CV_32FC3);
    for (int y = 0; y < fine.rows; ++y)
        for (int x = 0; x < fine.cols; ++x)
            for (int c = 0; c < 3; ++c) {
                const glm::dvec2 p((x + 0.5) / kFine, (y + 0.5) / kFine);
                const glm::dvec2 q = centre + (p - centre) / (1.0 + magnification[c]);
                const int i = static_cast<int>(std::floor(q.x / 60.0));
                const int k = static_cast<int>(std::floor(q.y / 60.0));
                const glm::dvec2 in = q - glm::dvec2(60.0 * i + 30.0, 60.0 * k + 30.0);
                const double turn = 0.15 + 0.21 * (i + 3 * k);
                const double u = std::cos(turn) * in.x + std::sin(turn) * in.y;
                const double v = std::cos(turn) * in.y - std::sin(turn) * in.x;
                const bool inside = std::max(std::abs(u), std::abs(v)) < 18.0;
                fine.at<cv::Vec3f>(y, x)[c] = inside ? 0.5f + 0.02f * float((i + k) & 7) : 0.12f;
            }
    cv::GaussianBlur(fine, fine, {0, 0}, sigma * kFine);
    cv::resize(fine, fine, {kWidth, kHeight}, 0.0, 0.0, cv::INTER_AREA);
    Image<Rgb> image(kWidth, kHeight);
    std::copy_n(fine.ptr<Rgb>(), image.pixelCount(), image.pixels().data());
    return image;
}

/// Photographed and made linear again.
Image<Rgb> throughCamera(const Image<Rgb>& light, double noise)
{
    SimulatedPhoto camera;
    camera.read_noise = noise;
    camera.photon_noise = noise * 0.2;
    return photographedRadiance(camera.take(light, 4), ResponseCurve::srgb(), 1.0);
}

class BlurOfPhotographs : public testing::TestWithParam<double> {};

TEST_P(BlurOfPhotographs, WithinTenPercent)
{
    const double sigma = GetParam();
    const Image<Rgb> light = squares(sigma);
    const Image<std::uint8_t> usable(kWidth, kHeight, 1);
    for (const double noise : {0.001, 0.006}) {
        const BlurEstimate estimate =
            estimateBlur(edgeProfiles(throughCamera(light, noise), usable));
        EXPECT_TRUE(estimate.findings.empty());
        EXPECT_NEAR(estimate.sigma_px, sigma, 0.1 * sigma) << "noise " << noise;
    }
}

INSTANTIATE_TEST_SUITE_P(Sigmas, BlurOfPhotographs, testing::Values(0.5, 0.8, 1.2, 2.0));

TEST(EdgeProfile, ChromaticAberrationWithinTenPercent)
{
    const glm::dvec3 truth(0.0012, 0.0, -0.0018);
    const Image<Rgb> light = squares(0.7, truth);
    const auto edges =
        edgeProfiles(throughCamera(light, 0.003), Image<std::uint8_t>(kWidth, kHeight, 1));
    const ChromaticAberration estimate =
        estimateChromaticAberration(edges, glm::dvec2(kWidth, kHeight) / 2.0);
    EXPECT_TRUE(estimate.significant);
    for (const int c : {0, 2}) {
        EXPECT_NEAR(estimate.magnification[c], truth[c], 0.1 * std::abs(truth[c]));
        EXPECT_LT(estimate.magnification_sigma[c], 0.05 * std::abs(truth[c]));
    }
    const auto plain =
        edgeProfiles(throughCamera(squares(0.7), 0.003), Image<std::uint8_t>(kWidth, kHeight, 1));
    const ChromaticAberration none =
        estimateChromaticAberration(plain, glm::dvec2(kWidth, kHeight) / 2.0);
    EXPECT_FALSE(none.significant);
    for (const int c : {0, 2})
        EXPECT_LT(std::abs(none.magnification[c]), 4.0 * none.magnification_sigma[c]);
}

TEST(EdgeProfile, PhotographWithoutEdgesSaysSo)
{
    const Image<Rgb> flat = throughCamera(Image<Rgb>(200, 200, Rgb(0.3f)), 0.01);
    const BlurEstimate estimate =
        estimateBlur(edgeProfiles(flat, Image<std::uint8_t>(200, 200, 1)));
    EXPECT_TRUE(hasFinding(estimate.findings, "blur-unknown"));
    EXPECT_EQ(estimate.sigma_px, 0.0);
    EXPECT_TRUE(edgeProfiles(Image<Rgb>(3, 3), Image<std::uint8_t>(3, 3, 1)).empty());
}

TEST(EdgeProfile, SameForEveryThreadCountAndLeavesOutUnusablePixels)
{
    const Image<Rgb> light = throughCamera(squares(0.7), 0.003);
    Image<std::uint8_t> usable(kWidth, kHeight, 1);
    for (int y = 0; y < kHeight; ++y)
        for (int x = 0; x < kWidth / 2; ++x)
            usable(x, y) = 0;
    const auto edges = edgeProfiles(light, usable);
    setThreadCount(1);
    const auto alone = edgeProfiles(light, usable);
    setThreadCount(0);
    ASSERT_EQ(edges.size(), alone.size());
    ASSERT_GT(edges.size(), 100u);
    for (std::size_t i = 0; i < edges.size(); ++i) {
        EXPECT_EQ(edges[i].spread, alone[i].spread);
        EXPECT_GT(edges[i].at.x, kWidth / 2.0 + 7.0);
    }
}

}  // namespace
}  // namespace insitu
