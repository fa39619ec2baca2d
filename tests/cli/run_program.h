#pragma once

#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

namespace insitu {

/// What a run of the program gave.
struct ProgramRun {
    int exit_code = -1;
    std::string output;    ///< stdout
    std::string messages;  ///< stderr
};

/// A folder of its own for one test, removed with it.
class ScratchFolder {
public:
    ScratchFolder()
    {
        std::string name = (std::filesystem::temp_directory_path() / "insitu-XXXXXX").string();
        if (::mkdtemp(name.data()) == nullptr) std::abort();
        folder_ = name;
    }
    ~ScratchFolder() { std::filesystem::remove_all(folder_); }
    ScratchFolder(const ScratchFolder&) = delete;
    ScratchFolder& operator=(const ScratchFolder&) = delete;

    [[nodiscard]] std::filesystem::path operator/(const std::string& name) const
    {
        return folder_ / name;
    }
    [[nodiscard]] std::vector<std::string> names() const
    {
        std::vector<std::string> names;
        for (const auto& entry : std::filesystem::directory_iterator(folder_))
            names.push_back(entry.path().filename().string());
        return names;
    }

private:
    std::filesystem::path folder_;
};

/// Runs the program under test (INSITU_PROGRAM) with these arguments and no terminal.
inline ProgramRun runProgram(const std::vector<std::string>& arguments)
{
    const ScratchFolder scratch;
    std::string command = "'" INSITU_PROGRAM "'";
    for (const std::string& argument : arguments)
        command += " '" + argument + "'";
    command += " >'" + (scratch / "out").string() + "' 2>'" + (scratch / "err").string() + "'";
    const int status = std::system(command.c_str());
    const auto textOf = [&](const char* name) {
        std::ifstream stream(scratch / name);
        return std::string(std::istreambuf_iterator<char>(stream), {});
    };
    return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, textOf("out"), textOf("err")};
}

}  // namespace insitu
