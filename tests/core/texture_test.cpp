#include "core/color.h"
#include "core/mesh.h"
#include "tests/support/tolerance.h"

#include <gmock/gmock.h>

#include <cmath>
#include <limits>

namespace insitu {
namespace {

void expectNear(glm::vec4 actual, glm::dvec4 expected)
{
    for (int i = 0; i < 4; ++i)
        EXPECT_NEAR(actual[i], expected[i], tolerance::kFloat) << "component " << i;
}

// Two columns, one row: black transparent, white opaque; data, not colour.
Texture blackWhite()
{
    Texture texture;
    texture.texels = Image<glm::u8vec4>(2, 1);
    texture.texels(0, 0) = {0, 0, 0, 0};
    texture.texels(1, 0) = {255, 255, 255, 255};
    texture.srgb = false;
    return texture;
}

TEST(Texture, TexelCentresAreExact)
{
    Texture texture;
    texture.texels = Image<glm::u8vec4>(4, 2);
    for (int y = 0; y < 2; ++y)
        for (int x = 0; x < 4; ++x)
            texture.texels(x, y) = glm::u8vec4(60 * x, 100 * y, 7, 255);
    texture.srgb = false;
    // (0, 0) is the top left corner, so row 1 is at the larger v.
    for (int y = 0; y < 2; ++y)
        for (int x = 0; x < 4; ++x)
            expectNear(texture.sample({(x + 0.5) / 4, (y + 0.5) / 2}),
                       {60 * x / 255.0, 100 * y / 255.0, 7 / 255.0, 1.0});
}

TEST(Texture, DecodesBeforeItFilters)
{
    Texture texture = blackWhite();
    texture.srgb = true;
    texture.texels(0, 0) = {188, 0, 0, 0};
    const double left = linearFromSrgb(188 / 255.0);
    // Half way between the texels; the mean of the codes would decode to something else. Alpha is
    // never encoded.
    expectNear(texture.sample({0.5, 0.5}), {(left + 1) / 2, 0.5, 0.5, 0.5});
    // IEC 61966-2-1: code 188 is about half of full intensity.
    EXPECT_NEAR(texture.sample({0.25, 0.5}).r, 0.50289, 1e-5);
}

TEST(Texture, WrapsOrClamps)
{
    Texture texture = blackWhite();
    // At u = 0 a repeating texture lies between its last and its first texel.
    EXPECT_NEAR(texture.sample({0.0, 0.5}).r, 0.5, tolerance::kFloat);
    EXPECT_NEAR(texture.sample({1.0, 0.5}).r, 0.5, tolerance::kFloat);
    EXPECT_NEAR(texture.sample({-0.25, 7.3}).r, 1.0, tolerance::kFloat);
    EXPECT_NEAR(texture.sample({3.25, -9.0}).r, 0.0, tolerance::kFloat);
    texture.clamp_s = true;
    EXPECT_NEAR(texture.sample({0.0, 0.5}).r, 0.0, tolerance::kFloat);
    EXPECT_NEAR(texture.sample({-5.0, 0.5}).r, 0.0, tolerance::kFloat);
    EXPECT_NEAR(texture.sample({42.0, 0.5}).r, 1.0, tolerance::kFloat);
}

TEST(Texture, RepeatsWithPeriodOne)
{
    Texture texture;
    texture.texels = Image<glm::u8vec4>(4, 3);
    for (int y = 0; y < 3; ++y)
        for (int x = 0; x < 4; ++x)
            texture.texels(x, y) = glm::u8vec4(60 * x, 80 * y, 20 * x * y, 255);
    for (const float u : {0.0f, 0.125f, 0.4375f, 0.96875f})
        for (int shift = -9; shift <= 9; ++shift)
            expectNear(
                texture.sample({u + static_cast<float>(shift), u - static_cast<float>(shift)}),
                texture.sample({u, u}));
}

TEST(Texture, ClampsVerticallyOnItsOwn)
{
    Texture texture;
    texture.texels = Image<glm::u8vec4>(1, 2);
    texture.texels(0, 1) = glm::u8vec4(255);
    texture.srgb = false;
    texture.clamp_t = true;
    EXPECT_NEAR(texture.sample({0.0, -1.0}).r, 0.0, tolerance::kFloat);
    EXPECT_NEAR(texture.sample({0.0, 2.0}).r, 1.0, tolerance::kFloat);
}

TEST(Texture, SurvivesAnyCoordinate)
{
    Texture texture = blackWhite();
    const float inf = std::numeric_limits<float>::infinity();
    const float nan = std::numeric_limits<float>::quiet_NaN();
    for (const bool clamp : {false, true}) {
        texture.clamp_s = texture.clamp_t = clamp;
        for (const float u : {inf, -inf, nan, 1e30f, -1e30f, 1e-30f, -1e-30f, 0.99999997f})
            for (const float v : {u, 0.5f}) {
                const glm::vec4 value = texture.sample({u, v});
                EXPECT_TRUE(value.r >= 0.0f && value.r <= 1.0f) << u << " " << v;
            }
    }
}

}  // namespace
}  // namespace insitu
