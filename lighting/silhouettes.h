#pragma once

#include "core/mesh.h"
#include "core/progress.h"

#include <glm/glm.hpp>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace insitu {

/// How an object's places become local ones: relative to the centre of its bounding sphere and
/// divided by its radius, so that neither its scale nor its distance from the origin costs
/// accuracy.
struct LocalFrame {
    glm::dvec3 center{0.0};
    double radius = 1.0;
    glm::vec3 half_extent{1.0f};  ///< of the bounding box around the centre, in radii

    [[nodiscard]] glm::vec3 localFrom(glm::dvec3 x) const { return {(x - center) / radius}; }
};
/// Around all vertices that triangles use; the sphere is centred on their bounding box.
[[nodiscard]] LocalFrame localFrame(const TriangleMesh& mesh);

/// Where a silhouette lies: maps a local place p to its column, its row and its depth along ω.
///
/// Texel i is centred on coordinate i. The object's outline spans columns and rows 0.5 to
/// resolution − 1.5, so that the outer ring of texels is always empty.
struct SilhouetteFrame {
    glm::vec3 column_axis{0.0f};
    float column_offset = 0.0f;
    glm::vec3 row_axis{0.0f};
    float row_offset = 0.0f;
    glm::vec3 depth_axis{0.0f};  ///< along ω, in depth codes
    float depth_offset = 0.0f;
    /// Depth codes that correspond to a texel's side: how far the surface inside a texel may lie
    /// from the depth that is kept of it.
    float texel_depth = 0.0f;
};

/// Nearest and farthest surface along ω inside a texel, mean over its covered samples.
struct DepthSpan {
    std::uint16_t near = 65535;
    std::uint16_t far = 0;
};
/// Depth codes of the object's own extent along ω.
inline constexpr float kMinDepthCode = 1.0f;
inline constexpr float kMaxDepthCode = 65534.0f;

/// Which parts of a silhouette are wholly covered and which wholly empty, and between which depths
/// its surfaces lie: most places fall into neither's neighbourhood, or are on one side of all
/// surfaces there, and need no texel looked at.
struct SilhouetteTiles {
    static constexpr int kSide = 16;

    std::array<std::uint16_t, kSide> full{}, empty{};  ///< 16 x 16 tiles, bit x of row y
    /// Texels along a tile's side.
    [[nodiscard]] static int texels(int resolution) { return (resolution + kSide - 1) / kSide; }

    /// Bounds of the depths in 2 x 2 tiles, in 1/256 of all codes, as numbers that are larger the
    /// wider the bounds.
    struct Depths {
        std::uint8_t near_most = 0, near_least = 0;  ///< the lesser ones are 255 less the bound
        std::uint8_t far_most = 0, far_least = 0;

        void add(const Depths& other)
        {
            near_most = std::max(near_most, other.near_most);
            near_least = std::max(near_least, other.near_least);
            far_most = std::max(far_most, other.far_most);
            far_least = std::max(far_least, other.far_least);
        }
        /// In depth codes; above all and below all when nothing was added.
        [[nodiscard]] float nearMost() const { return 256.0f * static_cast<float>(near_most + 1); }
        [[nodiscard]] float nearLeast() const
        {
            return 256.0f * static_cast<float>(255 - near_least);
        }
        [[nodiscard]] float farMost() const { return 256.0f * static_cast<float>(far_most + 1); }
        [[nodiscard]] float farLeast() const
        {
            return 256.0f * static_cast<float>(255 - far_least);
        }
    };
    std::array<Depths, kSide / 2 * kSide / 2> depths{};
    [[nodiscard]] const Depths& depthsAt(int x, int y) const
    {
        return depths[static_cast<std::size_t>(y * (kSide / 2) + x)];
    }
};

/// Orthographic silhouettes of one object along several directions.
///
/// A place x is hidden from the light of direction ω (which points to the light) when the ray from
/// x along ω meets the object: when x lies inside the silhouette and nearer along ω than its far
/// side. For −ω it has to lie beyond the near side. So two depths serve two directions, for places
/// inside the bounding sphere as well, and for meshes that are not closed.
struct SilhouetteSet {
    LocalFrame local;
    int resolution = 0;
    std::vector<glm::dvec3> directions;   ///< unit, in the object's own axes
    std::vector<SilhouetteFrame> frames;  ///< one a direction
    /// resolution² a direction, row by row: share of the texel that the object covers, 255 is all.
    std::vector<std::uint8_t> coverage;
    std::vector<DepthSpan> depths;
    std::vector<SilhouetteTiles> tiles;  ///< one a direction, from coverage and depths

    /// Makes the tiles.
    void summarize();
    [[nodiscard]] std::size_t texels() const
    {
        return static_cast<std::size_t>(resolution) * static_cast<std::size_t>(resolution);
    }
    [[nodiscard]] const std::uint8_t* coverageOf(std::size_t i) const
    {
        return coverage.data() + i * texels();
    }
    [[nodiscard]] const DepthSpan* depthsOf(std::size_t i) const
    {
        return depths.data() + i * texels();
    }
    [[nodiscard]] std::size_t memoryBytes() const;
};

/// Rasterises the mesh along each (unit) direction, in parallel over directions; the same bytes for
/// any number of threads. `samples`: along a texel's side, >= 1. Triangles with non-finite vertices
/// are left out. A mesh without triangles, or a direction that is not a unit vector, is a
/// LogicError.
[[nodiscard]] SilhouetteSet drawSilhouettes(const TriangleMesh& mesh,
                                            std::span<const glm::dvec3> directions,
                                            int resolution,
                                            int samples,
                                            Progress& progress);

/// Shares of the light of ω and of −ω, [0, 1], that the object hides from a place.
struct HiddenShares {
    float along = 0.0f;    ///< of the light of direction ω
    float against = 0.0f;  ///< of the light of direction −ω
};
/// Bilinear in the silhouette's coverage; each of the four texels counts when its depth says so.
///
/// `bias` in texels: that much farther behind the surface must a place lie to be hidden by it. 0
/// for places that are not on the object. This is the definition; FIV sums do the same for many
/// places at a time.
[[nodiscard]] HiddenShares hiddenShares(const SilhouetteSet& set,
                                        std::size_t index,
                                        glm::vec3 x_local,
                                        float bias_texels = 0.0f);

}  // namespace insitu
