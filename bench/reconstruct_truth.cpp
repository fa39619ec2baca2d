// reconstruct_truth [ROOM_FOLDER…]: the scene graph's solver. Re-solves a scene of 50 primitives
// after drags of one vertex, beside solving it anew; counts how often stated standard deviations
// cover the truth; and measures the furniture of rooms whose truth is known.

#include "core/io/json.h"
#include "tests/support/simulated_scene.h"

#include <fmt/core.h>
#include <sys/resource.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <limits>

namespace insitu {
namespace {

using namespace simulated_scene;
using Clock = std::chrono::steady_clock;

double processorSeconds()
{
    rusage usage{};
    getrusage(RUSAGE_SELF, &usage);
    return static_cast<double>(usage.ru_utime.tv_sec + usage.ru_stime.tv_sec) +
           1e-6 * static_cast<double>(usage.ru_utime.tv_usec + usage.ru_stime.tv_usec);
}
double median(std::vector<double> values)
{
    std::nth_element(values.begin(), values.begin() + values.size() / 2, values.end());
    return values[values.size() / 2];
}

/// A hall with `count` pieces: cupboards along the walls, tables with boxes on them.
SceneGraph hall(std::size_t count)
{
    SceneGraph graph;
    graph.primitives.push_back(primitive("hall", "room-box", {14, 3.5, 16}, {0, 0, -7}));
    graph.primitives[0].parameters[2].fixed = true;
    RandomStream random(41, 0, 0);
    while (graph.primitives.size() < count) {
        const std::size_t i = graph.primitives.size();
        const auto between = [&](double low, double high) {
            return low + (high - low) * random.uniformDouble();
        };
        ScenePrimitive box = primitive(fmt::format("piece {}", i),
                                       "box",
                                       {between(0.4, 1.2), between(0.4, 1.6), between(0.3, 0.8)},
                                       {between(-6, 6), 0, between(-14, -3)},
                                       between(-1, 1));
        if (i % 4 == 0) {
            standOn(box, graph, i - 1, "top");
        } else {
            standOn(box, graph, 0, "floor");
            if (i % 4 == 1) touch(box, "back", graph, 0, i % 8 == 1 ? "back" : "left");
        }
        graph.primitives.push_back(box);
    }
    return graph;
}

void measureDrag(std::size_t count)
{
    const Camera view = Camera::lookAt({0, 1.7, 0.8}, {0, 1.0, -8}, 1400, 3000, 2000);
    RandomStream random(43, 0, 0);
    SceneGraph graph = hall(count);
    observe(graph, view, 1.0, random);
    SceneSolver solver(disturbed(graph, 0.1, random), view);
    (void)solver.solve();
    int unknowns = solver.estimate().unknowns;

    constexpr int kDrags = 60;
    std::vector<double> wall, processor, cold_wall;
    int iterations = 0;
    double worst_cost = -1.0, best_cost = 1.0;
    for (int k = 0; k < kDrags; ++k) {
        // A vertex goes along a circle of 30 px, a step of 3 px each time.
        const std::size_t which = static_cast<std::size_t>(k / 10) * 37 % graph.vertices.size();
        const double angle = 0.1 * (k % 10);
        const glm::dvec2 to =
            graph.vertices[which].pixel + 30.0 * glm::dvec2(std::cos(angle) - 1.0, std::sin(angle));
        const double cpu = processorSeconds();
        const auto start = Clock::now();
        iterations += solver.drag(graph.vertices[which].vertex, to).iterations;
        wall.push_back(std::chrono::duration<double>(Clock::now() - start).count());
        processor.push_back(processorSeconds() - cpu);
        if (k % 10 != 9) continue;
        SceneGraph now = solver.graph();
        const auto cold_start = Clock::now();
        SceneSolver anew(disturbed(now, 0.1, random), view);
        const double other = anew.solve().cost;
        const double cost = solver.solve().cost;
        worst_cost = std::max(worst_cost, (cost - other) / other);
        best_cost = std::min(best_cost, (cost - other) / other);
        cold_wall.push_back(std::chrono::duration<double>(Clock::now() - cold_start).count());
    }
    std::sort(wall.begin(), wall.end());
    std::sort(processor.begin(), processor.end());
    fmt::print("{} primitives, {} unknowns, {} observed vertices\n",
               count,
               unknowns,
               graph.vertices.size());
    fmt::print(
        "  drag: median {:.2f} ms wall, {:.2f} ms processor; 95 % {:.2f} and {:.2f} ms; "
        "{:.1f} iterations\n",
        1e3 * median(wall),
        1e3 * median(processor),
        1e3 * wall[57],
        1e3 * processor[57],
        iterations / double(kDrags));
    fmt::print(
        "  anew, 0.1 m and 10 % off: median {:.2f} ms wall; the drags' cost is {:+.1e} to "
        "{:+.1e} of theirs\n",
        1e3 * median(cold_wall),
        best_cost,
        worst_cost);
}

void measureCoverage(double sigma_px, int draws)
{
    const Camera view = camera();
    const SceneGraph clean = furnishedRoom();
    const auto truth = placedByContacts(clean, view);
    int within1 = 0, within2 = 0, numbers = 0;
    for (int draw = 0; draw < draws; ++draw) {
        SceneGraph graph = clean;
        RandomStream random(47, static_cast<std::uint64_t>(draw), 0);
        observe(graph, view, sigma_px, random);
        SceneSolver solver(disturbed(graph, 0.1, random), view);
        (void)solver.solve();
        const SceneEstimate estimate = solver.estimate();
        const auto count = [&](const SolvedNumber& found, double wanted) {
            if (!found.sigma || *found.sigma < 1e-12) return;
            const double off = std::abs(found.value - wanted) / *found.sigma;
            within1 += off < 1.0;
            within2 += off < 1.959964;
            ++numbers;
        };
        for (std::size_t p = 0; p < truth.size(); ++p) {
            const SolvedPrimitive& found = estimate.primitives[p];
            for (std::size_t k = 0; k < truth[p].parameters.size(); ++k)
                count(found.parameters[k], truth[p].parameters[k].value);
            for (std::size_t k = 0; k < 3; ++k)
                count(found.position_m[k], truth[p].position_m[k].value);
            count(found.rotation_y_rad, truth[p].rotation_y_rad.value);
        }
    }
    fmt::print(
        "marks of {} px, {} rooms: {:.1f} % within one sigma, {:.1f} % within 1.96 "
        "({} numbers)\n",
        sigma_px,
        draws,
        100.0 * within1 / numbers,
        100.0 * within2 / numbers,
        numbers);
}

/// truth.json's camera and boxes, in the frame with the object at the origin.
void measureRoom(const std::filesystem::path& folder)
{
    const Json json = readJson(folder / "truth.json");
    const JsonNode root(json, (folder / "truth.json").string());
    const glm::dvec3 origin = root.at("object").at("position_in_world_m").vec3();
    const JsonNode c = root.at("camera");
    Camera view;
    view.width = root.at("image").at("width").integer();
    view.height = root.at("image").at("height").integer();
    view.focal_px = {c.at("fx_px").number(), c.at("fy_px").number()};
    view.principal_px = {c.at("cx_px").number(), c.at("cy_px").number()};
    view.position_m = c.at("position_in_world_m").vec3() - origin;
    view.right = c.at("right_in_world").vec3();
    view.up = c.at("up_in_world").vec3();
    view.forward = c.at("forward_in_world").vec3();

    SceneGraph clean;
    const JsonNode boxes = root.at("furniture_boxes_m");
    for (std::size_t i = 0; i < boxes.size(); ++i) {
        const glm::dvec3 low = boxes.at(i).at("min").vec3() - origin;
        const glm::dvec3 high = boxes.at(i).at("max").vec3() - origin;
        const glm::dvec3 size = high - low;
        ScenePrimitive box = primitive(boxes.at(i).at("name").text(),
                                       "box",
                                       {size.x, size.y, size.z},
                                       {0.5 * (low.x + high.x), low.y, 0.5 * (low.z + high.z)});
        clean.primitives.push_back(box);
    }
    constexpr int kDraws = 200;
    std::vector<double> square(clean.primitives.size()), stated(clean.primitives.size());
    std::vector<int> seen(clean.primitives.size());
    for (int draw = 0; draw < kDraws; ++draw) {
        SceneGraph graph = clean;
        RandomStream random(53, static_cast<std::uint64_t>(draw), 0);
        observe(graph, view, 1.0, random);
        SceneSolver solver(disturbed(graph, 0.1, random), view);
        try {
            (void)solver.solve();
        } catch (const InputError&) {
            continue;
        }
        const SceneEstimate estimate = solver.estimate();
        for (std::size_t p = 0; p < clean.primitives.size(); ++p)
            for (std::size_t k = 0; k < 3; ++k) {
                const SolvedNumber& found = estimate.primitives[p].parameters[k];
                if (!found.sigma) continue;
                const double off = found.value - clean.primitives[p].parameters[k].value;
                square[p] += off * off;
                stated[p] += *found.sigma * *found.sigma;
                ++seen[p];
            }
    }
    for (std::size_t p = 0; p < clean.primitives.size(); ++p)
        fmt::print("{} {}: size off by {:.1f} cm rms, stated {:.1f} cm ({} numbers)\n",
                   folder.filename().string(),
                   clean.primitives[p].name,
                   100.0 * std::sqrt(square[p] / std::max(1, seen[p])),
                   100.0 * std::sqrt(stated[p] / std::max(1, seen[p])),
                   seen[p]);
}

}  // namespace
}  // namespace insitu

int main(int count, char** arguments)
{
    try {
        insitu::measureDrag(50);
        insitu::measureCoverage(1.0, 1000);
        insitu::measureCoverage(4.0, 1000);
        for (int i = 1; i < count; ++i)
            insitu::measureRoom(arguments[i]);
    } catch (const std::exception& error) {
        fmt::print(stderr, "{}\n", error.what());
        return 1;
    }
    return 0;
}
