#include "core/mesh.h"

#include "tests/support/errors.h"
#include "tests/support/tolerance.h"

#include <gmock/gmock.h>

#include <limits>
#include <numbers>

namespace insitu {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

void expectNear(glm::dvec3 actual, glm::dvec3 expected, double tolerance)
{
    for (int i = 0; i < 3; ++i)
        EXPECT_NEAR(actual[i], expected[i], tolerance) << "component " << i;
}

Model oneTriangle()
{
    Model model;
    model.mesh.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
    model.mesh.triangles = {{0, 1, 2}};
    model.mesh.material_of = {0};
    model.materials.emplace_back();
    return model;
}

TEST(BoundingBox, HoldsAllVertices)
{
    TriangleMesh mesh;
    mesh.positions = {{1, -2, 3}, {-4, 5, 0}, {0, 0, 7}};
    const BoundingBox box = boundingBox(mesh);
    EXPECT_EQ(box.min, glm::dvec3(-4, -2, 0));
    EXPECT_EQ(box.max, glm::dvec3(1, 5, 7));
    EXPECT_EQ(bottomCenter(box), glm::dvec3(-1.5, -2, 3.5));
}

TEST(BoundingBox, OfNothingIsZero)
{
    const BoundingBox box = boundingBox({});
    EXPECT_EQ(box.min, glm::dvec3(0));
    EXPECT_EQ(box.max, glm::dvec3(0));
}

TEST(ExtentFinding, WarnsOfWrongUnits)
{
    EXPECT_FALSE(extentFinding({glm::dvec3(0), {0.8, 1.2, 0.7}}, "chair"));
    EXPECT_FALSE(extentFinding({glm::dvec3(0), {50, 0, 0}}, "wall"));
    const auto centimetres = extentFinding({glm::dvec3(0), {80, 120, 70}}, "chair");
    ASSERT_TRUE(centimetres);
    EXPECT_EQ(centimetres->code, "model-extent-implausible");
    EXPECT_EQ(centimetres->severity, Severity::Warning);
    EXPECT_TRUE(extentFinding({glm::dvec3(0), glm::dvec3(0.0009)}, "crumb"));
}

// Seen from above (+Y towards the viewer, x right, z down the page), counter-clockwise takes +x
// to -z and +z to +x.
TEST(Placement, TurnsCounterClockwiseSeenFromAbove)
{
    Placement quarter;
    quarter.rotation_y_rad = std::numbers::pi / 2;
    expectNear(quarter.apply({1, 0, 0}), {0, 0, -1}, tolerance::kDouble);
    expectNear(quarter.apply({0, 0, 1}), {1, 0, 0}, tolerance::kDouble);
    expectNear(quarter.apply({0, 1, 0}), {0, 1, 0}, tolerance::kDouble);
}

TEST(Placement, PivotsScalesTurnsAndMoves)
{
    const Placement placement{{10, 20, 30}, 0.01, std::numbers::pi / 6, {1, 2, 3}};
    expectNear(placement.apply({10, 20, 30}), {1, 2, 3}, tolerance::kDouble);
    const double half_sqrt3 = std::sqrt(3.0) / 2;
    expectNear(placement.apply({110, 220, 30}), {1 + half_sqrt3, 4, 3 - 0.5}, tolerance::kDouble);
}

TEST(Placed, BringsPositionsAndNormalsIntoTheWorld)
{
    TriangleMesh mesh = oneTriangle().mesh;
    mesh.normals.assign(3, {1, 0, 0});
    const TriangleMesh result = placed(mesh, {{0, 0, 0}, 2.0, std::numbers::pi / 2, {0, 1, 0}});
    expectNear(result.positions[1], {0, 1, -2}, tolerance::kFloat);
    expectNear(result.normals[1], {0, 0, -1}, tolerance::kFloat);
    EXPECT_EQ(result.triangles, mesh.triangles);
}

TEST(ValidateMesh, LeavesAGoodMeshAlone)
{
    Model model = oneTriangle();
    model.mesh.normals.assign(3, {0, 0, 1});
    const TriangleMesh before = model.mesh;
    validateMesh(model, "m.obj");
    EXPECT_EQ(model.mesh.positions, before.positions);
    EXPECT_EQ(model.mesh.normals, before.normals);
    EXPECT_EQ(model.mesh.triangles, before.triangles);
    EXPECT_THAT(model.findings, IsEmpty());
}

TEST(ValidateMesh, RefusesWhatCannotBeDrawn)
{
    const auto errorAfter = [](auto spoil) {
        Model model = oneTriangle();
        spoil(model);
        return inputErrorOf([&] { validateMesh(model, "m.obj"); });
    };
    const float nan = std::numeric_limits<float>::quiet_NaN();
    const float inf = std::numeric_limits<float>::infinity();
    EXPECT_THAT(errorAfter([](Model& m) { m.mesh = {}; }), HasSubstr("no triangles"));
    EXPECT_THAT(errorAfter([&](Model& m) { m.mesh.positions[1].y = nan; }), HasSubstr("vertex 1"));
    EXPECT_THAT(errorAfter([&](Model& m) { m.mesh.positions[2].x = inf; }), HasSubstr("vertex 2"));
    EXPECT_THAT(errorAfter([](Model& m) { m.mesh.triangles[0].z = 3; }),
                HasSubstr("vertex 3 of 3"));
    EXPECT_THAT(errorAfter([](Model& m) { m.mesh.material_of[0] = 1; }), HasSubstr("material 1"));
    EXPECT_THAT(errorAfter([](Model& m) { m.mesh.material_of.clear(); }), HasSubstr("material"));
    EXPECT_THAT(errorAfter([](Model& m) { m.mesh.normals.resize(2); }), HasSubstr("2 normals"));
    EXPECT_THAT(errorAfter([](Model& m) { m.mesh.texcoords.resize(4); }), HasSubstr("texture"));
    EXPECT_THAT(errorAfter([&](Model& m) {
                    m.mesh.texcoords.assign(3, {0, nan});
                }),
                HasSubstr("texture coordinate 0"));
    EXPECT_THAT(errorAfter([](Model& m) {
                    m.mesh.positions[2] = {2, 0, 0};
                }),
                HasSubstr("points or lines"));
}

TEST(ValidateMesh, DropsDegenerateTrianglesAndWhatOnlyTheyUse)
{
    Model model = oneTriangle();
    model.mesh.positions.insert(model.mesh.positions.begin(), glm::vec3(-100));
    model.mesh.triangles = {{0, 0, 1}, {1, 2, 3}, {1, 1, 1}};
    model.mesh.material_of = {0, 0, 0};
    validateMesh(model, "m.obj");
    EXPECT_TRUE(hasFinding(model.findings, "mesh-degenerate-triangles"));
    EXPECT_THAT(model.mesh.triangles, ElementsAre(glm::uvec3(0, 1, 2)));
    EXPECT_EQ(model.mesh.material_of.size(), 1u);
    EXPECT_EQ(boundingBox(model.mesh).min, glm::dvec3(0));
}

// The test for degeneracy is relative, so that small and large models are treated alike.
TEST(ValidateMesh, KeepsTinyAndHugeTriangles)
{
    for (const float size : {1e-15f, 1e15f}) {
        Model model = oneTriangle();
        for (glm::vec3& position : model.mesh.positions)
            position *= size;
        validateMesh(model, "m.obj");
        EXPECT_EQ(model.mesh.triangles.size(), 1u) << size;
    }
}

TEST(RelativeTo, LeadsToTheSamePlace)
{
    const Placement base{{0.1, 0.2, 0.3}, 2.0, 0.5, {10.0, 1.0, -20.0}};
    const Placement other{{-1.0, 0.0, 0.5}, 0.001, -2.0, {11.0, 1.5, -19.0}};
    const Placement relative = relativeTo(base, other);
    for (const glm::dvec3 x : {glm::dvec3(0.0), glm::dvec3(120.0, -40.0, 300.0)})
        expectNear(base.apply(relative.apply(x)), other.apply(x), 1e-6);
    // Seen from itself it is nowhere and does nothing.
    const glm::dvec3 x(1.0 / 3.0, -7.0, 0.1);
    expectNear(relativeTo(base, base).apply(x), x, tolerance::kDouble);
}

TEST(RelativeTo, IsTheSameNumbersElsewhere)
{
    const Placement base{{0.1, 0.2, 0.3}, 1.0, 0.0, {0.0, 0.0, 0.0}};
    const Placement other{{0.0, 0.0, 0.0}, 1.0, 0.25, {0.3, 0.0, 0.7}};
    const Placement here = relativeTo(base, other);
    for (const double turn : {0.1, 1.3, 2.9}) {
        const glm::dvec3 way(7.1, 0.0, -3.3);
        const Placement turning{glm::dvec3(0.0), 1.0, turn, way};
        Placement moved_base = base;
        moved_base.position_m = turning.apply(base.position_m);
        moved_base.rotation_y_rad += turn;
        Placement moved = other;
        moved.position_m = turning.apply(other.position_m);
        moved.rotation_y_rad += turn;
        const Placement there = relativeTo(moved_base, moved);
        EXPECT_EQ(there.position_m, here.position_m) << turn;
        EXPECT_EQ(there.rotation_y_rad, here.rotation_y_rad) << turn;
    }
}

TEST(ValidateMesh, RepairsNormals)
{
    Model model = oneTriangle();
    model.mesh.normals = {{0, 3, 4}, {0, 0, 0}, {0, 0, std::numeric_limits<float>::quiet_NaN()}};
    validateMesh(model, "m.obj");
    EXPECT_TRUE(hasFinding(model.findings, "mesh-normals-repaired"));
    expectNear(model.mesh.normals[0], {0, 0.6, 0.8}, tolerance::kFloat);
    expectNear(model.mesh.normals[1], {0, 0, 1}, tolerance::kFloat);
    expectNear(model.mesh.normals[2], {0, 0, 1}, tolerance::kFloat);
}

}  // namespace
}  // namespace insitu
