#include "lighting/hidden_picture.h"

#include "core/parallel.h"
#include "tests/lighting/furniture_shapes.h"
#include "tests/lighting/light_samples.h"
#include "tests/support/errors.h"
#include "tests/support/tolerance.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>

namespace insitu {
namespace {

using ::testing::HasSubstr;

constexpr glm::vec3 kUp(0.0f, 1.0f, 0.0f);

class HiddenPicture : public ::testing::Test {
protected:
    TriangleMesh mesh_ = shapes::chair();
    VisibilityAtlas atlas_ = buildVisibilityAtlas(mesh_, {16, 64, 2}, silent);
    ObjectLight object_ = lit(mesh_, atlas_, lamps());

    /// The floor under the chair, seen from the side at 30 degrees.
    [[nodiscard]] std::vector<glm::vec3> floorSeen(int width, int height) const
    {
        const LocalFrame& local = atlas_.silhouettes.local;
        const double floor = (0.0 - local.center.y) / local.radius;
        std::vector<glm::vec3> places;
        for (int y = 0; y < height; ++y)
            for (int x = 0; x < width; ++x) {
                const double u = (x + 0.5) / width - 0.5;
                const double v = ((y + 0.5) / height - 0.5) * height / width;
                const double down = std::sin(0.52) + v * std::cos(0.52);
                const double ahead = std::cos(0.52) - v * std::sin(0.52);
                const double t = 2.5 / std::max(down, 0.05);
                places.emplace_back(u * t, floor, ahead * t - 4.2);
            }
        return places;
    }
    [[nodiscard]] std::vector<Rgb> exact(std::span<const glm::vec3> places) const
    {
        std::vector<Rgb> hidden(places.size());
        hiddenIrradiance(object_, places, kUp, hidden);
        return hidden;
    }
    [[nodiscard]] Rgb free() const
    {
        Rgb sum(0.0f);
        for (const auto* vectors :
             {&object_.light.along, &object_.light.against, &object_.light.fine})
            for (const IrradianceVector& v : *vectors)
                sum += glm::max(v.along(kUp), Rgb(0.0f));
        return sum;
    }
};

TEST_F(HiddenPicture, IsOffByNoMoreThanAskedAndSumsAPart)
{
    constexpr int kWidth = 203;
    constexpr int kHeight = 149;
    const std::vector<glm::vec3> places = floorSeen(kWidth, kHeight);
    const std::vector<Rgb> truth = exact(places);
    double last_share = 0.0;
    for (const double asked : {0.03, 0.01, 0.003}) {
        std::vector<Rgb> hidden(places.size(), Rgb(-1.0f));
        const double share = hiddenIrradianceOfPicture(
            object_, kWidth, kHeight, places, kUp, {.max_error = asked}, hidden);
        std::size_t beyond = 0;
        double square = 0.0;
        for (std::size_t i = 0; i < places.size(); ++i) {
            const Rgb off = glm::abs(hidden[i] - truth[i]) / free();
            const double most = static_cast<double>(std::max({off.r, off.g, off.b}));
            beyond += most > asked ? 1 : 0;
            square += most * most;
        }
        // Middles are tested, not every pixel: thin shadows slip through here and there.
        EXPECT_LT(static_cast<double>(beyond) / static_cast<double>(places.size()), 0.02) << asked;
        EXPECT_LT(std::sqrt(square / static_cast<double>(places.size())), 0.5 * asked) << asked;
        EXPECT_GT(share, last_share) << asked;
        EXPECT_LT(share, 0.6) << asked;
        last_share = share;
    }
}

TEST_F(HiddenPicture, IsExactWhereItSums)
{
    // Corners of the first squares, and of a picture of one of them only.
    for (const glm::ivec2 size : {glm::ivec2(1, 1), {1, 40}, {37, 1}, {2, 2}, {64, 33}}) {
        const std::vector<glm::vec3> places = floorSeen(size.x, size.y);
        const std::vector<Rgb> truth = exact(places);
        std::vector<Rgb> hidden(places.size(), Rgb(-1.0f));
        (void)hiddenIrradianceOfPicture(object_, size.x, size.y, places, kUp, {.step = 8}, hidden);
        for (int y = 0; y < size.y; y += 8)
            for (int x = 0; x < size.x; x += 8) {
                const auto i = static_cast<std::size_t>(y * size.x + x);
                // Which places are summed together may change the last bits.
                EXPECT_NEAR(hidden[i].g, truth[i].g, tolerance::kFloat * free().g)
                    << size.x << "x" << size.y << " at " << x << " " << y;
            }
        EXPECT_GE(std::ranges::min(hidden, {}, &Rgb::r).r, 0.0f) << "a pixel was left out";
    }
}

TEST_F(HiddenPicture, SameBytesForOneThreadAndMany)
{
    const std::vector<glm::vec3> places = floorSeen(120, 90);
    const auto picture = [&] {
        std::vector<Rgb> hidden(places.size());
        (void)hiddenIrradianceOfPicture(object_, 120, 90, places, kUp, {}, hidden);
        return hidden;
    };
    setThreadCount(1);
    const auto one = picture();
    setThreadCount(0);
    EXPECT_EQ(picture(), one);
}

TEST_F(HiddenPicture, RefusesBadOptions)
{
    const std::vector<glm::vec3> places(4, glm::vec3(0.0f, 2.0f, 0.0f));
    std::vector<Rgb> hidden(4);
    const auto error = [&](const HiddenPictureOptions& options) {
        return inputErrorOf(
            [&] { (void)hiddenIrradianceOfPicture(object_, 2, 2, places, kUp, options, hidden); });
    };
    EXPECT_THAT(error({.step = 3}), HasSubstr("step is 3"));
    EXPECT_THAT(error({.max_error = 0.0}), HasSubstr("max_error is 0"));
    EXPECT_THAT(error({.bias_texels = 5.0f}), HasSubstr("bias_texels is 5"));
    EXPECT_THROW((void)hiddenIrradianceOfPicture(object_, 3, 2, places, kUp, {}, hidden),
                 LogicError);
}

}  // namespace
}  // namespace insitu
