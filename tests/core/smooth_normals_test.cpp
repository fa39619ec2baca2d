#include "core/io/smooth_normals.h"

#include "core/io/triangulate.h"
#include "tests/support/tolerance.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

namespace insitu {
namespace {

using ::testing::SizeIs;

void expectNear(glm::dvec3 actual, glm::dvec3 expected, double tolerance = tolerance::kFloat)
{
    for (int i = 0; i < 3; ++i)
        EXPECT_NEAR(actual[i], expected[i], tolerance) << "component " << i;
}

void addFace(PolygonSoup& soup, std::initializer_list<std::uint32_t> corners, std::int32_t group)
{
    if (soup.face_begin.empty()) soup.face_begin.push_back(0);
    soup.corner_position.insert(soup.corner_position.end(), corners);
    soup.face_begin.push_back(static_cast<std::uint32_t>(soup.corner_position.size()));
    soup.face_group.push_back(group);
}

std::vector<glm::vec3> cubeCorners()
{
    std::vector<glm::vec3> corners;
    for (int i = 0; i < 8; ++i)
        corners.emplace_back(i & 1 ? 1 : -1, i & 2 ? 1 : -1, i & 4 ? 1 : -1);
    return corners;
}

constexpr std::uint32_t kCubeQuads[6][4] = {
    {0, 4, 6, 2}, {1, 3, 7, 5}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 2, 3, 1}, {4, 5, 7, 6}};

// By symmetry the normal at a cube's corner is its diagonal, however the faces are cut: that is
// what weighting by angle is for. Weighting by face or area would lean to the side of the cuts.
TEST(CornerNormals, OfACubeAreItsDiagonalsWhateverTheCuts)
{
    for (const bool cut : {false, true}) {
        PolygonSoup cube;
        cube.positions = cubeCorners();
        for (const auto& q : kCubeQuads) {
            if (cut) {
                addFace(cube, {q[0], q[1], q[2]}, 1);
                addFace(cube, {q[0], q[2], q[3]}, 1);
            } else {
                addFace(cube, {q[0], q[1], q[2], q[3]}, 1);
            }
        }
        const std::vector<glm::vec3> normals = cornerNormals(cube);
        for (std::size_t i = 0; i < normals.size(); ++i)
            expectNear(normals[i],
                       glm::dvec3(cube.positions[cube.corner_position[i]]) / std::sqrt(3.0));
    }
}

// A corner of 90 degrees facing z against two of 30 degrees facing x: weights 3 to 2.
TEST(CornerNormals, WeighByTheAngleAtTheCorner)
{
    const auto at = [](double degrees) {
        const double a = degrees * std::numbers::pi / 180;
        return glm::vec3(0, std::cos(a), std::sin(a));
    };
    PolygonSoup soup;
    soup.positions = {{0, 0, 0}, {-5, 0, 0}, {0, 1, 0}, at(30), at(60), {-5, 1, 0}};
    addFace(soup, {0, 2, 5, 1}, 1);  // in the plane z = 0, facing +z
    addFace(soup, {0, 2, 3}, 1);     // in the plane x = 0, facing +x
    addFace(soup, {0, 3, 4}, 1);
    const glm::dvec3 expected = glm::normalize(glm::dvec3(2, 0, 3));
    expectNear(cornerNormals(soup)[0], expected);
    expectNear(cornerNormals(soup)[4], expected);
    // The far corner of the quadrilateral belongs to it alone.
    expectNear(cornerNormals(soup)[3], {0, 0, 1});
}

TEST(CornerNormals, DoNotReachOverGroupsNorFlatFaces)
{
    PolygonSoup fold;
    fold.positions = {{0, 0, 0}, {0, 1, 0}, {-1, 1, 0}, {-1, 0, 0}, {0, 1, 1}, {0, 0, 1}};
    for (const auto& [first, second] : {std::pair(1, 2), std::pair(1, kFlatGroup)}) {
        PolygonSoup soup = fold;
        addFace(soup, {0, 1, 2, 3}, first);
        addFace(soup, {0, 1, 4, 5}, second);
        const std::vector<glm::vec3> normals = cornerNormals(soup);
        for (std::size_t i = 0; i < 4; ++i)
            expectNear(normals[i], {0, 0, 1});
        for (std::size_t i = 4; i < 8; ++i)
            expectNear(normals[i], {1, 0, 0});
    }
}

TEST(CornerNormals, EqualCoordinatesUnderTwoIndicesAreNotJoined)
{
    PolygonSoup soup;
    soup.positions = {
        {0, 0, 0}, {0, 1, 0}, {-1, 1, 0}, {-1, 0, 0}, {0, 0, 0}, {0, 1, 0}, {0, 1, 1}, {0, 0, 1}};
    addFace(soup, {0, 1, 2, 3}, 1);
    addFace(soup, {4, 5, 6, 7}, 1);
    expectNear(cornerNormals(soup)[0], {0, 0, 1});
    expectNear(cornerNormals(soup)[4], {1, 0, 0});
}

TEST(CornerNormals, FallBackToTheFaceWhereTheyCancel)
{
    PolygonSoup sheet;
    sheet.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
    addFace(sheet, {0, 1, 2}, 1);
    addFace(sheet, {0, 2, 1}, 1);
    expectNear(cornerNormals(sheet)[0], {0, 0, 1});
    expectNear(cornerNormals(sheet)[3], {0, 0, -1});
}

TEST(PolygonNormal, FarFromTheOriginKeepsItsDigits)
{
    PolygonSoup soup;
    soup.positions = {{4096, 4096, 4096}, {4097, 4096, 4096}, {4097, 4097, 4096}};
    addFace(soup, {0, 1, 2}, 1);
    expectNear(polygonNormal(soup, 0), {0, 0, 1}, tolerance::kDouble);
}

double areaOf(const std::vector<glm::vec3>& polygon, const std::vector<glm::uvec3>& triangles)
{
    double area = 0.0;
    for (const glm::uvec3& t : triangles) {
        const glm::dvec3 n = glm::cross(glm::dvec3(polygon[t.y] - polygon[t.x]),
                                        glm::dvec3(polygon[t.z] - polygon[t.x]));
        area += 0.5 * n.z;
        EXPECT_GE(n.z, 0.0) << "triangle " << t.x << " " << t.y << " " << t.z << " is turned";
    }
    return area;
}

// Signed areas that are all positive and add up to the polygon's: a tiling without overlap.
TEST(Triangulator, TilesConcavePolygons)
{
    const std::vector<glm::vec3> arrow = {{0, 0, 0}, {2, -1, 0}, {0.5, 0, 0}, {2, 1, 0}};
    const std::vector<glm::vec3> comb = {{0, 0, 0},
                                         {5, 0, 0},
                                         {5, 3, 0},
                                         {4, 3, 0},
                                         {4, 1, 0},
                                         {3, 1, 0},
                                         {3, 3, 0},
                                         {2, 3, 0},
                                         {2, 1, 0},
                                         {1, 1, 0},
                                         {1, 3, 0},
                                         {0, 3, 0}};
    for (const auto& [polygon, area] : {std::pair(arrow, 0.5), std::pair(comb, 11.0)})
        for (std::size_t start = 0; start < polygon.size(); ++start) {
            std::vector<glm::vec3> turned = polygon;
            std::rotate(
                turned.begin(), turned.begin() + static_cast<std::ptrdiff_t>(start), turned.end());
            Triangulator triangulator;
            std::vector<glm::uvec3> triangles;
            triangulator.triangulate(turned, triangles);
            EXPECT_THAT(triangles, SizeIs(polygon.size() - 2));
            EXPECT_NEAR(areaOf(turned, triangles), area, tolerance::kFloat) << "start " << start;
            EXPECT_FALSE(triangulator.gaveUp());
        }
}

TEST(Triangulator, CutsQuadrilateralsAlongTheFirstDiagonal)
{
    const std::vector<glm::vec3> square = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}};
    std::vector<glm::uvec3> triangles;
    Triangulator().triangulate(square, triangles);
    EXPECT_THAT(triangles, testing::ElementsAre(glm::uvec3(0, 1, 2), glm::uvec3(0, 2, 3)));
}

TEST(Triangulator, EndsOnAnyPolygon)
{
    // A spiral has few ears at a time; crossed and collapsed polygons may have none.
    std::vector<glm::vec3> spiral;
    constexpr int kHalf = 20'000;
    for (int i = 0; i < 2 * kHalf; ++i) {
        const int step = i < kHalf ? i : 2 * kHalf - 1 - i;
        const double radius = 1.0 + 0.01 * step + (i < kHalf ? 0.0 : 0.3);
        spiral.emplace_back(radius * std::cos(0.05 * step), radius * std::sin(0.05 * step), 0);
    }
    const std::vector<glm::vec3> crossed = {
        {0, 0, 0}, {1, 1, 0}, {1, 0, 0}, {0, 1, 0}, {0.5, -1, 0}, {0.2, 2, 0}};
    const std::vector<glm::vec3> point(7, {1, 2, 3});
    for (const auto& polygon : {spiral, crossed, point}) {
        Triangulator triangulator;
        std::vector<glm::uvec3> triangles;
        triangulator.triangulate(polygon, triangles);
        EXPECT_THAT(triangles, SizeIs(polygon.size() - 2));
        EXPECT_EQ(triangulator.gaveUp(), polygon.size() > 1000);
    }
}

}  // namespace
}  // namespace insitu
