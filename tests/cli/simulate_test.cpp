#include "core/io/image_io.h"
#include "tests/cli/run_program.h"

#include <gmock/gmock.h>

namespace insitu {
namespace {

using testing::HasSubstr;

/// The shipped sample's room, in pictures of a few pixels.
std::vector<std::string> smallRun(const std::filesystem::path& folder)
{
    return {"simulate",
            INSITU_SOURCE_DIR "/samples/simulated-room/room.json",
            "-o",
            folder.string(),
            "--size",
            "0.03",
            "--samples",
            "1",
            "-q"};
}

TEST(SimulateCommand, MakesASmallerCaptureOfTheSample)
{
    const TemporaryFolder folder;
    const std::filesystem::path out = folder / "capture";
    const ProgramRun run = runProgram(smallRun(out));
    EXPECT_EQ(run.exit_code, 0) << run.messages;
    const Photo plate = readPhoto(out / "plate.jpg");
    EXPECT_EQ(plate.image.codes.width(), 38);
    EXPECT_EQ(plate.image.codes.height(), 29);
    for (const char* name : {"project.json", "lines.json", "truth/truth.jpg", "truth/truth.json"})
        EXPECT_TRUE(std::filesystem::exists(out / name)) << name;

    // Again: refused without --force.
    const ProgramRun again = runProgram(smallRun(out));
    EXPECT_EQ(again.exit_code, 1);
    EXPECT_THAT(again.messages, HasSubstr("--force"));
}

TEST(SimulateCommand, FailsOnAMissingRoomAndLeavesNothing)
{
    const TemporaryFolder folder;
    const ProgramRun run = runProgram(
        {"simulate", (folder / "no.json").string(), "-o", (folder / "capture").string()});
    EXPECT_EQ(run.exit_code, 1);
    EXPECT_THAT(run.messages, HasSubstr("no.json"));
    EXPECT_FALSE(std::filesystem::exists(folder / "capture"));
}

TEST(SimulateCommand, WrongSizeIsWrongUsage)
{
    EXPECT_EQ(runProgram({"simulate", "room.json", "-o", "x", "--size", "2"}).exit_code, 2);
}

}  // namespace
}  // namespace insitu
