#include "reconstruct/scene_solve.h"
#include "tests/support/errors.h"
#include "tests/support/simulated_scene.h"
#include "tests/support/tolerance.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <functional>

namespace insitu {
namespace {

using namespace simulated_scene;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

std::string messageOf(const Findings& findings, const std::string& code)
{
    std::string all;
    for (const Finding& finding : findings)
        if (finding.code == code) all += finding.message + "\n";
    return all;
}

SceneEstimate solved(const SceneGraph& graph)
{
    SceneSolver solver(graph, camera());
    (void)solver.solve();
    return solver.estimate();
}

SceneGraph observedRoom(double sigma_px = 1.0)
{
    SceneGraph graph = furnishedRoom();
    RandomStream random(23, 0, 0);
    observe(graph, camera(), sigma_px, random);
    return graph;
}

std::size_t observation(const SceneGraph& graph, const std::string& name)
{
    for (std::size_t i = 0; i < graph.vertices.size(); ++i)
        if (graph.vertices[i].name == name) return i;
    ADD_FAILURE() << "no observation " << name;
    return 0;
}

TEST(SceneFindings, AContradictionIsNamed)
{
    for (const char* name : {"table.top_front_left", "cupboard.top_front_right", "ramp.top_left"}) {
        SceneGraph graph = observedRoom();
        graph.vertices[observation(graph, name)].pixel += glm::dvec2(25, -10);
        const Findings findings = solved(graph).findings;
        const std::string message = messageOf(findings, "reconstruct-conflict");
        EXPECT_THAT(message, HasSubstr(fmt::format("\"{}\" contradicts", name)));
        EXPECT_EQ(std::count(message.begin(), message.end(), '\n'), 1) << message;
    }
    EXPECT_TRUE(solved(observedRoom()).findings.empty());
}

TEST(SceneFindings, TwoContradictionsAreBothNamed)
{
    SceneGraph graph = observedRoom();
    graph.vertices[observation(graph, "table.top_front_left")].pixel += glm::dvec2(25, -10);
    graph.vertices[observation(graph, "shelf.top_front_left")].pixel += glm::dvec2(-18, 22);
    const std::string message = messageOf(solved(graph).findings, "reconstruct-conflict");
    EXPECT_THAT(message,
                AllOf(HasSubstr("\"table.top_front_left\" contradicts"),
                      HasSubstr("\"shelf.top_front_left\" contradicts")));
    EXPECT_EQ(std::count(message.begin(), message.end(), '\n'), 2) << message;
}

TEST(SceneFindings, WhatCannotBeToldApartIsNamedTogether)
{
    // One edge of the table is all that two lengths say different things about.
    SceneGraph graph;
    graph.primitives.push_back(primitive("desk", "box", {1.4, 0.7, 0.8}, {0.3, 0, -1.5}));
    graph.primitives[0].position_fixed = graph.primitives[0].rotation_fixed = true;
    graph.lengths.push_back({{0, 0}, {0, 1}, 1.4, 0.01, "width by tape"});
    graph.lengths.push_back({{0, 2}, {0, 3}, 1.6, 0.01, "width by plan"});
    const std::string message = messageOf(solved(graph).findings, "reconstruct-conflict");
    EXPECT_THAT(message, AllOf(HasSubstr("width by tape"), HasSubstr("width by plan")));
}

TEST(SceneFindings, WhatIsLeftOpenIsNamed)
{
    SceneGraph graph = observedRoom();
    // Without its top vertices nothing tells how high the table is; the lamp stands on it.
    std::erase_if(graph.vertices, [&](const VertexObservation& o) {
        return o.vertex.primitive == 4 || (o.vertex.primitive == 3 && o.vertex.vertex >= 4);
    });
    const SceneEstimate estimate = solved(graph);
    const std::string message = messageOf(estimate.findings, "reconstruct-undetermined");
    EXPECT_THAT(message,
                AllOf(HasSubstr("table.height_m"),
                      HasSubstr("lamp.radius_m"),
                      HasSubstr("lamp.position_x"),
                      HasSubstr("5 numbers"),
                      Not(HasSubstr("table.width_m")),
                      Not(HasSubstr("lamp.rotation"))));
    EXPECT_FALSE(estimate.primitives[3].parameters[1].sigma);
    EXPECT_EQ(estimate.primitives[3].parameters[1].value, 0.75);  // as it began
    EXPECT_FALSE(estimate.primitives[4].position_m[1].sigma);
    EXPECT_TRUE(estimate.primitives[3].parameters[0].sigma);
    EXPECT_TRUE(estimate.primitives[3].position_m[1].sigma);
}

TEST(SceneFindings, SizeAndDistanceOfWhatFloatsAreOneOpenDirection)
{
    SceneGraph graph;
    graph.primitives.push_back(primitive("kite", "box", {0.5, 0.5, 0.5}, {0, 1, -2}));
    graph.primitives[0].height = SceneHeight::Free;
    RandomStream random(29, 0, 0);
    observe(graph, camera(), 0.5, random);
    const SceneEstimate estimate = solved(graph);
    EXPECT_THAT(messageOf(estimate.findings, "reconstruct-undetermined"),
                AllOf(HasSubstr("1 number more"), HasSubstr("kite.width_m")));
    EXPECT_FALSE(estimate.primitives[0].parameters[0].sigma);
    EXPECT_TRUE(estimate.primitives[0].rotation_y_rad.sigma);  // scale leaves the turn alone
}

TEST(SceneFindings, NumbersThatSayLittle)
{
    SceneGraph weak;
    weak.primitives.push_back(primitive("desk", "box", {0.3, 0.3, 0.3}, {0, 0, -2}));
    RandomStream random(31, 0, 0);
    observe(weak, camera(), 0.0, random);
    for (VertexObservation& o : weak.vertices)
        o.sigma_px = 60.0;
    EXPECT_THAT(messageOf(solved(weak).findings, "reconstruct-weak"), HasSubstr("desk.depth_m"));

    SceneGraph flat = observedRoom(0.5);
    flat.primitives[3].shape.parameters[1].minimum = 0.9;
    flat.primitives[3].parameters[1].value = 1.0;
    const SceneEstimate bounded = solved(flat);
    EXPECT_EQ(bounded.primitives[3].parameters[1].value, 0.9);
    EXPECT_THAT(messageOf(bounded.findings, "reconstruct-at-bound"),
                HasSubstr("table.height_m = 0.9"));

    SceneGraph noisy = observedRoom(3.0);
    for (VertexObservation& o : noisy.vertices)
        o.sigma_px = 1.4;
    EXPECT_THAT(messageOf(solved(noisy).findings, "reconstruct-residuals-large"), HasSubstr("1."));
}

TEST(SceneFindings, NoEndIsTold)
{
    // A floor point that is seen above the horizon: the box flees without end.
    SceneGraph graph;
    graph.primitives.push_back(primitive("desk", "box", {1, 1, 1}, {0, 0, -2}));
    graph.vertices.push_back({{0, 0}, {600, 100}, 1.0, "desk.a"});
    graph.vertices.push_back({{0, 1}, {700, 100}, 1.0, "desk.b"});
    const SceneEstimate estimate = solved(graph);
    EXPECT_TRUE(hasFinding(estimate.findings, "reconstruct-not-converged") ||
                hasFinding(estimate.findings, "reconstruct-residuals-large") ||
                hasFinding(estimate.findings, "reconstruct-conflict"));
}

TEST(SceneFindings, AVertexBehindTheCameraIsAnError)
{
    SceneGraph graph;
    graph.primitives.push_back(primitive("desk", "box", {1, 1, 1}, {0, 0, 9}));
    graph.vertices.push_back({{0, 0}, {600, 500}, 1.0, "desk.bottom_back_left"});
    SceneSolver solver(graph, camera());
    EXPECT_THAT(inputErrorOf([&] { (void)solver.solve(); }),
                AllOf(HasSubstr("desk.bottom_back_left"), HasSubstr("behind the camera")));
}

TEST(SceneGraph, HierarchiesThatContradictThemselvesAreNamed)
{
    EXPECT_FALSE(sceneProblem(furnishedRoom()));
    const auto problem = [](const std::function<void(SceneGraph&)>& change) {
        SceneGraph graph = furnishedRoom();
        change(graph);
        const auto found = sceneProblem(graph);
        return found ? graph.primitives[found->primitive].name + ": " + found->cause
                     : std::string("none");
    };
    EXPECT_THAT(problem([](SceneGraph& g) { touch(g.primitives[3], "left", g, 0, "ceiling"); }),
                AllOf(HasSubstr("table"), HasSubstr("ceiling"), HasSubstr("not upright")));
    EXPECT_THAT(problem([](SceneGraph& g) { touch(g.primitives[3], "top", g, 0, "left"); }),
                HasSubstr("its face \"top\" is not upright"));
    EXPECT_THAT(problem([](SceneGraph& g) {
                    ScenePrimitive lying = primitive("book", "box", {1, 1, 1}, {0, 0, 0});
                    standOn(lying, g, 5, "slope");
                    g.primitives.push_back(lying);
                }),
                AllOf(HasSubstr("book"), HasSubstr("does not look up")));
    EXPECT_THAT(problem([](SceneGraph& g) { touch(g.primitives[1], "right", g, 0, "right"); }),
                HasSubstr("two of its contacts are along its x axis"));
    EXPECT_THAT(
        problem([](SceneGraph& g) {
            g.primitives[1].aligned = SceneAlignment{0, 0.1};
        }),
        AllOf(HasSubstr("contradict"), HasSubstr("aligned with room"), HasSubstr("against")));
    EXPECT_THAT(problem([](SceneGraph& g) { g.primitives[5].rotation_fixed = true; }),
                AllOf(HasSubstr("ramp"), HasSubstr("its fixed rotation")));
    // Both contacts are at the corner of one room: no contradiction.
    EXPECT_EQ(problem([](SceneGraph& g) {
                  g.primitives[1].aligned = SceneAlignment{0, 0.0};
              }),
              "none");
    EXPECT_THAT(problem([](SceneGraph& g) {
                    for (int i = 0; i < 12; ++i) {
                        ScenePrimitive next = primitive("tower", "box", {1, 1, 1}, {0, 0, 0});
                        standOn(next, g, g.primitives.size() - 1, "top");
                        if (i == 0) next.height = SceneHeight::Fixed;
                        g.primitives.push_back(next);
                    }
                }),
                HasSubstr("at most 64 are solved"));
}

}  // namespace
}  // namespace insitu
