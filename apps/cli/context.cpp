#include "apps/cli/command.h"
#include "apps/cli/terminal_progress.h"
#include "core/parallel.h"

#include <fmt/format.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <iostream>

namespace insitu::cli {

namespace {

/// Set by Ctrl-C; the only thing a signal handler may touch.
std::atomic<bool> interrupted{false};
static_assert(std::atomic<bool>::is_always_lock_free);

/// The first Ctrl-C asks the command to stop at its next checkpoint, the second ends the process.
extern "C" void onInterrupt(int signal)
{
    interrupted.store(true);
    std::signal(signal, SIG_DFL);
}

double monotonicSeconds()
{
    using Seconds = std::chrono::duration<double>;
    return Seconds(std::chrono::steady_clock::now().time_since_epoch()).count();
}

bool wantsColor(const std::string& choice)
{
    if (choice != "auto") return choice == "always";
    const char* no_color = std::getenv("NO_COLOR");
    return (no_color == nullptr || *no_color == '\0') && ::isatty(STDERR_FILENO) == 1;
}

/// ANSI colour of a label: red, yellow, cyan.
const char* colorCode(Severity severity)
{
    switch (severity) {
        case Severity::Info:
            return "\x1b[36m";
        case Severity::Warning:
            return "\x1b[33m";
        case Severity::Error:
            return "\x1b[31m";
    }
    return "";
}

}  // namespace

Context::Context()
{
    std::signal(SIGINT, onInterrupt);
}

Context::~Context() = default;

void Context::addCommonOptions(CLI::App& command)
{
    const char* group = "Common options";
    command.add_flag("--force", options.force, "Overwrite existing output files")->group(group);
    command.add_flag("-q,--quiet", options.quiet, "Print nothing but errors")->group(group);
    command.add_flag("--strict", options.strict, "End with exit code 4 when there was a warning")
        ->group(group);
    command.add_option("-j,--threads", options.threads, "Threads to use; 0 = all cores")
        ->check(CLI::Range(0, 1024))
        ->capture_default_str()
        ->group(group);
    command.add_option("--seed", options.seed, "Seed of all random numbers; same seed, same bytes")
        ->capture_default_str()
        ->group(group);
    command.add_option("--color", options.color, "Colour of messages: auto, always or never")
        ->check(CLI::IsMember({"auto", "always", "never"}))
        ->capture_default_str()
        ->group(group);
}

void Context::start()
{
    setThreadCount(options.threads);
}

void Context::checkOutput(const std::filesystem::path& path) const
{
    if (path.empty()) throw InputError("output", "the name is empty; give a file name");
    if (path == "-") return;
    std::error_code error;
    if (std::filesystem::is_directory(path, error))
        throw InputError(path.string(), "is a folder; give a file name");
    const std::filesystem::path folder = path.has_parent_path() ? path.parent_path() : ".";
    if (!std::filesystem::is_directory(folder, error))
        throw InputError(path.string(), "its folder does not exist; create it first");
    if (!options.force && std::filesystem::exists(path, error))
        throw InputError(path.string(), "exists already; give --force to overwrite it");
}

void Context::print(const Findings& findings)
{
    for (const Finding& finding : findings) {
        if (finding.severity != Severity::Info && options.strict && exit_code == kDone)
            exit_code = kStrictWarning;
        if (options.quiet && finding.severity != Severity::Error) continue;
        printLabelled(finding.severity, finding.code, finding.message);
    }
}

void Context::printError(const std::string& message)
{
    printLabelled(Severity::Error, "", message);
}

Progress& Context::progress()
{
    if (!progress_) {
        using Style = TerminalProgress::Style;
        Style style = ::isatty(STDERR_FILENO) == 1 ? Style::Bar : Style::Lines;
        if (options.quiet) style = Style::Silent;
        progress_ =
            std::make_unique<TerminalProgress>(std::cerr, style, monotonicSeconds, interrupted);
    }
    return *progress_;
}

void Context::printLabelled(Severity severity, const std::string& code, const std::string& message)
{
    if (progress_) progress_->clear();
    const bool color = wantsColor(options.color);
    std::cerr << fmt::format("insitu: {}{}{}{}: {}\n",
                             color ? colorCode(severity) : "",
                             severityName(severity),
                             color ? "\x1b[0m" : "",
                             code.empty() ? "" : " [" + code + "]",
                             message);
}

}  // namespace insitu::cli
