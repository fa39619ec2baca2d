#include "lighting/silhouettes.h"

#include "core/check.h"
#include "core/parallel.h"
#include "lighting/silhouette_raster.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <mutex>

namespace insitu {

namespace {

/// Most directions that share one set of buffers.
constexpr std::size_t kDirectionsAtATime = 24;

bool isFinite(glm::vec3 v)
{
    return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

SilhouetteTiles tilesOf(const std::uint8_t* coverage, const DepthSpan* depths, int resolution)
{
    const int side = SilhouetteTiles::texels(resolution);
    SilhouetteTiles tiles;
    std::array<std::uint16_t, SilhouetteTiles::kSide> partly{}, touched{};
    std::size_t texel = 0;
    for (int y = 0; y < resolution; ++y)
        for (int x = 0; x < resolution; ++x, ++texel) {
            const auto row = static_cast<std::size_t>(y / side);
            const auto bit = static_cast<std::uint16_t>(1u << (x / side));
            if (coverage[texel] != 255) partly[row] = static_cast<std::uint16_t>(partly[row] | bit);
            if (coverage[texel] == 0) continue;
            touched[row] = static_cast<std::uint16_t>(touched[row] | bit);
            const auto near = static_cast<std::uint8_t>(depths[texel].near >> 8);
            const auto far = static_cast<std::uint8_t>(depths[texel].far >> 8);
            tiles
                .depths[row / 2 * (SilhouetteTiles::kSide / 2) +
                        static_cast<std::size_t>(x / side / 2)]
                .add({near,
                      static_cast<std::uint8_t>(255 - near),
                      far,
                      static_cast<std::uint8_t>(255 - far)});
        }
    for (std::size_t row = 0; row < SilhouetteTiles::kSide; ++row) {
        tiles.full[row] = static_cast<std::uint16_t>(~partly[row]);
        tiles.empty[row] = static_cast<std::uint16_t>(~touched[row]);
    }
    return tiles;
}

}  // namespace

LocalFrame localFrame(const TriangleMesh& mesh)
{
    glm::dvec3 low(std::numeric_limits<double>::max());
    glm::dvec3 high(-std::numeric_limits<double>::max());
    const auto forEachCorner = [&mesh](const auto& visit) {
        for (const glm::uvec3& t : mesh.triangles)
            for (int corner = 0; corner < 3; ++corner)
                if (isFinite(mesh.positions[t[corner]]))
                    visit(glm::dvec3(mesh.positions[t[corner]]));
    };
    forEachCorner([&](glm::dvec3 p) {
        low = glm::min(low, p);
        high = glm::max(high, p);
    });
    LocalFrame frame;
    if (!(low.x <= high.x)) return frame;
    frame.center = 0.5 * (low + high);
    double largest = 0.0;
    forEachCorner([&](glm::dvec3 p) {
        largest = std::max(largest, glm::dot(p - frame.center, p - frame.center));
    });
    if (largest > 0.0) frame.radius = std::sqrt(largest);
    frame.half_extent = glm::vec3((high - frame.center) / frame.radius);
    return frame;
}

std::size_t SilhouetteSet::memoryBytes() const
{
    return coverage.size() * sizeof(coverage[0]) + depths.size() * sizeof(depths[0]) +
           frames.size() * sizeof(frames[0]) + directions.size() * sizeof(directions[0]) +
           tiles.size() * sizeof(tiles[0]);
}

void SilhouetteSet::summarize()
{
    tiles.assign(frames.size(), {});
    parallelFor(0, static_cast<std::int64_t>(frames.size()), [&](std::int64_t task) {
        const auto i = static_cast<std::size_t>(task);
        tiles[i] = tilesOf(coverageOf(i), depthsOf(i), resolution);
    });
}

SilhouetteSet drawSilhouettes(const TriangleMesh& mesh,
                              std::span<const glm::dvec3> directions,
                              int resolution,
                              int samples,
                              Progress& progress)
{
    INSITU_CHECK(resolution >= 4 && samples >= 1, "{} texels, {} samples", resolution, samples);
    for (const glm::dvec3& d : directions)
        INSITU_CHECK(std::abs(glm::length(d) - 1.0) < 1e-6, "length {}", glm::length(d));
    SilhouetteSet set;
    set.local = localFrame(mesh);
    set.resolution = resolution;
    set.directions.assign(directions.begin(), directions.end());
    set.frames.resize(directions.size());
    set.coverage.resize(directions.size() * set.texels());
    set.depths.resize(directions.size() * set.texels());
    const RasterMesh raster_mesh = rasterMesh(mesh, set.local);
    INSITU_CHECK(!raster_mesh.triangles.empty(), "a mesh without triangles");

    // Few directions, of concentrated light, keep all threads busy too.
    const std::size_t at_a_time =
        std::clamp<std::size_t>(directions.size() / 16, 1, kDirectionsAtATime);
    const std::size_t chunks = (directions.size() + at_a_time - 1) / at_a_time;
    std::atomic<std::size_t> done{0};
    std::mutex reporting;
    parallelFor(0, static_cast<std::int64_t>(chunks), [&](std::int64_t chunk) {
        {
            const std::lock_guard lock(reporting);
            progress.checkpoint();
        }
        SilhouetteRaster raster(raster_mesh, resolution, samples);
        const std::size_t begin = static_cast<std::size_t>(chunk) * at_a_time;
        const std::size_t end = std::min(begin + at_a_time, directions.size());
        for (std::size_t i = begin; i < end; ++i)
            set.frames[i] = raster.draw(directions[i],
                                        set.coverage.data() + i * set.texels(),
                                        set.depths.data() + i * set.texels());
        const std::lock_guard lock(reporting);
        progress.report("silhouettes", static_cast<double>(++done) / static_cast<double>(chunks));
    });
    set.summarize();
    return set;
}

HiddenShares hiddenShares(const SilhouetteSet& set,
                          std::size_t index,
                          glm::vec3 x,
                          float bias_texels)
{
    const SilhouetteFrame& frame = set.frames[index];
    const float edge = static_cast<float>(set.resolution - 1);
    const float column =
        std::clamp(glm::dot(frame.column_axis, x) + frame.column_offset, 0.0f, edge);
    const float row = std::clamp(glm::dot(frame.row_axis, x) + frame.row_offset, 0.0f, edge);
    const float depth = glm::dot(frame.depth_axis, x) + frame.depth_offset;
    const int column0 = std::min(static_cast<int>(column), set.resolution - 2);
    const int row0 = std::min(static_cast<int>(row), set.resolution - 2);
    const float tx = column - static_cast<float>(column0);
    const float ty = row - static_cast<float>(row0);
    const float sharpness = 1.0f / frame.texel_depth;

    HiddenShares shares;
    for (int corner = 0; corner < 4; ++corner) {
        const int i = corner % 2;
        const int j = corner / 2;
        const auto texel = static_cast<std::size_t>((row0 + j) * set.resolution + column0 + i);
        const DepthSpan span = set.depthsOf(index)[texel];
        const float weight = (i == 0 ? 1.0f - tx : tx) * (j == 0 ? 1.0f - ty : ty) *
                             static_cast<float>(set.coverageOf(index)[texel]) / 255.0f;
        // Half hidden at the surface itself, over one texel's depth.
        const auto behind = [&](float by) {
            return std::clamp(0.5f - bias_texels + by * sharpness, 0.0f, 1.0f);
        };
        shares.along += weight * behind(static_cast<float>(span.far) - depth);
        shares.against += weight * behind(depth - static_cast<float>(span.near));
    }
    return shares;
}

}  // namespace insitu
