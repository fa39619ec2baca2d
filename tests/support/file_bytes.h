#pragma once

#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

namespace insitu {

/// All bytes of a file; "" if there is none.
inline std::string fileBytes(const std::filesystem::path& path)
{
    std::ifstream stream(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(stream), {}};
}

}  // namespace insitu
