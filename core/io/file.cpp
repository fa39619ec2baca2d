#include "core/io/file.h"

#include "core/check.h"

#include <unistd.h>

#include <atomic>
#include <fstream>

namespace insitu {

namespace fs = std::filesystem;

std::vector<std::uint8_t> readFile(const fs::path& path, std::int64_t max_bytes)
{
    std::error_code error;
    if (!fs::exists(path, error)) throw InputError(path.string(), "no such file");
    if (!fs::is_regular_file(path, error)) throw InputError(path.string(), "not a file");
    const auto size = fs::file_size(path, error);
    if (error) throw InputError(path.string(), "cannot be read: " + error.message());
    if (size > static_cast<std::uintmax_t>(max_bytes))
        throw InputError(path.string(),
                         fmt::format("is {} bytes; at most {} are read", size, max_bytes));
    std::ifstream stream(path, std::ios::binary);
    std::vector<std::uint8_t> bytes(static_cast<std::size_t>(size));
    if (!stream || (size > 0 && !stream.read(reinterpret_cast<char*>(bytes.data()),
                                             static_cast<std::streamsize>(size))))
        throw InputError(path.string(), "cannot be read");
    return bytes;
}

fs::path temporaryName(const fs::path& path)
{
    static std::atomic<unsigned> counter{0};
    return path.parent_path() / fmt::format(".{}.{}-{}{}",
                                            path.stem().string(),
                                            ::getpid(),
                                            counter.fetch_add(1),
                                            path.extension().string());
}

void renameInPlace(const fs::path& temporary, const fs::path& path)
{
    std::error_code error;
    fs::rename(temporary, path, error);
    if (!error) return;
    const std::string cause = error.message();
    fs::remove(temporary, error);
    throw InputError(path.string(), "cannot be written: " + cause);
}

void writeAtomically(const fs::path& path, const std::function<void(const fs::path&)>& write)
{
    const fs::path temporary = temporaryName(path);
    try {
        write(temporary);
    } catch (...) {
        std::error_code error;
        fs::remove(temporary, error);
        throw;
    }
    renameInPlace(temporary, path);
}

void writeTextFile(const fs::path& path, std::string_view text)
{
    writeAtomically(path, [&](const fs::path& temporary) {
        std::ofstream stream(temporary, std::ios::binary);
        stream.write(text.data(), static_cast<std::streamsize>(text.size()));
        stream.flush();
        if (!stream) throw InputError(path.string(), "cannot be written");
    });
}

}  // namespace insitu
