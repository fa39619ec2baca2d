#include "capture/bracket.h"

#include "core/check.h"
#include "core/io/exif.h"
#include "core/io/image_io.h"
#include "tests/support/temporary_folder.h"

#include <gmock/gmock.h>

namespace insitu {
namespace {

using testing::HasSubstr;

EncodedImage grey(int width, int height, std::uint16_t code = 100)
{
    return {Image<glm::u16vec3>(width, height, glm::u16vec3(code)), 255};
}

BracketFrame frame(const std::string& name, double exposure, int width = 4)
{
    // No two are the same picture.
    return {name, grey(width, 3, static_cast<std::uint16_t>(name.front())), exposure};
}

std::string messageOf(const std::function<void()>& action)
{
    try {
        action();
    } catch (const InputError& error) {
        return error.what();
    }
    return "no InputError";
}

std::filesystem::path writeJpeg(const TemporaryFolder& folder,
                                const std::string& name,
                                const Exposure& exposure,
                                const std::string& model = "Model")
{
    PhotoMetadata metadata;
    metadata.exposure = exposure;
    metadata.make = "Make";
    metadata.model = model;
    writeEncoded(folder / name, grey(16, 16), makeExif(metadata));
    return folder / name;
}

TEST(MakeBracket, SortsFromLongestToShortest)
{
    const Bracket bracket = makeBracket({frame("b", 0.25), frame("a", 1.0), frame("c", 0.1)});
    EXPECT_EQ(bracket.frames[0].name, "a");
    EXPECT_EQ(bracket.frames[1].name, "b");
    EXPECT_EQ(bracket.frames[2].name, "c");
    EXPECT_TRUE(bracket.findings.empty());
}

TEST(MakeBracket, RefusesUnequalSizesByName)
{
    const std::string message = messageOf([] {
        (void)makeBracket({frame("a", 1.0), frame("b.jpg", 0.5, 5)});
    });
    EXPECT_THAT(message, HasSubstr("b.jpg"));
    EXPECT_THAT(message, HasSubstr("5x3"));
    EXPECT_THAT(message, HasSubstr("4x3"));
}

TEST(MakeBracket, RefusesNoFramesAndBadExposures)
{
    EXPECT_THROW((void)makeBracket({}), InputError);
    EXPECT_THROW((void)makeBracket({frame("a", 0.0)}), InputError);
    EXPECT_THROW((void)makeBracket({frame("a", std::nan(""))}), InputError);
    EXPECT_THROW((void)makeBracket({{"a", {}, 1.0}}), InputError);
}

TEST(MakeBracket, ReportsSingleAndDuplicateExposures)
{
    EXPECT_TRUE(hasFinding(makeBracket({frame("a", 1.0)}).findings, "bracket-single-exposure"));
    const Bracket same = makeBracket({frame("a", 1.0), frame("b", 1.0)});
    EXPECT_TRUE(hasFinding(same.findings, "bracket-single-exposure"));
    EXPECT_TRUE(hasFinding(same.findings, "bracket-duplicate-exposure"));
    const Bracket two = makeBracket({frame("a", 1.0), frame("b", 0.5), frame("c", 0.5)});
    EXPECT_FALSE(hasFinding(two.findings, "bracket-single-exposure"));
    EXPECT_TRUE(hasFinding(two.findings, "bracket-duplicate-exposure"));
}

TEST(MakeBracket, APictureThatIsThereTwiceCountsOnce)
{
    BracketFrame copy = frame("a", 1.0);
    copy.name = "copy";
    const Bracket bracket = makeBracket({frame("a", 1.0), copy, frame("b", 0.5)});
    EXPECT_EQ(bracket.frames.size(), 2u);
    EXPECT_TRUE(hasFinding(bracket.findings, "bracket-repeated-picture"));
    EXPECT_FALSE(hasFinding(bracket.findings, "bracket-duplicate-exposure"));
    // Under another exposure it is no copy: what that means, the exposures' check tells.
    copy.relative_exposure = 0.25;
    EXPECT_EQ(makeBracket({frame("a", 1.0), copy}).frames.size(), 2u);
}

TEST(ReadBracket, TakesExposureAndCameraFromExif)
{
    const TemporaryFolder folder;
    const auto a = writeJpeg(folder, "a.jpg", {1.0 / 60, 4.0, 200.0});
    const auto b = writeJpeg(folder, "b.jpg", {1.0 / 15, 4.0, 200.0});
    const Bracket bracket = readBracket({a, b});
    EXPECT_EQ(bracket.frames[0].name, "b.jpg");
    EXPECT_NEAR(bracket.frames[0].relative_exposure, 2.0 / 15 / 16, 1e-9);
    EXPECT_NEAR(bracket.frames[1].relative_exposure, 2.0 / 60 / 16, 1e-9);
    EXPECT_EQ(bracket.metadata.model, "Model");
    EXPECT_TRUE(bracket.findings.empty());
}

TEST(ReadBracket, OverridesExifMemberByMember)
{
    const TemporaryFolder folder;
    const auto a = writeJpeg(folder, "a.jpg", {1.0 / 60, 4.0, 200.0});
    Exposure given;
    given.seconds = 0.5;
    const Bracket bracket = readBracket({a}, {given});
    EXPECT_NEAR(bracket.frames[0].relative_exposure, 0.5 * 2.0 / 16, 1e-9);
}

TEST(ReadBracket, NamesTheFileWithoutExposureAndTheRemedy)
{
    const TemporaryFolder folder;
    writeEncoded(folder / "room_03.png", grey(8, 8));
    const std::string message = messageOf([&] { (void)readBracket({folder / "room_03.png"}); });
    EXPECT_THAT(message, HasSubstr("room_03.png: no exposure time in EXIF; give --exposures 1/60"));
    EXPECT_THAT(message, HasSubstr("exposure_seconds"));
}

// A picture's middle stays in the middle; what a smaller one lacks may not be used.
TEST(ReadBracket, HandCutPicturesOfUnequalSizeComeToLieMiddleOnMiddle)
{
    const TemporaryFolder folder;
    EncodedImage large = grey(12, 10, 100);
    large.codes(6, 5) = glm::u16vec3(200);
    EncodedImage small = grey(10, 10, 50);
    small.codes(5, 5) = glm::u16vec3(150);
    writeEncoded(folder / "large.png", large);
    writeEncoded(folder / "small.png", small);
    const std::vector<std::filesystem::path> files = {folder / "large.png", folder / "small.png"};
    const std::vector<Exposure> times = {{1.0, {}, {}}, {0.5, {}, {}}};
    const Bracket bracket = readBracket(files, times, FrameSizes::HandCut);
    EXPECT_TRUE(bracket.hand_cut);
    EXPECT_TRUE(hasFinding(bracket.findings, "bracket-hand-cut"));
    EXPECT_TRUE(bracket.frames[0].excluded.empty());
    const BracketFrame& padded = bracket.frames[1];
    ASSERT_EQ(padded.image.codes.width(), 12);
    EXPECT_EQ(padded.image.codes(6, 5), glm::u16vec3(150));
    EXPECT_EQ(padded.image.codes(0, 4), glm::u16vec3(50));
    EXPECT_EQ(padded.excluded(0, 4), 1);
    EXPECT_EQ(padded.excluded(1, 4), 0);
    EXPECT_EQ(padded.excluded(10, 4), 0);
    EXPECT_EQ(padded.excluded(11, 4), 1);

    EXPECT_THAT(messageOf([&] { (void)readBracket(files, times); }), HasSubstr("same size"));
    writeEncoded(folder / "small.png", grey(8, 10));
    EXPECT_THAT(messageOf([&] { (void)readBracket(files, times, FrameSizes::HandCut); }),
                HasSubstr("too different"));
    writeEncoded(folder / "small.png", grey(12, 10));
    EXPECT_FALSE(readBracket(files, times, FrameSizes::HandCut).hand_cut);
}

TEST(ReadBracket, RefusesMissingFilesAndAnEmptyList)
{
    EXPECT_THAT(messageOf([] { (void)readBracket({"no/such/file.jpg"}); }),
                HasSubstr("no/such/file.jpg"));
    EXPECT_THROW((void)readBracket({}), InputError);
}

TEST(ReadBracket, ReportsMixedCamerasAndPartlyKnownExposures)
{
    const TemporaryFolder folder;
    const auto a = writeJpeg(folder, "a.jpg", {1.0 / 60, 4.0, 200.0});
    const auto b = writeJpeg(folder, "b.jpg", {1.0 / 15, std::nullopt, 200.0}, "Other");
    const Bracket bracket = readBracket({a, b});
    EXPECT_TRUE(hasFinding(bracket.findings, "bracket-mixed-cameras"));
    EXPECT_TRUE(hasFinding(bracket.findings, "bracket-partial-exposure"));
}

}  // namespace
}  // namespace insitu
