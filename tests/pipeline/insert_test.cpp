#include "pipeline/insert.h"

#include "core/color.h"
#include "core/io/image_io.h"
#include "core/parallel.h"
#include "tests/support/errors.h"
#include "tests/support/temporary_folder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>

namespace insitu {
namespace {

const std::filesystem::path kSample =
    std::filesystem::path(INSITU_SOURCE_DIR) / "samples" / "simulated-room";

InsertOptions quick()
{
    InsertOptions options;
    options.render.max_samples = 4;
    options.render.min_samples = 4;
    options.render.interreflection.samples_per_cell = 64;
    return options;
}

/// Mean of a square of linear light, so that grain and noise do not count.
glm::dvec3 meanLight(const EncodedImage& image, int left, int top, int size)
{
    glm::dvec3 sum(0.0);
    for (int y = top; y < top + size; ++y)
        for (int x = left; x < left + size; ++x)
            for (int c = 0; c < 3; ++c)
                sum[c] +=
                    linearFromSrgb(image.codes(x, y)[c] / static_cast<double>(image.max_code));
    return sum / (static_cast<double>(size) * size);
}

/// Sum over 16 px squares of squared differences to the truth, where `chosen`.
template <class Chosen>
double squaredError(const EncodedImage& picture, const EncodedImage& truth, Chosen chosen)
{
    constexpr int kSquare = 16;
    double sum = 0.0;
    for (int y = 0; y + kSquare <= truth.codes.height(); y += kSquare)
        for (int x = 0; x + kSquare <= truth.codes.width(); x += kSquare)
            if (chosen(x + kSquare / 2, y + kSquare / 2)) {
                const glm::dvec3 off =
                    meanLight(picture, x, y, kSquare) - meanLight(truth, x, y, kSquare);
                sum += glm::dot(off, off);
            }
    return sum;
}

// From JPEG brackets and lines to a picture that is much nearer to the true photograph than the
// empty room is: four samples a pixel, so the bounds leave room for noise.
TEST(InsertObjects, SimulatedRoomComesCloseToTheTruePhotograph)
{
    const Project project = readProject(kSample / "project.json");
    Progress progress;
    const InsertResult result = insertObjects(project, quick(), progress);
    const EncodedImage truth = readPhoto(kSample / "truth" / "truth.jpg").image;
    const Photo mask = readPhoto(kSample / "truth" / "object_mask.png");
    const auto on_object = [&](int x, int y) { return mask.image.codes(x, y).r > 127; };
    const auto beside = [&](int x, int y) { return mask.image.codes(x, y).r == 0; };

    const EncodedImage& made = result.composite.image;
    const EncodedImage& plate = result.photo.image;
    EXPECT_LT(
        std::sqrt(squaredError(made, truth, on_object) / squaredError(plate, truth, on_object)),
        0.15);
    EXPECT_LT(std::sqrt(squaredError(made, truth, beside) / squaredError(plate, truth, beside)),
              0.3);
    // What the light does not reach stays as it came.
    for (std::size_t i = 0; i < made.codes.pixelCount(); ++i)
        if (result.composite.influence.pixels()[i] == 0) {
            ASSERT_EQ(made.codes.pixels()[i], plate.codes.pixels()[i]) << i;
        }
    EXPECT_NEAR(result.balance.luminance, 1.0, 0.15);
    EXPECT_EQ(result.balance.used, glm::dvec3(1.0));
    EXPECT_FALSE(hasFinding(result.findings, "light-photo-mismatch"));
}

// The same room photographed as radiance, in a unit of its own: the picture is the same light.
TEST(InsertObjects, AnHdrPhotographGivesTheSameAndKeepsItsOwnValues)
{
    Project project = readProject(kSample / "project.json");
    InsertOptions options = quick();
    const TemporaryFolder folder;
    options.render.technique = Technique::Fiv;
    options.render.fiv.atlas_folder = folder.path();
    leaveOut("all", options.match);
    Progress progress;
    const InsertResult encoded = insertObjects(project, options, progress);

    constexpr float kUnit = 1e-3f;
    Image<Rgb> radiance = photographedRadiance(
        encoded.photo.image, encoded.photo_response, encoded.photo_relative_exposure);
    for (Rgb& value : radiance.pixels())
        value *= kUnit;
    project.photo.path = folder / "plate.exr";
    writeRadiance(project.photo.path, radiance);
    const InsertResult result = insertObjects(project, options, progress);
    EXPECT_TRUE(hasFinding(result.findings, "light-scale-from-photograph"));
    EXPECT_EQ(result.photo_response.source, "linear");
    // Surfaces seen by both tell the unit.
    EXPECT_NEAR(result.balance.used.g, kUnit * encoded.balance.luminance, 1e-3 * kUnit);

    double off = 0.0;
    double change = 0.0;
    const double scale = encoded.balance.luminance;
    for (std::size_t i = 0; i < radiance.pixelCount(); ++i) {
        if (result.composite.influence.pixels()[i] == 0) {
            ASSERT_EQ(result.composite.linear.pixels()[i], radiance.pixels()[i]) << i;
        }
        if (encoded.composite.influence.pixels()[i] == 0) continue;
        const double before = radiance.pixels()[i].g / kUnit;
        const double one = encoded.composite.linear.pixels()[i].g;
        const double other = result.composite.linear.pixels()[i].g / kUnit;
        change += std::abs(one - before);
        off += std::abs(other - one);
    }
    // The light is scaled here and was not there; clipped pixels of the plate have no probe's
    // value.
    EXPECT_LT(off / change, std::abs(scale - 1.0) + 0.05);

    project.photo.exposure.seconds = 0.5;
    EXPECT_THAT(inputErrorOf([&] { (void)insertObjects(project, options, progress); }),
                testing::HasSubstr("holds radiance"));
}

}  // namespace
}  // namespace insitu
