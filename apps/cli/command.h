#pragma once

#include "core/finding.h"
#include "core/progress.h"

#include <CLI/CLI.hpp>

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>

namespace insitu::cli {

/// Exit codes of every command.
enum ExitCode {
    kDone = 0,
    kFailed = 1,
    kWrongUsage = 2,
    kNoAnswer = 3,
    kStrictWarning = 4,
    kInterrupted = 130
};

/// Flags every command has.
struct CommonOptions {
    bool force = false;   ///< --force: overwrite outputs
    bool quiet = false;   ///< -q: only errors
    bool strict = false;  ///< --strict: a warning makes the exit code 4
    int threads = 0;      ///< --threads: 0 = all
    std::uint64_t seed = 1;
    std::string color = "auto";  ///< --color: auto (a terminal without NO_COLOR), always, never
};

class TerminalProgress;

/// What a command uses to talk to the user; one per run.
class Context {
public:
    CommonOptions options;
    int exit_code = kDone;

    /// Adds --force, -q, --strict, --threads, --seed, --color to a subcommand.
    void addCommonOptions(CLI::App& command);
    /// To be called first by every command: applies --threads.
    void start();
    /// InputError when `path` exists and --force was not given, when its folder is missing or when
    /// it is itself a folder. To be called before the work, for every output.
    void checkOutput(const std::filesystem::path& path) const;
    /// Findings to stderr with their codes; remembers warnings for --strict.
    void print(const Findings& findings);
    /// One line on stderr, printed even with --quiet: why the run failed.
    void printError(const std::string& message);
    /// A bar with ETA on a terminal, a line per 10 % otherwise, nothing with --quiet. Cancelled by
    /// Ctrl-C.
    [[nodiscard]] Progress& progress();

    Context();
    ~Context();

private:
    void printLabelled(Severity severity, const std::string& code, const std::string& message);

    std::unique_ptr<TerminalProgress> progress_;
};

/// One function per command file: adds the subcommand and its callback to `app`.
void registerMerge(CLI::App& app, Context& context);
void registerProbe(CLI::App& app, Context& context);
void registerCalibrate(CLI::App& app, Context& context);
void registerInsert(CLI::App& app, Context& context);
void registerTonemap(CLI::App& app, Context& context);
void registerCompare(CLI::App& app, Context& context);
void registerReconstruct(CLI::App& app, Context& context);
void registerMesh(CLI::App& app, Context& context);
void registerInfo(CLI::App& app, Context& context);
void registerSimulate(CLI::App& app, Context& context);

}  // namespace insitu::cli
