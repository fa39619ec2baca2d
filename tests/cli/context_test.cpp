#include "apps/cli/command.h"
#include "apps/cli/terminal_progress.h"
#include "tests/support/temporary_folder.h"

#include <gmock/gmock.h>

#include <csignal>
#include <fstream>

namespace insitu::cli {
namespace {

using testing::HasSubstr;

std::string refusal(const Context& context, const std::filesystem::path& path)
{
    try {
        context.checkOutput(path);
    } catch (const InputError& error) {
        return error.what();
    }
    return "";
}

TEST(Context, RefusesToOverwriteUnlessForced)
{
    const TemporaryFolder folder;
    Context context;
    EXPECT_EQ(refusal(context, folder / "new.png"), "");
    std::ofstream(folder / "old.png") << "mine";
    EXPECT_THAT(refusal(context, folder / "old.png"), HasSubstr("--force"));
    context.options.force = true;
    EXPECT_EQ(refusal(context, folder / "old.png"), "");
}

TEST(Context, RefusesOutputsThatCannotBeWritten)
{
    const TemporaryFolder folder;
    Context context;
    context.options.force = true;
    EXPECT_THAT(refusal(context, folder / "missing" / "new.png"), HasSubstr("does not exist"));
    EXPECT_THAT(refusal(context, folder.path()), HasSubstr("is a folder"));
    EXPECT_THAT(refusal(context, ""), HasSubstr("empty"));
    EXPECT_EQ(refusal(context, "-"), "");
}

TEST(Context, FindingsGoToStderrWithTheirCodes)
{
    Context context;
    context.options.color = "never";
    testing::internal::CaptureStderr();
    context.print({{Severity::Warning, "probe-clipped", "a lamp is white in every picture"}});
    EXPECT_EQ(testing::internal::GetCapturedStderr(),
              "insitu: warning [probe-clipped]: a lamp is white in every picture\n");
    EXPECT_EQ(context.exit_code, kDone);
}

TEST(Context, QuietKeepsErrors)
{
    Context context;
    context.options.color = "never";
    context.options.quiet = true;
    testing::internal::CaptureStderr();
    context.print({{Severity::Warning, "a", "hidden"}, {Severity::Error, "b", "shown"}});
    context.progress().report("render", 1.0);
    context.printError("why it failed");
    EXPECT_EQ(testing::internal::GetCapturedStderr(),
              "insitu: error [b]: shown\ninsitu: error: why it failed\n");
}

TEST(Context, StrictTurnsAWarningIntoTheExitCode)
{
    Context context;
    context.options.strict = true;
    context.options.quiet = true;
    context.print({{Severity::Info, "a", "good to know"}});
    EXPECT_EQ(context.exit_code, kDone);
    context.print({{Severity::Warning, "b", "doubtful"}});
    EXPECT_EQ(context.exit_code, kStrictWarning);
    context.exit_code = kNoAnswer;
    context.print({{Severity::Warning, "b", "doubtful"}});
    EXPECT_EQ(context.exit_code, kNoAnswer);
}

TEST(Context, ColorIsAskedForOrNot)
{
    Context context;
    testing::internal::CaptureStderr();
    context.options.color = "always";
    context.printError("why");
    EXPECT_THAT(testing::internal::GetCapturedStderr(), HasSubstr("\x1b[31merror\x1b[0m"));
    testing::internal::CaptureStderr();
    context.options.color = "auto";  // not a terminal here
    context.printError("why");
    EXPECT_EQ(testing::internal::GetCapturedStderr(), "insitu: error: why\n");
}

// Last in this file: an interruption is for the whole process and stays.
TEST(ContextLast, FirstInterruptAsksTheSecondEnds)
{
    Context context;
    EXPECT_FALSE(context.progress().cancelled());
    EXPECT_EXIT(
        {
            std::raise(SIGINT);
            std::raise(SIGINT);
        },
        testing::KilledBySignal(SIGINT),
        "");
    std::raise(SIGINT);
    EXPECT_TRUE(context.progress().cancelled());
}

}  // namespace
}  // namespace insitu::cli
