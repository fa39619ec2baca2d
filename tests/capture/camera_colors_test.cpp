#include "capture/radiance_capture.h"
#include "core/color.h"
#include "core/io/exif.h"
#include "core/io/image_io.h"
#include "core/random.h"
#include "tests/capture/synthetic_bracket.h"
#include "tests/support/dng_writer.h"
#include "tests/support/errors.h"
#include "tests/support/icc_profiles.h"
#include "tests/support/temporary_folder.h"

#include <gmock/gmock.h>

namespace insitu {
namespace {

using testing::HasSubstr;

/// A camera with channels that overlap and see unequally much, as real ones do.
const glm::dmat3 kCamera(0.55, 0.12, 0.03, 0.25, 0.75, 0.20, 0.05, 0.13, 0.42);
constexpr double kElectrons = 40'000.0;
constexpr double kReadElectrons = 3.0;

/// Tiles of all colours over ten stops.
Image<Rgb> coloredTiles()
{
    Image<Rgb> image = tiles(96, 72, 12, 0.02, 16.0);
    for (int y = 0; y < image.height(); ++y)
        for (int x = 0; x < image.width(); ++x) {
            const int hue = (x / 12 + y / 12) % 3;
            image(x, y)[hue] *= 0.4f;
        }
    return image;
}

/// One exposure as the sensor saw it, with its noise.
DngPicture rawPicture(const Image<Rgb>& scene, double seconds, std::uint64_t seed)
{
    DngPicture picture;
    picture.black = 512;
    picture.white = 16383;
    picture.camera_from_rec709 = kCamera;
    picture.neutral = kCamera * glm::dvec3(1.0);
    picture.seconds = seconds;
    picture.f_number = 1.0;
    picture.sensor = Image<glm::u16vec3>(scene.width(), scene.height());
    RandomStream random(seed, 0, 0);
    for (std::size_t i = 0; i < scene.pixelCount(); ++i) {
        const glm::dvec3 exposure = kCamera * glm::dvec3(scene.pixels()[i]) * seconds;
        for (int c = 0; c < 3; ++c) {
            const double electrons = exposure[c] * kElectrons +
                                     random.normal() * std::sqrt(exposure[c] * kElectrons +
                                                                 kReadElectrons * kReadElectrons);
            const double value =
                picture.black + electrons / kElectrons * (picture.white - picture.black);
            picture.sensor.pixels()[i][c] =
                static_cast<std::uint16_t>(std::lround(std::clamp(value, 0.0, 16383.0)));
        }
    }
    return picture;
}

struct RawFiles {
    TemporaryFolder folder;
    std::vector<std::filesystem::path> paths;
};

void writeRawBracket(RawFiles& files, const std::vector<double>& seconds)
{
    for (std::size_t k = 0; k < seconds.size(); ++k)
        files.paths.push_back(files.folder.add(
            fmt::format("{}.dng", k), makeDng(rawPicture(coloredTiles(), seconds[k], 100 + k))));
}

TEST(CameraColors, ABracketOfRawFilesGivesTheSceneInRec709)
{
    RawFiles files;
    writeRawBracket(files, {0.5, 0.05, 0.0125});
    const CapturedRadiance captured = captureRadiance(readBracket(files.paths), {}, {});
    EXPECT_TRUE(captured.response_known);
    EXPECT_TRUE(hasFinding(captured.findings, "response-linear"));
    EXPECT_EQ(captured.merged.clipped_fraction, 0.0);
    const Image<Rgb> scene = coloredTiles();
    const glm::dvec3 neutral = kCamera * glm::dvec3(1.0);
    const double unit = std::max({neutral.r, neutral.g, neutral.b});
    // Inside the tiles, where demosaicing has nothing to guess.
    for (int y = 6; y < scene.height(); y += 12)
        for (int x = 6; x < scene.width(); x += 12)
            for (int c = 0; c < 3; ++c) {
                const double truth = unit * static_cast<double>(scene(x, y)[c]);
                const double read = captured.merged.radiance.pixels(x, y)[c];
                const double sigma = std::sqrt(captured.merged.variance(x, y)[c]);
                // The variance counts the frames' noise, demosaicing smooths it and the file
                // rounds.
                EXPECT_NEAR(read, truth, 5.0 * sigma + 0.003 * truth) << x << "," << y << " " << c;
                EXPECT_LT(sigma, 0.05 * truth + 0.01) << x << "," << y << " " << c;
            }
}

TEST(CameraColors, LinearPicturesTellTheTrueShutterTimes)
{
    RawFiles files;
    writeRawBracket(files, {0.5, 1.0 / 16, 1.0 / 64});
    // What cameras write for these: 1/15 and 1/60.
    const std::vector<Exposure> written = {
        {0.5, 1.0, 100.0}, {1.0 / 15, 1.0, 100.0}, {1.0 / 60, 1.0, 100.0}};
    const Bracket bracket = readBracket(files.paths, written);
    const CapturedRadiance refined = captureRadiance(bracket, {}, {});
    EXPECT_TRUE(hasFinding(refined.findings, "capture-exposures-refined"));
    EXPECT_NEAR(refined.frames[0].used_exposure / refined.frames[1].used_exposure, 8.0, 0.02);
    EXPECT_NEAR(refined.frames[1].used_exposure / refined.frames[2].used_exposure, 4.0, 0.01);
    CaptureOptions options;
    options.response.refine_exposures = false;
    const CapturedRadiance given = captureRadiance(bracket, {}, options);
    EXPECT_EQ(given.frames[1].used_exposure, 1.0 / 15);
    EXPECT_NEAR(*given.frames[1].measured_exposure / refined.frames[1].used_exposure, 1.0, 1e-9);
}

TEST(CameraColors, TheOrderOfFilesDoesNotMatter)
{
    RawFiles files;
    writeRawBracket(files, {0.05, 0.5, 0.0125});
    const CapturedRadiance captured = captureRadiance(readBracket(files.paths), {}, {});
    std::ranges::reverse(files.paths);
    const CapturedRadiance reversed = captureRadiance(readBracket(files.paths), {}, {});
    EXPECT_EQ(captured.merged.radiance.pixels, reversed.merged.radiance.pixels);
    EXPECT_EQ(captured.merged.variance, reversed.merged.variance);
}

TEST(CameraColors, OtherWhiteBalancesInTheBracketChangeNothingButTheFinding)
{
    RawFiles files;
    writeRawBracket(files, {0.5, 0.05, 0.0125});
    const CapturedRadiance captured = captureRadiance(readBracket(files.paths), {}, {});
    DngPicture warm = rawPicture(coloredTiles(), 0.05, 101);
    warm.neutral = {1.0, 0.8, 0.3};
    files.paths[1] = files.folder.add("warm.dng", makeDng(warm));
    const Bracket bracket = readBracket(files.paths);
    EXPECT_TRUE(hasFinding(bracket.findings, "bracket-white-balance"));
    const CapturedRadiance mixed = captureRadiance(bracket, {}, {});
    // The single pixel's noise differs, since demosaicing decides by balanced channels.
    for (const glm::ivec2 corner : {glm::ivec2(2, 2), {38, 26}, {62, 50}}) {
        glm::dvec3 expected(0.0);
        glm::dvec3 actual(0.0);
        for (int i = 0; i < 64; ++i) {
            const glm::ivec2 at = corner + glm::ivec2(i % 8, i / 8);
            expected += glm::dvec3(captured.merged.radiance.pixels(at.x, at.y));
            actual += glm::dvec3(mixed.merged.radiance.pixels(at.x, at.y));
        }
        for (int c = 0; c < 3; ++c)
            EXPECT_NEAR(actual[c] / expected[c], 1.0, 0.01) << c;  // 3 % of noise over 64 pixels
    }
}

TEST(CameraColors, RawTakesNoResponseAndNoOtherFilesBesideIt)
{
    RawFiles files;
    writeRawBracket(files, {0.5, 0.05});
    const Bracket bracket = readBracket(files.paths);
    EXPECT_THAT(inputErrorOf([&] { (void)captureRadiance(bracket, ResponseCurve::srgb(), {}); }),
                HasSubstr("RAW files are linear"));

    PhotoMetadata metadata;
    metadata.exposure.seconds = 0.01;
    writeEncoded(files.folder / "a.png",
                 {Image<glm::u16vec3>(96, 72, glm::u16vec3(100)), 255},
                 makeExif(metadata));
    files.paths.push_back(files.folder / "a.png");
    EXPECT_THAT(inputErrorOf([&] { (void)readBracket(files.paths); }),
                HasSubstr("a.png: is not RAW, unlike 0.dng"));
}

/// Pictures of a scene by a camera whose channels have Display P3's primaries.
Bracket wideBracket(const std::vector<double>& seconds)
{
    Image<Rgb> wide = coloredTiles();
    (void)convertPixels(wide, glm::inverse(rec709From(kDisplayP3)));
    Bracket bracket = photograph(
        wide, seconds, shoulderCamera(/*power=*/0.6, /*shot=*/1.0 / 60'000.0, /*read=*/2.5e-9));
    bracket.metadata.color.name = "Display P3";
    bracket.metadata.color.rec709_from_linear = rec709From(kDisplayP3);
    return bracket;
}

TEST(CameraColors, RadianceLeavesInRec709WhileTheResponseIsTheCodes)
{
    const Bracket bracket = wideBracket({2.0, 1.0, 0.5, 0.25, 0.125, 1.0 / 16});
    const ResponseCurve truth = tableOf(shoulderCamera(0.6, 0.0, 0.0));
    const CapturedRadiance captured = captureRadiance(bracket, truth, {});
    const Image<Rgb> scene = coloredTiles();
    for (int y = 6; y < scene.height(); y += 12)
        for (int x = 6; x < scene.width(); x += 12)
            for (int c = 0; c < 3; ++c) {
                const double sigma = std::sqrt(captured.merged.variance(x, y)[c]);
                const double expected = scene(x, y)[c];
                EXPECT_NEAR(captured.merged.radiance.pixels(x, y)[c],
                            expected,
                            5.0 * sigma + 1e-3 * expected)
                    << x << "," << y << " " << c;
            }
    // The same codes without the matrix give the channels themselves.
    Bracket plain = bracket;
    plain.metadata.color = {};
    const CapturedRadiance channels = captureRadiance(plain, truth, {});
    EXPECT_EQ(channels.response.exposure, captured.response.exposure);
    Image<Rgb> converted = channels.merged.radiance.pixels;
    (void)convertPixels(converted, rec709From(kDisplayP3));
    EXPECT_EQ(converted, captured.merged.radiance.pixels);
}

TEST(CameraColors, WithoutAResponseTheProfilesCurveStandsIn)
{
    Bracket bracket = wideBracket({0.125});
    for (auto& table : bracket.metadata.color.transfer.exposure)
        for (std::size_t z = 0; z < table.size(); ++z)
            table[z] = std::pow(static_cast<double>(z) / 255.0, 1.8);
    const CapturedRadiance captured = captureRadiance(bracket, {}, {});
    EXPECT_TRUE(hasFinding(captured.findings, "response-not-recoverable"));
    EXPECT_EQ(captured.response.exposure, bracket.metadata.color.transfer.exposure);
}

TEST(CameraColors, ColoursThatRec709CannotHoldAreTold)
{
    Bracket bracket = wideBracket({0.125});
    for (glm::u16vec3& code : bracket.frames[0].image.codes.pixels())
        code = {20, 200, 20};  // P3's green
    const CapturedRadiance captured = captureRadiance(bracket, ResponseCurve::srgb(), {});
    EXPECT_TRUE(hasFinding(captured.findings, "capture-outside-rec709"));
    EXPECT_EQ(captured.merged.radiance.pixels(3, 3).r, 0.0f);
}

TEST(CameraColors, UnlikeProfilesInOneBracketAreRefused)
{
    const TemporaryFolder folder;
    PhotoMetadata metadata;
    const EncodedImage image{Image<glm::u16vec3>(16, 16, glm::u16vec3(100)), 255};
    metadata.exposure.seconds = 0.01;
    writeEncoded(folder / "a.jpg", image, makeExif(metadata));
    metadata.exposure.seconds = 0.1;
    const auto profile = makeProfile(kDisplayP3, srgbCurve());
    writeEncoded(folder / "b.jpg", image, makeExif(metadata), 97, profile);
    EXPECT_THAT(inputErrorOf([&] {
                    (void)readBracket({folder / "a.jpg", folder / "b.jpg"});
                }),
                HasSubstr("b.jpg: has the colour profile"));
    const Bracket alone = readBracket({folder / "b.jpg"});
    EXPECT_TRUE(hasFinding(alone.findings, "photo-profile"));
}

}  // namespace
}  // namespace insitu
