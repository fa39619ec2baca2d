#include "core/io/gltf_check.h"

#include "core/check.h"
#include "core/io/byte_view.h"
#include "core/io/model_resources.h"

#include <fmt/ranges.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <string_view>

namespace insitu {

namespace {

using Json = nlohmann::json;

constexpr int kMaxDepth = 64;
// tinygltf keeps up to some 600 bytes for one value of JSON; furniture has a few thousand values.
constexpr std::int64_t kMaxJsonValues = 1'000'000;

/// The JSON text of a glTF file and the length of its binary chunk.
struct Container {
    std::span<const std::uint8_t> json;
    std::int64_t binary_length = 0;
};

// glTF 2.0, section 4.4 (binary glTF layout): 12-byte header, JSON chunk, optional BIN chunk.
Container openBinary(std::span<const std::uint8_t> bytes, const std::string& path)
{
    constexpr std::uint32_t kJsonChunk = 0x4E4F534A;
    constexpr std::uint32_t kBinaryChunk = 0x004E4942;
    const ByteView view(bytes, path, ByteOrder::Little);
    if (view.u32(4) != 2)
        throw InputError(path, fmt::format("binary glTF version {}; only 2 is read", view.u32(4)));
    const std::size_t length = view.u32(8);
    if (length > bytes.size())
        throw InputError(
            path,
            fmt::format("declares {} bytes but has {}; the file is cut off", length, bytes.size()));
    const std::size_t json_length = view.u32(12);
    if (view.u32(16) != kJsonChunk) throw InputError(path, "byte 16", "no JSON chunk");
    if (json_length > length - 20 || length < 20)
        throw InputError(path, "byte 12", "the JSON chunk is longer than the file");
    Container result;
    result.json = view.slice(20, json_length);
    const std::size_t next = 20 + json_length;
    if (next == length) return result;
    if (length - next < 8)
        throw InputError(path, fmt::format("byte {}", next), "a chunk is cut off");
    const std::size_t binary_length = view.u32(next);
    if (view.u32(next + 4) != kBinaryChunk)
        throw InputError(path, fmt::format("byte {}", next + 4), "no binary chunk");
    if (binary_length > length - next - 8)
        throw InputError(
            path, fmt::format("byte {}", next), "the binary chunk is longer than the file");
    result.binary_length = static_cast<std::int64_t>(binary_length);
    return result;
}

/// Walks the JSON without building it, to bound what building it would take.
class JsonGuard : public nlohmann::json_sax<Json> {
public:
    explicit JsonGuard(const std::string& path) : path_(path) {}

    bool null() override { return count(); }
    bool boolean(bool) override { return count(); }
    bool number_integer(Json::number_integer_t) override { return count(); }
    bool number_unsigned(Json::number_unsigned_t) override { return count(); }
    bool number_float(Json::number_float_t, const std::string&) override { return count(); }
    bool string(std::string&) override { return count(); }
    bool binary(Json::binary_t&) override { return count(); }
    bool key(std::string&) override { return true; }
    bool start_object(std::size_t) override { return enter(); }
    bool end_object() override { return leave(); }
    bool start_array(std::size_t) override { return enter(); }
    bool end_array() override { return leave(); }
    bool parse_error(std::size_t position,
                     const std::string&,
                     const nlohmann::detail::exception& error) override
    {
        throw InputError(
            path_, fmt::format("byte {}", position), fmt::format("bad JSON: {}", error.what()));
    }

private:
    bool count()
    {
        if (++values_ > kMaxJsonValues)
            throw InputError(path_, fmt::format("more than {} JSON values", kMaxJsonValues));
        return true;
    }
    bool enter()
    {
        if (++depth_ > kMaxDepth) throw InputError(path_, "its JSON is nested too deeply");
        return count();
    }
    bool leave()
    {
        --depth_;
        return true;
    }

    const std::string& path_;
    std::int64_t values_ = 0;
    int depth_ = 0;
};

Json parseJson(std::span<const std::uint8_t> text, const std::string& path)
{
    JsonGuard guard(path);
    Json::sax_parse(text.begin(), text.end(), &guard);
    Json json = Json::parse(text.begin(), text.end());
    if (!json.is_object()) throw InputError(path, "its JSON is not an object");
    return json;
}

const Json& member(const Json& object, const char* key)
{
    static const Json kNothing;
    if (!object.is_object()) return kNothing;
    const auto found = object.find(key);
    return found == object.end() ? kNothing : *found;
}

std::vector<std::string> stringsOf(const Json& array)
{
    std::vector<std::string> strings;
    if (array.is_array())
        for (const Json& entry : array)
            if (entry.is_string()) strings.push_back(entry.get<std::string>());
    return strings;
}

/// A whole number >= 0, or `fallback` when absent; InputError for anything else.
std::int64_t countOf(const Json& object,
                     const char* key,
                     std::int64_t fallback,
                     const std::string& path)
{
    const Json& value = member(object, key);
    if (value.is_null()) return fallback;
    if (!value.is_number_unsigned() || value.get<std::uint64_t>() > (1ull << 40))
        throw InputError(path, fmt::format("'{}' is not a plausible size", key));
    return static_cast<std::int64_t>(value.get<std::uint64_t>());
}

void checkVersion(const Json& json, const std::string& path)
{
    const Json& version = member(member(json, "asset"), "version");
    if (!version.is_string()) throw InputError(path, "no glTF: 'asset.version' is missing");
    if (!version.get<std::string>().starts_with("2."))
        throw InputError(path,
                         fmt::format("glTF version {}; only 2.0 is read, please convert it",
                                     version.get<std::string>()));
}

void checkRequiredExtensions(const Json& json, const std::string& path)
{
    std::vector<std::string> missing = stringsOf(member(json, "extensionsRequired"));
    std::erase_if(missing, isGltfExtensionImplemented);
    if (missing.empty()) return;
    constexpr std::size_t kNamed = 10;
    missing.resize(std::min(missing.size(), kNamed));
    throw InputError(path,
                     fmt::format("requires the glTF extension{} {}, which {} not supported; export "
                                 "the model without",
                                 missing.size() > 1 ? "s" : "",
                                 fmt::join(missing, ", "),
                                 missing.size() > 1 ? "are" : "is"));
}

bool isDataUri(std::string_view uri)
{
    return uri.starts_with("data:");
}

/// Byte length of each buffer, after checking that together they are bounded.
std::vector<std::int64_t> checkBuffers(const Json& json,
                                       const Container& container,
                                       const std::string& path,
                                       GltfOutline& outline)
{
    std::vector<std::int64_t> lengths;
    const Json& buffers = member(json, "buffers");
    if (!buffers.is_array()) return lengths;
    std::int64_t total = 0;
    for (const Json& buffer : buffers) {
        const std::int64_t length = countOf(buffer, "byteLength", 0, path);
        total += length;
        if (length < 1 || total > kMaxModelBytes)
            throw InputError(path,
                             fmt::format("buffer {}: {} bytes; 1 to {} in all are read",
                                         lengths.size(),
                                         length,
                                         kMaxModelBytes));
        const Json& uri = member(buffer, "uri");
        if (uri.is_string() && !isDataUri(uri.get<std::string>())) {
            outline.external_buffers.push_back({percentDecoded(uri.get<std::string>()), length});
        } else if (!uri.is_string()) {
            if (!lengths.empty() || length > container.binary_length)
                throw InputError(path,
                                 fmt::format("buffer {} has neither a file nor a place in the "
                                             "binary chunk",
                                             lengths.size()));
        }
        lengths.push_back(length);
    }
    return lengths;
}

void checkImages(const Json& json,
                 const std::vector<std::int64_t>& buffer_lengths,
                 const std::string& path)
{
    const Json& images = member(json, "images");
    const Json& views = member(json, "bufferViews");
    if (!images.is_array()) return;
    for (const Json& image : images) {
        if (member(image, "bufferView").is_null()) continue;
        const auto index = static_cast<std::size_t>(countOf(image, "bufferView", 0, path));
        const auto fail = [&] {
            throw InputError(path,
                             fmt::format("an image lies outside its buffer (view {})", index));
        };
        if (!views.is_array() || index >= views.size()) fail();
        const Json& view = views[index];
        const auto buffer = static_cast<std::size_t>(countOf(view, "buffer", -1, path));
        const std::int64_t offset = countOf(view, "byteOffset", 0, path);
        const std::int64_t length = countOf(view, "byteLength", 0, path);
        if (buffer >= buffer_lengths.size() || length < 1 ||
            offset + length > buffer_lengths[buffer])
            fail();
    }
}

}  // namespace

bool isGltfExtensionImplemented(const std::string& name)
{
    static constexpr std::array<std::string_view, 2> kImplemented = {
        "KHR_materials_specular", "KHR_materials_emissive_strength"};
    return std::find(kImplemented.begin(), kImplemented.end(), name) != kImplemented.end();
}

std::string percentDecoded(const std::string& uri)
{
    std::string result;
    for (std::size_t i = 0; i < uri.size(); ++i) {
        unsigned value = 0;
        if (uri[i] == '%' && i + 2 < uri.size()) {
            const char* end = uri.data() + i + 3;
            const auto parsed = std::from_chars(uri.data() + i + 1, end, value, 16);
            if (parsed.ec == std::errc{} && parsed.ptr == end) {
                result += static_cast<char>(value);
                i += 2;
                continue;
            }
        }
        result += uri[i];
    }
    return result;
}

GltfOutline checkGltf(std::span<const std::uint8_t> bytes, const std::filesystem::path& path)
{
    const std::string name = path.string();
    GltfOutline outline;
    outline.binary = ByteView(bytes, name, ByteOrder::Little).startsWith("glTF");
    Container container;
    container.json = bytes;
    if (outline.binary) container = openBinary(bytes, name);

    const Json json = parseJson(container.json, name);
    checkVersion(json, name);
    checkRequiredExtensions(json, name);
    checkImages(json, checkBuffers(json, container, name, outline), name);
    outline.extensions_used = stringsOf(member(json, "extensionsUsed"));
    return outline;
}

}  // namespace insitu
