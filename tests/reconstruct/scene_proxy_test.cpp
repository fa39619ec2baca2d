#include "reconstruct/scene_proxy.h"

#include "reconstruct/primitive_library.h"
#include "reconstruct/room_bounds.h"
#include "tests/support/tolerance.h"

#include <glm/gtc/constants.hpp>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <span>

namespace insitu {
namespace {

/// A 4 x 2.5 x 5 m room with a window in its +x wall and a solid box on the floor.
RoomDescription furnishedRoom(glm::dvec3 origin = glm::dvec3(0.0))
{
    RoomDescription room;
    room.boxes.push_back(
        {origin + glm::dvec3(-2, 0, -3), origin + glm::dvec3(2, 2.5, 2), false, ""});
    room.boxes.push_back(
        {origin + glm::dvec3(-1, 0, -2), origin + glm::dvec3(0, 1, -1), true, "cupboard"});
    RoomOpening window;
    for (const glm::dvec3& corner :
         {glm::dvec3(2, 1, -1), glm::dvec3(2, 1, 1), glm::dvec3(2, 2, 1), glm::dvec3(2, 2, -1)})
        window.corners_m.push_back(origin + corner);
    room.openings.push_back(window);
    return room;
}

TEST(SceneProxy, RayFromInsideMeetsTheWallItLooksAt)
{
    const SceneProxy proxy(furnishedRoom());
    const struct {
        glm::dvec3 direction;
        const char* name;
        double distance;
    } expected[] = {{{-1, 0, 0}, "wall -x", 2.0},
                    {{0, -1, 0}, "floor", 1.5},
                    {{0, 1, 0}, "ceiling", 1.0},
                    {{0, 0, 1}, "wall +z", 1.5},
                    {{0, 0, -1}, "wall -z", 3.5}};
    for (const auto& e : expected) {
        const auto hit = proxy.intersect({0, 1.5, 0.5}, e.direction);
        ASSERT_TRUE(hit) << e.name;
        EXPECT_EQ(proxy.faces()[hit->face].name, e.name);
        EXPECT_NEAR(hit->distance_m, e.distance, tolerance::kDouble);
        EXPECT_NEAR(glm::dot(hit->normal, e.direction), -1.0, tolerance::kDouble);
        EXPECT_FALSE(hit->opening);
    }
}

TEST(SceneProxy, WindowIsAnOpeningAndTheWallAroundItIsNot)
{
    const SceneProxy proxy(furnishedRoom());
    EXPECT_TRUE(proxy.findings().empty());
    const auto through = proxy.intersect({0, 1.5, 0}, {1, 0, 0});
    ASSERT_TRUE(through);
    EXPECT_TRUE(through->opening);
    const auto beside = proxy.intersect({0, 0.5, 0}, {1, 0, 0});
    ASSERT_TRUE(beside);
    EXPECT_FALSE(beside->opening);
}

TEST(SceneProxy, SolidBoxOccludesFromOutsideOnly)
{
    const SceneProxy proxy(furnishedRoom());
    EXPECT_FALSE(proxy.mutuallyVisible({-0.5, 0.5, 0}, {-0.5, 0.5, -2.9}));
    EXPECT_TRUE(proxy.mutuallyVisible({-0.5, 1.5, 0}, {-0.5, 1.5, -2.9}));
    // From within the box, light passes its faces.
    EXPECT_TRUE(proxy.mutuallyVisible({-0.5, 0.5, -1.5}, {-0.5, 0.5, 1.0}));
}

TEST(SceneProxy, FaceThatRestsOnTheFloorReceivesNothing)
{
    const SceneProxy proxy(furnishedRoom());
    for (const ProxyFace& face : proxy.faces())
        EXPECT_NE(face.name, "cupboard bottom");
    EXPECT_EQ(proxy.faces().size(), 6u + 5u);
}

TEST(SceneProxy, CameraOutsideLooksThroughTheNearWall)
{
    const SceneProxy proxy(furnishedRoom());
    const auto hit = proxy.intersect({0.5, 1.5, 10.0}, {0, 0, -1});
    ASSERT_TRUE(hit);
    EXPECT_EQ(proxy.faces()[hit->face].name, "wall -z");
    EXPECT_NEAR(hit->distance_m, 13.0, 13.0 * tolerance::kDouble);
}

TEST(SceneProxy, FarFromTheOriginIsAsExact)
{
    const glm::dvec3 far(40000.0, -25000.0, 70000.0);
    const SceneProxy proxy(furnishedRoom(far));
    const auto hit = proxy.intersect(far + glm::dvec3(0.3, 1.2, 0.1), {0, -1, 0});
    ASSERT_TRUE(hit);
    // Coordinates of 7e4 m leave 1.5e-11 m of a double.
    EXPECT_NEAR(hit->distance_m, 1.2, 1e-10);
    const auto through = proxy.intersect(far + glm::dvec3(0, 1.5, 0), {1, 0, 0});
    ASSERT_TRUE(through);
    EXPECT_TRUE(through->opening);
}

TEST(SceneProxy, OpeningOffTheWallsIsAFinding)
{
    RoomDescription room = furnishedRoom();
    for (glm::dvec3& corner : room.openings[0].corners_m)
        corner.x -= 0.6;
    const SceneProxy proxy(room);
    EXPECT_TRUE(hasFinding(proxy.findings(), "opening-off-the-walls"));
    EXPECT_FALSE(proxy.intersect({0, 1.5, 0}, {1, 0, 0})->opening);
}

TEST(SceneProxy, PlaneIsSeenFromBothSidesAndMeshByItsTriangles)
{
    RoomDescription room;
    room.planes.push_back({{-1, 0, 0}, {2, 0, 0}, {0, 2, 0}});
    TriangleMesh mesh;
    mesh.positions = {{-1, 0, -3}, {1, 0, -3}, {-1, 2, -3}};
    mesh.triangles = {{0, 1, 2}};
    mesh.material_of = {0};
    room.meshes.push_back({mesh, "panel"});
    const SceneProxy proxy(room);
    EXPECT_NEAR(proxy.intersect({0, 1.5, 1}, {0, 0, -1})->distance_m, 1.0, tolerance::kDouble);
    EXPECT_NEAR(proxy.intersect({-0.5, 1.2, -1}, {0, 0, 1})->distance_m, 1.0, tolerance::kDouble);
    const auto on_mesh = proxy.intersect({-0.5, 0.5, -1}, {0, 0, -1});
    ASSERT_TRUE(on_mesh);
    EXPECT_EQ(proxy.faces()[on_mesh->face].name, "panel");
    // The other half of the parallelogram is not part of the triangle.
    EXPECT_FALSE(proxy.intersect({0.5, 1.8, -1}, {0, 0, -1}));
}

RoomPrimitive standing(const char* shape, const std::vector<double>& sizes, double turn_rad)
{
    const PrimitiveShape& found = builtinPrimitives().at(shape);
    RoomPrimitive primitive;
    primitive.faces = placedFaces(found, sizes, {1.0, 0.0, 0.0}, turn_rad);
    primitive.two_sided = found.two_sided;
    primitive.solid = found.solid;
    return primitive;
}

TEST(ReachOutside, IsTheLeastWayBackThroughAWall)
{
    const auto reach = [](const RoomDescription& room, glm::dvec3 p) {
        return reachOutside(room, std::span(&p, 1));
    };
    RoomDescription room;
    EXPECT_FALSE(reach(room, {0, 0, 0}));
    room.primitives.push_back(standing("box", {1, 1, 1}, 0.0));
    EXPECT_FALSE(reach(room, {0, 0, 0}));  // furniture encloses nothing

    // 4 x 2.5 x 4 m about (1, 0, 0), turned by 45°: corners at 2.83 m, walls at 2 m.
    room.primitives.push_back(standing("room-box", {4, 2.5, 4}, glm::quarter_pi<double>()));
    EXPECT_NEAR(*reach(room, {3.8, 1.0, 0.0}), 0.0, tolerance::kDouble);
    EXPECT_NEAR(*reach(room, {1.0, -0.2, 0.0}), 0.2, tolerance::kDouble);
    const double along = 3.0 / std::sqrt(2.0);
    EXPECT_NEAR(*reach(room, {1.0 + along, 1.0, along}), 1.0, 10 * tolerance::kDouble);
    // A second room beside it.
    room.boxes.push_back({{2, 0, 1}, {5, 2.5, 5}, false, ""});
    EXPECT_NEAR(*reach(room, {1.0 + along, 1.0, along}), 0.0, tolerance::kDouble);
    const std::vector<glm::dvec3> several = {{1, 1, 0}, {4, 1, 4}, {4, 2.9, 4}, {4, 1, 5.1}};
    EXPECT_NEAR(*reachOutside(room, several), 0.4, 10 * tolerance::kDouble);
    // Without its ceiling it is no longer closed: nobody knows what it encloses.
    RoomDescription open;
    open.primitives.push_back(standing("room-box", {4, 2.5, 4}, 0.0));
    open.primitives[0].faces.erase(open.primitives[0].faces.begin() + 1);
    EXPECT_FALSE(reach(open, {0, 0, 0}));
}

}  // namespace
}  // namespace insitu
