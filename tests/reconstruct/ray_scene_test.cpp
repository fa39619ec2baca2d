#include "reconstruct/ray_scene.h"

#include "core/check.h"
#include "core/parallel.h"
#include "core/random.h"
#include "tests/support/shapes.h"
#include "tests/support/tolerance.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>
#include <vector>

namespace insitu {
namespace {

RayScene sceneOf(const std::vector<TriangleMesh>& meshes)
{
    std::vector<const TriangleMesh*> pointers;
    for (const TriangleMesh& mesh : meshes)
        pointers.push_back(&mesh);
    return RayScene(pointers);
}

glm::dvec3 randomDirection(RandomStream& random)
{
    return glm::normalize(glm::dvec3(random.normal(), random.normal(), random.normal()));
}

glm::vec3 randomPoint(RandomStream& random)
{
    const float x = random.uniform();
    const float y = random.uniform();
    return {x, y, random.uniform()};
}

TriangleMesh soup(int triangles, float size, std::uint64_t seed)
{
    RandomStream random(seed, 0, 0);
    TriangleMesh mesh;
    for (int i = 0; i < triangles; ++i) {
        const glm::vec3 center = randomPoint(random);
        const auto base = static_cast<std::uint32_t>(mesh.positions.size());
        for (int corner = 0; corner < 3; ++corner)
            mesh.positions.push_back(center + size * (randomPoint(random) - 0.5f));
        mesh.triangles.push_back({base, base + 1, base + 2});
        mesh.material_of.push_back(0);
    }
    return mesh;
}

/// Distance along the ray in double, by the definition: x = o + t·d = a + u·(b − a) + v·(c − a).
std::optional<double> bruteForce(const TriangleMesh& mesh, glm::dvec3 o, glm::dvec3 d, double slack)
{
    std::optional<double> nearest;
    for (const glm::uvec3& t : mesh.triangles) {
        const glm::dvec3 a(mesh.positions[t.x]);
        const glm::dmat3 system(
            glm::dvec3(mesh.positions[t.y]) - a, glm::dvec3(mesh.positions[t.z]) - a, -d);
        const glm::dvec3 uvt = glm::inverse(system) * (o - a);
        if (uvt.x < -slack || uvt.y < -slack || uvt.x + uvt.y > 1.0 + slack || uvt.z <= 0.0)
            continue;
        if (!nearest || uvt.z < *nearest) nearest = uvt.z;
    }
    return nearest;
}

TEST(RayScene, TellsWhereATriangleIsHit)
{
    TriangleMesh mesh;
    mesh.positions = {{0, 0, 0}, {2, 0, 0}, {0, 0, -2}};
    mesh.triangles = {{0, 1, 2}};
    const RayScene scene = sceneOf({mesh});
    const std::optional<RayHit> hit = scene.intersect({0.5, 3.0, -1.0}, {0.0, -1.0, 0.0});
    ASSERT_TRUE(hit.has_value());
    EXPECT_DOUBLE_EQ(hit->distance_m, 3.0);
    EXPECT_EQ(hit->mesh, 0u);
    EXPECT_EQ(hit->triangle, 0u);
    EXPECT_NEAR(hit->barycentric.x, 0.25, tolerance::kFloat);
    EXPECT_NEAR(hit->barycentric.y, 0.5, tolerance::kFloat);
    EXPECT_EQ(hit->normal, glm::dvec3(0.0, 1.0, 0.0));
    // The normal stays on the counter-clockwise side when the ray comes from behind.
    const std::optional<RayHit> below = scene.intersect({0.5, -3.0, -1.0}, {0.0, 1.0, 0.0});
    ASSERT_TRUE(below.has_value());
    EXPECT_EQ(below->normal, glm::dvec3(0.0, 1.0, 0.0));
    EXPECT_FALSE(scene.intersect({-0.5, 3.0, -1.0}, {0.0, -1.0, 0.0}).has_value());
    EXPECT_FALSE(scene.intersect({0.5, 3.0, -1.0}, {0.0, 1.0, 0.0}).has_value());
}

TEST(RayScene, AgreesWithBruteForce)
{
    const TriangleMesh mesh = soup(300, 0.3f, 4);
    const RayScene scene = sceneOf({mesh});
    RandomStream random(5, 0, 0);
    int hits = 0;
    for (int i = 0; i < 2000; ++i) {
        const glm::dvec3 o(randomPoint(random));
        const glm::dvec3 d = randomDirection(random);
        const std::optional<RayHit> hit = scene.intersect(o, d);
        // A ray through an edge may be judged either way: leave out where slack matters.
        const std::optional<double> inside = bruteForce(mesh, o, d, -1e-5);
        const std::optional<double> around = bruteForce(mesh, o, d, 1e-5);
        if (inside != around) continue;
        ASSERT_EQ(hit.has_value(), inside.has_value()) << i;
        EXPECT_EQ(scene.occluded(o, d), hit.has_value());
        if (!hit) continue;
        ++hits;
        // Vertices are kept to a float step of the scene's size, which is 1.
        EXPECT_NEAR(hit->distance_m, *inside, tolerance::kFloat) << i;
    }
    EXPECT_GT(hits, 900);
}

TEST(RayScene, StopsAtTheGivenDistance)
{
    const RayScene scene = sceneOf({shapes::quad({-1, 0, 1}, {2, 0, 0}, {0, 0, -2})});
    const glm::dvec3 origin(0.1, 2.0, 0.2);
    const glm::dvec3 down(0.0, -1.0, 0.0);
    EXPECT_TRUE(scene.intersect(origin, down, 2.001).has_value());
    EXPECT_FALSE(scene.intersect(origin, down, 1.999).has_value());
    EXPECT_TRUE(scene.occluded(origin, down, 2.001));
    EXPECT_FALSE(scene.occluded(origin, down, 1.999));
    EXPECT_FALSE(scene.intersect(origin, down, 0.0).has_value());
    EXPECT_FALSE(scene.occluded(origin, down, -1.0));
}

TEST(RayScene, NamesTheMeshAndItsTriangle)
{
    const RayScene scene = sceneOf({shapes::quad({-1, 0, 1}, {2, 0, 0}, {0, 0, -2}),
                                    TriangleMesh{},
                                    shapes::quad({-1, 1, 1}, {2, 0, 0}, {0, 0, -2})});
    const std::optional<RayHit> top = scene.intersect({0.5, 3.0, 0.5}, {0.0, -1.0, 0.0});
    const std::optional<RayHit> bottom = scene.intersect({-0.5, 0.5, -0.5}, {0.0, -1.0, 0.0});
    ASSERT_TRUE(top && bottom);
    EXPECT_EQ(top->mesh, 2u);
    EXPECT_EQ(top->triangle, 0u);
    EXPECT_EQ(bottom->mesh, 0u);
    EXPECT_EQ(bottom->triangle, 1u);
}

TEST(RayScene, EmptyScenesHitNothing)
{
    for (const RayScene& scene : {sceneOf({}), sceneOf({TriangleMesh{}})}) {
        EXPECT_TRUE(scene.empty());
        EXPECT_FALSE(scene.intersect(glm::dvec3(0.0), {0.0, 0.0, 1.0}).has_value());
        EXPECT_FALSE(scene.occluded(glm::dvec3(0.0), {0.0, 0.0, 1.0}));
    }
}

TEST(RayScene, LeavesOutBrokenTriangles)
{
    const float nan = std::numeric_limits<float>::quiet_NaN();
    const float infinity = std::numeric_limits<float>::infinity();
    TriangleMesh mesh = shapes::quad({-1, 0, 1}, {2, 0, 0}, {0, 0, -2});
    const auto base = static_cast<std::uint32_t>(mesh.positions.size());
    for (const glm::vec3& p : {glm::vec3(nan, 1, 0), glm::vec3(infinity, 1, 0), glm::vec3(0, 1, 0)})
        mesh.positions.push_back(p);
    mesh.triangles.push_back({0, 1, base});             // a vertex that is not a number
    mesh.triangles.push_back({0, 1, base + 1});         // one at infinity
    mesh.triangles.push_back({base + 2, base + 2, 0});  // a line
    mesh.triangles.push_back({0, 0, 0});                // a point
    mesh.material_of.resize(mesh.triangles.size());
    const RayScene scene = sceneOf({mesh});
    RandomStream random(3, 0, 0);
    for (int i = 0; i < 2000; ++i) {
        const glm::dvec3 o(2.0 * random.uniform() - 1.0, 2.0, 2.0 * random.uniform() - 1.0);
        const glm::dvec3 target(2.0 * random.uniform() - 1.0, 0.0, 2.0 * random.uniform() - 1.0);
        const std::optional<RayHit> hit = scene.intersect(o, glm::normalize(target - o));
        ASSERT_TRUE(hit.has_value());
        EXPECT_LT(hit->triangle, 2u);
        EXPECT_NEAR(hit->distance_m, glm::length(target - o), tolerance::kFloat);
    }
}

TEST(RayScene, RefusesIndicesOutOfRange)
{
    TriangleMesh mesh = shapes::quad({-1, 0, 1}, {2, 0, 0}, {0, 0, -2});
    mesh.triangles.push_back({0, 1, 4});
    EXPECT_THROW(sceneOf({mesh}), LogicError);
}

// Rays from inside a closed mesh never slip out between its triangles.
TEST(RayScene, ClosedMeshesAreWatertight)
{
    const TriangleMesh mesh = shapes::sphere({0.3f, -0.2f, 0.1f}, 1.0f, 16);
    const RayScene scene = sceneOf({mesh});
    const glm::dvec3 center(0.3, -0.2, 0.1);
    RandomStream random(8, 0, 0);
    for (int i = 0; i < 20000; ++i) {
        // Aim at edges and corners.
        const glm::uvec3& t =
            mesh.triangles[random.below(static_cast<std::uint32_t>(mesh.triangles.size()))];
        const double along = i % 3 == 0 ? 0.0 : random.uniformDouble();
        const glm::dvec3 target =
            glm::mix(glm::dvec3(mesh.positions[t.x]), glm::dvec3(mesh.positions[t.y]), along);
        ASSERT_TRUE(scene.intersect(center, glm::normalize(target - center)).has_value()) << i;
    }
}

TEST(RayScene, FiltersLetRaysPass)
{
    const std::array<TriangleMesh, 3> meshes = {
        shapes::quad({-1, 2, 1}, {2, 0, 0}, {0, 0, -2}),
        shapes::quad({-1, 1, 1}, {2, 0, 0}, {0, 0, -2}),
        shapes::quad({-1, 0, 1}, {2, 0, 0}, {0, 0, -2}),
    };
    const std::array<const TriangleMesh*, 3> pointers = {&meshes[0], &meshes[1], &meshes[2]};
    const std::array<bool, 3> filtered = {true, false, true};
    // Only the half with u < 1/2 of each triangle is there; mesh 1 is not asked.
    const RayScene scene(
        pointers, filtered, [](std::uint32_t mesh, std::uint32_t, glm::vec2 barycentric) {
            EXPECT_NE(mesh, 1u);
            return barycentric.x < 0.5f;
        });
    const glm::dvec3 down(0.0, -1.0, 0.0);
    // First triangle of the quad: u grows along (2, 0, 0) from the corner (-1, ., 1).
    const std::optional<RayHit> kept = scene.intersect({-0.9, 3.0, 0.95}, down);
    const std::optional<RayHit> passed = scene.intersect({0.7, 3.0, 0.95}, down);
    ASSERT_TRUE(kept && passed);
    EXPECT_EQ(kept->mesh, 0u);
    EXPECT_EQ(passed->mesh, 1u);
    EXPECT_FALSE(scene.occluded({0.7, 3.0, 0.95}, down, 1.5));
    EXPECT_TRUE(scene.occluded({0.7, 3.0, 0.95}, down, 2.5));
    EXPECT_FALSE(scene.occluded({0.7, 0.5, 0.95}, down));
}

/// Leaves random surface points in random directions; counts rays that meet their own triangle.
int selfHits(const TriangleMesh& mesh, int rays)
{
    const RayScene scene = sceneOf({mesh});
    const BoundingBox box = boundingBox(mesh);
    RandomStream random(13, 0, 0);
    int self_hits = 0;
    for (int i = 0; i < rays; ++i) {
        const glm::dvec3 o = glm::mix(box.min, box.max, glm::dvec3(randomPoint(random)));
        const glm::dvec3 d = randomDirection(random);
        const std::optional<RayHit> hit = scene.intersect(o, d);
        if (!hit) continue;
        const glm::dvec3 point = o + d * hit->distance_m;
        const glm::dvec3 away = randomDirection(random);
        const std::optional<RayHit> again =
            scene.intersect(scene.offsetOrigin(point, hit->normal, away), away);
        if (again && again->triangle == hit->triangle) ++self_hits;
    }
    return self_hits;
}

TEST(OffsetOrigin, LeavesItsOwnTriangleAtEveryScaleAndPlace)
{
    for (const float scale : {0.01f, 1.0f, 1000.0f})
        for (const float offset : {0.0f, 100.0f, 10000.0f}) {
            TriangleMesh mesh = soup(200, 1.0f, 6);
            for (glm::vec3& p : mesh.positions)
                p = scale * p + glm::vec3(offset, -offset, 0.5f * offset);
            EXPECT_EQ(selfHits(mesh, 20000), 0) << "scale " << scale << ", offset " << offset;
        }
}

TEST(OffsetOrigin, OfASceneStaysSmall)
{
    const RayScene scene = sceneOf({shapes::box({-1, -1, -1}, {1, 1, 1})});
    const glm::dvec3 moved = scene.offsetOrigin({1.0, 0.0, 0.0}, {1.0, 0.0, 0.0}, {-0.6, 0.8, 0.0});
    EXPECT_LT(moved.x, 1.0);
    EXPECT_GT(moved.x, 1.0 - 1e-5);
}

// Without a scene at hand: same duty for rooms in metres near the origin.
TEST(OffsetOrigin, WithoutASceneServesRoomsInMetres)
{
    const TriangleMesh mesh = shapes::box({-4, 0, -5}, {4, 3, 5});
    const RayScene scene = sceneOf({mesh});
    RandomStream random(17, 0, 0);
    for (int i = 0; i < 20000; ++i) {
        const glm::dvec3 d = randomDirection(random);
        const std::optional<RayHit> hit = scene.intersect({0.5, 1.0, -0.3}, d);
        ASSERT_TRUE(hit.has_value());
        const glm::dvec3 point = glm::dvec3(0.5, 1.0, -0.3) + d * hit->distance_m;
        const glm::dvec3 away = randomDirection(random);
        const std::optional<RayHit> again =
            scene.intersect(offsetOrigin(point, hit->normal, away), away);
        // A box's normals point outwards: outwards nothing is left to be hit.
        EXPECT_EQ(again.has_value(), glm::dot(hit->normal, away) < 0.0);
    }
}

TEST(RayScene, SameHitsFromAnyNumberOfThreads)
{
    const TriangleMesh mesh = soup(2000, 0.2f, 4);
    const auto trace = [&] {
        const RayScene scene = sceneOf({mesh});
        std::vector<double> distance(20000);
        parallelFor(0, 20000, [&](std::int64_t i) {
            RandomStream random(9, static_cast<std::uint64_t>(i), 0);
            const glm::dvec3 o(randomPoint(random));
            const std::optional<RayHit> hit = scene.intersect(o, randomDirection(random));
            distance[static_cast<std::size_t>(i)] =
                hit ? hit->distance_m + hit->triangle : kInfinity;
        });
        return distance;
    };
    setThreadCount(1);
    const std::vector<double> one = trace();
    setThreadCount(0);
    EXPECT_EQ(one, trace());
}

TEST(RayScene, MayBeMoved)
{
    RayScene first = sceneOf({shapes::quad({-1, 0, 1}, {2, 0, 0}, {0, 0, -2})});
    RayScene second = std::move(first);
    EXPECT_TRUE(second.occluded({0.1, 1.0, 0.2}, {0.0, -1.0, 0.0}));
    second = sceneOf({});
    EXPECT_TRUE(second.empty());
}

}  // namespace
}  // namespace insitu
