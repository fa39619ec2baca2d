#include "core/color.h"
#include "core/mesh.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace insitu {

namespace {

std::array<float, 256> makeTable(bool srgb)
{
    std::array<float, 256> table{};
    for (std::size_t code = 0; code < table.size(); ++code) {
        const double value = static_cast<double>(code) / 255.0;
        table[code] = static_cast<float>(srgb ? linearFromSrgb(value) : value);
    }
    return table;
}

const std::array<float, 256> kLinearFromSrgbCode = makeTable(true);
const std::array<float, 256> kLinearFromCode = makeTable(false);

/// The two texels that surround a coordinate along one axis, and the weight of the second.
struct Neighbors {
    int first = 0;
    int second = 0;
    float weight = 0.0f;
};

Neighbors neighbors(float coordinate, int size, bool clamp)
{
    if (!std::isfinite(coordinate)) coordinate = 0.0f;
    const float unit =
        clamp ? std::clamp(coordinate, 0.0f, 1.0f) : coordinate - std::floor(coordinate);
    const float continuous = unit * static_cast<float>(size) - 0.5f;
    const float lower = std::floor(continuous);
    Neighbors result{static_cast<int>(lower), static_cast<int>(lower) + 1, continuous - lower};
    if (clamp) {
        result.first = std::clamp(result.first, 0, size - 1);
        result.second = std::clamp(result.second, 0, size - 1);
    } else {
        result.first = (result.first + size) % size;
        result.second = result.second % size;
    }
    return result;
}

}  // namespace

glm::vec4 Texture::sample(glm::vec2 uv) const
{
    INSITU_DCHECK(!texels.empty(), "texture without texels");
    const std::array<float, 256>& decode = srgb ? kLinearFromSrgbCode : kLinearFromCode;
    const Neighbors x = neighbors(uv.x, texels.width(), clamp_s);
    const Neighbors y = neighbors(uv.y, texels.height(), clamp_t);
    const auto at = [&](int column, int row) {
        const glm::u8vec4 code = texels(column, row);
        return glm::vec4(decode[code.r], decode[code.g], decode[code.b], kLinearFromCode[code.a]);
    };
    const glm::vec4 top = glm::mix(at(x.first, y.first), at(x.second, y.first), x.weight);
    const glm::vec4 bottom = glm::mix(at(x.first, y.second), at(x.second, y.second), x.weight);
    return glm::mix(top, bottom, y.weight);
}

}  // namespace insitu
