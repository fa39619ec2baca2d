#include "core/check.h"
#include "core/parallel.h"
#include "core/random.h"
#include "tests/capture/expect_outline.h"
#include "tests/capture/synthetic_ball.h"

#include <gmock/gmock.h>

#include <cmath>
#include <limits>
#include <numbers>

namespace insitu {
namespace {

using std::numbers::pi;

/// The aim of the stage. Pixels.
constexpr double kOutlineAim = 0.3;

/// A chromed ball: darker than what it mirrors, as real ones are.
struct Scene {
    MirrorBall ball;
    Camera camera;
    Image<Rgb> picture;
};

Scene photograph(glm::dvec2 center, double radius, glm::ivec2 size)
{
    Scene scene;
    scene.ball.center_m = {0.1, 0.9, -0.2};
    scene.ball.radius_m = 0.06;
    scene.ball.reflectance = 0.6;
    scene.ball.center_px = center;
    scene.ball.radius_px = radius;
    scene.camera = ballCamera(scene.ball, {-0.3, 1.2, 0.5}, size.x, size.y);
    scene.picture = renderBall(
        scene.ball, scene.camera, roomRadiance, {0, 0}, size, Rgb(0.0f), roomRadiance, 4);
    return scene;
}

void addNoise(Image<Rgb>& image, double share)
{
    for (std::size_t i = 0; i < image.pixelCount(); ++i) {
        RandomStream random(11, i, 0);
        for (int c = 0; c < 3; ++c) {
            float& value = image.pixels()[i][c];
            value = std::max(value * (1.0f + static_cast<float>(share * random.normal())), 0.0f);
        }
    }
}

struct Place {
    glm::dvec2 center;
    double radius;
    glm::ivec2 size;
};

class FindBallOutline : public testing::TestWithParam<Place> {};

TEST_P(FindBallOutline, ToAThirdOfAPixel)
{
    const Place place = GetParam();
    Scene scene = photograph(place.center, place.radius, place.size);
    addNoise(scene.picture, 0.02);
    const BallOutlineResult result = findBallOutline(scene.picture);
    expectOutline(result, scene.ball, kOutlineAim);
    EXPECT_TRUE(result.findings.empty());
    EXPECT_GT(result.outline->inlier_share, 0.35);
    EXPECT_EQ(result.outline->axis_ratio, 1.0);
    EXPECT_GT(result.outline->radius_sigma, 0.0);
    EXPECT_LT(result.outline->radius_sigma, kOutlineAim);
}

INSTANTIATE_TEST_SUITE_P(Places,
                         FindBallOutline,
                         testing::Values(Place{{150.3, 139.6}, 50.0, {300, 280}},
                                         Place{{420.7, 200.2}, 72.0, {600, 400}},
                                         Place{{160.2, 160.9}, 120.5, {320, 320}},
                                         // twice reduced for the search
                                         Place{{500.4, 380.6}, 250.0, {1000, 800}}));

TEST(FindBallOutlineHard, FillsThePictureNearly)
{
    const Scene scene = photograph({150.2, 149.7}, 147.0, {300, 300});
    expectOutline(findBallOutline(scene.picture), scene.ball, 0.5);  // 3 pixels of background
}

TEST(FindBallOutlineHard, CutByTheFrame)
{
    const Scene scene = photograph({70.4, 160.2}, 100.0, {300, 300});
    const BallOutlineResult result = findBallOutline(scene.picture);
    expectOutline(result, scene.ball, 1.0);  // a quarter is missing: all on one side
    EXPECT_LT(result.outline->visible_share, 0.8);
    EXPECT_GT(result.outline->visible_share, 0.65);
}

TEST(FindBallOutlineHard, StandHandAndLamps)
{
    Scene scene = photograph({200.3, 180.8}, 110.0, {420, 400});
    for (int y = 0; y < 400; ++y) {
        for (int x = 0; x < 420; ++x) {
            const glm::dvec2 p =
                (glm::dvec2(x + 0.5, y + 0.5) - scene.ball.center_px) / scene.ball.radius_px;
            if (std::abs(p.x) < 0.3 && p.y > 0.93) scene.picture(x, y) = Rgb(0.02f);
            if (std::abs(p.x + 1.0) < 0.12 && std::abs(p.y - 0.4) < 0.3)
                scene.picture(x, y) = Rgb(0.5f, 0.35f, 0.3f);
            if (glm::length(p - glm::dvec2(0.2, -0.3)) < 0.2) scene.picture(x, y) = Rgb(500.0f);
        }
    }
    addNoise(scene.picture, 0.02);
    expectOutline(findBallOutline(scene.picture), scene.ball, kOutlineAim);
}

TEST(FindBallOutlineHard, BlackBlueChannel)
{
    Scene scene = photograph({160.2, 160.9}, 120.5, {320, 320});
    for (Rgb& pixel : scene.picture.pixels())
        pixel.b = 0.0f;
    expectOutline(findBallOutline(scene.picture), scene.ball, kOutlineAim);
}

TEST(FindBallOutlineHard, DarkBallOnDarkGroundIsNotFound)
{
    Image<Rgb> picture(300, 280, Rgb(1.0f));
    addNoise(picture, 0.1);
    const BallOutlineResult result = findBallOutline(picture);
    EXPECT_FALSE(result.outline);
    EXPECT_TRUE(hasFinding(result.findings, "ball-not-found"));
    EXPECT_TRUE(hasFinding(findBallOutline(Image<Rgb>(300, 280)).findings, "ball-not-found"));
}

TEST(FindBallOutlineHard, RefusesWhatIsNotFinite)
{
    Image<Rgb> picture(64, 48, Rgb(1.0f));
    picture(3, 4).g = std::numeric_limits<float>::quiet_NaN();
    EXPECT_THROW((void)findBallOutline(picture), InputError);
    EXPECT_THROW((void)findBallOutline(Image<Rgb>()), InputError);
    EXPECT_THROW((void)findBallOutline(Bracket{}), InputError);
}

// A wide-angle photograph with the ball near its corner.
TEST(FindBallOutlineHard, EllipseOffTheAxis)
{
    MirrorBall ball;
    ball.radius_m = 0.2;
    ball.center_m = {0.75, 0.6, -0.2};
    ball.reflectance = 0.6;
    const Camera camera = Camera::lookAt({-0.4, 1.2, 1.2}, {0.15, 0.9, -0.4}, 500.0, 800, 600);
    const Silhouette truth = silhouetteOf(ball, camera);
    ASSERT_LT(truth.shorter / truth.longer, 0.96);
    ASSERT_GT(truth.shorter / truth.longer, 0.92);
    const Image<Rgb> picture =
        renderBall(ball, camera, roomRadiance, {0, 0}, {0, 0}, Rgb(0.0f), roomRadiance, 4);
    const BallOutline exact = predictBallOutline(ball.center_m, ball.radius_m, camera);
    EXPECT_LT(glm::length(exact.center_px - truth.center),
              1e-3);  // both are polygons of the outline
    EXPECT_NEAR(exact.axis_ratio, truth.shorter / truth.longer, 1e-4);
    EXPECT_NEAR(std::cos(2.0 * (exact.axis_angle - truth.angle)), 1.0, 1e-3);

    BallOutlineOptions options;
    options.ellipse = true;
    options.start =
        predictBallOutline(ball.center_m + glm::dvec3(0.01, -0.01, 0.02), ball.radius_m, camera);
    ASSERT_GT(glm::length(options.start->center_px - truth.center), 3.0);
    const BallOutlineResult result = findBallOutline(picture, options);
    ASSERT_TRUE(result.outline);
    EXPECT_LT(glm::length(result.outline->center_px - truth.center), 1.0);
    EXPECT_NEAR(result.outline->radius_px, 0.5 * (truth.longer + truth.shorter), 1.0);
    EXPECT_NEAR(result.outline->axis_ratio, truth.shorter / truth.longer, 0.01);
    EXPECT_NEAR(std::cos(2.0 * (result.outline->axis_angle - truth.angle)), 1.0, 0.05);
}

TEST(PredictBallOutline, RefusesABallThatIsNotInFront)
{
    const Camera camera = Camera::lookAt({0.0, 1.0, 1.0}, {0.0, 1.0, 0.0}, 500.0, 800, 600);
    EXPECT_THROW((void)predictBallOutline({0.0, 1.0, 2.0}, 0.1, camera), InputError);
    EXPECT_THROW((void)predictBallOutline({0.0, 1.0, 0.95}, 0.1, camera), InputError);
    EXPECT_THROW((void)predictBallOutline({0.0, 1.0, 0.0}, -0.1, camera), InputError);
}

// Codes of a camera that clips: the rim must come from the frames that show it.
TEST(FindBallOutline, InABracket)
{
    const Scene scene = photograph({160.2, 150.9}, 90.5, {320, 300});
    std::vector<BracketFrame> frames;
    for (const double exposure : {2.0, 0.5, 0.1}) {
        BracketFrame frame;
        frame.relative_exposure = exposure;
        frame.image.codes = Image<glm::u16vec3>(320, 300);
        for (std::size_t i = 0; i < scene.picture.pixelCount(); ++i)
            frame.image.codes.pixels()[i] = glm::u16vec3(glm::round(
                255.0f *
                glm::pow(glm::clamp(
                             static_cast<float>(exposure) * scene.picture.pixels()[i], 0.0f, 1.0f),
                         Rgb(0.45f))));
        frames.push_back(std::move(frame));
    }
    expectOutline(findBallOutline(makeBracket(std::move(frames))), scene.ball, kOutlineAim);
}

TEST(FindBallOutline, FromAStartOrAsGiven)
{
    const Scene scene = photograph({160.2, 150.9}, 90.5, {320, 300});
    BallOutlineOptions options;
    options.start = BallOutline{};
    options.start->center_px = {165.0, 147.0};
    options.start->radius_px = 94.0;
    expectOutline(findBallOutline(scene.picture, options), scene.ball, kOutlineAim);

    options.refine = false;
    const BallOutlineResult wrong = findBallOutline(scene.picture, options);
    ASSERT_TRUE(wrong.outline);
    EXPECT_EQ(wrong.outline->radius_px, 94.0);
    EXPECT_TRUE(hasFinding(wrong.findings, "ball-outline-weak"));
    options.start->center_px = scene.ball.center_px;
    options.start->radius_px = scene.ball.radius_px;
    const BallOutlineResult right = findBallOutline(scene.picture, options);
    EXPECT_GT(right.outline->inlier_share, 0.35);
    EXPECT_TRUE(right.findings.empty());
}

TEST(FindBallOutline, DoesNotDependOnTheNumberOfThreads)
{
    const Scene scene = photograph({150.3, 139.6}, 60.0, {300, 280});
    setThreadCount(1);
    const BallOutlineResult one = findBallOutline(scene.picture);
    setThreadCount(4);
    const BallOutlineResult four = findBallOutline(scene.picture);
    setThreadCount(0);
    ASSERT_TRUE(one.outline && four.outline);
    EXPECT_EQ(one.outline->center_px, four.outline->center_px);
    EXPECT_EQ(one.outline->radius_px, four.outline->radius_px);
    EXPECT_EQ(one.outline->center_sigma, four.outline->center_sigma);
}

TEST(FindBallOutline, RefusesUnusableOptions)
{
    const auto refuses = [](auto change) {
        BallOutlineOptions options;
        change(options);
        EXPECT_TRUE(hasFinding(options.validate(), "ball-options"));
        EXPECT_THROW((void)findBallOutline(Image<Rgb>(64, 48, Rgb(1.0f)), options), InputError);
    };
    refuses([](BallOutlineOptions& options) { options.refine = false; });
    refuses([](BallOutlineOptions& options) { options.smallest_radius = 0.0; });
    refuses([](BallOutlineOptions& options) { options.start = BallOutline{}; });
    refuses([](BallOutlineOptions& options) {
        options.start = BallOutline{};
        options.start->radius_px = 50.0;
        options.start->axis_ratio = 0.5;
    });
    refuses([](BallOutlineOptions& options) {
        options.start = BallOutline{};
        options.start->radius_px = 50.0;
        options.start->center_px.x = std::numeric_limits<double>::infinity();
    });
    EXPECT_TRUE(BallOutlineOptions{}.validate().empty());
}

}  // namespace
}  // namespace insitu
