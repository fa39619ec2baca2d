// Many objects on a floor, 512 x 512 pixels: how a frame's time grows with objects, vertices and
// lights, and its error. [Michael10] 5.2.3 shows sixty objects of 1.7 million vertices at 22 frames
// a second on its graphics hardware.
//
// fiv_many MODEL ENVIRONMENT
//
// Each object has the shells of its model: one trilinear look-up a pixel within their reach; what
// several hide is taken as independent, the product of what each leaves. Errors are NRMSE eq. 17
// against rays to the same 6x32x32 directions, over 1024 pixels.
#include "bench/fiv_lights.h"
#include "bench/fiv_report.h"
#include "bench/fiv_stage.h"
#include "core/io/image_io.h"
#include "core/io/model_io.h"
#include "core/random.h"

namespace {

using namespace insitu;
using namespace fiv_bench;
using report::Stopwatch;

constexpr int kSide = 512;
constexpr double kReach = 8.0;  // radii

/// Four triangles for each.
TriangleMesh subdivided(const TriangleMesh& mesh)
{
    TriangleMesh fine;
    fine.positions = mesh.positions;
    for (const glm::uvec3& t : mesh.triangles) {
        const auto first = static_cast<std::uint32_t>(fine.positions.size());
        for (int k = 0; k < 3; ++k)
            fine.positions.push_back(0.5f *
                                     (mesh.positions[t[k]] + mesh.positions[t[(k + 1) % 3]]));
        fine.triangles.emplace_back(first, first + 1, first + 2);
        for (std::uint32_t k = 0; k < 3; ++k)
            fine.triangles.emplace_back(t[static_cast<int>(k)], first + k, first + (k + 2) % 3);
    }
    fine.material_of.assign(fine.triangles.size(), 0);
    return fine;
}

/// A floor seen from above, and objects on it.
struct Crowd {
    LocalFrame local;
    std::vector<glm::dvec3> places;   ///< tiles of 8 x 4 pixels
    std::vector<glm::dvec3> offsets;  ///< of the objects, in the model's units

    Crowd(const LocalFrame& frame, double floor_y, int objects) : local(frame)
    {
        const double spacing = 2.6 * local.radius;
        for (int k = 0; k < objects; ++k) {
            RandomStream random(4, static_cast<std::uint64_t>(k), 0);
            offsets.emplace_back((k % 8 - 3.5 + 0.6 * (random.uniformDouble() - 0.5)) * spacing,
                                 0.0,
                                 (k / 8 - 3.5 + 0.6 * (random.uniformDouble() - 0.5)) * spacing);
        }
        const double extent = 9.0 * spacing;
        for (int top = 0; top < kSide; top += 4)
            for (int left = 0; left < kSide; left += 8)
                for (int y = top; y < top + 4; ++y)
                    for (int x = left; x < left + 8; ++x)
                        places.emplace_back(local.center.x + ((x + 0.5) / kSide - 0.5) * extent,
                                            floor_y,
                                            local.center.z + ((y + 0.5) / kSide - 0.5) * extent);
    }

    /// Irradiance of all pixels, `workspace` kept from frame to frame.
    void shade(const ShellField& field, Rgb free, std::vector<Rgb>& shown) const
    {
        // One task a stretch of pixels: each asks the objects near it.
        constexpr std::size_t kStretch = 4096;
        const std::size_t tasks = (places.size() + kStretch - 1) / kStretch;
        parallelFor(0, static_cast<std::int64_t>(tasks), [&](std::int64_t task) {
            const std::size_t begin = static_cast<std::size_t>(task) * kStretch;
            const std::size_t end = std::min(begin + kStretch, places.size());
            const std::vector<glm::vec3> normals(kStretch, kUp);
            std::vector<glm::vec3> near;
            std::vector<std::size_t> whose;
            std::vector<Rgb> hidden;
            for (std::size_t i = begin; i < end; ++i)
                shown[i] = free;
            for (const glm::dvec3 offset : offsets) {
                near.clear();
                whose.clear();
                for (std::size_t i = begin; i < end; ++i) {
                    const glm::vec3 place = local.localFrom(places[i] - offset);
                    if (glm::dot(place, place) >= static_cast<float>(kReach * kReach)) continue;
                    near.push_back(place);
                    whose.push_back(i);
                }
                if (near.empty()) continue;
                hidden.resize(near.size());
                field.hiddenIrradiance(near, std::span(normals).first(near.size()), hidden);
                for (std::size_t k = 0; k < near.size(); ++k)
                    for (int c = 0; c < 3; ++c)
                        if (free[c] > 0.0f)
                            shown[whose[k]][c] *= std::max(0.0f, 1.0f - hidden[k][c] / free[c]);
            }
        });
    }
};

double errorOf(const Crowd& crowd,
               const TriangleMesh& mesh,
               const TexelLight& light,
               const std::vector<Rgb>& shown)
{
    TriangleMesh all;
    for (const glm::dvec3 offset : crowd.offsets) {
        const auto first = static_cast<std::uint32_t>(all.positions.size());
        for (const glm::vec3 p : mesh.positions)
            all.positions.push_back(p + glm::vec3(offset));
        for (const glm::uvec3 t : mesh.triangles)
            all.triangles.push_back(t + first);
    }
    all.material_of.assign(all.triangles.size(), 0);
    const TriangleMesh* const pointer = &all;
    const RayScene rays(std::span<const TriangleMesh* const>(&pointer, 1));
    const RayScene* const scenes[] = {&rays};
    constexpr std::size_t kStep = 257;
    std::vector<std::size_t> pixels;
    for (std::size_t i = 0; i < crowd.places.size(); i += kStep)
        pixels.push_back(i);
    std::vector<Rgb> truth(pixels.size());
    parallelFor(0, static_cast<std::int64_t>(pixels.size()), [&](std::int64_t i) {
        const auto k = static_cast<std::size_t>(i);
        truth[k] = baseline::bruteForce(scenes, light, crowd.places[pixels[k]], glm::dvec3(kUp));
    });
    double square = 0.0;
    float most = 0.0f;
    float least = 1e30f;
    for (std::size_t k = 0; k < pixels.size(); ++k) {
        const Rgb off = shown[pixels[k]] - truth[k];
        square += static_cast<double>(glm::dot(off, off)) / 3.0;
        most = std::max({most, truth[k].r, truth[k].g, truth[k].b});
        least = std::min({least, truth[k].r, truth[k].g, truth[k].b});
    }
    return std::sqrt(square / static_cast<double>(pixels.size())) / (most - least);
}

void row(const std::string& name,
         const TriangleMesh& mesh,
         const TexelLight& light,
         int objects,
         bool with_error)
{
    Stage stage;
    stage.mesh = mesh;
    stage.atlas = buildVisibilityAtlas(mesh, {}, silent);
    const ObjectLight object = litByTexels(stage, light, 0);
    const ShellField field(object, {128, 65, 30, 0.35, kReach});
    const Rgb free = object.light.irradiance(kUp);
    const Crowd crowd(
        stage.local(), boundingBox(mesh).min.y - 1e-4 * stage.local().radius, objects);
    std::vector<Rgb> shown(crowd.places.size());
    const auto spent = report::fastest(5, [&] { crowd.shade(field, free, shown); });
    fmt::print("{:<26} {:>7} {:>10.2f} {:>9.1f} {:>9.1f} {:>9} {:>9.1f}\n",
               name,
               objects,
               1e-6 * static_cast<double>(mesh.positions.size()) * objects,
               1e3 * spent.wall,
               1e3 * spent.processor,
               with_error ? fmt::format("{:.4f}", errorOf(crowd, mesh, light, shown)) : "-",
               1.0 / spent.wall);
    std::fflush(stdout);
}

}  // namespace

int main(int argc, char** argv)
{
    if (argc != 3) {
        fmt::print(stderr, "usage: fiv_many MODEL ENVIRONMENT\n");
        return 2;
    }
    try {
        const TriangleMesh mesh = readModel(argv[1]).mesh;
        const EnvironmentMap environment{readRadiance(argv[2]).pixels};
        const TexelLight indoor = baseline::texelLight(environment, 32);
        fmt::print("{:<26} {:>7} {:>10} {:>9} {:>9} {:>9} {:>9}\n",
                   "light and model",
                   "objects",
                   "M vertices",
                   "ms",
                   "ms, CPU",
                   "NRMSE",
                   "frames/s");
        for (const int objects : {1, 15, 30, 60})
            row("environment", mesh, indoor, objects, objects == 1 || objects == 60);
        row("environment, 4x triangles", subdivided(mesh), indoor, 60, false);
        row("one point light", mesh, patches({{{0.5, 0.8, 0.3}, 1.0, Rgb(100.0f)}}), 60, false);
        row("two area lights",
            mesh,
            patches({{{0.6, 0.7, 0.3}, 0.97, Rgb(0.2f, 5.0f, 0.2f)},
                     {{-0.7, 0.5, 0.2}, 0.97, Rgb(5.0f, 0.2f, 0.2f)}}),
            60,
            true);
        return 0;
    } catch (const std::exception& error) {
        fmt::print(stderr, "{}\n", error.what());
        return 1;
    }
}
