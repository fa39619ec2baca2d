#pragma once

#include <nlohmann/json.hpp>

#include <filesystem>
#include <fstream>

namespace insitu {

/// A JSON file as it is, keys in their order.
inline nlohmann::ordered_json readJsonFile(const std::filesystem::path& path)
{
    std::ifstream stream(path);
    return nlohmann::ordered_json::parse(stream);
}

}  // namespace insitu
