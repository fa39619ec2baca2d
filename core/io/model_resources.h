#pragma once

#include "core/mesh.h"

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>

namespace insitu {

/// Files and images that a model file names. Used by the model readers, not by callers.

/// A model file, and each file that it names, is read only up to this size.
inline constexpr std::int64_t kMaxModelBytes = 1LL << 30;
/// A model may have at most this many vertices or corners of faces (some 3 GB while it is read).
inline constexpr std::size_t kMaxModelElements = 20'000'000;
/// 16384 x 8192: a texture larger than this is refused before it is decoded.
inline constexpr std::int64_t kMaxTexturePixels = 1LL << 27;

/// InputError naming `path` when `count` exceeds kMaxModelElements.
void checkElementCount(std::uint64_t count, const std::string& path);

/// The file that a model names, which must lie in the model's own folder or below it.
///
/// Backslashes count as slashes. InputError naming `model`: an empty or absolute name, a drive
/// letter or scheme, a "..", or a symbolic link that leaves the folder. The file need not exist.
[[nodiscard]] std::filesystem::path resourceBeside(const std::filesystem::path& model,
                                                   std::string_view name);

/// Decodes a PNG, JPEG or TIFF (8 or 16 bit, grey or colour, with or without alpha) into RGBA.
///
/// Embedded orientation is not applied (texture coordinates refer to stored rows). The
/// header is checked first (parseEncodedHeader, kMaxTexturePixels). `name` is for messages.
/// InputError: another format, damaged, too large.
[[nodiscard]] Image<glm::u8vec4> decodeTexture(std::span<const std::uint8_t> bytes,
                                               const std::string& name);

/// Decodes an image that a model holds and appends it to `model.textures`; its index, or kNoTexture
/// with finding "model-texture-unreadable". All textures of a model together hold at most
/// kMaxTexturePixels, else InputError.
[[nodiscard]] int addTexture(Model& model,
                             std::span<const std::uint8_t> bytes,
                             const std::string& name,
                             bool srgb);

/// Reads a texture named by a model and appends it to `model.textures`; its index, or kNoTexture
/// with finding "model-texture-missing" or "model-texture-unreadable" when it cannot be used.
/// A name that leaves the folder is an InputError (see resourceBeside).
[[nodiscard]] int addTextureFile(Model& model,
                                 const std::filesystem::path& model_path,
                                 std::string_view name,
                                 bool srgb);

}  // namespace insitu
