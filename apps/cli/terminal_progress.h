#pragma once

#include "core/progress.h"

#include <atomic>
#include <functional>
#include <iosfwd>
#include <string>

namespace insitu::cli {

/// Draws the progress of a command: on a terminal one line that is redrawn (bar, per cent, time
/// left), elsewhere a line per 10 %, so that a log stays short.
class TerminalProgress : public Progress {
public:
    enum class Style { Bar, Lines, Silent };

    /// `seconds` is a monotonic clock; `interrupted` is set from outside (Ctrl-C) and makes
    /// cancelled() true. All three references must outlive this object.
    TerminalProgress(std::ostream& out,
                     Style style,
                     std::function<double()> seconds,
                     const std::atomic<bool>& interrupted);

    /// A repeated stage name continues the stage; another one starts the next.
    void report(std::string_view stage, double fraction) override;
    [[nodiscard]] bool cancelled() const override { return interrupted_.load(); }

    /// Removes the bar, so that a message can be printed in its place.
    void clear();

private:
    void startStage(std::string_view stage);
    void drawBar(double fraction);
    void printLine(double fraction);
    /// ", 1:05 left", or nothing while it would be a guess.
    [[nodiscard]] std::string timeLeft(double fraction) const;

    std::ostream& out_;
    Style style_;
    std::function<double()> seconds_;
    const std::atomic<bool>& interrupted_;
    std::string stage_;
    double stage_start_ = 0.0;
    double last_drawn_ = 0.0;
    int last_tenth_ = 0;
    bool bar_visible_ = false;
};

}  // namespace insitu::cli
