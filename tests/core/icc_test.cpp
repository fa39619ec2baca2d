#include "core/color.h"
#include "core/io/file.h"
#include "core/io/icc_profile.h"
#include "core/io/image_io.h"
#include "core/io/zlib_bytes.h"
#include "core/random.h"
#include "tests/support/icc_profiles.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/tolerance.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>

namespace insitu {
namespace {

/// Profiles hold s15Fixed16 numbers (1.5e-5), and three of them are multiplied here.
constexpr double kProfileRounding = 1e-4;

void expectMatrix(const glm::dmat3& actual, const glm::dmat3& expected)
{
    for (int column = 0; column < 3; ++column)
        for (int row = 0; row < 3; ++row)
            EXPECT_NEAR(actual[column][row], expected[column][row], kProfileRounding)
                << "row " << row << ", column " << column;
}

TEST(Icc, DisplayP3HasItsClosedFormMatrixAndTheCurveOfSrgb)
{
    const IccReading reading = readIccProfile(makeProfile(kDisplayP3, srgbCurve()));
    ASSERT_TRUE(reading.profile) << reading.problem;
    expectMatrix(reading.profile->rec709_from_linear, rec709From(kDisplayP3));
    // The literal values that follow from SMPTE EG 432-1's primaries and D65.
    EXPECT_NEAR(reading.profile->rec709_from_linear[0][0], 1.2249401, kProfileRounding);
    EXPECT_NEAR(reading.profile->rec709_from_linear[1][0], -0.2249404, kProfileRounding);
    EXPECT_NEAR(reading.profile->rec709_from_linear[2][2], 1.0982735, kProfileRounding);
    EXPECT_EQ(reading.profile->transfer.exposure, ResponseCurve::srgb().exposure);
    EXPECT_FALSE(reading.profile->transfer_is_response);
}

TEST(Icc, AdobeRgbHasItsGamma)
{
    constexpr double kGamma = 2.19921875;  // Adobe RGB (1998), section 4.3.1.2
    const IccReading reading = readIccProfile(makeProfile(kAdobeRgb, gammaCurve(kGamma)));
    ASSERT_TRUE(reading.profile) << reading.problem;
    expectMatrix(reading.profile->rec709_from_linear, rec709From(kAdobeRgb));
    for (const int code : {10, 100, 200, 255})
        EXPECT_NEAR(reading.profile->transfer.exposure[1][static_cast<std::size_t>(code)],
                    std::pow(code / 255.0, kGamma),
                    tolerance::kFloat);  // the library evaluates curves in float
}

TEST(Icc, SrgbIsExactlySrgb)
{
    const IccReading reading = readIccProfile(makeProfile(kRec709, srgbCurve()));
    ASSERT_TRUE(reading.profile) << reading.problem;
    EXPECT_TRUE(sameColors(*reading.profile, ColorProfile{}));
    EXPECT_TRUE(reading.profile->hasRec709Primaries());
}

TEST(Icc, TablesCountWhereCurvesAndAMatrixReproduceThem)
{
    const IccReading plain = readIccProfile(makeTableProfile(kDisplayP3, /*hue_twist=*/0.0));
    ASSERT_TRUE(plain.profile) << plain.problem;
    const glm::dmat3 expected = rec709From(kDisplayP3);
    for (int column = 0; column < 3; ++column)
        for (int row = 0; row < 3; ++row)
            EXPECT_NEAR(plain.profile->rec709_from_linear[column][row],
                        expected[column][row],
                        2e-3);  // 16-bit tables of 33 points
    EXPECT_NEAR(plain.profile->transfer.decode(0, 128.0), linearFromSrgb(128.0 / 255.0), 2e-3);

    const IccReading twisted = readIccProfile(makeTableProfile(kDisplayP3, /*hue_twist=*/0.3));
    EXPECT_FALSE(twisted.profile);
    EXPECT_TRUE(twisted.rgb);
    EXPECT_THAT(twisted.problem, testing::HasSubstr("curves and a matrix miss"));
}

/// Where a tag's entry stands: signature, offset, size [ICC10, section 7.3].
std::ptrdiff_t tagEntry(const Bytes& profile, std::string_view signature)
{
    const auto table = profile.begin() + 128;
    return std::search(table, profile.end(), signature.begin(), signature.end()) - profile.begin();
}

TEST(Icc, WhatIsNoProfileOfAPictureIsAProblem)
{
    EXPECT_EQ(readIccProfile({}).problem, "is damaged");
    const Bytes whole = makeProfile(kDisplayP3, srgbCurve());
    EXPECT_EQ(readIccProfile(std::span(whole).first(100)).problem, "is damaged");
    const IccReading grey = readIccProfile(makeGreyProfile());
    EXPECT_EQ(grey.problem, "is not one of RGB pictures");
    EXPECT_FALSE(grey.rgb);
    EXPECT_THAT(readIccProfile(makeProfile(kDisplayP3, fallingCurve())).problem,
                testing::HasSubstr("do not rise"));
    Bytes flat = whole;
    std::copy_n(
        flat.begin() + tagEntry(flat, "rXYZ") + 4, 4, flat.begin() + tagEntry(flat, "gXYZ") + 4);
    EXPECT_EQ(readIccProfile(flat).problem, "has no three primaries");
}

TEST(Icc, DamagedProfilesNeverHurt)
{
    RandomStream random(20261125, 0, 0);
    for (const Bytes& whole :
         {makeProfile(kDisplayP3, srgbCurve()), makeTableProfile(kDisplayP3, 0.0)})
        for (int i = 0; i < 300; ++i) {
            Bytes damaged = whole;
            const auto head = static_cast<std::uint32_t>(std::min<std::size_t>(400, whole.size()));
            for (std::uint32_t k = 1 + random.below(5); k > 0; --k)
                damaged[random.below(head)] = static_cast<std::uint8_t>(random.below(256));
            const IccReading reading = readIccProfile(damaged);
            EXPECT_EQ(reading.profile.has_value(), reading.problem.empty());
            if (!reading.profile) continue;
            for (const auto& table : reading.profile->transfer.exposure)
                for (std::size_t z = 1; z < table.size(); ++z)
                    ASSERT_GT(table[z], table[z - 1]);
        }
}

TEST(Icc, ProfilesTravelThroughEveryFormat)
{
    const TemporaryFolder folder;
    // Longer than one segment of a JPEG holds.
    Bytes profile = makeProfile(kDisplayP3, srgbCurve());
    const Bytes small = profile;
    EncodedImage image{Image<glm::u16vec3>(24, 16, glm::u16vec3(90, 120, 200)), 255};
    for (const char* name : {"a.png", "a.jpg"}) {
        writeEncoded(folder / name, image, {}, 97, profile);
        const Photo photo = readPhoto(folder / name);
        EXPECT_EQ(photo.metadata.icc, profile) << name;
        EXPECT_TRUE(photo.metadata.icc_problem.empty()) << photo.metadata.icc_problem;
        expectMatrix(photo.metadata.color.rec709_from_linear, rec709From(kDisplayP3));
        EXPECT_TRUE(hasFinding(photoFindings(photo.metadata, name), "photo-profile"));
    }
    EXPECT_EQ(readPhoto(folder / "a.png").image.codes, image.codes);
    profile.resize(150'000, 0);  // padded: three segments
    writeEncoded(folder / "b.jpg", image, {}, 97, profile);
    EXPECT_EQ(readPhoto(folder / "b.jpg").metadata.icc, profile);
}

TEST(Icc, UnusableProfilesAreToldAndKept)
{
    const TemporaryFolder folder;
    const EncodedImage image{Image<glm::u16vec3>(24, 16, glm::u16vec3(90)), 255};
    const Bytes twisted = makeTableProfile(kDisplayP3, 0.3);
    writeEncoded(folder / "a.png", image, {}, 97, twisted);
    const PhotoMetadata metadata = readPhoto(folder / "a.png").metadata;
    EXPECT_TRUE(metadata.color.hasRec709Primaries());
    EXPECT_EQ(metadata.icc, twisted);
    EXPECT_TRUE(hasFinding(photoFindings(metadata, "a.png"), "photo-profile-unusable"));

    // A part of the profile is missing from the JPEG.
    Bytes padded = makeProfile(kDisplayP3, srgbCurve());
    padded.resize(150'000, 0);
    writeEncoded(folder / "a.jpg", image, {}, 97, padded);
    Bytes jpeg = readFile(folder / "a.jpg");
    jpeg.erase(jpeg.begin() + 2, jpeg.begin() + 2 + 65537);  // the first segment
    const PhotoMetadata missing = readPhoto(folder.add("b.jpg", jpeg)).metadata;
    EXPECT_EQ(missing.icc_problem, "is damaged");
    EXPECT_TRUE(missing.icc.empty());
}

TEST(Icc, ConvertingPixelsFollowsTheMatrixAndCutsWhatLiesOutside)
{
    const glm::dmat3 matrix = rec709From(kDisplayP3);
    Image<Rgb> pixels(4, 1, Rgb(0.5f));
    pixels(1, 0) = Rgb(0.0f, 1.0f, 0.0f);  // P3's green is outside
    const double outside = convertPixels(pixels, matrix);
    EXPECT_EQ(outside, 0.25);
    EXPECT_NEAR(pixels(0, 0).g, 0.5f, tolerance::kFloat);
    EXPECT_EQ(pixels(1, 0).r, 0.0f);
    EXPECT_NEAR(pixels(1, 0).g, matrix[1][1], tolerance::kFloat);
    EXPECT_EQ(convertPixels(pixels, glm::dmat3(1.0)), 0.0);
}

TEST(Icc, StreamsUnpackUpToALimit)
{
    const Bytes bytes(100'000, 7);
    const Bytes stream = deflated(bytes);
    EXPECT_LT(stream.size(), 1000u);
    EXPECT_EQ(inflated(stream, 100'000), bytes);
    EXPECT_FALSE(inflated(stream, 99'999));
    EXPECT_FALSE(inflated(std::span(stream).first(stream.size() / 2), 100'000));
    EXPECT_FALSE(inflated(bytes, 100'000));
}

}  // namespace
}  // namespace insitu
