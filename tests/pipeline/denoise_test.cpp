#include "pipeline/denoise.h"

#include "core/color.h"
#include "core/random.h"
#include "pipeline/surface_builder.h"
#include "tests/support/tolerance.h"

#include <gtest/gtest.h>

#include <cmath>

namespace insitu {
namespace {

constexpr int kSize = 48;

/// A checkered floor seen from above at an angle.
ObjectScene checkeredFloor()
{
    SurfaceBuilder builder(1);
    SimulatedSurface surface;
    surface.kind = SimulatedSurface::Kind::Checker;
    surface.color_linear = glm::vec3(0.7f);
    surface.second_linear = glm::vec3(0.2f);
    surface.size_m = 0.4;
    builder.addRectangle(surface, {-5, 0, -5}, {10, 0, 0}, {0, 0, 10});
    std::vector<ObjectScene::Object> objects;
    objects.push_back({builder.take()});
    return ObjectScene(std::move(objects));
}

Camera camera()
{
    return Camera::lookAt({0, 2, 3}, {0, 0, 0}, 60.0, kSize, kSize);
}

/// Noise-free radiance of the floor in light of 1 left of x = 0 and 3 right of it.
Image<Rgb> cleanPicture(const ObjectScene& scene)
{
    Image<Rgb> picture(kSize, kSize);
    for (int y = 0; y < kSize; ++y)
        for (int x = 0; x < kSize; ++x) {
            Rgb sum(0.0f);
            for (int i = 0; i < 16; ++i) {
                const glm::dvec2 pixel{x + (i % 4 + 0.5) / 4, y + (i / 4 + 0.5) / 4};
                const auto hit = scene.intersect(camera().position_m, camera().rayDirection(pixel));
                if (hit) sum += hit->material.base_color * (hit->position.x < 0.0 ? 1.0f : 3.0f);
            }
            picture(x, y) = sum / 16.0f;
        }
    return picture;
}

double rmsDifference(const Image<Rgb>& a, const Image<Rgb>& b)
{
    double sum = 0.0;
    for (std::size_t i = 0; i < a.pixelCount(); ++i) {
        const double d = static_cast<double>(luminance(a.pixels()[i]) - luminance(b.pixels()[i]));
        sum += d * d;
    }
    return std::sqrt(sum / static_cast<double>(a.pixelCount()));
}

RenderedImage withNoise(const Image<Rgb>& clean, float relative)
{
    RenderedImage noisy{clean, Image<float>(kSize, kSize), 16};
    for (int y = 0; y < kSize; ++y)
        for (int x = 0; x < kSize; ++x) {
            RandomStream random(3, static_cast<std::uint64_t>(y * kSize + x), 0);
            const float sigma = relative * clean(x, y).g;
            noisy.radiance(x, y) += Rgb(sigma * static_cast<float>(random.normal()));
            noisy.variance(x, y) = sigma * sigma;
        }
    return noisy;
}

// Textures and an edge of light stay, three quarters of the noise go.
TEST(Denoise, RemovesNoiseAndKeepsTexture)
{
    const ObjectScene scene = checkeredFloor();
    const Image<Rgb> clean = cleanPicture(scene);
    const RenderedImage noisy = withNoise(clean, 0.15f);
    const Image<Rgb> result = denoised(noisy, scene, camera());
    EXPECT_LT(rmsDifference(result, clean), 0.25 * rmsDifference(noisy.radiance, clean));
}

TEST(Denoise, PictureWithoutVarianceStays)
{
    const ObjectScene scene = checkeredFloor();
    RenderedImage exact = withNoise(cleanPicture(scene), 0.15f);
    exact.variance = Image<float>(kSize, kSize);
    const Image<Rgb> result = denoised(exact, scene, camera());
    EXPECT_LT(rmsDifference(result, exact.radiance), tolerance::kFloat);
}

}  // namespace
}  // namespace insitu
