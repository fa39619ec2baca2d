#include "lighting/radiance_mesh.h"

#include "core/parallel.h"
#include "lighting/see_through.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace insitu {

namespace {

using std::numbers::pi;

constexpr double kMaxPatches = 2e5;
/// As in RoomLight: what reflects more shines by itself.
constexpr float kMaxReflectance = 0.95f;
/// Directions looked along in each texel of the probe's grid, a side.
constexpr int kDirectionGrid = 2;
/// Points of a patch at which it is looked whether it is seen, a side of its triangle.
constexpr int kVisibilityGrid = 5;
/// How far in front of a surface its radiance is asked for.
constexpr double kInFront_m = 1e-3;

/// Which triangle of which face a place belongs to.
class PatchGrid {
public:
    PatchGrid(const SceneProxy& proxy, double patch_m)
    {
        for (std::size_t f = 0; f < proxy.faces().size(); ++f) {
            const ProxyFace& face = proxy.faces()[f];
            const auto cells = [&](glm::dvec3 edge) {
                return std::max(1, static_cast<int>(std::lround(glm::length(edge) / patch_m)));
            };
            Block block{cells(face.edge_u), cells(face.edge_v), count_, face.triangle};
            if (face.triangle) block.columns = block.rows = std::max(block.columns, block.rows);
            blocks_.push_back(block);
            count_ += 2 * static_cast<std::size_t>(block.columns) * block.rows;
        }
    }
    /// Slots for two triangles a cell, also for those of which a triangular face has only one.
    [[nodiscard]] std::size_t size() const { return count_; }
    [[nodiscard]] std::size_t slot(std::size_t face, glm::dvec2 uv) const
    {
        const Block& b = blocks_[face];
        const int column = std::clamp(static_cast<int>(uv.x * b.columns), 0, b.columns - 1);
        const int row = std::clamp(static_cast<int>(uv.y * b.rows), 0, b.rows - 1);
        bool upper = uv.x * b.columns - column + uv.y * b.rows - row > 1.0;
        if (b.triangle && column + row >= b.columns - 1) upper = false;
        return b.first + 2 * static_cast<std::size_t>(row * b.columns + column) + upper;
    }
    /// Calls make(slot, uv of the three corners, grid places of the three corners).
    template <class Make>
    void forEach(std::size_t face, const Make& make) const
    {
        const Block& b = blocks_[face];
        for (int row = 0; row < b.rows; ++row)
            for (int column = 0; column < b.columns; ++column) {
                const glm::ivec2 c00(column, row), c10(column + 1, row), c01(column, row + 1),
                    c11(column + 1, row + 1);
                const std::size_t first =
                    b.first + 2 * static_cast<std::size_t>(row * b.columns + column);
                if (!b.triangle || column + row < b.columns) make(first, std::array{c00, c10, c01});
                if (!b.triangle || column + row < b.columns - 1)
                    make(first + 1, std::array{c10, c11, c01});
            }
    }
    [[nodiscard]] glm::dvec2 uv(std::size_t face, glm::ivec2 place) const
    {
        const Block& b = blocks_[face];
        return {place.x / static_cast<double>(b.columns), place.y / static_cast<double>(b.rows)};
    }
    [[nodiscard]] std::size_t vertexCount(std::size_t face) const
    {
        return static_cast<std::size_t>(blocks_[face].columns + 1) * (blocks_[face].rows + 1);
    }
    [[nodiscard]] std::size_t vertexAt(std::size_t face, glm::ivec2 place) const
    {
        return static_cast<std::size_t>(place.y * (blocks_[face].columns + 1) + place.x);
    }

private:
    struct Block {
        int columns = 1;
        int rows = 1;
        std::size_t first = 0;
        bool triangle = false;
    };
    std::vector<Block> blocks_;
    std::size_t count_ = 0;
};

/// A sum with weights.
struct Mean {
    glm::dvec3 sum{0.0};
    double weight = 0.0;
    double opening = 0.0;  ///< of the weight
    void add(Rgb value, double w)
    {
        sum += w * glm::dvec3(value);
        weight += w;
    }
    [[nodiscard]] Rgb value() const { return Rgb(sum / std::max(weight, 1e-300)); }
};

double patchSize(const SceneProxy& proxy, double wanted)
{
    double area = 0.0;
    for (std::size_t f = 0; f < proxy.faces().size(); ++f)
        area += proxy.area(f);
    return std::max(wanted, std::sqrt(2.0 * area / kMaxPatches));
}

/// A lower bound is all that the probe knows of this direction.
bool isClipped(const EnvironmentMap& probe, glm::dvec3 direction)
{
    return lookUpClipped(probe, direction) != Rgb(0.0f);
}

/// Probe radiance projected outwards: each direction's goes to the patch that it meets.
std::vector<Mean> projectOutwards(const RoomLight& room,
                                  const PatchGrid& grid,
                                  const EnvironmentMap& probe,
                                  glm::dvec3 center)
{
    struct Arrived {
        std::size_t slot = 0;
        Rgb radiance{0.0f};
        bool any = false;
        bool opening = false;
    };
    const int height = probe.pixels.height() * kDirectionGrid;
    const int width = probe.pixels.width() * kDirectionGrid;
    std::vector<Mean> means(grid.size());
    std::vector<Arrived> line(static_cast<std::size_t>(width));
    for (int y = 0; y < height; ++y) {
        parallelFor(0, width, [&](std::int64_t x) {
            const glm::dvec3 direction = environmentDirectionFromUv(
                {(static_cast<double>(x) + 0.5) / width, (y + 0.5) / height});
            const RoomLight::Arrival arrival = room.arrive(center, direction);
            Arrived& at = line[static_cast<std::size_t>(x)];
            at.any = arrival.hit.has_value();
            if (!at.any) return;
            at.slot = grid.slot(arrival.hit->face, arrival.hit->uv);
            at.radiance = isClipped(probe, direction) ? arrival.radiance : lookUp(probe, direction);
            at.opening = arrival.hit->opening;
        });
        // Summed in one order, whatever the threads did.
        const double solid_angle = environmentTexelSolidAngle(width, height, y);
        for (const Arrived& at : line) {
            if (!at.any) continue;
            means[at.slot].add(at.radiance, solid_angle);
            if (at.opening) means[at.slot].opening += solid_angle;
        }
    }
    return means;
}

/// Reflectance of the surface behind every pixel, averaged over patches.
std::vector<Mean> photographedReflectance(const RoomLight& room,
                                          const PatchGrid& grid,
                                          const PhotographedRadiance& photograph,
                                          int max_pixels)
{
    const int width = photograph.radiance.width();
    const int height = photograph.radiance.height();
    const double pixels = static_cast<double>(width) * height;
    const int step = std::max(1, static_cast<int>(std::ceil(std::sqrt(pixels / max_pixels))));
    std::vector<Mean> means(grid.size());
    const SceneProxy& proxy = room.proxy();
    for (int y = step / 2; y < height; y += step)
        for (int x = step / 2; x < width; x += step) {
            const glm::dvec3 direction = photograph.camera.rayDirection({x + 0.5, y + 0.5});
            const glm::dvec3 eye = photograph.camera.position_m;
            const auto hit = room.seesThrough(x, y) ? intersectBehindBoxes(proxy, eye, direction)
                                                    : proxy.intersect(eye, direction);
            if (!hit || hit->opening) continue;
            const Rgb irradiance = room.cellIrradiance().lookUp(hit->face, hit->uv, Rgb(0.0f)) *
                                   room.irradianceScale(hit->face, hit->uv);
            if (!(irradiance.r > 0.0f && irradiance.g > 0.0f && irradiance.b > 0.0f)) continue;
            const Rgb reflectance = photograph.radiance(x, y) * static_cast<float>(pi) / irradiance;
            means[grid.slot(hit->face, hit->uv)].add(glm::min(reflectance, Rgb(kMaxReflectance)),
                                                     1.0);
        }
    return means;
}

/// What the room says of a patch that the probe did not see, at a few of its points.
Rgb roomRadiance(const RoomLight& room, std::size_t face, const std::array<glm::dvec2, 3>& uv)
{
    const glm::dvec3 normal = room.proxy().faces()[face].normal;
    glm::dvec3 sum(0.0);
    for (int k = 0; k < 3; ++k) {
        const glm::dvec2 inside =
            (4.0 * uv[static_cast<std::size_t>(k)] + uv[static_cast<std::size_t>((k + 1) % 3)] +
             uv[static_cast<std::size_t>((k + 2) % 3)]) /
            6.0;
        const glm::dvec3 point = room.proxy().pointOn(face, inside);
        sum += glm::dvec3(room.incident(point + kInFront_m * normal, -normal).radiance) / 3.0;
    }
    return Rgb(sum);
}

void averageOverVertices(RadianceMesh& mesh)
{
    std::vector<Mean> radiance(mesh.vertices.size());
    std::vector<Mean> reflectance(mesh.vertices.size());
    for (const RadiancePatch& patch : mesh.patches)
        for (int k = 0; k < 3; ++k) {
            radiance[patch.corners[k]].add(patch.radiance, patch.area_m2);
            reflectance[patch.corners[k]].add(patch.reflectance, patch.area_m2);
        }
    for (std::size_t v = 0; v < mesh.vertices.size(); ++v) {
        mesh.vertices[v].radiance = radiance[v].value();
        mesh.vertices[v].reflectance = reflectance[v].value();
    }
}

/// Drops vertices that no patch uses (of triangular faces).
void compactVertices(RadianceMesh& mesh)
{
    std::vector<std::uint32_t> place(mesh.vertices.size(), ~0u);
    std::vector<RadianceVertex> used;
    for (RadiancePatch& patch : mesh.patches)
        for (int k = 0; k < 3; ++k) {
            std::uint32_t& to = place[patch.corners[k]];
            if (to == ~0u) {
                to = static_cast<std::uint32_t>(used.size());
                used.push_back(mesh.vertices[patch.corners[k]]);
            }
            patch.corners[k] = to;
        }
    mesh.vertices = std::move(used);
}

/// Lambert's integral of the cosine over a triangle, clipped at the horizon: ½ Σ θᵢ (n · Γᵢ).
double cosineIntegral(const std::array<glm::dvec3, 3>& corners, glm::dvec3 x, glm::dvec3 normal)
{
    std::array<glm::dvec3, 4> above{};
    std::size_t count = 0;
    for (std::size_t i = 0; i < 3; ++i) {
        const glm::dvec3 a = corners[i] - x;
        const glm::dvec3 b = corners[(i + 1) % 3] - x;
        const double ha = glm::dot(a, normal);
        const double hb = glm::dot(b, normal);
        if (ha >= 0.0 && count < 4) above[count++] = a;
        if ((ha >= 0.0) != (hb >= 0.0) && count < 4)
            above[count++] = glm::mix(a, b, ha / (ha - hb));
    }
    double sum = 0.0;
    for (std::size_t i = 0; i < count; ++i) {
        const glm::dvec3 cross = glm::cross(above[i], above[(i + 1) % count]);
        const double sine = glm::length(cross);
        if (!(sine > 0.0)) continue;
        sum += std::atan2(sine, glm::dot(above[i], above[(i + 1) % count])) *
               glm::dot(cross / sine, normal);
    }
    return 0.5 * std::abs(sum);
}

}  // namespace

Findings RadianceMeshOptions::validate() const
{
    Findings findings;
    if (!(patch_m > 0.0))
        findings.push_back({Severity::Error, "option-out-of-range", "patch_m must be > 0"});
    if (max_pixels <= 0)
        findings.push_back({Severity::Error, "option-out-of-range", "max_pixels must be > 0"});
    return findings;
}

RadianceMesh makeRadianceMesh(const RoomLight& room,
                              const EnvironmentMap& probe,
                              glm::dvec3 probe_center_m,
                              const std::optional<PhotographedRadiance>& photograph,
                              const RadianceMeshOptions& options)
{
    requireValid(options.validate(), "radiance mesh options");
    const SceneProxy& proxy = room.proxy();
    const PatchGrid grid(proxy, patchSize(proxy, options.patch_m));
    const std::vector<Mean> seen = projectOutwards(room, grid, probe, probe_center_m);
    std::vector<Mean> reflected(grid.size());
    if (photograph)
        reflected = photographedReflectance(room, grid, *photograph, options.max_pixels);

    RadianceMesh mesh;
    for (std::size_t f = 0; f < proxy.faces().size(); ++f) {
        const auto first = static_cast<std::uint32_t>(mesh.vertices.size());
        mesh.vertices.resize(first + grid.vertexCount(f));
        grid.forEach(f, [&](std::size_t slot, const std::array<glm::ivec2, 3>& places) {
            RadiancePatch patch;
            patch.face = static_cast<std::uint32_t>(f);
            std::array<glm::dvec2, 3> uv;
            std::array<glm::dvec3, 3> points;
            for (std::size_t k = 0; k < 3; ++k) {
                uv[k] = grid.uv(f, places[k]);
                points[k] = proxy.pointOn(f, uv[k]);
                patch.corners[static_cast<int>(k)] =
                    first + static_cast<std::uint32_t>(grid.vertexAt(f, places[k]));
                RadianceVertex& vertex = mesh.vertices[patch.corners[static_cast<int>(k)]];
                vertex.position_m = points[k];
                vertex.normal = proxy.faces()[f].normal;
            }
            patch.area_m2 =
                0.5 * glm::length(glm::cross(points[1] - points[0], points[2] - points[0]));
            const glm::dvec2 middle = (uv[0] + uv[1] + uv[2]) / 3.0;
            const Mean& arrived = seen[slot];
            const bool opening = arrived.weight > 0.0
                                     ? arrived.opening > 0.5 * arrived.weight
                                     : proxy.insideOpening(f, proxy.pointOn(f, middle));
            patch.source = opening              ? PatchSource::Opening
                           : arrived.weight > 0 ? PatchSource::Probe
                                                : PatchSource::Photograph;
            patch.radiance = arrived.weight > 0.0 ? arrived.value() : roomRadiance(room, f, uv);
            if (!opening) {
                patch.irradiance = room.cellIrradiance().lookUp(f, middle, Rgb(0.0f)) *
                                   room.irradianceScale(f, middle);
                patch.reflectance = reflected[slot].weight > 0.0
                                        ? reflected[slot].value()
                                        : room.cellReflectance().lookUp(f, middle, Rgb(0.5f));
            }
            mesh.patches.push_back(patch);
        });
    }
    averageOverVertices(mesh);
    compactVertices(mesh);
    return mesh;
}

glm::dvec3 irradianceFromMesh(const RadianceMesh& mesh,
                              const RoomLight& room,
                              glm::dvec3 x,
                              glm::dvec3 unit_normal)
{
    std::vector<glm::dvec3> parts(mesh.patches.size(), glm::dvec3(0.0));
    parallelFor(0, static_cast<std::int64_t>(mesh.patches.size()), [&](std::int64_t number) {
        const RadiancePatch& patch = mesh.patches[static_cast<std::size_t>(number)];
        std::array<glm::dvec3, 3> corners;
        for (std::size_t k = 0; k < 3; ++k)
            corners[k] = mesh.vertices[patch.corners[static_cast<int>(k)]].position_m;
        const double whole = cosineIntegral(corners, x, unit_normal);
        if (!(whole > 0.0)) return;
        double all = 0.0;
        double visible = 0.0;
        for (int i = 0; i < kVisibilityGrid; ++i)
            for (int j = 0; j < kVisibilityGrid; ++j) {
                // Equal areas: the unit square folded into the triangle.
                double u = (i + 0.5) / kVisibilityGrid;
                double v = (j + 0.5) / kVisibilityGrid;
                if (u + v > 1.0) {
                    u = 1.0 - u;
                    v = 1.0 - v;
                }
                const glm::dvec3 way =
                    corners[0] + u * (corners[1] - corners[0]) + v * (corners[2] - corners[0]) - x;
                const double distance = glm::length(way);
                const double cosine = glm::dot(way, unit_normal) / distance;
                if (!(cosine > 0.0)) continue;
                const double weight = cosine / (distance * distance);
                all += weight;
                const auto hit = room.intersect(x, way / distance);
                if (hit && hit->face == patch.face &&
                    std::abs(hit->distance_m - distance) < 1e-4 * (1.0 + distance))
                    visible += weight;
            }
        if (all > 0.0)
            parts[static_cast<std::size_t>(number)] =
                whole * (visible / all) * glm::dvec3(patch.radiance);
    });
    glm::dvec3 sum(0.0);
    for (const glm::dvec3& part : parts)
        sum += part;
    return sum;
}

}  // namespace insitu
