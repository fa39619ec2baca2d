#include "apps/cli/terminal_progress.h"

#include <gmock/gmock.h>

#include <limits>
#include <sstream>

namespace insitu::cli {
namespace {

using testing::EndsWith;
using testing::HasSubstr;
using testing::Not;
using Style = TerminalProgress::Style;

/// A terminal that remembers, and a clock that stands still until told.
struct FakeTerminal {
    std::ostringstream out;
    double now = 100.0;
    std::atomic<bool> interrupted{false};

    TerminalProgress progress(Style style)
    {
        return TerminalProgress(
            out, style, [this] { return now; }, interrupted);
    }
    std::string take()
    {
        std::string text = out.str();
        out.str("");
        return text;
    }
};

TEST(TerminalProgress, LinesComeOncePerTenPercent)
{
    FakeTerminal terminal;
    TerminalProgress progress = terminal.progress(Style::Lines);
    for (int i = 0; i <= 1000; ++i)
        progress.report("render", i / 1000.0);
    const std::string text = terminal.take();
    EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 10);
    EXPECT_THAT(text, testing::StartsWith("render: 10 %\n"));
    EXPECT_THAT(text, EndsWith("render: 100 %\n"));
    EXPECT_THAT(text, Not(HasSubstr("\r")));
}

TEST(TerminalProgress, LinesStartAgainWithTheNextStage)
{
    FakeTerminal terminal;
    TerminalProgress progress = terminal.progress(Style::Lines);
    progress.report("merge", 1.0);
    progress.report("render", 0.2);
    EXPECT_EQ(terminal.take(), "merge: 100 %\nrender: 20 %\n");
}

// A quarter took 15 s, so three quarters take 45 s; a tenth of 400 s leaves an hour.
TEST(TerminalProgress, TimeLeftFollowsFromTheTimeTaken)
{
    FakeTerminal terminal;
    TerminalProgress progress = terminal.progress(Style::Lines);
    progress.report("render", 0.0);
    terminal.now += 15.0;
    progress.report("render", 0.25);
    EXPECT_EQ(terminal.take(), "render: 20 %, 0:45 left\n");
    progress.report("benchmark", 0.0);
    terminal.now += 400.0;
    progress.report("benchmark", 0.1);
    EXPECT_EQ(terminal.take(), "benchmark: 10 %, 1:00:00 left\n");
}

TEST(TerminalProgress, BarIsRedrawnInPlaceAndNotTooOften)
{
    FakeTerminal terminal;
    TerminalProgress progress = terminal.progress(Style::Bar);
    progress.report("render", 0.5);
    const std::string first = terminal.take();
    EXPECT_THAT(first, HasSubstr("[###############...............]  50 %"));
    EXPECT_THAT(first, Not(HasSubstr("\n")));
    terminal.now += 0.01;
    progress.report("render", 0.51);
    EXPECT_EQ(terminal.take(), "");
    terminal.now += 0.2;
    progress.report("render", 0.52);
    EXPECT_THAT(terminal.take(), testing::StartsWith("\r\x1b[K"));
}

TEST(TerminalProgress, ClearRemovesTheBarOnce)
{
    FakeTerminal terminal;
    TerminalProgress progress = terminal.progress(Style::Bar);
    progress.clear();
    EXPECT_EQ(terminal.take(), "");
    progress.report("render", 0.5);
    (void)terminal.take();
    progress.clear();
    EXPECT_EQ(terminal.take(), "\r\x1b[K");
    progress.clear();
    EXPECT_EQ(terminal.take(), "");
}

TEST(TerminalProgress, SilentSaysNothing)
{
    FakeTerminal terminal;
    TerminalProgress progress = terminal.progress(Style::Silent);
    progress.report("render", 0.5);
    progress.clear();
    EXPECT_EQ(terminal.take(), "");
}

TEST(TerminalProgress, SurvivesFractionsThatAreNone)
{
    FakeTerminal terminal;
    TerminalProgress progress = terminal.progress(Style::Bar);
    progress.report("render", std::numeric_limits<double>::quiet_NaN());
    EXPECT_THAT(terminal.take(), HasSubstr("  0 %"));
    terminal.now += 1.0;
    progress.report("render", 17.0);
    EXPECT_THAT(terminal.take(), HasSubstr("100 %"));
}

TEST(TerminalProgress, InterruptionReachesTheCheckpoint)
{
    FakeTerminal terminal;
    const TerminalProgress progress = terminal.progress(Style::Silent);
    EXPECT_NO_THROW(progress.checkpoint());
    terminal.interrupted = true;
    EXPECT_THROW(progress.checkpoint(), CancelledError);
}

}  // namespace
}  // namespace insitu::cli
