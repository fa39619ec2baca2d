#include "apps/cli/terminal_progress.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <ostream>

namespace insitu::cli {

namespace {

constexpr int kBarWidth = 30;
constexpr double kRedrawSeconds = 0.1;
/// An estimate from less than this is a guess and not shown.
constexpr double kEstimateAfterSeconds = 1.0;
constexpr double kEstimateAfterFraction = 0.02;

}  // namespace

TerminalProgress::TerminalProgress(std::ostream& out,
                                   Style style,
                                   std::function<double()> seconds,
                                   const std::atomic<bool>& interrupted)
    : out_(out), style_(style), seconds_(std::move(seconds)), interrupted_(interrupted)
{
}

void TerminalProgress::report(std::string_view stage, double fraction)
{
    if (style_ == Style::Silent) return;
    if (stage != stage_) startStage(stage);
    const double clamped = std::isfinite(fraction) ? std::clamp(fraction, 0.0, 1.0) : 0.0;
    if (style_ == Style::Bar)
        drawBar(clamped);
    else
        printLine(clamped);
}

void TerminalProgress::clear()
{
    if (!bar_visible_) return;
    out_ << "\r\x1b[K" << std::flush;
    bar_visible_ = false;
}

void TerminalProgress::startStage(std::string_view stage)
{
    clear();
    stage_ = stage;
    stage_start_ = seconds_();
    last_drawn_ = -std::numeric_limits<double>::infinity();
    last_tenth_ = 0;
}

void TerminalProgress::drawBar(double fraction)
{
    const double now = seconds_();
    if (now - last_drawn_ < kRedrawSeconds && fraction < 1.0) return;
    last_drawn_ = now;
    const int filled = static_cast<int>(std::floor(fraction * kBarWidth));
    out_ << fmt::format("\r\x1b[K{:<24.24} [{}{}] {:3.0f} %{}",
                        stage_,
                        std::string(static_cast<std::size_t>(filled), '#'),
                        std::string(static_cast<std::size_t>(kBarWidth - filled), '.'),
                        std::floor(100.0 * fraction),
                        timeLeft(fraction))
         << std::flush;
    bar_visible_ = true;
}

void TerminalProgress::printLine(double fraction)
{
    const int tenth = static_cast<int>(std::floor(fraction * 10.0 + 1e-9));
    if (tenth <= last_tenth_) return;
    last_tenth_ = tenth;
    out_ << fmt::format("{}: {} %{}\n", stage_, 10 * tenth, timeLeft(fraction)) << std::flush;
}

std::string TerminalProgress::timeLeft(double fraction) const
{
    const double elapsed = seconds_() - stage_start_;
    if (elapsed < kEstimateAfterSeconds || fraction < kEstimateAfterFraction || fraction >= 1.0)
        return "";
    const int left = static_cast<int>(std::ceil(elapsed * (1.0 - fraction) / fraction));
    if (left >= 3600)
        return fmt::format(", {}:{:02}:{:02} left", left / 3600, left / 60 % 60, left % 60);
    return fmt::format(", {}:{:02} left", left / 60, left % 60);
}

}  // namespace insitu::cli
