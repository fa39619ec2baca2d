#pragma once

#include "bench/fiv_baseline.h"
#include "bench/fiv_lights.h"
#include "bench/fiv_report.h"
#include "bench/fiv_stage.h"
#include "lighting/staged_objects.h"

#include <span>
#include <string>
#include <vector>

namespace insitu::fiv_bench {

using report::Stopwatch;

/// Two of the objects, one behind the other as the light sees them.
inline void twoOccluders(report::Table& table, const Stage& stage, const TexelLight& light)
{
    const LocalFrame& local = stage.local();
    const glm::dvec3 apart(1.2 * local.radius, 0.0, 0.3 * local.radius);
    Placement moved;
    moved.position_m = apart;
    const TriangleMesh second = placed(stage.mesh, moved);
    const TriangleMesh* const pointer = &second;
    const RayScene second_rays(std::span<const TriangleMesh* const>(&pointer, 1));
    const RayScene* const scenes[] = {&*stage.rays, &second_rays};
    const Picture truth = pictureOf(stage.floor, [&](glm::dvec3 x) {
        return baseline::bruteForce(scenes, light, x, glm::dvec3(kUp));
    });
    const baseline::IrradianceCube cube(light, 32);
    const baseline::Table fivs(*stage.rays, local, light, {32, 17, 15, 0.35, 8.0});
    const baseline::Occluder both[] = {{&fivs, local.center, local.radius},
                                       {&fivs, local.center + apart, local.radius}};
    const auto add = [&](const std::string& technique, double shade, const Picture& picture) {
        table.add(
            {"two occluders", technique, 0.0, shade, 0.0, nrmse(truth, picture), "0.005 (0.019)"});
    };
    for (const bool corrected : {false, true}) {
        const Stopwatch watch;
        const Picture picture = pictureOf(stage.floor, [&](glm::dvec3 x) {
            return baseline::shadowed(cube, both, x, glm::dvec3(kUp), {.multiple = corrected});
        });
        add(corrected ? "thesis, by rays" : "thesis, not corrected",
            watch.passed().processor,
            picture);
    }
    const ObjectLight one = litByTexels(stage, light, 256);
    const StagedObject objects[] = {{&stage.mesh, &stage.atlas, {}},
                                    {&stage.mesh, &stage.atlas, moved}};
    const ObjectStage pair(objects, one.light, light.cells, {}, silent);
    std::vector<glm::dvec3> places;
    for (const glm::ivec2 p : stage.pixels)
        places.push_back(stage.floor.place(p.x, p.y));
    std::vector<Rgb> hidden(places.size());
    const Stopwatch watch;
    pair.hiddenIrradiance(places, kUp, hidden);
    const double shade = watch.passed().processor;
    const Rgb free = one.light.irradiance(kUp);
    Picture picture(stage.floor.side, stage.floor.side);
    for (std::size_t i = 0; i < hidden.size(); ++i)
        picture(stage.pixels[i].x, stage.pixels[i].y) = free - hidden[i];
    add("ours, exact union", shade, picture);
}

}  // namespace insitu::fiv_bench
