#pragma once

#include "core/image.h"
#include "reconstruct/scene_proxy.h"

#include <algorithm>
#include <cmath>
#include <ranges>
#include <vector>

namespace insitu {

/// One value per texel of every proxy face: nearly square texels in the face's (u, v).
///
/// Texels are numbered face by face, row by row. A texel without a value (in an opening, outside a
/// triangle) is marked invalid by its owner and takes no part in look-ups.
template <class Value>
class FaceGrid {
public:
    FaceGrid() = default;

    /// Texels of about `texel_m` metres, at least one a face.
    FaceGrid(const SceneProxy& proxy, double texel_m)
    {
        std::size_t count = 0;
        for (const ProxyFace& face : proxy.faces()) {
            const auto cells = [&](glm::dvec3 edge) {
                return std::max(1, static_cast<int>(std::lround(glm::length(edge) / texel_m)));
            };
            blocks_.push_back({cells(face.edge_u), cells(face.edge_v), count});
            count += static_cast<std::size_t>(blocks_.back().columns) *
                     static_cast<std::size_t>(blocks_.back().rows);
        }
        texels_.resize(count);
    }

    struct Texel {
        std::size_t face = 0;
        int column = 0;
        int row = 0;
    };
    [[nodiscard]] std::size_t size() const { return texels_.size(); }
    [[nodiscard]] std::size_t faceCount() const { return blocks_.size(); }
    [[nodiscard]] int columns(std::size_t face) const { return blocks_[face].columns; }
    [[nodiscard]] int rows(std::size_t face) const { return blocks_[face].rows; }
    [[nodiscard]] std::size_t firstOf(std::size_t face) const { return blocks_[face].first; }
    /// The numbers of a face's texels, row by row.
    [[nodiscard]] auto texelsOf(std::size_t face) const
    {
        const Block& b = blocks_[face];
        const std::size_t count =
            static_cast<std::size_t>(b.columns) * static_cast<std::size_t>(b.rows);
        return std::views::iota(b.first, b.first + count);
    }

    [[nodiscard]] Value& operator[](std::size_t texel) { return texels_[texel].value; }
    [[nodiscard]] const Value& operator[](std::size_t texel) const { return texels_[texel].value; }
    [[nodiscard]] bool valid(std::size_t texel) const { return texels_[texel].valid; }
    void setValid(std::size_t texel, bool valid) { texels_[texel].valid = valid; }

    [[nodiscard]] std::size_t texelAt(std::size_t face, glm::dvec2 uv) const
    {
        const Block& b = blocks_[face];
        const int column = std::clamp(static_cast<int>(uv.x * b.columns), 0, b.columns - 1);
        const int row = std::clamp(static_cast<int>(uv.y * b.rows), 0, b.rows - 1);
        return index(b, column, row);
    }
    [[nodiscard]] Texel texel(std::size_t number) const
    {
        const auto after = std::upper_bound(
            blocks_.begin(), blocks_.end(), number, [](std::size_t n, const Block& b) {
                return n < b.first;
            });
        const std::size_t face = static_cast<std::size_t>(after - blocks_.begin()) - 1;
        const std::size_t local = number - blocks_[face].first;
        const std::size_t columns = static_cast<std::size_t>(blocks_[face].columns);
        return {face, static_cast<int>(local % columns), static_cast<int>(local / columns)};
    }
    /// (u, v) of a place within a texel, `inside` in [0, 1]².
    [[nodiscard]] glm::dvec2 uv(const Texel& t, glm::dvec2 inside) const
    {
        return {(t.column + inside.x) / blocks_[t.face].columns,
                (t.row + inside.y) / blocks_[t.face].rows};
    }

    [[nodiscard]] glm::dvec2 centerUv(std::size_t number) const
    {
        return uv(texel(number), glm::dvec2(0.5));
    }

    /// Bilinear over the valid texels around; `fallback` when there is none.
    [[nodiscard]] Value lookUp(std::size_t face, glm::dvec2 uv, Value fallback) const
    {
        const Block& b = blocks_[face];
        const double x = std::clamp(uv.x * b.columns - 0.5, 0.0, b.columns - 1.0);
        const double y = std::clamp(uv.y * b.rows - 0.5, 0.0, b.rows - 1.0);
        const int x0 = static_cast<int>(x);
        const int y0 = static_cast<int>(y);
        const float tx = static_cast<float>(x - x0);
        const float ty = static_cast<float>(y - y0);
        Value sum{};
        float weight_sum = 0.0f;
        for (int dy = 0; dy < 2; ++dy) {
            for (int dx = 0; dx < 2; ++dx) {
                const float weight = (dx ? tx : 1.0f - tx) * (dy ? ty : 1.0f - ty);
                if (weight <= 0.0f) continue;
                const Stored& texel = texels_[index(
                    b, std::min(x0 + dx, b.columns - 1), std::min(y0 + dy, b.rows - 1))];
                if (!texel.valid) continue;
                sum += texel.value * weight;
                weight_sum += weight;
            }
        }
        return weight_sum > 0.0f ? sum / weight_sum : fallback;
    }

private:
    struct Block {
        int columns = 1;
        int rows = 1;
        std::size_t first = 0;
    };
    [[nodiscard]] static std::size_t index(const Block& b, int column, int row)
    {
        return b.first + static_cast<std::size_t>(row) * static_cast<std::size_t>(b.columns) +
               static_cast<std::size_t>(column);
    }

    /// Side by side: look-ups wait for memory, more than for anything else.
    struct Stored {
        Value value{};
        bool valid = false;
    };
    std::vector<Block> blocks_;
    std::vector<Stored> texels_;
};

}  // namespace insitu
