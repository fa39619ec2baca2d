// A capture with two views of the ball, from the simulator to the finished picture.
#include "core/color.h"
#include "core/quantile.h"
#include "pipeline/insert.h"
#include "pipeline/simulate.h"
#include "tests/pipeline/small_room.h"

#include <glm/glm.hpp>
#include <gmock/gmock.h>

#include <cmath>
#include <filesystem>
#include <string>

namespace insitu {
namespace {

namespace fs = std::filesystem;

/// The small room in pictures large enough to insert into, its ball seen from two sides.
class TwoViewsOfTheBall : public SimulateRoom {
protected:
    [[nodiscard]] SimulatedRoom room() const
    {
        Json json = good();
        json["camera"]["focal_px"] = 182;
        json["camera"]["width"] = 224;
        json["camera"]["height"] = 168;
        json["ball"]["size_px"] = 140;
        json["ball"]["further_view_positions_m"] = {{-0.6, 0.7, -0.9}};
        json["photography"] = {{"ball_seconds", {0.5, 0.125, 0.03125, 0.0078125}}};
        json["lines"] = {{"noise_px", 0.1}};
        json["render"]["samples_per_pixel"] = 12;
        // The truth must be nearer to the light than the views are.
        json["render"]["panorama_samples_per_pixel"] = 1024;
        json["render"]["ball_samples_per_pixel"] = 64;
        return read(json);
    }

    /// What insitu simulate would leave in a folder.
    Project capture()
    {
        const SimulatedRoom described = room();
        simulated_ = simulate(described, silent_);
        writeCapture(simulated_, described, folder_ / "capture");
        return readProject(folder_ / "capture" / "project.json");
    }

    SimulatedCapture simulated_;
};

/// The light's mean luminance over a texel of the truth.
double meanOver(const EnvironmentMap& light, const Image<Rgb>& truth, int x, int y)
{
    constexpr int kParts = 4;
    double sum = 0.0;
    for (int j = 0; j < kParts; ++j)
        for (int i = 0; i < kParts; ++i) {
            const glm::dvec2 uv((x + (i + 0.5) / kParts) / truth.width(),
                                (y + (j + 0.5) / kParts) / truth.height());
            sum += luminance(lookUp(light, environmentDirectionFromUv(uv)));
        }
    return sum / (kParts * kParts);
}

/// Median over the sphere of truth over light: their units differ.
double unitOf(const EnvironmentMap& light, const Image<Rgb>& truth)
{
    std::vector<double> ratios;
    for (int y = 0; y < truth.height(); ++y)
        for (int x = 0; x < truth.width(); ++x)
            ratios.push_back(luminance(truth(x, y)) / meanOver(light, truth, x, y));
    return quantile(ratios, 0.5);
}

/// Mean difference of light to the truth, relative, within 25 degrees of a direction.
double errorAround(const EnvironmentMap& light, const Image<Rgb>& truth, glm::dvec3 direction)
{
    const double unit = unitOf(light, truth);
    const double cosine = std::cos(glm::radians(25.0));
    double off = 0.0;
    double sum = 0.0;
    for (int y = 0; y < truth.height(); ++y)
        for (int x = 0; x < truth.width(); ++x) {
            const glm::dvec2 uv((x + 0.5) / truth.width(), (y + 0.5) / truth.height());
            if (glm::dot(environmentDirectionFromUv(uv), direction) < cosine) continue;
            const double weight = environmentTexelSolidAngle(truth.width(), truth.height(), y);
            const double real = luminance(truth(x, y));
            off += weight * std::abs(unit * meanOver(light, truth, x, y) - real);
            sum += weight * real;
        }
    return off / sum;
}

/// Squared error of linear light over squares of 8 pixels that the object covers or not at all.
double squaredError(const EncodedImage& picture,
                    const EncodedImage& truth,
                    const Image<float>& coverage,
                    bool on_object)
{
    constexpr int kSquare = 8;
    double sum = 0.0;
    for (int y = 0; y + kSquare <= truth.codes.height(); y += kSquare)
        for (int x = 0; x + kSquare <= truth.codes.width(); x += kSquare) {
            const float covered = coverage(x + kSquare / 2, y + kSquare / 2);
            if (on_object ? covered < 1.0f : covered > 0.0f) continue;
            double off = 0.0;
            for (int j = y; j < y + kSquare; ++j)
                for (int i = x; i < x + kSquare; ++i)
                    off += linearFromSrgb(picture.codes(i, j).g / 255.0) -
                           linearFromSrgb(truth.codes(i, j).g / 255.0);
            sum += off * off;
        }
    return sum;
}

/// The message that says how much of the sphere no view shows.
std::string blindShare(const Findings& findings)
{
    for (const Finding& finding : findings)
        if (finding.code == "probe-blind-spot") return finding.message;
    return "no finding";
}

TEST_F(TwoViewsOfTheBall, ShowWhatOneHidesAndInsert)
{
    const Project two = capture();
    ASSERT_THAT(two.light.probe->views, testing::SizeIs(2));
    EXPECT_TRUE(fs::exists(folder_ / "capture" / "ball2_1_32.jpg"));
    EXPECT_EQ(two.light.probe->views[1].view_position_m, glm::dvec3(-0.6, 0.7, -0.9));
    EXPECT_EQ(readJson(folder_ / "capture" / "truth" /
                       "truth.json")["ball"]["camera_positions_in_world_m"]
                  .size(),
              2u);

    InsertOptions options;
    options.render.max_samples = options.render.min_samples = 4;
    options.render.interreflection.samples_per_cell = 64;
    const InsertResult result = insertObjects(two, options, silent_);
    EXPECT_THAT(blindShare(result.findings), testing::StartsWith("0.00 %"));
    EXPECT_FALSE(hasFinding(result.findings, "probe-views-disagree"));

    // Behind the ball, seen from the first camera.
    ProjectProbe one = *two.light.probe;
    one.views.resize(1);
    const CapturedLight single = captureProbe(one, nullptr, {}, {});
    EXPECT_THAT(blindShare(single.findings), testing::Not(testing::StartsWith("0.00 %")));
    const Image<Rgb>& truth = simulated_.truth.panorama;
    const MirrorBall& ball = two.light.probe->views[0].ball;
    const glm::dvec3 behind =
        glm::normalize(ball.center_m - *two.light.probe->views[0].view_position_m);
    const double with_one = errorAround(single.environment, truth, behind);
    const double with_two = errorAround(result.light.environment, truth, behind);
    EXPECT_LT(with_two, 0.5 * with_one) << with_one << " with one view";

    // The picture is nearer to the true photograph than the empty room is; its shadow is weak here,
    // as the lamp is clipped in every exposure.
    const EncodedImage& made = result.composite.image;
    const EncodedImage& plate = result.photo.image;
    const EncodedImage& real = simulated_.with.image;
    for (const bool on_object : {true, false}) {
        const auto error = [&](const EncodedImage& picture) {
            return squaredError(picture, real, simulated_.truth.coverage, on_object);
        };
        EXPECT_LT(std::sqrt(error(made) / error(plate)), on_object ? 0.2 : 1.0) << on_object;
    }
}

}  // namespace
}  // namespace insitu
