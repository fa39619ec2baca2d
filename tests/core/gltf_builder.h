#pragma once

#include <glm/glm.hpp>
#include <nlohmann/json.hpp>

#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

namespace insitu {

/// Writes glTF files for tests, part by part: every add… returns the index of what it added.
class GltfBuilder {
public:
    using Json = nlohmann::json;

    Json json = {{"asset", {{"version", "2.0"}}}};
    std::string binary;

    int addView(const void* data, std::size_t bytes)
    {
        binary.resize((binary.size() + 3) / 4 * 4, '\0');
        const std::size_t offset = binary.size();
        binary.append(static_cast<const char*>(data), bytes);
        return push("bufferViews", {{"buffer", 0}, {"byteOffset", offset}, {"byteLength", bytes}});
    }
    template <class Element>
    int addAccessor(const std::vector<Element>& elements, int component_type, const char* type)
    {
        const int view = addView(elements.data(), elements.size() * sizeof(Element));
        return push("accessors",
                    {{"bufferView", view},
                     {"componentType", component_type},
                     {"count", elements.size()},
                     {"type", type}});
    }
    int addPositions(const std::vector<glm::vec3>& positions)
    {
        return addAccessor(positions, kFloat, "VEC3");
    }
    /// A mesh of one primitive; `extra` is merged into it.
    int addMesh(const Json& attributes, const Json& extra = Json::object())
    {
        Json primitive = {{"attributes", attributes}};
        primitive.update(extra);
        return push("meshes", {{"primitives", Json::array({primitive})}});
    }
    int addNode(const Json& node) { return push("nodes", node); }
    int push(const char* array, const Json& entry)
    {
        json[array].push_back(entry);
        return static_cast<int>(json[array].size()) - 1;
    }

    [[nodiscard]] std::string glb() const
    {
        Json complete = json;
        std::string payload = binary;
        payload.resize((payload.size() + 3) / 4 * 4, '\0');
        if (!payload.empty() && !complete.contains("buffers"))
            complete["buffers"] = {{{"byteLength", payload.size()}}};
        std::string text = complete.dump();
        text.resize((text.size() + 3) / 4 * 4, ' ');
        std::string chunks = word(text.size()) + "JSON" + text;
        if (!payload.empty()) chunks += word(payload.size()) + std::string("BIN\0", 4) + payload;
        return "glTF" + word(2) + word(12 + chunks.size()) + chunks;
    }

    static std::string word(std::size_t value)
    {
        const auto number = static_cast<std::uint32_t>(value);
        std::string bytes(4, '\0');
        std::memcpy(bytes.data(), &number, 4);
        return bytes;
    }

    static constexpr int kUnsignedByte = 5121;
    static constexpr int kUnsignedShort = 5123;
    static constexpr int kUnsignedInt = 5125;
    static constexpr int kFloat = 5126;
};

/// A builder that holds one triangle (0,0,0), (1,0,0), (0,1,0) on one node.
inline GltfBuilder triangleGltf()
{
    GltfBuilder builder;
    const int positions = builder.addPositions({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}});
    builder.addNode({{"mesh", builder.addMesh({{"POSITION", positions}})}});
    return builder;
}

}  // namespace insitu
