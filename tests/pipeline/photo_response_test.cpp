#include "pipeline/photo_response.h"

#include "core/random.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>

namespace insitu {
namespace {

const glm::dvec3 kCenter(0.3, 1.0, -0.4);

/// A room whose surfaces shine over five stops, whoever looks at them.
struct Scene {
    Scene()
    {
        room.boxes.push_back({{-2, 0, -3}, {2, 2.5, 2}, false, ""});
        proxy = SceneProxy(room);
        probe.pixels = Image<Rgb>(512, 256);
        for (int y = 0; y < 256; ++y)
            for (int x = 0; x < 512; ++x)
                probe.pixels(x, y) = radianceAt(
                    proxy
                        .intersect(
                            kCenter,
                            environmentDirectionFromUv({(x + 0.5) / 512.0, (y + 0.5) / 256.0}))
                        ->point);
    }
    [[nodiscard]] static Rgb radianceAt(glm::dvec3 p)
    {
        const double level =
            0.2 * std::exp2(1.2 * std::sin(1.7 * p.x + 2.1 * p.z) + 0.8 * p.y - 1.0);
        return {level, 0.8 * level, level * (0.7 + 0.1 * p.x)};
    }
    /// The photograph by a response, with 3 % of noise; `wrong` times as bright where the proxy is
    /// wrong: beyond x = 1.
    [[nodiscard]] EncodedImage photo(const std::function<double(double)>& response,
                                     double wrong = 1.0) const
    {
        EncodedImage image{Image<glm::u16vec3>(view.width, view.height), 255};
        for (int y = 0; y < view.height; ++y)
            for (int x = 0; x < view.width; ++x) {
                RandomStream random(
                    3, static_cast<std::uint64_t>(y), static_cast<std::uint64_t>(x));
                const glm::dvec3 p =
                    proxy.intersect(view.position_m, view.rayDirection({x + 0.5, y + 0.5}))->point;
                const double gain = (1.0 + 0.03 * random.normal()) * (p.x > 1.0 ? wrong : 1.0);
                for (int c = 0; c < 3; ++c)
                    image.codes(x, y)[c] = static_cast<std::uint16_t>(std::lround(
                        255.0 * response(std::clamp(gain * radianceAt(p)[c], 0.0, 1.0))));
            }
        return image;
    }
    [[nodiscard]] PhotoResponseEstimate estimate(const EncodedImage& image) const
    {
        return estimatePhotoResponse(
            image, middleGrey(ResponseCurve::srgb()), commonPixels(view, proxy, probe, kCenter));
    }
    [[nodiscard]] static ResponseCurve middleGrey(ResponseCurve curve)
    {
        for (auto& table : curve.exposure) {
            const double middle = table[128];
            for (double& value : table)
                value /= middle;
        }
        return curve;
    }

    RoomDescription room;
    SceneProxy proxy{RoomDescription{}};
    EnvironmentMap probe;
    Camera view = Camera::lookAt({1.5, 1.4, 1.6}, {-0.5, 0.8, -2.0}, 200.0, 320, 240);
};

/// Largest error over codes 50 to 235, which the scene has, stops, of exposures relative to code
/// 128.
double worstStops(const ResponseCurve& curve, const std::function<double(double code)>& exposure)
{
    double worst = 0.0;
    for (int code = 50; code <= 235; ++code)
        worst = std::max(
            worst, std::abs(std::log2(curve.decode(1, code) / (exposure(code) / exposure(128.0)))));
    return worst;
}

TEST(PhotoResponse, PowersAreFoundAndSrgbIsLeftAlone)
{
    const Scene scene;
    for (const double gamma : {1.5, 1.8, 2.8}) {
        const PhotoResponseEstimate estimate = scene.estimate(
            scene.photo([&](double exposure) { return std::pow(exposure, 1.0 / gamma); }));
        EXPECT_TRUE(estimate.differs) << gamma;
        const auto truth = [&](double code) { return std::pow(code / 255.0, gamma); };
        // sRGB to a power has no toe like that of a pure power far from it.
        EXPECT_LT(worstStops(estimate.curve, truth), gamma < 2.0 ? 0.12 : 0.25) << gamma;
        EXPECT_GT(worstStops(Scene::middleGrey(ResponseCurve::srgb()), truth), 0.3) << gamma;
        EXPECT_LT(estimate.spread, 0.03);
    }
    const PhotoResponseEstimate same = scene.estimate(scene.photo(
        [](double exposure) { return ResponseCurve::srgb().encode(1, exposure) / 255.0; }));
    EXPECT_FALSE(same.differs);
    EXPECT_NEAR(same.power, 1.0, 0.03);
    EXPECT_EQ(same.curve.exposure, Scene::middleGrey(ResponseCurve::srgb()).exposure);
}

TEST(PhotoResponse, ASteepShoulderIsABend)
{
    const Scene scene;
    const auto response = [](double exposure) {
        const double y = std::pow(exposure, 1.0 / 2.2);
        return y * y * (3.0 - 2.0 * y);
    };
    const PhotoResponseEstimate estimate = scene.estimate(scene.photo(response));
    EXPECT_TRUE(estimate.differs);
    // The inverse, by bisection.
    const auto truth = [&](double code) {
        double low = 0.0;
        double high = 1.0;
        for (int i = 0; i < 60; ++i)
            (response(0.5 * (low + high)) < code / 255.0 ? low : high) = 0.5 * (low + high);
        return low;
    };
    const double srgb = worstStops(Scene::middleGrey(ResponseCurve::srgb()), truth);
    EXPECT_LT(worstStops(estimate.curve, truth), 0.5 * srgb);
}

TEST(PhotoResponse, AWrongRoomOrTooLittleToSeeChangesNothing)
{
    Scene scene;
    const auto srgb = [](double exposure) {
        return ResponseCurve::srgb().encode(1, exposure) / 255.0;
    };
    // A quarter of the picture, twice as bright as the probe says: the faces disagree.
    EXPECT_FALSE(scene.estimate(scene.photo(srgb, 2.0)).differs);
    EXPECT_FALSE(estimatePhotoResponse(scene.photo(srgb), ResponseCurve::srgb(), {}).differs);
    for (Rgb& pixel : scene.probe.pixels.pixels())
        pixel = Rgb(0.0f);
    EXPECT_EQ(scene.estimate(scene.photo(srgb)).pixels, 0u);
}

}  // namespace
}  // namespace insitu
