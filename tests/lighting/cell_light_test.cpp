#include "lighting/cell_light.h"

#include "tests/lighting/furniture_shapes.h"
#include "tests/lighting/light_samples.h"
#include "tests/support/errors.h"
#include "tests/support/tolerance.h"

#include <gmock/gmock.h>

#include <limits>
#include <numbers>

namespace insitu {
namespace {

using std::numbers::pi;
using testing::HasSubstr;

TEST(CellLight, VectorOfAHemisphereIsPi)
{
    EnvironmentMap sky = constant(0.0f);
    for (int y = 0; y < 16; ++y)
        for (int x = 0; x < 64; ++x)
            sky.pixels(x, y) = Rgb(1.0f, 2.0f, 0.5f);
    for (const int most : {0, 48}) {
        const IrradianceVector total =
            splitLight(sky, glm::dmat3(1.0), {32}, {.max_fine_directions = most}).total();
        // ∫ ω dω over the upper hemisphere: (0, π, 0), by the midpoint rule in elevation.
        EXPECT_NEAR(total.channels[0].y / pi, 1.0, 3e-4);
        EXPECT_NEAR(total.channels[1].y / pi, 2.0, 6e-4);
        EXPECT_NEAR(total.channels[2].y / pi, 0.5, 2e-4);
        EXPECT_NEAR(total.channels[0].x, 0.0, tolerance::kFloat);
        EXPECT_NEAR(total.channels[0].z, 0.0, tolerance::kFloat);
    }
    EXPECT_LT(sizeOf(splitLight(constant(1.0f), glm::dmat3(1.0), {32}).total()), 1e-4);
}

TEST(CellLight, ASunGetsDirectionsOfItsOwn)
{
    EnvironmentMap map = constant(0.1f);
    map.pixels(20, 5) = map.pixels(21, 5) = Rgb(5000.0f);
    const CellLight light = splitLight(map, glm::dmat3(1.0), {32});
    const CellLight blunt = splitLight(map, glm::dmat3(1.0), {32}, {.max_fine_directions = 0});
    ASSERT_GE(light.fine.size(), 8u);
    EXPECT_TRUE(blunt.fine.empty());
    IrradianceVector sun;
    for (std::size_t i = 0; i < light.fine.size(); ++i) {
        sun += light.fine[i];
        const glm::dvec2 uv = environmentUvFromDirection(light.fine_directions[i]);
        EXPECT_NEAR(uv.x * 64.0, 21.0, 1.0 + 1e-6);
        EXPECT_NEAR(uv.y * 32.0, 5.5, 0.5 + 1e-6);
    }
    const double solid_angle = environmentTexelSolidAngle(64, 32, 5);
    // Both texels; their light's vector is a little shorter than its sum.
    EXPECT_NEAR(glm::length(sun.channels[0]) / (2.0 * 5000.0 * solid_angle), 1.0, 0.002);
    EXPECT_LT(distance(light.total(), blunt.total()), 1e-3 * sizeOf(light.total()));
    EXPECT_LT(light.spread_rad, 0.6 * blunt.spread_rad);
}

TEST(CellLight, BlackAndEmptyMapsGiveNothing)
{
    for (const EnvironmentMap& map : {constant(0.0f), EnvironmentMap{}}) {
        const CellLight light = splitLight(map, glm::dmat3(1.0), {8});
        EXPECT_EQ(sizeOf(light.total()), 0.0);
        EXPECT_TRUE(light.fine.empty());
        EXPECT_EQ(light.spread_rad, 0.0);
        const TriangleMesh mesh = shapes::chair();
        const VisibilityAtlas atlas = buildVisibilityAtlas(mesh, {8, 32, 1}, silent);
        const ObjectLight object = lit(mesh, atlas, map);
        for (const IrradianceVector& v : hiddenAt(object, placesAround(1.2, 40)))
            EXPECT_EQ(sizeOf(v), 0.0);
    }
}

TEST(CellLight, RefusesWhatIsNoLight)
{
    const auto errorOf = [](float value) {
        EnvironmentMap map = constant(1.0f);
        map.pixels(3, 7).g = value;
        return inputErrorOf([&] { (void)splitLight(map, glm::dmat3(1.0), {8}); });
    };
    EXPECT_THAT(errorOf(std::numeric_limits<float>::quiet_NaN()), HasSubstr("(3, 7)"));
    EXPECT_THAT(errorOf(std::numeric_limits<float>::infinity()), HasSubstr("(3, 7)"));
    EXPECT_THAT(errorOf(-1.0f), HasSubstr("(3, 7)"));
    EXPECT_THAT(inputErrorOf([] {
                    (void)splitLight(constant(1.0f), glm::dmat3(1.0), {8}, {-1, -1.0});
                }),
                testing::AllOf(HasSubstr("max_fine_directions"), HasSubstr("spread_tolerance")));
    const TriangleMesh mesh = shapes::chair();
    const VisibilityAtlas atlas = buildVisibilityAtlas(mesh, {4, 32, 1}, silent);
    const CellLight light = splitLight(lamps(), glm::dmat3(1.0), {4});
    EXPECT_THAT(inputErrorOf([&] {
                    (void)lightObject(mesh, atlas, light, {8, 9}, silent);
                }),
                testing::AllOf(HasSubstr("resolution is 8"), HasSubstr("samples is 9")));
    const CellLight other = splitLight(lamps(), glm::dmat3(1.0), {8});
    EXPECT_THROW((void)lightObject(mesh, atlas, other, {}, silent), LogicError);
}

}  // namespace
}  // namespace insitu
