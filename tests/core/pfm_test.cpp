#include "core/io/byte_writer.h"
#include "core/io/image_io.h"
#include "tests/support/errors.h"
#include "tests/support/temporary_folder.h"

#include <gmock/gmock.h>
#include <opencv2/imgcodecs.hpp>

namespace insitu {
namespace {

using testing::HasSubstr;

Image<Rgb> ramp()
{
    Image<Rgb> image(3, 2);
    for (int y = 0; y < 2; ++y)
        for (int x = 0; x < 3; ++x)
            image(x, y) = Rgb(x, y, 0.1f * static_cast<float>(x + y));
    return image;
}

Bytes pfm(std::string_view header, std::initializer_list<int> pixels)
{
    Bytes bytes;
    append(bytes, header);
    for (const int byte : pixels)
        bytes.push_back(static_cast<std::uint8_t>(byte));
    return bytes;
}

TEST(Pfm, RoundTripIsExact)
{
    const TemporaryFolder folder;
    writeRadiance(folder / "a.pfm", ramp());
    EXPECT_EQ(readRadiance(folder / "a.pfm").pixels, ramp());
    const cv::Mat theirs = cv::imread((folder / "a.pfm").string(), cv::IMREAD_UNCHANGED);
    ASSERT_EQ(theirs.rows, 2);
    const auto bgr = theirs.at<cv::Vec3f>(1, 2);
    EXPECT_EQ(Rgb(bgr[2], bgr[1], bgr[0]), ramp()(2, 1));
}

TEST(Pfm, RowsRunUpwardsAndTheSignOfTheScaleIsTheByteOrder)
{
    const TemporaryFolder folder;
    // 1.0f is 3F800000, 2.0f is 40000000. Grey: the first row stored is the lowest.
    const Bytes big = pfm("Pf\n1 2\n1.0\n", {0x3F, 0x80, 0, 0, 0x40, 0, 0, 0});
    const Image<Rgb> image = readRadiance(folder.add("a.pfm", big)).pixels;
    EXPECT_EQ(image(0, 0), Rgb(2.0f));
    EXPECT_EQ(image(0, 1), Rgb(1.0f));
    const Bytes little = pfm("Pf\n1 2\n-3.0\n", {0, 0, 0x80, 0x3F, 0, 0, 0, 0x40});
    EXPECT_EQ(readRadiance(folder.add("b.pfm", little)).pixels(0, 0), Rgb(6.0f));
}

TEST(Pfm, RefusesDamage)
{
    const TemporaryFolder folder;
    const auto message = [&](const Bytes& bytes) {
        return inputErrorOf([&] { (void)readRadiance(folder.add("a.pfm", bytes)); });
    };
    EXPECT_THAT(message(pfm("PF\n1 2\n-1.0\n", {0, 0, 0, 0})), HasSubstr("ends early"));
    EXPECT_THAT(message(pfm("PF\n1 2\n0\n", {0, 0, 0, 0})), HasSubstr("no valid scale"));
    EXPECT_THAT(message(pfm("PF\n1 2\nnan\n", {0, 0, 0, 0})), HasSubstr("no valid scale"));
    EXPECT_THAT(message(pfm("PF\n1 x\n-1\n", {})), HasSubstr("no valid height"));
    EXPECT_THAT(message(pfm("PF\n", {})), HasSubstr("no valid width"));
    EXPECT_THAT(message(pfm("PF\n-4 5\n-1\n", {})), HasSubstr("empty"));
    EXPECT_THAT(message(pfm("PF\n90000 90000\n-1\n", {})), HasSubstr("at most"));
    EXPECT_THAT(message(pfm("PF\n1 1\n-1", {})), HasSubstr("ends early"));
    EXPECT_THAT(message(pfm("Pf\n1 1\n1\n", {0x7F, 0xC0, 0, 0})), HasSubstr("pixel (0, 0)"));
}

}  // namespace
}  // namespace insitu
