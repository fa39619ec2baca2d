#pragma once

#include "tests/support/file_bytes.h"
#include "tests/support/temporary_folder.h"

#include <sys/wait.h>

#include <cstdlib>
#include <string>
#include <vector>

namespace insitu {

/// What a run of the program gave.
struct ProgramRun {
    int exit_code = -1;
    std::string output;    ///< stdout
    std::string messages;  ///< stderr
};

/// Runs the program under test (INSITU_PROGRAM) with these arguments, no terminal and an empty
/// cache.
inline ProgramRun runProgram(const std::vector<std::string>& arguments)
{
    const TemporaryFolder scratch;
    std::string command =
        "INSITU_CACHE='" + (scratch / "cache").string() + "' '" INSITU_PROGRAM "'";
    for (const std::string& argument : arguments)
        command += " '" + argument + "'";
    command += " >'" + (scratch / "out").string() + "' 2>'" + (scratch / "err").string() + "'";
    const int status = std::system(command.c_str());
    return {WIFEXITED(status) ? WEXITSTATUS(status) : -1,
            fileBytes(scratch / "out"),
            fileBytes(scratch / "err")};
}

}  // namespace insitu
