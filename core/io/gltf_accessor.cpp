#include "core/io/gltf_accessor.h"

#include "core/check.h"
#include "core/io/gltf_library.h"
#include "core/io/model_resources.h"

#include <cstring>
#include <span>

namespace insitu {

namespace {

[[noreturn]] void fail(const std::string& path, int accessor, const std::string& cause)
{
    throw InputError(path, fmt::format("accessor {}", accessor), cause);
}

const tinygltf::Accessor& accessorAt(const tinygltf::Model& gltf,
                                     int index,
                                     const std::string& path)
{
    if (index < 0 || static_cast<std::size_t>(index) >= gltf.accessors.size())
        fail(path, index, "does not exist");
    const tinygltf::Accessor& accessor = gltf.accessors[static_cast<std::size_t>(index)];
    if (accessor.count > kMaxModelElements)
        fail(
            path, index, fmt::format("{} elements; at most {}", accessor.count, kMaxModelElements));
    return accessor;
}

std::size_t componentSize(int component_type)
{
    switch (component_type) {
        case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
            return 1;
        case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
            return 2;
        case TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT:
        case TINYGLTF_COMPONENT_TYPE_FLOAT:
            return 4;
        default:
            return 0;
    }
}

template <class Component>
double load(const unsigned char* from)
{
    Component value;
    std::memcpy(&value, from, sizeof value);
    return static_cast<double>(value);
}

/// Equally spaced elements inside a buffer; reading element i is safe for i < count.
struct Elements {
    const unsigned char* first = nullptr;
    std::size_t stride = 0;
    int component_type = 0;

    [[nodiscard]] double component(std::size_t element, std::size_t which) const
    {
        const unsigned char* at = first + element * stride + which * componentSize(component_type);
        switch (component_type) {
            case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
                return load<std::uint8_t>(at);
            case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
                return load<std::uint16_t>(at);
            case TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT:
                return load<std::uint32_t>(at);
            default:
                return load<float>(at);
        }
    }
};

/// Where an accessor, or half of a sparse one, says its data lies.
struct Region {
    int buffer_view = -1;
    std::int64_t byte_offset = 0;
    int component_type = 0;
    std::size_t components = 1;
    std::size_t count = 0;
    bool may_be_strided = false;
};

Elements elementsOf(const tinygltf::Model& gltf,
                    const Region& region,
                    int accessor,
                    const std::string& path)
{
    if (region.buffer_view < 0 ||
        static_cast<std::size_t>(region.buffer_view) >= gltf.bufferViews.size())
        fail(path, accessor, fmt::format("buffer view {} does not exist", region.buffer_view));
    const auto& view = gltf.bufferViews[static_cast<std::size_t>(region.buffer_view)];
    if (view.buffer < 0 || static_cast<std::size_t>(view.buffer) >= gltf.buffers.size())
        fail(path, accessor, fmt::format("buffer {} does not exist", view.buffer));
    const auto& data = gltf.buffers[static_cast<std::size_t>(view.buffer)].data;
    if (view.byteOffset > data.size() || view.byteLength > data.size() - view.byteOffset)
        fail(path, accessor, "its buffer view reaches outside the buffer");

    const std::size_t element_size = region.components * componentSize(region.component_type);
    Elements elements;
    elements.component_type = region.component_type;
    elements.stride = region.may_be_strided && view.byteStride > 0 ? view.byteStride : element_size;
    // The specification's limit; it also keeps the product below from overflowing.
    constexpr std::size_t kMaxStride = 252;
    if (elements.stride > kMaxStride) fail(path, accessor, "its stride is above 252 bytes");
    const std::size_t needed =
        region.count == 0 ? 0 : (region.count - 1) * elements.stride + element_size;
    if (region.byte_offset < 0 || static_cast<std::size_t>(region.byte_offset) > view.byteLength ||
        needed > view.byteLength - static_cast<std::size_t>(region.byte_offset))
        fail(path, accessor, "reaches outside its buffer view; the file is damaged or incomplete");
    elements.first = data.data() + view.byteOffset + region.byte_offset;
    return elements;
}

// glTF 2.0, section 3.6.2.3: some elements are replaced, given by index.
void substitute(const tinygltf::Model& gltf,
                int index,
                std::size_t components,
                const std::string& path,
                std::span<double> values)
{
    const tinygltf::Accessor& accessor = accessorAt(gltf, index, path);
    const auto& sparse = accessor.sparse;
    if (sparse.count < 1 || static_cast<std::size_t>(sparse.count) > accessor.count)
        fail(path, index, "a sparse count out of range");
    const int index_type = sparse.indices.componentType;
    if (index_type == TINYGLTF_COMPONENT_TYPE_FLOAT || componentSize(index_type) == 0)
        fail(path, index, "sparse indices of a wrong type");
    const auto count = static_cast<std::size_t>(sparse.count);
    const Elements indices = elementsOf(
        gltf,
        {sparse.indices.bufferView, sparse.indices.byteOffset, index_type, 1, count, false},
        index,
        path);
    const Elements replacements = elementsOf(gltf,
                                             {sparse.values.bufferView,
                                              sparse.values.byteOffset,
                                              accessor.componentType,
                                              components,
                                              count,
                                              false},
                                             index,
                                             path);
    for (std::size_t i = 0; i < count; ++i) {
        const auto target = static_cast<std::size_t>(indices.component(i, 0));
        if (target >= accessor.count) fail(path, index, "a sparse index out of range");
        for (std::size_t c = 0; c < components; ++c)
            values[target * components + c] = replacements.component(i, c);
    }
}

/// All components, element after element; absent data counts as zeros. Checked before allocation.
std::vector<double> readComponents(const tinygltf::Model& gltf,
                                   int index,
                                   std::size_t components,
                                   const std::string& path)
{
    const tinygltf::Accessor& accessor = accessorAt(gltf, index, path);
    Elements elements;
    if (accessor.bufferView >= 0 || !accessor.sparse.isSparse) {
        if (accessor.byteOffset > (1ull << 40)) fail(path, index, "offset out of range");
        elements = elementsOf(gltf,
                              {accessor.bufferView,
                               static_cast<std::int64_t>(accessor.byteOffset),
                               accessor.componentType,
                               components,
                               accessor.count,
                               true},
                              index,
                              path);
    }
    std::vector<double> values(accessor.count * components, 0.0);
    if (elements.first)
        for (std::size_t i = 0; i < accessor.count; ++i)
            for (std::size_t c = 0; c < components; ++c)
                values[i * components + c] = elements.component(i, c);
    if (accessor.sparse.isSparse) substitute(gltf, index, components, path, values);
    return values;
}

}  // namespace

std::size_t accessorCount(const tinygltf::Model& gltf, int accessor, const std::string& path)
{
    return accessorAt(gltf, accessor, path).count;
}

std::vector<glm::vec3> readVec3Accessor(const tinygltf::Model& gltf,
                                        int accessor,
                                        const std::string& path)
{
    const tinygltf::Accessor& source = accessorAt(gltf, accessor, path);
    if (source.type != TINYGLTF_TYPE_VEC3 || source.componentType != TINYGLTF_COMPONENT_TYPE_FLOAT)
        fail(path, accessor, "is not made of three floats (quantised meshes are not supported)");
    const std::vector<double> values = readComponents(gltf, accessor, 3, path);
    std::vector<glm::vec3> result(source.count);
    for (std::size_t i = 0; i < result.size(); ++i)
        result[i] = glm::vec3(glm::dvec3(values[3 * i], values[3 * i + 1], values[3 * i + 2]));
    return result;
}

std::vector<glm::vec2> readTexcoordAccessor(const tinygltf::Model& gltf,
                                            int accessor,
                                            const std::string& path)
{
    const tinygltf::Accessor& source = accessorAt(gltf, accessor, path);
    double scale = 1.0;
    if (source.componentType == TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE)
        scale = 1.0 / 255.0;
    else if (source.componentType == TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT)
        scale = 1.0 / 65535.0;
    else if (source.componentType != TINYGLTF_COMPONENT_TYPE_FLOAT)
        fail(path, accessor, "texture coordinates of a wrong type");
    if (source.type != TINYGLTF_TYPE_VEC2) fail(path, accessor, "is not made of pairs");
    const std::vector<double> values = readComponents(gltf, accessor, 2, path);
    std::vector<glm::vec2> result(source.count);
    for (std::size_t i = 0; i < result.size(); ++i)
        result[i] = glm::vec2(scale * glm::dvec2(values[2 * i], values[2 * i + 1]));
    return result;
}

std::vector<std::uint32_t> readIndexAccessor(const tinygltf::Model& gltf,
                                             int accessor,
                                             const std::string& path)
{
    const tinygltf::Accessor& source = accessorAt(gltf, accessor, path);
    if (source.type != TINYGLTF_TYPE_SCALAR ||
        source.componentType == TINYGLTF_COMPONENT_TYPE_FLOAT ||
        componentSize(source.componentType) == 0)
        fail(path, accessor, "indices of a wrong type");
    const std::vector<double> values = readComponents(gltf, accessor, 1, path);
    std::vector<std::uint32_t> result(values.size());
    for (std::size_t i = 0; i < result.size(); ++i)
        result[i] = static_cast<std::uint32_t>(values[i]);
    return result;
}

}  // namespace insitu
