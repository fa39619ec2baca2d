#include "pipeline/surface_texture.h"

#include "core/io/image_io.h"
#include "pipeline/surface_builder.h"
#include "tests/support/data.h"
#include "tests/support/tolerance.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>

namespace insitu {
namespace {

/// Half a code of 8-bit sRGB, as linear light at 0.5: colours come back no nearer.
constexpr double kCode = 0.004;

TEST(CheckerTexture, FieldsHaveTheirColours)
{
    SimulatedSurface surface;
    surface.color_linear = {0.5f, 0.4f, 0.3f};
    surface.second_linear = {0.05f, 0.1f, 0.2f};
    const Texture texture = checkerTexture(surface);
    for (int c = 0; c < 3; ++c) {
        EXPECT_NEAR(texture.sample({0.25f, 0.25f})[c], surface.color_linear[c], kCode);
        EXPECT_NEAR(texture.sample({0.75f, 0.75f})[c], surface.color_linear[c], kCode);
        EXPECT_NEAR(texture.sample({0.75f, 0.25f})[c], surface.second_linear[c], kCode);
    }
}

TEST(BoardsTexture, IsWoodOnAverageWithDarkJointsBetween)
{
    SimulatedSurface surface;
    surface.color_linear = {0.4f, 0.25f, 0.12f};
    surface.board_width_m = 0.2;
    surface.board_length_m = 1.0;
    const Texture texture = boardsTexture(surface, 1.0, 1.2, 5);
    EXPECT_EQ(texture.texels.width(), 420);
    EXPECT_EQ(texture.texels.height(), 504);
    double middle = 0.0;
    double joint = 0.0;
    for (int y = 0; y < 504; ++y) {
        middle +=
            static_cast<double>(texture.sample({0.5f, (static_cast<float>(y) + 0.5f) / 504.0f}).r) /
            504.0;
        joint +=
            static_cast<double>(texture.sample({0.4f, (static_cast<float>(y) + 0.5f) / 504.0f}).r) /
            504.0;
    }
    EXPECT_NEAR(middle, 0.4, 0.1);  // two boards: their own brightness varies
    EXPECT_LT(joint, 0.6 * middle);

    const Texture again = boardsTexture(surface, 1.0, 1.2, 5);
    EXPECT_EQ(texture.texels, again.texels);
    surface.boards_along_x = true;
    const Texture turned = boardsTexture(surface, 1.2, 1.0, 5);
    EXPECT_EQ(turned.texels(100, 50), texture.texels(50, 100));
}

// A picture stands upright and unmirrored on a wall that is looked at along -z.
TEST(PictureTexture, StandsUpright)
{
    const std::filesystem::path folder =
        std::filesystem::path(INSITU_BINARY_DIR) / "test-artifacts" / "picture-texture";
    std::filesystem::create_directories(folder);
    EncodedImage image;
    image.codes = Image<glm::u16vec3>(2, 2);
    image.codes(0, 0) = {255, 0, 0};  // top left red
    image.codes(1, 1) = {0, 0, 255};  // bottom right blue
    writeEncoded(folder / "corners.png", image);
    SimulatedSurface surface;
    surface.kind = SimulatedSurface::Kind::Picture;
    surface.color_linear = glm::vec3(1.0f);
    surface.picture = folder / "corners.png";
    SurfaceBuilder builder(1);
    builder.addRectangle(surface, {0, 0, 0}, {1, 0, 0}, {0, 1, 0});
    const Model model = builder.take();
    ASSERT_EQ(model.textures.size(), 1u);
    for (std::size_t i = 0; i < model.mesh.positions.size(); ++i) {
        // 0.01 m inside the corner: the repeated neighbour does not shine in.
        const glm::vec3 p = model.mesh.positions[i];
        const glm::vec2 uv = model.mesh.texcoords[i];
        EXPECT_EQ(uv, glm::vec2(p.x, 1.0f - p.y));
    }
    EXPECT_NEAR(model.textures[0].sample({0.25f, 0.25f}).r, 1.0, tolerance::kFloat);
    EXPECT_NEAR(model.textures[0].sample({0.75f, 0.75f}).b, 1.0, tolerance::kFloat);
    std::filesystem::remove_all(folder);
}

// A hole leaves the rest of the wall: areas add up.
TEST(SurfaceBuilder, WallWithHoles)
{
    SurfaceBuilder builder(1);
    const std::pair<glm::dvec2, glm::dvec2> holes[] = {{{1, 1}, {2, 2}}, {{2.5, 0.5}, {3, 1.5}}};
    builder.addRectangle({}, {0, 0, 0}, {4, 0, 0}, {0, 3, 0}, holes);
    const Model model = builder.take();
    double area = 0.0;
    for (const glm::uvec3 t : model.mesh.triangles) {
        const auto& p = model.mesh.positions;
        area +=
            0.5 * static_cast<double>(glm::length(glm::cross(p[t.y] - p[t.x], p[t.z] - p[t.x])));
    }
    EXPECT_NEAR(area, 12.0 - 1.0 - 0.5, 12.0 * tolerance::kFloat);
}

}  // namespace
}  // namespace insitu
