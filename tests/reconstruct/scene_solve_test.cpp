#include "reconstruct/scene_solve.h"

#include "calib/camera_errors.h"
#include "reconstruct/scene_equations.h"
#include "tests/support/simulated_scene.h"
#include "tests/support/tolerance.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace insitu {
namespace {

using namespace simulated_scene;

/// Largest distance of any vertex between two solutions.
double furthest(const SceneGraph& graph,
                const std::vector<SolvedPrimitive>& a,
                const std::vector<SolvedPrimitive>& b)
{
    double most = 0.0;
    for (std::size_t p = 0; p < a.size(); ++p)
        for (std::size_t v = 0; v < graph.primitives[p].shape.vertices.size(); ++v)
            most = std::max(most,
                            glm::distance(vertexOf(graph, a, {p, v}), vertexOf(graph, b, {p, v})));
    return most;
}

// Every kind of constraint through every kind of hierarchy, against central differences.
TEST(SceneEquations, DerivativesAreThoseOfDifferences)
{
    SceneGraph graph = furnishedRoom();
    const Camera view = camera();
    RandomStream random(3, 0, 0);
    observe(graph, view, 5.0, random, 3);
    graph.edges.push_back({{3, 4}, {3, 5}, {300, 400}, {500, 420}, 2.0, "edge"});
    graph.lengths.push_back({{1, 0}, {4, 30}, 2.0, 0.05, "length"});
    graph.lengths.push_back({{0, 0}, {0, 7}, 7.0, 0.05, "diagonal"});
    graph.primitives[3].parameters[1].sigma = 0.01;
    const SceneLayout layout(graph);
    std::vector<double> state;
    for (const SceneUnknown& unknown : layout.unknowns())
        state.push_back(unknown.start + 0.05 * gauss(random));
    std::vector<ScenePose> poses;
    int checked = 0;
    for (const SceneEquation& equation : sceneEquations(graph, view, layout)) {
        layout.evaluate(state, poses);
        double at[2];
        EquationJacobian jacobian;
        ASSERT_TRUE(evaluateEquation(equation, view, layout, state, poses, at, &jacobian));
        for (std::size_t u = 0; u < equation.unknowns.size(); ++u) {
            const double step = 1e-5;
            double side[2][2];
            for (int k = 0; k < 2; ++k) {
                std::vector<double> moved = state;
                moved[equation.unknowns[u]] += k == 0 ? step : -step;
                layout.evaluate(moved, poses);
                ASSERT_TRUE(
                    evaluateEquation(equation, view, layout, moved, poses, side[k], nullptr));
            }
            for (int r = 0; r < equation.size; ++r) {
                const double numeric = (side[0][r] - side[1][r]) / (2 * step);
                const double analytic = jacobian(r, static_cast<Eigen::Index>(u));
                // Central differences of step 1e-5 leave about 1e-7 of the greatest derivative.
                EXPECT_NEAR(analytic, numeric, 1e-6 * (1.0 + std::abs(numeric)))
                    << equation.name << ", " << layout.unknowns()[equation.unknowns[u]].label;
                ++checked;
            }
        }
    }
    EXPECT_GT(checked, 300);
}

TEST(SceneGraph, HierarchicalConstraintsHoldExactly)
{
    SceneGraph graph = furnishedRoom();
    const Camera view = camera();
    RandomStream random(5, 0, 0);
    observe(graph, view, 8.0, random);
    SceneSolver solver(disturbed(graph, 0.2, random), view);
    EXPECT_TRUE(solver.solve().converged);
    const auto solved = solver.primitives();
    const auto at = [&](std::size_t p, const char* vertex) {
        return vertexOf(graph, solved, {p, *graph.primitives[p].shape.findVertex(vertex)});
    };
    const auto outOf = [&](std::size_t wall_primitive, const char* wall, glm::dvec3 point) {
        const auto faces = solvedFaces(graph.primitives[wall_primitive], solved[wall_primitive]);
        const auto& c = faces[face(graph.primitives[wall_primitive], wall)].corners_m;
        return glm::dot(glm::normalize(glm::cross(c[1] - c[0], c[2] - c[0])), point - c[0]);
    };
    const double exact = 1e-11;  // a few roundings of coordinates of metres
    for (const char* vertex : {"bottom_back_left", "top_back_right"})
        EXPECT_NEAR(outOf(0, "back", at(1, vertex)), 0.02, exact);
    for (const char* vertex : {"bottom_front_left", "top_back_left"})
        EXPECT_NEAR(outOf(0, "left", at(1, vertex)), 0.0, exact);
    for (const char* vertex : {"bottom_front_left", "top_back_left"})
        EXPECT_NEAR(outOf(1, "right", at(2, vertex)), 0.0, exact);
    EXPECT_NEAR(outOf(1, "front", at(2, "top_front_right")), 0.0, exact);
    EXPECT_NEAR(outOf(3, "top", at(4, "bottom_5")), 0.0, exact);
    EXPECT_NEAR(outOf(0, "back", at(5, "top_left")), 0.0, exact);
    EXPECT_EQ(solved[4].rotation_y_rad.value, solved[3].rotation_y_rad.value);
    for (std::size_t p : {1, 2, 3, 5})
        EXPECT_EQ(solved[p].position_m[1].value, 0.0);
}

TEST(SceneSolver, FindsTheRoomWithoutNoise)
{
    SceneGraph graph = furnishedRoom();
    const Camera view = camera();
    RandomStream random(7, 0, 0);
    const auto truth = placedByContacts(graph, view);
    observe(graph, view, 0.0, random);
    for (int start = 0; start < 5; ++start) {
        SceneSolver solver(disturbed(graph, 0.25, random), view);
        const SceneSolution solution = solver.solve();
        EXPECT_TRUE(solution.converged);
        EXPECT_LT(solution.iterations, 30);
        EXPECT_LT(furthest(graph, solver.primitives(), truth), tolerance::kIterative);
        EXPECT_TRUE(solver.estimate().findings.empty());
    }
}

TEST(SceneSolver, EdgesAloneFindABox)
{
    SceneGraph graph;
    graph.primitives.push_back(primitive("desk", "box", {1.4, 0.7, 0.8}, {0.3, 0, -1.5}, 0.5));
    const Camera view = camera();
    const auto truth = placedByContacts(graph, view);
    const PrimitiveShape& box = graph.primitives[0].shape;
    for (const PrimitiveFace& f : box.faces)
        for (std::size_t i = 0; i < 4; ++i) {
            const SceneVertex a{0, f.corners[i]};
            const SceneVertex b{0, f.corners[(i + 1) % 4]};
            const glm::dvec3 pa = vertexOf(graph, truth, a);
            const glm::dvec3 pb = vertexOf(graph, truth, b);
            // Marked somewhere along the edge, not at its ends.
            graph.edges.push_back({a,
                                   b,
                                   *view.project(glm::mix(pa, pb, 0.2)),
                                   *view.project(glm::mix(pa, pb, 0.7)),
                                   1.0,
                                   f.name});
        }
    RandomStream random(9, 0, 0);
    SceneSolver solver(disturbed(graph, 0.2, random), view);
    EXPECT_TRUE(solver.solve().converged);
    EXPECT_LT(furthest(graph, solver.primitives(), truth), tolerance::kIterative);
}

TEST(SceneSolver, ADragIsTheWholeSolution)
{
    SceneGraph graph = furnishedRoom();
    const Camera view = camera();
    RandomStream random(11, 0, 0);
    observe(graph, view, 2.0, random);
    SceneSolver dragged(graph, view);
    (void)dragged.solve();
    for (int step = 1; step <= 5; ++step)
        EXPECT_TRUE(dragged.drag({3, 6}, graph.vertices[20].pixel + glm::dvec2(4.0 * step, step))
                        .converged);
    EXPECT_TRUE(dragged.solve().converged);
    SceneSolver anew(dragged.graph(), view);
    EXPECT_TRUE(anew.solve().converged);
    // Both stop once the cost changes by 1e-10 of itself, a hundredth of a standard deviation off.
    EXPECT_LT(furthest(graph, dragged.primitives(), anew.primitives()), 1e-4);
    EXPECT_EQ(dragged.graph().vertices.size(), graph.vertices.size());
}

TEST(SceneSolver, WhatStandsOnAPrimitiveFollowsIt)
{
    SceneGraph graph = furnishedRoom();
    const Camera view = camera();
    RandomStream random(13, 0, 0);
    observe(graph, view, 0.0, random);
    // No observation of the lamp: it stays where it is on the table.
    std::erase_if(graph.vertices, [](const auto& o) { return o.vertex.primitive == 4; });
    SceneSolver solver(graph, view);
    (void)solver.solve();
    const auto before = solver.primitives();
    for (const VertexObservation& o : graph.vertices)
        if (o.vertex.primitive == 3) (void)solver.drag(o.vertex, o.pixel + glm::dvec2(60, 0), 0.01);
    const auto after = solver.primitives();
    const auto relative = [&](const std::vector<SolvedPrimitive>& solved) {
        const glm::dvec3 way(solved[4].position_m[0].value - solved[3].position_m[0].value,
                             solved[4].position_m[1].value,
                             solved[4].position_m[2].value - solved[3].position_m[2].value);
        return rotatedY(way, -solved[3].rotation_y_rad.value);
    };
    EXPECT_GT(std::abs(after[3].position_m[0].value - before[3].position_m[0].value), 0.1);
    EXPECT_NEAR(relative(after).x, relative(before).x, 1e-9);
    EXPECT_NEAR(relative(after).z, relative(before).z, 1e-9);
    EXPECT_NEAR(relative(after).y, after[3].parameters[1].value, 1e-12);
}

/// How often the numbers of solved scenes lie within their stated deviations.
struct Coverage {
    int within1 = 0;
    int within2 = 0;
    int numbers = 0;

    void count(const SolvedNumber& found, double wanted)
    {
        ASSERT_TRUE(found.sigma);
        if (*found.sigma < 1e-12) return;
        const double off = std::abs(found.value - wanted) / *found.sigma;
        within1 += off < 1.0;
        within2 += off < 1.959964;
        ++numbers;
    }
    void count(const SceneEstimate& estimate, const std::vector<SolvedPrimitive>& truth)
    {
        for (std::size_t p = 0; p < truth.size(); ++p) {
            for (std::size_t k = 0; k < truth[p].parameters.size(); ++k)
                count(estimate.primitives[p].parameters[k], truth[p].parameters[k].value);
            for (std::size_t k = 0; k < 3; ++k)
                count(estimate.primitives[p].position_m[k], truth[p].position_m[k].value);
            count(estimate.primitives[p].rotation_y_rad, truth[p].rotation_y_rad.value);
        }
    }
    /// Within three standard errors of what a normal distribution gives.
    void expectNormal(double independent) const
    {
        EXPECT_NEAR(within1 / double(numbers), 0.6827, 3 * std::sqrt(0.217 / independent));
        EXPECT_NEAR(within2 / double(numbers), 0.95, 3 * std::sqrt(0.0475 / independent));
    }
};

// Stated standard deviations cover the truth as often as they should.
TEST(SceneEstimate, SigmasCoverTheTruth)
{
    const Camera view = camera();
    SceneGraph clean = furnishedRoom();
    const auto truth = placedByContacts(clean, view);
    Coverage coverage;
    double factor = 0.0;
    constexpr int kDraws = 150;
    for (int draw = 0; draw < kDraws; ++draw) {
        SceneGraph graph = clean;
        RandomStream random(17, static_cast<std::uint64_t>(draw), 0);
        observe(graph, view, 2.0, random);
        SceneSolver solver(graph, view);
        (void)solver.solve();
        const SceneEstimate estimate = solver.estimate();
        factor += estimate.variance_factor / kDraws;
        coverage.count(estimate, truth);
    }
    // The numbers of one draw depend on each other: about as many independent ones as unknowns, 25
    // of 35, in 150 draws.
    coverage.expectNormal(25.0 * kDraws);
    EXPECT_NEAR(factor, 1.0, 0.05);
}

TEST(SceneEstimate, TheCamerasErrorsAreInTheSigmas)
{
    const Camera view = camera();
    SceneGraph clean = furnishedRoom();
    const auto truth = placedByContacts(clean, view);
    // Focal length 0.6 %, turns 0.2°, place 1.5 cm, lens 0.004; turn and focal length hang
    // together.
    CameraEstimate calibrated;
    CameraCovariance covariance{};
    const double sigma[] = {0.0035, 0.0035, 0.002, 0.006, 2.0, 2.0, 0.004, 0.015, 0.015, 0.015};
    for (std::size_t i = 0; i < 10; ++i)
        covariance[i][i] = sigma[i] * sigma[i];
    covariance[0][3] = covariance[3][0] = 0.7 * sigma[0] * sigma[3];
    covariance[1][7] = covariance[7][1] = -0.6 * sigma[1] * sigma[7];
    calibrated.camera = view;
    setCovariance(covariance, calibrated);
    Coverage with;
    Coverage without;
    constexpr int kDraws = 400;
    for (int draw = 0; draw < kDraws; ++draw) {
        SceneGraph graph = clean;
        RandomStream random(19, static_cast<std::uint64_t>(draw), 0);
        observe(graph, view, 1.0, random);
        // Drawn by hand, not by errorSteps.
        double normal[10];
        for (double& one : normal)
            one = gauss(random);
        normal[3] = 0.7 * normal[0] + std::sqrt(1.0 - 0.7 * 0.7) * normal[3];
        normal[7] = -0.6 * normal[1] + 0.8 * normal[7];
        CameraStep off{};
        for (std::size_t i = 0; i < off.size(); ++i)
            off[i] = sigma[i] * normal[i];
        CameraEstimate found = calibrated;
        found.camera = stepped(view, off);
        SceneSolver solver(graph, found.camera);
        (void)solver.solve();
        with.count(solver.estimate(errorCameras(found)), truth);
        without.count(solver.estimate(), truth);
    }
    // All numbers of a draw follow the few directions in which the camera's errors are large.
    with.expectNormal(4.0 * kDraws);
    EXPECT_LT(without.within1, without.numbers / 2);
}

}  // namespace
}  // namespace insitu
