#include "core/io/encoded_rows.h"

#include "core/io/image_io.h"
#include "core/random.h"
#include "tests/support/errors.h"
#include "tests/support/temporary_folder.h"

#include <gmock/gmock.h>

#include <algorithm>

namespace insitu {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

EncodedImage smoothImage(int width, int height, int max_code)
{
    EncodedImage image{Image<glm::u16vec3>(width, height), max_code};
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x)
            image.codes(x, y) = glm::u16vec3(
                x * max_code / width, y * max_code / height, (x + y) * max_code / (width + height));
    return image;
}

EncodedImage rowsOf(const EncodedImage& image, int first, int count)
{
    EncodedImage rows{Image<glm::u16vec3>(image.codes.width(), count), image.max_code};
    for (int y = 0; y < count; ++y)
        std::ranges::copy(image.codes.row(first + y), rows.codes.row(y).begin());
    return rows;
}

void writeInStrips(const fs::path& path, const EncodedImage& image)
{
    EncodedRowWriter writer(path, {image.codes.width(), image.codes.height(), image.max_code});
    for (int y = 0; y < image.codes.height(); y += 10)
        writer.write(rowsOf(image, y, std::min(10, image.codes.height() - y)));
    EXPECT_FALSE(fs::exists(path)) << "before it is finished";
    writer.finish();
}

TEST(EncodedRowWriter, PicturesAreThoseOfTheWhole)
{
    const TemporaryFolder folder;
    for (const int max_code : {255, 65535}) {
        const EncodedImage image = smoothImage(61, 43, max_code);
        writeInStrips(folder / "strips.png", image);
        const Photo read = readPhoto(folder / "strips.png");
        EXPECT_EQ(read.image.max_code, max_code);
        EXPECT_EQ(read.image.codes, image.codes);
        EXPECT_EQ(read.metadata.color.name, "sRGB");
        fs::remove(folder / "strips.png");
    }
    const EncodedImage image = smoothImage(61, 43, 255);
    writeInStrips(folder / "strips.jpg", image);
    writeEncoded(folder / "whole.jpg", image);
    EXPECT_EQ(readPhoto(folder / "strips.jpg").image.codes,
              readPhoto(folder / "whole.jpg").image.codes);
}

TEST(EncodedRowWriter, WhatIsNotFinishedLeavesNoFile)
{
    const TemporaryFolder folder;
    for (const char* name : {"part.png", "part.jpg"}) {
        EncodedRowWriter writer(folder / name, {20, 20, 255});
        writer.write(smoothImage(20, 7, 255));
    }
    EXPECT_TRUE(fs::is_empty(folder.path()));
}

TEST(EncodedRowWriter, RefusesWhatItCannotWrite)
{
    const TemporaryFolder folder;
    const auto complaint = [&](const char* name, const EncodedRowWriter::Format& format) {
        return inputErrorOf([&] { const EncodedRowWriter writer(folder / name, format); });
    };
    EXPECT_THAT(complaint("a.tif", {4, 4, 255}), HasSubstr(".png, .jpg or .jpeg"));
    EXPECT_THAT(complaint("a.jpg", {4, 4, 65535}), HasSubstr("holds 8 bits"));
    EXPECT_THAT(complaint("a.jpg", {70000, 4, 255}), HasSubstr("65500"));
    EXPECT_THAT(complaint("none/a.png", {4, 4, 255}), HasSubstr("cannot be written"));
    EXPECT_TRUE(fs::is_empty(folder.path()));
}

}  // namespace
}  // namespace insitu
