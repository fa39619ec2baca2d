#include "lighting/radiance_mesh.h"

#include "core/io/json.h"
#include "core/io/model_io.h"
#include "core/parallel.h"
#include "tests/support/errors.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/tolerance.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <numbers>

namespace insitu {
namespace {

using std::numbers::pi;
using testing::HasSubstr;

constexpr glm::dvec3 kProbe(0.3, 1.0, -0.4);
constexpr int kRows = 128;

RoomDescription furnishedRoom()
{
    RoomDescription room;
    room.boxes.push_back({{-2, 0, -3}, {2, 2.5, 2}, false, ""});
    room.boxes.push_back({{-1.6, 0, -2.6}, {-0.6, 0.9, -1.6}, true, "chest"});
    room.openings.push_back({{{2, 1, -1}, {2, 1, 1}, {2, 2, 1}, {2, 2, -1}}});
    return room;
}

/// What the surfaces of the room send: darker walls, a bright window, a lamp on the ceiling.
Rgb sent(const SceneProxy& proxy, const ProxyHit& hit)
{
    if (hit.opening) return {8.0f, 9.0f, 11.0f};
    const glm::dvec3 p = hit.point;
    if (p.y > 2.49 && std::abs(p.x) < 0.2 && std::abs(p.z) < 0.2) return {60.0f, 50.0f, 40.0f};
    const float wave = static_cast<float>(1.0 + 0.3 * std::sin(2.0 * p.x + 3.0 * p.z + p.y));
    const bool floor = proxy.faces()[hit.face].name == "floor";
    return (floor ? Rgb(0.5f, 0.35f, 0.2f) : Rgb(0.7f, 0.72f, 0.7f)) * wave;
}

EnvironmentMap probeOf(const SceneProxy& proxy)
{
    EnvironmentMap map{Image<Rgb>(2 * kRows, kRows)};
    for (int y = 0; y < kRows; ++y)
        for (int x = 0; x < 2 * kRows; ++x) {
            const auto hit = proxy.intersect(
                kProbe, environmentDirectionFromUv({(x + 0.5) / (2.0 * kRows), (y + 0.5) / kRows}));
            map.pixels(x, y) = hit ? sent(proxy, *hit) : Rgb(0.0f);
        }
    return map;
}

/// The room, its light and its mesh, made once.
struct Scene {
    SceneProxy proxy{furnishedRoom()};
    EnvironmentMap probe = probeOf(proxy);
    Progress silent;
    RoomLight light;
    RadianceMesh mesh;

    static RoomLightOptions options()
    {
        RoomLightOptions coarse;
        coarse.texel_m = 0.04;
        coarse.cell_m = 0.4;
        coarse.rays_per_cell = 128;
        return coarse;
    }
    static RadianceMeshOptions patches()
    {
        RadianceMeshOptions coarse;
        coarse.patch_m = 0.2;
        return coarse;
    }
    Scene()
        : light(proxy, probe, kProbe, std::nullopt, options(), silent),
          mesh(makeRadianceMesh(light, probe, kProbe, std::nullopt, patches()))
    {
    }
};
const Scene& scene()
{
    static const Scene made;
    return made;
}

TEST(RadianceMesh, SendsTheProbeAsMuchLightAsCame)
{
    for (const glm::dvec3 normal : {glm::dvec3(1, 0, 0),
                                    glm::dvec3(-1, 0, 0),
                                    glm::dvec3(0, 1, 0),
                                    glm::dvec3(0, -1, 0),
                                    glm::dvec3(0, 0, 1),
                                    glm::dvec3(0, 0, -1)}) {
        const glm::dvec3 wanted = irradiance(scene().probe, normal);
        const glm::dvec3 found = irradianceFromMesh(scene().mesh, scene().light, kProbe, normal);
        for (int c = 0; c < 3; ++c)
            EXPECT_NEAR(found[c] / wanted[c], 1.0, 0.03) << normal.x << normal.y << normal.z;
    }
}

TEST(RadianceMesh, CoversEverySurfaceOnce)
{
    std::vector<double> area(scene().proxy.faces().size());
    for (const RadiancePatch& patch : scene().mesh.patches) {
        area[patch.face] += patch.area_m2;
        const auto corner = [&](int k) { return scene().mesh.vertices[patch.corners[k]]; };
        const glm::dvec3 normal = glm::cross(corner(1).position_m - corner(0).position_m,
                                             corner(2).position_m - corner(0).position_m);
        EXPECT_GT(glm::dot(normal, corner(0).normal), 0.0);
    }
    for (std::size_t f = 0; f < area.size(); ++f)
        EXPECT_NEAR(area[f], scene().proxy.area(f), 1e-9) << f;
}

TEST(RadianceMesh, PatchesShineAsTheirSurfaces)
{
    double window = 0.0;
    double radiance_off = 0.0;
    double reflectance_off = 0.0;
    int probe = 0;
    int unseen = 0;
    for (const RadiancePatch& patch : scene().mesh.patches) {
        glm::dvec3 middle(0.0);
        for (int k = 0; k < 3; ++k)
            middle += scene().mesh.vertices[patch.corners[k]].position_m / 3.0;
        if (patch.source == PatchSource::Opening) {
            window += patch.area_m2;
            EXPECT_EQ(patch.reflectance, Rgb(0.0f));
        }
        unseen += patch.source == PatchSource::Photograph;
        const std::string& name = scene().proxy.faces()[patch.face].name;
        if (patch.source != PatchSource::Probe || name != "wall -x") continue;
        ++probe;
        ProxyHit hit;
        hit.face = patch.face;
        hit.point = middle;
        radiance_off +=
            static_cast<double>(std::abs(patch.radiance.g - sent(scene().proxy, hit).g));
        const float ratio = static_cast<float>(pi) * patch.radiance.g / patch.irradiance.g;
        reflectance_off +=
            static_cast<double>(std::abs(patch.reflectance.g - std::min(ratio, 0.95f)));
    }
    // A patch of 0.2 m spans a wave of 0.2 by up to 0.04 either way, less in the mean; behind the
    // chest's edge only a part of it was seen. Reflectance is that of cells of 0.4 m.
    EXPECT_LT(radiance_off / probe, 0.01);
    EXPECT_LT(reflectance_off / probe, 0.05);
    EXPECT_NEAR(window, 2.0, 0.3);  // the window's edges lie inside patches
    EXPECT_GT(probe, 300);
    EXPECT_GT(unseen, 20);  // the far sides of the chest
}

// Nothing of the chest's far side was seen: gathered light times 0.5.
TEST(RadianceMesh, WhatNoPictureSawGathersLight)
{
    int checked = 0;
    for (const RadiancePatch& patch : scene().mesh.patches) {
        if (scene().proxy.faces()[patch.face].name != "chest -x") continue;
        EXPECT_EQ(patch.source, PatchSource::Photograph);
        const glm::dvec3 gathered = irradianceFromMesh(
            scene().mesh,
            scene().light,
            scene().mesh.vertices[patch.corners[0]].position_m + glm::dvec3(-0.01, 0.01, 0.01),
            {-1, 0, 0});
        // Cells of 0.4 m and 128 rays against the mesh's own integral: 15 % each.
        EXPECT_NEAR(patch.radiance.g / (0.5 / pi * gathered.g), 1.0, 0.35);
        ++checked;
    }
    EXPECT_GT(checked, 20);
}

TEST(RadianceMesh, ReflectanceComesFromThePhotographsPixels)
{
    const Camera camera = Camera::lookAt({1.5, 1.6, 1.5}, {-1.0, 0.6, -2.5}, 220, 320, 240);
    Image<Rgb> picture(320, 240);
    for (int y = 0; y < 240; ++y)
        for (int x = 0; x < 320; ++x)
            if (const auto hit = scene().proxy.intersect(camera.position_m,
                                                         camera.rayDirection({x + 0.5, y + 0.5})))
                // Twice as bright as the probe saw it, so that one can tell who was asked.
                picture(x, y) = 2.0f * sent(scene().proxy, *hit);
    const PhotographedRadiance photograph{camera, picture};
    const RadianceMesh mesh =
        makeRadianceMesh(scene().light, scene().probe, kProbe, photograph, Scene::patches());
    ASSERT_EQ(mesh.patches.size(), scene().mesh.patches.size());
    int doubled = 0;
    for (std::size_t i = 0; i < mesh.patches.size(); ++i) {
        EXPECT_EQ(mesh.patches[i].radiance, scene().mesh.patches[i].radiance);
        const float before = scene().mesh.patches[i].reflectance.g;
        if (before > 0.05f && before < 0.4f)
            doubled += std::abs(mesh.patches[i].reflectance.g / before - 2.0f) < 0.5f;
        EXPECT_LE(mesh.patches[i].reflectance.g, 0.95001f);  // a mean of floats
    }
    EXPECT_GT(doubled, 50);
}

TEST(RadianceMesh, IsTheSameFromAnyNumberOfThreads)
{
    setThreadCount(1);
    const RadianceMesh one =
        makeRadianceMesh(scene().light, scene().probe, kProbe, std::nullopt, Scene::patches());
    setThreadCount(0);
    for (std::size_t i = 0; i < one.patches.size(); ++i)
        ASSERT_EQ(one.patches[i].radiance, scene().mesh.patches[i].radiance);
}

TEST(RadianceMesh, IsWrittenForOtherPrograms)
{
    const TemporaryFolder folder;
    writeRadianceMesh(folder / "mesh.ply", scene().mesh);
    const Model read = readModel(folder / "mesh.ply");
    EXPECT_EQ(read.mesh.positions.size(), scene().mesh.vertices.size());
    ASSERT_EQ(read.mesh.triangles.size(), scene().mesh.patches.size());
    EXPECT_EQ(read.mesh.triangles[7], scene().mesh.patches[7].corners);
    EXPECT_EQ(read.mesh.positions[9], glm::vec3(scene().mesh.vertices[9].position_m));

    writeRadianceMesh(folder / "mesh.json", scene().mesh);
    const Json json = readJson(folder / "mesh.json");
    EXPECT_EQ(json["patches"].size(), scene().mesh.patches.size());
    EXPECT_EQ(json["vertices"][3]["radiance"][1].get<float>(), scene().mesh.vertices[3].radiance.g);
    EXPECT_THAT(inputErrorOf([&] { writeRadianceMesh(folder / "mesh.obj", scene().mesh); }),
                HasSubstr(".ply or .json"));
}

TEST(RadianceMesh, OptionsAreChecked)
{
    RadianceMeshOptions options;
    options.patch_m = 0.0;
    options.max_pixels = 0;
    EXPECT_THAT(inputErrorOf([&] {
                    (void)makeRadianceMesh(
                        scene().light, scene().probe, kProbe, std::nullopt, options);
                }),
                testing::AllOf(HasSubstr("patch_m"), HasSubstr("max_pixels")));
}

}  // namespace
}  // namespace insitu
