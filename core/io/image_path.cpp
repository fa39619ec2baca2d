#include "core/io/image_path.h"

#include "core/io/file.h"

#include <algorithm>

namespace insitu {

std::string lowerCaseExtension(const std::filesystem::path& path)
{
    std::string extension = path.extension().string();
    std::transform(extension.begin(), extension.end(), extension.begin(), [](char c) {
        return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
    });
    return extension;
}

void writeBytes(const std::filesystem::path& path, std::span<const std::uint8_t> bytes)
{
    writeTextFile(path, {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
}

}  // namespace insitu
