#pragma once

#include "lighting/silhouettes.h"

#include <glm/glm.hpp>

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace insitu {

/// A mesh as the rasteriser wants it: vertices local, none unused, no triangle without a place.
struct RasterMesh {
    /// One coordinate after the other, all of x first.
    std::vector<float> x, y, z;
    std::vector<glm::uvec3> triangles;
};
[[nodiscard]] RasterMesh rasterMesh(const TriangleMesh& mesh, const LocalFrame& local);

/// Draws one silhouette after the other into the same buffers. Not for several threads at once.
class SilhouetteRaster {
public:
    SilhouetteRaster(const RasterMesh& mesh, int resolution, int samples);

    /// resolution² texels each.
    [[nodiscard]] SilhouetteFrame draw(glm::dvec3 unit_direction,
                                       std::uint8_t* coverage,
                                       DepthSpan* depths);

private:
    /// A vertex in sample units (x, y) and depth codes (z); w is unused.
    using Point = float __attribute__((vector_size(16)));

    [[nodiscard]] SilhouetteFrame project(glm::dvec3 unit_direction);
    /// How many of a batch of triangles hold at most 2 x 2 samples, and more.
    struct Sorted {
        std::size_t small = 0;
        std::size_t large = 0;
    };
    [[nodiscard]] Sorted sortTriangles(std::size_t begin, std::size_t end);
    void fillSmall(const Point& a, const Point& b, const Point& c);
    void fillLarge(const Point& a, const Point& b, const Point& c);
    void resolve(std::uint8_t* coverage, DepthSpan* depths) const;

    const RasterMesh& mesh_;
    int resolution_ = 0;
    int samples_ = 0;
    int side_ = 0;  ///< samples along the picture's side
    std::vector<Point> points_;
    std::vector<float> near_, far_;  ///< of each sample; far < near where nothing covers it
    static constexpr std::size_t kBatch = 512;  ///< triangles that stay in the nearest cache
    std::array<std::uint32_t, kBatch> small_{}, large_{};  ///< of the batch
};

}  // namespace insitu
