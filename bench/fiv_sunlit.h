#pragma once

#include "bench/fiv_lights.h"
#include "bench/fiv_report.h"
#include "bench/fiv_stage.h"

#include <cmath>
#include <string>

namespace insitu::fiv_bench {

using report::Stopwatch;

/// Where the error comes from under a sun: truth has directions 1/8 as wide and a finely cut sun.
inline void lightBudget(report::Table& table, const Stage& stage, const EnvironmentMap& sunlit)
{
    Floor floor = stage.floor;
    floor.side = 48;
    Stage small;
    small.mesh = stage.mesh;
    small.atlas = stage.atlas;
    small.floor = floor;
    floor.tiled(stage.local(), small.places, small.pixels);
    const auto byRays = [&](const CellLight& light, DirectionCells cells) {
        const Rgb free = light.irradiance(kUp);
        return pictureOf(floor, [&](glm::dvec3 x) {
            const glm::dvec3 to = stage.local().center - x;
            const double distance = glm::length(to);
            const double radius = stage.local().radius;
            const double cone =
                distance > radius ? std::sqrt(1.0 - radius * radius / distance / distance) : -1.0;
            glm::dvec3 hidden(0.0);
            const auto add = [&](const IrradianceVector& v, glm::dvec3 d) {
                const Rgb e = glm::max(v.along(kUp), Rgb(0.0f));
                if (e != Rgb(0.0f) && glm::dot(to, d) >= cone * distance &&
                    stage.rays->occluded(x, d))
                    hidden += glm::dvec3(e);
            };
            for (std::size_t k = 0; k < light.along.size(); ++k) {
                add(light.along[k], cells.direction(k));
                add(light.against[k], -cells.direction(k));
            }
            for (std::size_t k = 0; k < light.fine.size(); ++k)
                add(light.fine[k], light.fine_directions[k]);
            return free - Rgb(hidden);
        });
    };
    const Stopwatch brute;
    const Picture truth = byRays(splitLight(sunlit, glm::dmat3(1.0), {128}, {2000, 1e-6}), {128});
    table.add({"sunlit",
               "truth: 6x128x128 and 2000, rays",
               0.0,
               brute.passed().processor,
               0.0,
               -1.0,
               ""});
    const auto add = [&](const std::string& technique,
                         double before,
                         double shade,
                         const Picture& picture,
                         const std::string& asked) {
        table.add({"sunlit", technique, before, shade, 0.0, nrmse(truth, picture), asked});
    };
    for (const int n : {32, 64, 128}) {
        const Stopwatch watch;
        const Picture picture =
            byRays(splitLight(sunlit, glm::dmat3(1.0), {n}, {.max_fine_directions = 0}), {n});
        add(fmt::format("rays, 6x{0}x{0} texels", n),
            0.0,
            watch.passed().processor,
            picture,
            n == 32   ? "(0.047)"
            : n == 64 ? "(0.019)"
                      : "(0.012)");
    }
    for (const int fine : {0, 16, 48, 128}) {
        const Stopwatch watch;
        const ObjectLight object =
            lightObject(stage.mesh,
                        stage.atlas,
                        splitLight(sunlit, glm::dmat3(1.0), {32}, {.max_fine_directions = fine}),
                        {},
                        silent);
        const double before = watch.passed().processor;
        const Stopwatch shading;
        const Picture picture = exactPicture(small, object);
        add(fmt::format("ours, exact, {} fine directions", object.light.fine.size()),
            before,
            shading.passed().processor,
            picture,
            "");
    }
}

}  // namespace insitu::fiv_bench
