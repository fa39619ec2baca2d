#include "apps/cli/command.h"

#include <fmt/format.h>

#include <iostream>
#include <iterator>
#include <new>

namespace insitu::cli {
namespace {

using RegisterCommand = void (*)(CLI::App&, Context&);

/// Every command, in the order of the help text: the order in which a project uses them.
constexpr RegisterCommand kCommands[] = {
    registerMerge,
    registerProbe,
    registerCalibrate,
    registerInsert,
    registerTonemap,
    registerCompare,
    registerReconstruct,
    registerMesh,
    registerInfo,
    registerSimulate,
};

std::string versionText()
{
    return fmt::format("insitu {}\nbuilt by {} ({}), C++{}\nwith {}",
                       INSITU_VERSION,
                       INSITU_COMPILER,
                       INSITU_BUILD_TYPE,
                       __cplusplus / 100 % 100,
                       INSITU_LIBRARIES);
}

/// CLI11 knows a hundred codes; ours has one: wrong usage. Asking for help is no failure.
int exitFromParser(const CLI::App& app, const CLI::ParseError& error)
{
    return app.exit(error, std::cout, std::cerr) == 0 ? kDone : kWrongUsage;
}

/// Parses and runs the command; the only place of the program that catches exceptions.
int run(CLI::App& app, Context& context, int argc, char** argv)
{
    try {
        app.parse(argc, argv);
        std::cout.flush();
        if (!std::cout) throw InputError("stdout", "cannot be written");
        return context.exit_code;
    } catch (const CLI::ParseError& error) {
        return exitFromParser(app, error);
    } catch (const NoAnswerError& error) {
        context.printError(error.what());
        return kNoAnswer;
    } catch (const CancelledError&) {
        context.printError("interrupted; nothing half-written is left");
        return kInterrupted;
    } catch (const LogicError& error) {
        context.printError(fmt::format("internal error, please report it: {}", error.what()));
        return kFailed;
    } catch (const std::bad_alloc&) {
        context.printError("out of memory; try a smaller image or fewer samples");
        return kFailed;
    } catch (const std::exception& error) {
        context.printError(error.what());
        return kFailed;
    }
}

}  // namespace
}  // namespace insitu::cli

int main(int argc, char** argv)
{
    CLI::App app{"Puts virtual furniture into photographs of real rooms.", "insitu"};
    app.set_version_flag("--version", insitu::cli::versionText);
    app.require_subcommand(1);
    app.footer(
        "Exit codes: 0 done, 1 failed, 2 wrong usage, 3 no answer, 4 warning with --strict,\n"
        "130 interrupted. 'insitu COMMAND --help' explains a command.");
    insitu::cli::Context context;
    for (const auto& registerCommand : insitu::cli::kCommands)
        registerCommand(app, context);
    return insitu::cli::run(app, context, argc, argv);
}
