#include "core/io/file.h"

#include "tests/support/errors.h"
#include "tests/support/temporary_folder.h"

#include <gmock/gmock.h>

namespace insitu {
namespace {

using testing::HasSubstr;

TEST(File, ReadsWhatWasWritten)
{
    const TemporaryFolder folder;
    const std::string text("a\0b\r\n\xFF", 6);
    writeTextFile(folder / "a.txt", text);
    const std::vector<std::uint8_t> bytes = readFile(folder / "a.txt");
    EXPECT_EQ(std::string(bytes.begin(), bytes.end()), text);
    EXPECT_TRUE(readFile(folder.add("empty", "")).empty());
    EXPECT_EQ(folder.size(), 2u);
}

TEST(File, RefusesWithTheCause)
{
    const TemporaryFolder folder;
    EXPECT_THAT(inputErrorOf([&] { (void)readFile(folder / "no"); }), HasSubstr("no such file"));
    EXPECT_THAT(inputErrorOf([&] { (void)readFile(folder.path()); }), HasSubstr("not a file"));
    const auto path = folder.add("a", "12345");
    EXPECT_NO_THROW((void)readFile(path, 5));
    EXPECT_THAT(inputErrorOf([&] { (void)readFile(path, 4); }), HasSubstr("at most 4"));
    EXPECT_THAT(inputErrorOf([&] { writeTextFile(folder / "no" / "a", "x"); }),
                HasSubstr("cannot be written"));
}

TEST(File, AFailedWriteLeavesTheOldFileAlone)
{
    const TemporaryFolder folder;
    const auto path = folder.add("a.txt", "old");
    const auto failing = [](const std::filesystem::path& temporary) {
        EXPECT_EQ(temporary.extension(), ".txt");
        writeTextFile(temporary, "half a fi");
        throw InputError("a.txt", "the disk is full");
    };
    EXPECT_THROW(writeAtomically(path, failing), InputError);
    const std::vector<std::uint8_t> bytes = readFile(path);
    EXPECT_EQ(std::string(bytes.begin(), bytes.end()), "old");
    EXPECT_EQ(folder.size(), 1u);
}

TEST(File, OverwritesInOneStep)
{
    const TemporaryFolder folder;
    const auto path = folder.add("a.txt", "old and longer");
    writeTextFile(path, "new");
    EXPECT_EQ(readFile(path).size(), 3u);
    EXPECT_THAT(inputErrorOf([&] { writeTextFile(folder.path(), "x"); }),
                HasSubstr("cannot be written"));
}

}  // namespace
}  // namespace insitu
