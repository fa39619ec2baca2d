#include "core/color.h"
#include "core/io/image_io.h"
#include "core/quantile.h"
#include "core/random.h"
#include "tests/support/errors.h"
#include "tests/support/temporary_folder.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <vector>

namespace insitu {
namespace {

using testing::HasSubstr;

/// Values over twelve decades around 1, every channel by itself.
Image<Rgb> wideRange()
{
    Image<Rgb> radiance(64, 48);
    RandomStream random(5, 0, 0);
    for (Rgb& value : radiance.pixels())
        for (int c = 0; c < 3; ++c)
            value[c] = static_cast<float>(std::pow(10.0, 12.0 * random.uniformDouble() - 6.0));
    return radiance;
}

TEST(PhotoFromRadiance, CodesDecodeToTheirValues)
{
    const Image<Rgb> radiance = wideRange();
    const Photo photo = photoFromRadiance(radiance);
    ASSERT_EQ(photo.image.max_code, 65535);
    EXPECT_EQ(photo.radiance, radiance);
    EXPECT_TRUE(photo.metadata.color.transfer_is_response);
    std::vector<double> luminances;
    for (const Rgb& value : radiance.pixels())
        luminances.push_back(luminance(value));
    const double linear = 0.01 * quantile(luminances, 0.5);
    for (std::size_t i = 0; i < radiance.pixelCount(); ++i)
        for (int c = 0; c < 3; ++c) {
            const std::uint16_t code = photo.image.codes.pixels()[i][c];
            const double value = radiance.pixels()[i][c];
            EXPECT_LT(code, 0.985 * 65535) << "counts as clipped";
            const double decoded = photo.metadata.color.transfer.decode(c, code * 255.0 / 65535.0);
            EXPECT_NEAR(decoded, value, 3e-4 * std::max(value, linear)) << i;
        }
}

TEST(PhotoFromRadiance, BlackAndSinglePicturesHaveACurve)
{
    for (const float value : {0.0f, 1e-30f, 1.0f, 1e30f}) {
        const Photo photo = photoFromRadiance(Image<Rgb>(3, 2, Rgb(value)));
        const auto& table = photo.metadata.color.transfer.exposure[0];
        for (std::size_t z = 1; z < table.size(); ++z)
            ASSERT_GT(table[z], table[z - 1]) << value;
        const double decoded =
            photo.metadata.color.transfer.decode(0, photo.image.codes(0, 0).r * 255.0 / 65535.0);
        EXPECT_NEAR(decoded, value, 3e-4 * value);
    }
    EXPECT_TRUE(photoFromRadiance({}).image.codes.empty());
}

TEST(ReadPhotograph, TakesRadianceByNameAndRefusesWhatIsNone)
{
    const TemporaryFolder folder;
    const std::filesystem::path file = folder / "plate.exr";
    writeRadiance(file, Image<Rgb>(4, 3, Rgb(0.5f, 2.0f, 8.0f)));
    const Photo photo = readPhotograph(file);
    EXPECT_EQ(photo.radiance(1, 1), Rgb(0.5f, 2.0f, 8.0f));
    EXPECT_EQ(photo.image.codes.width(), 4);

    const std::filesystem::path wrong = folder.add("wrong.hdr", "no picture");
    EXPECT_THAT(inputErrorOf([&] { (void)readPhotograph(wrong); }), HasSubstr("wrong.hdr"));
    const std::filesystem::path codes = folder / "plate.png";
    writeEncoded(codes, {Image<glm::u16vec3>(4, 3, glm::u16vec3(9)), 255});
    EXPECT_TRUE(readPhotograph(codes).radiance.empty());
}

}  // namespace
}  // namespace insitu
