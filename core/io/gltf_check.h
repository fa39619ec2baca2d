#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

namespace insitu {

/// What must be known of a glTF file before a parser without checks of its own may see it.

/// A buffer that lies in a file beside the model.
struct ExternalBuffer {
    std::string name;  ///< percent-decoded URI, not yet resolved
    std::int64_t byte_length = 0;
};

struct GltfOutline {
    bool binary = false;                           ///< .glb container
    std::vector<ExternalBuffer> external_buffers;  ///< in the order of `buffers`
    std::vector<std::string> extensions_used;
};

/// Checks container, JSON and what tinygltf takes on trust: chunk lengths; nesting (at most 64) and
/// number of JSON values (at most 1 million); glTF version 2; buffer sizes (sum at most
/// kMaxModelBytes) and the ranges of images inside buffers.
///
/// InputError names the cause, and each entry of `extensionsRequired` that is not implemented.
[[nodiscard]] GltfOutline checkGltf(std::span<const std::uint8_t> bytes,
                                    const std::filesystem::path& path);

/// Extensions whose meaning we honour.
[[nodiscard]] bool isGltfExtensionImplemented(const std::string& name);

/// "%20" becomes a blank; a broken escape stays as it is.
[[nodiscard]] std::string percentDecoded(const std::string& uri);

}  // namespace insitu
