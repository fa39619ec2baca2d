#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

namespace insitu {

/// Whole file; InputError when missing, a folder, unreadable or larger than `max_bytes`.
[[nodiscard]] std::vector<std::uint8_t> readFile(const std::filesystem::path& path,
                                                 std::int64_t max_bytes = 4LL << 30);

/// Calls `write` with a temporary name beside `path` (same extension), then renames it to `path`.
/// The temporary file is removed when `write` throws.
void writeAtomically(const std::filesystem::path& path,
                     const std::function<void(const std::filesystem::path&)>& write);
/// A name beside `path` that no other call gives, with the same extension.
[[nodiscard]] std::filesystem::path temporaryName(const std::filesystem::path& path);
/// Gives a temporary file its name; InputError, the file removed, when that fails.
void renameInPlace(const std::filesystem::path& temporary, const std::filesystem::path& path);
void writeTextFile(const std::filesystem::path& path, std::string_view text);

}  // namespace insitu
