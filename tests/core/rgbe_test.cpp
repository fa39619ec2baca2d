#include "core/io/byte_writer.h"
#include "core/io/image_io.h"
#include "core/random.h"
#include "tests/support/data.h"
#include "tests/support/errors.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/tolerance.h"

#include <gmock/gmock.h>
#include <opencv2/imgcodecs.hpp>

#include <cmath>

namespace insitu {
namespace {

using testing::HasSubstr;

/// Half a step of the shared mantissa, which is at least 128: relative to the largest component.
constexpr double kHalfStep = 0.5 / 128.0;

Bytes file(std::string_view header, std::initializer_list<int> pixels)
{
    Bytes bytes;
    append(bytes, header);
    for (const int byte : pixels)
        bytes.push_back(static_cast<std::uint8_t>(byte));
    return bytes;
}

constexpr std::string_view kTwoByOne = "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 2\n";

Image<Rgb> read(const TemporaryFolder& folder, const Bytes& bytes)
{
    return readRadiance(folder.add("a.hdr", bytes)).pixels;
}

TEST(Rgbe, MantissaTimesPowerOfTwo)
{
    const TemporaryFolder folder;
    // 2^(136-136) · (128, 64, 1) and 2^(129-136) · (255, 0, 128); an exponent of 0 is black.
    const Image<Rgb> image = read(folder, file(kTwoByOne, {128, 64, 1, 136, 255, 0, 128, 129}));
    EXPECT_EQ(image(0, 0), Rgb(128.0f, 64.0f, 1.0f));
    EXPECT_EQ(image(1, 0), Rgb(255.0f / 128.0f, 0.0f, 1.0f));
    EXPECT_EQ(read(folder, file(kTwoByOne, {9, 9, 9, 0, 9, 9, 9, 0})), Image<Rgb>(2, 1));
}

TEST(Rgbe, RoundTripIsWithinHalfAStep)
{
    const TemporaryFolder folder;
    for (const int width : {3, 200}) {  // too narrow for runs, and with runs
        Image<Rgb> image(width, 17);
        RandomStream random(11, 0, 0);
        for (int y = 0; y < 17; ++y)
            for (int x = 0; x < width; ++x) {
                if (y > 10 && x > 0 && x % 50 != 0) {  // long runs of the same
                    image(x, y) = image(x - 1, y);
                    continue;
                }
                for (int c = 0; c < 3; ++c)
                    image(x, y)[c] = std::exp2(random.uniform() * 40.0f - 20.0f);
            }
        image(1, 0) = Rgb(0.99999f, 0.0f, 0.0f);  // rounds up to the next exponent
        writeRadiance(folder / "a.hdr", image);
        const Image<Rgb> copy = readRadiance(folder / "a.hdr").pixels;
        ASSERT_TRUE(copy.sameSize(image));
        for (int y = 0; y < 17; ++y)
            for (int x = 0; x < width; ++x) {
                const Rgb& pixel = image(x, y);
                const double bound = std::max({pixel.r, pixel.g, pixel.b}) * kHalfStep;
                for (int c = 0; c < 3; ++c)
                    EXPECT_NEAR(copy(x, y)[c], pixel[c], bound * (1.0 + tolerance::kFloat));
            }
        // A second pass changes nothing: every value is representable now.
        writeRadiance(folder / "b.hdr", copy);
        EXPECT_EQ(readRadiance(folder / "b.hdr").pixels, copy);
    }
}

TEST(Rgbe, AnotherReaderSeesTheSame)
{
    const TemporaryFolder folder;
    Image<Rgb> image(100, 9);
    RandomStream random(12, 0, 0);
    for (Rgb& pixel : image.pixels())
        pixel = Rgb(random.uniform(), random.below(3) == 0 ? 0.25f : 0.5f, 4.0f);
    writeRadiance(folder / "a.hdr", image);
    const Image<Rgb> ours = readRadiance(folder / "a.hdr").pixels;
    const cv::Mat theirs = cv::imread((folder / "a.hdr").string(), cv::IMREAD_UNCHANGED);
    ASSERT_EQ(theirs.type(), CV_32FC3);
    for (int y = 0; y < 9; ++y)
        for (int x = 0; x < 100; ++x) {
            const auto bgr = theirs.at<cv::Vec3f>(y, x);
            EXPECT_EQ(ours(x, y), Rgb(bgr[2], bgr[1], bgr[0]));
        }
}

TEST(Rgbe, OldRunsRepeatThePixelBefore)
{
    const TemporaryFolder folder;
    // One pixel, then 2 + 1·256 repetitions: the second run in a row counts in units of 256.
    const Bytes bytes = file("#?RADIANCE\n\n-Y 1 +X 260\n",
                             {128, 0, 0, 129, 1, 1, 1, 2, 1, 1, 1, 1, 0, 128, 0, 129});
    const Image<Rgb> image = read(folder, bytes);
    for (int x = 0; x < 259; ++x)
        EXPECT_EQ(image(x, 0), Rgb(1.0f, 0.0f, 0.0f)) << x;
    EXPECT_EQ(image(259, 0), Rgb(0.0f, 1.0f, 0.0f));
}

TEST(Rgbe, NewRunsAreByComponent)
{
    const TemporaryFolder folder;
    // Eight pixels: red a run of 8, green 2 literals and a run of 6, blue a run, exponent a run.
    const Bytes bytes = file("#?RADIANCE\n\n-Y 1 +X 8\n",
                             {2, 2, 0, 8, 136, 128, 2, 7, 8, 134, 9, 136, 0, 136, 136});
    const Image<Rgb> image = read(folder, bytes);
    EXPECT_EQ(image(0, 0), Rgb(128.0f, 7.0f, 0.0f));
    EXPECT_EQ(image(1, 0), Rgb(128.0f, 8.0f, 0.0f));
    EXPECT_EQ(image(7, 0), Rgb(128.0f, 9.0f, 0.0f));
}

TEST(Rgbe, ExposureAndColourCorrectionAreDividedOut)
{
    const TemporaryFolder folder;
    const Bytes bytes = file(
        "#?RADIANCE\nEXPOSURE= 2.0\n# EXPOSURE=7\nEXPOSURE=4\nCOLORCORR=1 2 0.5\n\n-Y 1 +X 1\n",
        {128, 128, 128, 136});
    EXPECT_EQ(read(folder, bytes)(0, 0), Rgb(16.0f, 8.0f, 32.0f));
}

TEST(Rgbe, XyzBecomesRgb)
{
    const TemporaryFolder folder;
    // The white of D65, XYZ = (0.9505, 1, 1.0890), in steps of 1/128 (IEC 61966-2-1).
    const Bytes bytes =
        file("#?RADIANCE\nFORMAT=32-bit_rle_xyze\n\n-Y 1 +X 1\n", {122, 128, 139, 129});
    const Rgb white = read(folder, bytes)(0, 0);
    for (int c = 0; c < 3; ++c)
        EXPECT_NEAR(white[c], 1.0, 4.0 * kHalfStep);  // the matrix multiplies the step by up to 3.2
}

// 1 2 3 in file order, then 4 5 6, stored with each of the eight orders; what is seen upright.
TEST(Rgbe, EightPixelOrders)
{
    const std::vector<std::pair<std::string, std::vector<int>>> cases = {
        {"-Y 2 +X 3", {1, 2, 3, 4, 5, 6}},
        {"-Y 2 -X 3", {3, 2, 1, 6, 5, 4}},
        {"+Y 2 -X 3", {6, 5, 4, 3, 2, 1}},
        {"+Y 2 +X 3", {4, 5, 6, 1, 2, 3}},
        {"+X 2 -Y 3", {1, 4, 2, 5, 3, 6}},
        {"-X 2 -Y 3", {4, 1, 5, 2, 6, 3}},
        {"-X 2 +Y 3", {6, 3, 5, 2, 4, 1}},
        {"+X 2 +Y 3", {3, 6, 2, 5, 1, 4}},
    };
    const TemporaryFolder folder;
    for (const auto& [resolution, expected] : cases) {
        Bytes bytes = file("#?RADIANCE\n\n" + resolution + "\n", {});
        for (int i = 1; i <= 6; ++i)
            append(bytes, Bytes{static_cast<std::uint8_t>(i * 20), 0, 255, 136});
        const Image<Rgb> image = read(folder, bytes);
        EXPECT_EQ(image.width(), resolution[1] == 'Y' ? 3 : 2) << resolution;
        std::vector<int> seen;
        for (const Rgb& pixel : image.pixels())
            seen.push_back(static_cast<int>(pixel.r) / 20);
        EXPECT_EQ(seen, expected) << resolution;
    }
}

TEST(Rgbe, RefusesDamage)
{
    const TemporaryFolder folder;
    const auto message = [&](std::string_view header, std::initializer_list<int> pixels) {
        return inputErrorOf([&] { (void)read(folder, file(header, pixels)); });
    };
    EXPECT_THAT(message(kTwoByOne, {1, 2, 3, 4, 5, 6, 7}), HasSubstr("end early"));
    EXPECT_THAT(message("#?RADIANCE\n\n-Y 1 +X 8\n", {2, 2, 0, 8, 136, 1, 136}),
                HasSubstr("cannot hold"));
    EXPECT_THAT(message("#?RADIANCE\n\n-Y 1 +X 8\n", {2, 2, 0, 8, 137, 1, 0, 0}),
                HasSubstr("longer than its row"));
    EXPECT_THAT(message("#?RADIANCE\n\n-Y 1 +X 8\n", {2, 2, 0, 9, 136, 1, 0, 0}),
                HasSubstr("another width"));
    EXPECT_THAT(message("#?RADIANCE\n\n-Y 1 +X 8\n", {1, 1, 1, 8, 0, 0, 0, 0}),
                HasSubstr("longer than its row"));
    EXPECT_THAT(message("#?RADIANCE\n\n-Y 0 +X 8\n", {}), HasSubstr("empty"));
    EXPECT_THAT(message("#?RADIANCE\n\n-Y -3 +X 8\n", {}), HasSubstr("empty"));
    EXPECT_THAT(message("#?RADIANCE\n\n-Y 40000 +X 40000\n", {}), HasSubstr("at most"));
    EXPECT_THAT(message("#?RADIANCE\n\n-Y 8 +Y 8\n", {}), HasSubstr("not like"));
    EXPECT_THAT(message("#?RADIANCE\n\n-Y 99999999999 +X 8\n", {}), HasSubstr("not like"));
    EXPECT_THAT(message("#?RADIANCE\nFORMAT=float\n\n-Y 1 +X 1\n", {}), HasSubstr("FORMAT"));
    EXPECT_THAT(message("#?RADIANCE\nEXPOSURE=0\n\n-Y 1 +X 1\n", {}), HasSubstr("EXPOSURE"));
    EXPECT_THAT(message("#?RADIANCE\n", {}), HasSubstr("no end"));
    EXPECT_THAT(message("#?RADIANCE\nEXPOSURE=1e-38\n\n-Y 1 +X 1\n", {255, 1, 1, 255}),
                HasSubstr("not finite"));
}

TEST(Rgbe, ReadsMemorialWithItsOddHeader)
{
    INSITU_NEEDS_DATA();
    const auto folder = dataFolder() / "hdrphotos";
    const Image<Rgb> image = readRadiance(folder / "memorial.hdr").pixels;
    EXPECT_EQ(image.width(), 512);
    EXPECT_EQ(image.height(), 768);
    EXPECT_EQ(image, readRadiance(folder / "memorial_std_header.hdr").pixels);
    // OpenCV cannot read the odd header, but the ordinary one, and must see the same.
    const cv::Mat theirs =
        cv::imread((folder / "memorial_std_header.hdr").string(), cv::IMREAD_UNCHANGED);
    for (int y = 0; y < 768; y += 7)
        for (int x = 0; x < 512; ++x) {
            const auto bgr = theirs.at<cv::Vec3f>(y, x);
            EXPECT_EQ(image(x, y), Rgb(bgr[2], bgr[1], bgr[0]));
        }
}

TEST(Rgbe, ATransferInTextModeIsSeen)
{
    INSITU_NEEDS_DATA();
    const auto path =
        dataFolder() / "brackets/memorial16/memorial_CRLF_mangled_do_not_use_as_truth.hdr";
    EXPECT_THAT(inputErrorOf([&] { (void)readRadiance(path); }), HasSubstr("memorial_CRLF"));
}

}  // namespace
}  // namespace insitu
