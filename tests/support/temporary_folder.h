#pragma once

#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace insitu {

/// A new empty folder that goes away with the object. Its name holds the process, so that tests
/// may run side by side.
class TemporaryFolder {
public:
    TemporaryFolder()
    {
        static int count = 0;
        path_ = std::filesystem::temp_directory_path() /
                ("insitu-test-" + std::to_string(::getpid()) + "-" + std::to_string(count++));
        std::filesystem::create_directories(path_);
    }
    ~TemporaryFolder()
    {
        std::error_code ignored;
        std::filesystem::remove_all(path_, ignored);
    }
    TemporaryFolder(const TemporaryFolder&) = delete;
    TemporaryFolder& operator=(const TemporaryFolder&) = delete;

    [[nodiscard]] const std::filesystem::path& path() const { return path_; }
    [[nodiscard]] std::filesystem::path operator/(std::string_view name) const
    {
        return path_ / name;
    }
    /// Writes a file of these bytes and returns its path.
    std::filesystem::path add(std::string_view name, std::string_view bytes) const
    {
        std::ofstream(path_ / name, std::ios::binary) << bytes;
        return path_ / name;
    }
    std::filesystem::path add(std::string_view name, std::span<const std::uint8_t> bytes) const
    {
        return add(name,
                   std::string_view(reinterpret_cast<const char*>(bytes.data()), bytes.size()));
    }
    /// Number of entries: to see that nothing temporary was left behind.
    [[nodiscard]] std::size_t size() const
    {
        const std::filesystem::directory_iterator entries(path_);
        return static_cast<std::size_t>(std::distance(begin(entries), end(entries)));
    }

private:
    std::filesystem::path path_;
};

}  // namespace insitu
