#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>

namespace insitu {

/// ".exr" for "A.EXR": how the writers choose the format.
[[nodiscard]] std::string lowerCaseExtension(const std::filesystem::path& path);

/// The bytes under a temporary name, then renamed; InputError when they cannot be written.
void writeBytes(const std::filesystem::path& path, std::span<const std::uint8_t> bytes);

}  // namespace insitu
