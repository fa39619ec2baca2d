// Fullsphere irradiance vectors: speed against error of every technique, on the thesis's own
// configurations remade [Michael10] 5.2.1, against brute force over the same light.
//
// fiv [--stride N] MODEL ENVIRONMENT SUNLIT OUT_FOLDER: the Stanford bunny, an indoor and an
// outdoor environment. N: only every N-th position of the largest tables is traced, to measure rays
// a second (default 64).
//
// Physical limits on one core of the machine the figures in docs/validation.md are from: 10 GB/s of
// memory, 3.1 GHz. A trilinear look-up reads 8 nodes of 48 bytes that fit the second cache in part;
// a pixel's place, normal and result are 36 bytes: 28 MB for 1024 x 768, 2.8 ms of one core.

#include "bench/fiv_baseline.h"
#include "bench/fiv_lights.h"
#include "bench/fiv_occluders.h"
#include "bench/fiv_report.h"
#include "bench/fiv_stage.h"
#include "bench/fiv_sunlit.h"
#include "core/io/image_io.h"
#include "core/io/model_io.h"
#include "core/parallel.h"
#include "core/random.h"
#include "lighting/fiv_field.h"
#include "lighting/hidden_light.h"

#include <array>
#include <cstdlib>
#include <cstring>
#include <functional>

namespace {

using namespace insitu;
using baseline::TexelLight;
using report::Row;
using report::Stopwatch;
using namespace fiv_bench;

/// All of our techniques on one light against its brute force truth.
struct Asked {
    std::string shells, plane, exact;
};
void compareOurs(report::Table& table,
                 const std::string& name,
                 const Stage& stage,
                 const ObjectLight& object,
                 double light_s,
                 const Picture& truth,
                 const ShellFieldOptions& shells,
                 const Asked& asked)
{
    const auto add = [&](const std::string& technique,
                         double before,
                         double shade,
                         std::size_t memory,
                         const Picture& picture,
                         const std::string& wanted) {
        table.add({name,
                   technique,
                   before,
                   shade,
                   static_cast<double>(memory) * 1e-6,
                   nrmse(truth, picture),
                   wanted});
    };
    Picture picture;
    {
        const Stopwatch building;
        const ShellField field(object, shells);
        const double before = light_s + building.passed().processor;
        const Stopwatch watch;
        picture = shellPicture(stage, object, field);
        add("ours, shells, trilinear",
            before,
            watch.passed().processor,
            field.memoryBytes(),
            picture,
            asked.shells);
    }
    {
        const Stopwatch building;
        const PlaneField field(object, planeOf(stage.floor), {});
        const double before = light_s + building.passed().processor;
        const Stopwatch watch;
        picture = planePicture(stage, object, field);
        add("ours, plane",
            before,
            watch.passed().processor,
            field.memoryBytes(),
            picture,
            asked.plane);
    }
    const Stopwatch watch;
    picture = exactPicture(stage, object);
    add("ours, exact",
        light_s,
        watch.passed().processor,
        stage.atlas.silhouettes.memoryBytes(),
        picture,
        asked.exact);
}

/// The thesis's method with a table of this size.
void addThesis(report::Table& table,
               const std::string& name,
               const Stage& stage,
               const TexelLight& light,
               const baseline::IrradianceCube& cube,
               const baseline::TableSize& size,
               const Picture& truth)
{
    const Stopwatch building;
    const baseline::Table fivs(*stage.rays, stage.local(), light, size);
    const double before = building.passed().processor;
    const baseline::Occluder occluder{&fivs, stage.local().center, stage.local().radius};
    const Stopwatch watch;
    const Picture picture = pictureOf(stage.floor, [&](glm::dvec3 x) {
        return baseline::shadowed(cube, {&occluder, 1}, x, glm::dvec3(kUp));
    });
    table.add({name,
               "thesis, by rays",
               before,
               watch.passed().processor,
               static_cast<double>(fivs.memoryBytes()) * 1e-6,
               nrmse(truth, picture),
               ""});
}

/// Thesis tables of some sizes beside ours on one environment.
void compareTables(report::Table& table,
                   const std::string& name,
                   const Stage& stage,
                   const TexelLight& light,
                   const std::vector<baseline::TableSize>& sizes,
                   const std::vector<Asked>& asked)
{
    const RayScene* const scenes[] = {&*stage.rays};
    const Stopwatch brute;
    const Picture truth = pictureOf(stage.floor, [&](glm::dvec3 x) {
        return baseline::bruteForce(scenes, light, x, glm::dvec3(kUp));
    });
    table.add({name, "brute force, rays", 0.0, brute.passed().processor, 0.0, -1.0, ""});
    const baseline::IrradianceCube cube(light, 32);
    const Stopwatch lighting;
    const ObjectLight object = litByTexels(stage, light, 256);
    const double light_s = lighting.passed().processor;
    for (std::size_t i = 0; i < sizes.size(); ++i) {
        const baseline::TableSize& size = sizes[i];
        const std::string sized =
            fmt::format("{} {}x{}x{}", name, size.azimuths, size.polars, size.shells);
        // By rays the largest takes a quarter of an hour.
        if (size.azimuths <= 64) addThesis(table, sized, stage, light, cube, size, truth);
        compareOurs(table,
                    sized,
                    stage,
                    object,
                    light_s,
                    truth,
                    {size.azimuths, size.polars, size.shells, size.first_radii, size.last_radii},
                    asked[i]);
    }
    // Silhouettes of smaller texels, of the brightest directions and of half of all.
    constexpr std::array<std::pair<std::size_t, int>, 2> kSharper = {{{256, 512}, {3072, 128}}};
    for (const auto& [fine, resolution] : kSharper) {
        const Stopwatch sharpening;
        const ObjectLight sharp = litByTexels(stage, light, fine, {.resolution = resolution});
        const double sharp_s = sharpening.passed().processor;
        const Stopwatch watch;
        const Picture picture = exactPicture(stage, sharp);
        table.add({name,
                   fmt::format(
                       "ours, exact, {} at {}x{}", sharp.light.fine.size(), resolution, resolution),
                   sharp_s,
                   watch.passed().processor,
                   static_cast<double>(sharp.fine.memoryBytes()) * 1e-6,
                   nrmse(truth, picture),
                   asked.front().exact});
    }
}

/// Atlas and first field against plain culled rays, and how equal their masks are.
void precompute(report::Table& table, Stage& stage, const TexelLight& light, int stride)
{
    {
        const auto seconds =
            report::fastest(1, [&] { stage.atlas = buildVisibilityAtlas(stage.mesh, {}, silent); });
        stage.atlas_s = seconds.processor;
        table.add({"precompute",
                   "atlas 6x32x32 at 64x64",
                   seconds.processor,
                   0.0,
                   static_cast<double>(stage.atlas.silhouettes.memoryBytes()) * 1e-6,
                   -1.0,
                   fmt::format("64 MB; {:.2f} s wall", seconds.wall)});
    }
    const ObjectLight object = litByTexels(stage, light, 0);
    for (const double first : {1.05, 0.35}) {
        const std::string name = first > 1.0 ? "128x65x30 from 1.05 R" : "128x65x30 from 0.35 R";
        ShellField field;
        const auto seconds = report::fastest(2, [&] {
            field = ShellField(object, {128, 65, 30, first, 8.0});
        });
        table.add({name,
                   "ours, field from the atlas",
                   seconds.processor,
                   0.0,
                   static_cast<double>(field.memoryBytes()) * 1e-6,
                   -1.0,
                   fmt::format(
                       "{} ms on two cores; {:.3f} s wall", first > 1.0 ? 60 : 500, seconds.wall)});
        const Stopwatch watch;
        const baseline::Table some(
            *stage.rays, stage.local(), light, {128, 65, 30, first, 8.0}, stride);
        const double spent = watch.passed().processor;
        table.add(
            {name,
             fmt::format("rays, x{} of {:.1f} M", stride, 1e-6 * static_cast<double>(some.rays())),
             spent * stride,
             0.0,
             static_cast<double>(some.memoryBytes()) * 1e-6,
             -1.0,
             fmt::format("99 min; {:.2f} Mray/s of a core",
                         1e-6 * static_cast<double>(some.rays()) / spent)});
    }
}

/// Shares of directions inside the cone whose mask equals a ray.
void maskEquality(const Stage& stage)
{
    for (const double radii : {0.35, 0.6, 0.9, 1.05, 2.0, 5.0}) {
        std::int64_t rays = 0;
        std::int64_t equal = 0;
        for (std::uint64_t k = 0; k < 24; ++k) {
            RandomStream random(3, k, 0);
            const glm::dvec3 x = radii * glm::normalize(glm::dvec3(
                                             random.normal(), random.normal(), random.normal()));
            for (std::size_t i = 0; i < 2 * stage.atlas.cells().pairCount(); ++i) {
                const glm::dvec3 d =
                    stage.atlas.cells().direction(i / 2) * (i % 2 == 0 ? 1.0 : -1.0);
                const double along = -glm::dot(x, d);
                if (radii * radii - along * along > 1.0 || (radii > 1.0 && along < 0.0)) continue;
                const bool hidden =
                    stage.rays->occluded(stage.local().center + x * stage.local().radius, d);
                ++rays;
                equal += (hiddenShare(stage.atlas, glm::vec3(x), d) >= 0.5f) == hidden ? 1 : 0;
            }
        }
        fmt::print("masks equal to rays at {:.2f} R: {:.2f} % of {} (asked 99 %)\n",
                   radii,
                   100.0 * static_cast<double>(equal) / static_cast<double>(rays),
                   rays);
    }
}

/// Frames of 1024 x 768 pixels, each a floor point in the same view.
void frames(report::Table& table, const ObjectLight& object)
{
    constexpr int kWidth = 1024;
    constexpr int kHeight = 768;
    std::vector<glm::vec3> places;
    for (int top = 0; top < kHeight; top += 4)
        for (int left = 0; left < kWidth; left += 8)
            for (int y = top; y < top + 4; ++y)
                for (int x = left; x < left + 8; ++x) {
                    // Looking down 35 degrees from 6 radii away.
                    const double u = (x + 0.5 - 0.5 * kWidth) / kWidth;
                    const double v = (y + 0.5 - 0.5 * kHeight) / kWidth;
                    const double down = std::sin(0.61) + v * std::cos(0.61);
                    const double ahead = std::cos(0.61) - v * std::sin(0.61);
                    const double t = 3.5 / std::max(down, 0.05);
                    places.emplace_back(u * t, -0.7, ahead * t - 5.0);
                }
    std::vector<Rgb> hidden(places.size());
    const std::vector<glm::vec3> normals(places.size(), kUp);
    const auto add = [&](const std::string& technique,
                         double before,
                         Stopwatch::Seconds s,
                         const std::string& asked) {
        table.add({"frame 1024x768",
                   technique,
                   before,
                   s.processor,
                   0.0,
                   -1.0,
                   fmt::format("{}; {:.1f} ms wall", asked, 1e3 * s.wall)});
    };
    const ShellField field(object, {128, 65, 30, 0.35, 8.0});
    add("ours, shells, trilinear",
        0.0,
        report::fastest(5, [&] { field.hiddenIrradiance(places, normals, hidden); }),
        "4 ms");
    add("ours, exact, one normal",
        0.0,
        report::fastest(2, [&] { hiddenIrradiance(object, places, kUp, hidden); }),
        "80 ms");
    add("ours, exact, a normal a pixel",
        0.0,
        report::fastest(2, [&] { hiddenIrradiance(object, places, normals, hidden); }),
        "80 ms");
}

int run(const std::vector<std::string>& names, int stride)
{
    Stage stage;
    stage.mesh = readModel(names[0]).mesh;
    const TriangleMesh* const pointer = &stage.mesh;
    stage.rays.emplace(std::span<const TriangleMesh* const>(&pointer, 1));
    const EnvironmentMap indoor{readRadiance(names[1]).pixels};
    const EnvironmentMap sunlit{readRadiance(names[2]).pixels};
    const TexelLight texels = baseline::texelLight(indoor, 32);

    report::Table table;
    fmt::print("{} triangles\n", stage.mesh.triangles.size());
    report::Table::printHead();
    precompute(table, stage, texels, stride);
    maskEquality(stage);
    const double base = boundingBox(stage.mesh).min.y;
    stage.put(base, 0.0);
    const baseline::TableSize medium{48, 25, 20, 0.35, 8.0};
    compareTables(table,
                  "indoor",
                  stage,
                  texels,
                  {{32, 17, 15, 0.35, 8.0}, {64, 33, 30, 0.35, 8.0}, {256, 129, 30, 0.35, 8.0}},
                  {{"0.010 (0.023)", "0.010", "0.001"},
                   {"0.004 (0.008)", "0.004", "0.001"},
                   {"0.002 (0.007)", "0.002", "0.001"}});
    compareTables(table,
                  "one point light",
                  stage,
                  patches({{{0.5, 0.8, 0.3}, 1.0, Rgb(100.0f)}}),
                  {medium},
                  {{"0.02 (0.1)", "0.02", "0.02"}});
    const TexelLight areas = patches({{{0.6, 0.7, 0.3}, 0.97, Rgb(0.2f, 5.0f, 0.2f)},
                                      {{-0.7, 0.5, 0.2}, 0.97, Rgb(5.0f, 0.2f, 0.2f)}});
    compareTables(
        table, "two area lights", stage, areas, {medium}, {{"0.008 (0.035)", "0.008", "0.008"}});
    // A fifth of the sphere's diameter below the floor.
    stage.put(stage.local().center.y - 0.6 * stage.local().radius, 0.0);
    compareTables(table, "a fifth below", stage, areas, {medium}, {{"(0.019)", "0.005", "0.005"}});
    stage.put(base, 0.0);
    twoOccluders(table, stage, areas);
    lightBudget(table, stage, sunlit);
    frames(table, litByTexels(stage, texels, 0));
    table.write(names[3]);
    return 0;
}

}  // namespace

int main(int argc, char** argv)
{
    int stride = 64;
    std::vector<std::string> names;
    for (int i = 1; i < argc; ++i)
        if (std::strcmp(argv[i], "--stride") == 0 && i + 1 < argc)
            stride = std::max(1, std::atoi(argv[++i]));
        else
            names.emplace_back(argv[i]);
    if (names.size() != 4) {
        fmt::print(stderr, "usage: fiv [--stride N] MODEL ENVIRONMENT SUNLIT OUT_FOLDER\n");
        return 2;
    }
    try {
        return run(names, stride);
    } catch (const std::exception& error) {
        fmt::print(stderr, "{}\n", error.what());
        return 1;
    }
}
