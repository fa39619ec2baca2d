#include "lighting/hidden_light.h"

#include "core/parallel.h"
#include "core/random.h"
#include "lighting/fiv_kernel.h"
#include "reconstruct/ray_scene.h"
#include "tests/lighting/furniture_shapes.h"
#include "tests/lighting/light_samples.h"
#include "tests/support/errors.h"
#include "tests/support/tolerance.h"

#include <gmock/gmock.h>

#include <cstring>
#include <limits>
#include <numbers>

namespace insitu {
namespace {

using std::numbers::pi;
using testing::HasSubstr;

const AtlasOptions kSmall{.face_size = 16, .resolution = 64, .samples = 2};

TEST(HiddenLight, BallUnderConstantLightIsItsFormFactor)
{
    const TriangleMesh ball = shapes::sphere({0, 0, 0}, 1.0f, 32);
    const VisibilityAtlas atlas = buildVisibilityAtlas(ball, {32, 32, 2}, silent);
    const ObjectLight object = lit(ball, atlas, constant(1.0f));
    for (const double radii : {1.2, 1.5, 2.5}) {
        const std::vector<glm::vec3> places = placesAround(radii, 200);
        const std::vector<IrradianceVector> hidden = hiddenAt(object, places);
        double square = 0.0;
        for (std::size_t i = 0; i < places.size(); ++i) {
            // FIV of a disc of uniform radiance: π sin² of its half angle, towards its middle.
            const glm::vec3 expected = -glm::normalize(places[i]) * static_cast<float>(pi) /
                                       static_cast<float>(radii * radii);
            const double off = glm::length(hidden[i].channels[0] - expected);
            square += off * off * radii * radii * radii * radii / (pi * pi);
        }
        // The cells on the cone's edge count by their middle: n of them, each wrong at random.
        EXPECT_LT(std::sqrt(square / 200.0), radii < 2.0 ? 0.01 : 0.02) << radii;
    }
}

TEST(HiddenLight, SumsAreThoseOfTheDefinition)
{
    const TriangleMesh mesh = shapes::table();
    const VisibilityAtlas atlas = buildVisibilityAtlas(mesh, kSmall, silent);
    const ObjectLight object = lit(mesh, atlas, lamps());
    ASSERT_FALSE(object.light.fine.empty());
    std::vector<glm::vec3> places;
    for (const double radii : {0.3, 0.8, 1.1, 3.0})
        for (const glm::vec3& p : placesAround(radii, 25))
            places.push_back(p);
    const float bias = 0.25f;
    std::vector<IrradianceVector> hidden(places.size());
    hiddenVectors(object, places, hidden, bias);
    const double total = 10.0;
    for (std::size_t i = 0; i < places.size(); ++i) {
        std::array<glm::dvec3, 3> sum{glm::dvec3(0.0), glm::dvec3(0.0), glm::dvec3(0.0)};
        const auto add = [&](const IrradianceVector& light, double share) {
            for (std::size_t c = 0; c < 3; ++c)
                sum[c] += glm::dvec3(light.channels[c]) * share;
        };
        for (std::size_t k = 0; k < atlas.cells().pairCount(); ++k) {
            const HiddenShares shares = hiddenShares(atlas.silhouettes, k, places[i], bias);
            add(object.light.along[k], shares.along);
            add(object.light.against[k], shares.against);
        }
        for (std::size_t k = 0; k < object.light.fine.size(); ++k)
            add(object.light.fine[k], hiddenShares(object.fine, k, places[i], bias).along);
        // The stated error of summing in float: 1e-6 of all light, over thousands of directions.
        for (std::size_t c = 0; c < 3; ++c)
            for (int axis = 0; axis < 3; ++axis)
                EXPECT_NEAR(hidden[i].channels[c][axis], sum[c][axis], 2e-6 * total) << i;
    }
}

TEST(HiddenLight, HorizonIsThatOfTheNormal)
{
    const TriangleMesh mesh = shapes::chair();
    const VisibilityAtlas atlas = buildVisibilityAtlas(mesh, kSmall, silent);
    const ObjectLight object = lit(mesh, atlas, lamps());
    const std::vector<glm::vec3> places = placesAround(0.9, 100);
    const glm::vec3 normal = glm::normalize(glm::vec3(0.2f, 1.0f, -0.3f));
    std::vector<Rgb> common(places.size());
    std::vector<Rgb> own(places.size());
    hiddenIrradiance(object, places, normal, common);
    hiddenIrradiance(object, places, std::vector<glm::vec3>(places.size(), normal), own);
    const std::vector<IrradianceVector> vectors = hiddenAt(object, places);
    int clipped = 0;
    for (std::size_t i = 0; i < places.size(); ++i) {
        EXPECT_EQ(common[i], own[i]);
        // Light below the horizon counts against N·FIV, never against the clipped sum.
        const Rgb whole = vectors[i].along(normal);
        EXPECT_GE(common[i].g, whole.g - 1e-5f);
        clipped += common[i].g > whole.g + 1e-3f ? 1 : 0;
    }
    EXPECT_GT(clipped, 20);
}

TEST(HiddenLight, EveryInstructionSetAndThreadCountGivesTheSameBytes)
{
    const TriangleMesh mesh = shapes::table();
    const VisibilityAtlas atlas = buildVisibilityAtlas(mesh, {8, 32, 2}, silent);
    const ObjectLight object = lit(mesh, atlas, lamps());
    std::vector<glm::vec3> places = placesAround(0.5, 3000);
    for (const glm::vec3& p : placesAround(1.3, 4000))
        places.push_back(p);
    const auto same = [](const auto& a, const auto& b) {
        return std::memcmp(a.data(), b.data(), a.size() * sizeof(a[0])) == 0;
    };
    const std::vector<IrradianceVector> many = hiddenAt(object, places);
    setThreadCount(1);
    EXPECT_TRUE(same(hiddenAt(object, places), many));
    setThreadCount(0);

    fiv::Source source;
    source.set = &atlas.silhouettes;
    for (const IrradianceVector& light : object.light.along)
        for (const glm::vec3& channel : light.channels)
            for (int axis = 0; axis < 3; ++axis)
                source.along.push_back(channel[axis]);
    source.against = source.along;
    source.shines.assign(object.light.along.size(), 3);
    const auto sums = [&](fiv::Isa isa) {
        const auto group = std::make_unique<fiv::Group>();
        group->resize(96);
        for (std::size_t b = 0; b < group->blocks.size(); ++b) {
            std::memset(static_cast<void*>(&group->blocks[b]), 0, sizeof(fiv::Block));
            group->x[b] = group->y[b] = group->z[b] = 0.0f;
            group->radius[b] = 10.0f;
            for (std::size_t i = 0; i < fiv::Block::kSize; ++i) {
                const glm::vec3 p = places[b * fiv::Block::kSize + i];
                group->blocks[b].x[i] = p.x;
                group->blocks[b].y[i] = p.y;
                group->blocks[b].z[i] = p.z;
            }
        }
        fiv::addHidden(isa, fiv::Sum::Vectors, source, 0.0f, *group);
        std::vector<float> all;
        for (const fiv::Block& block : group->blocks)
            for (const auto& row : block.sums)
                all.insert(all.end(), std::begin(row), std::end(row));
        return all;
    };
    const std::vector<float> base = sums(fiv::Isa::Base);
    EXPECT_NE(*std::ranges::max_element(base), 0.0f);
    for (int isa = 1; isa <= static_cast<int>(bestInstructionSet()); ++isa)
        EXPECT_TRUE(same(sums(static_cast<fiv::Isa>(isa)), base)) << isa;
}

TEST(HiddenLight, IsLinearInTheLight)
{
    const TriangleMesh mesh = shapes::chair();
    const VisibilityAtlas atlas = buildVisibilityAtlas(mesh, kSmall, silent);
    EnvironmentMap one = constant(0.0f);
    EnvironmentMap other = constant(0.0f);
    EnvironmentMap both = constant(0.0f);
    for (std::size_t i = 0; i < one.pixels.pixels().size(); ++i) {
        RandomStream random(2, i, 0);
        one.pixels.pixels()[i] = Rgb(random.uniform(), random.uniform(), random.uniform());
        other.pixels.pixels()[i] = Rgb(random.uniform(), 0.0f, random.uniform());
        both.pixels.pixels()[i] = one.pixels.pixels()[i] + 4.0f * other.pixels.pixels()[i];
    }
    const LightSplitOptions plain{.max_fine_directions = 0};
    const std::vector<glm::vec3> places = placesAround(0.7, 64);
    const auto a = hiddenAt(lit(mesh, atlas, one, plain), places);
    const auto b = hiddenAt(lit(mesh, atlas, other, plain), places);
    const auto c = hiddenAt(lit(mesh, atlas, both, plain), places);
    for (std::size_t i = 0; i < places.size(); ++i) {
        IrradianceVector sum = b[i];
        sum *= 4.0f;
        sum += a[i];
        EXPECT_LT(distance(sum, c[i]), tolerance::kFloat * 10.0) << "4 + 1 units of light";
    }
}

/// Light of the cells of an atlas, one a pair.
struct CellRadiance {
    std::vector<Rgb> along, against;
};
/// Random, some of it negative.
CellRadiance randomCells(const VisibilityAtlas& atlas, std::uint64_t seed)
{
    CellRadiance cells;
    for (std::size_t i = 0; i < atlas.cells().pairCount(); ++i) {
        RandomStream random(seed, i, 0);
        const auto value = [&] { return 0.01f * (random.uniform() - 0.3f); };
        cells.along.emplace_back(value(), value(), value());
        cells.against.emplace_back(value(), i % 3 == 0 ? 0.0f : value(), value());
    }
    return cells;
}

/// As hiddenShares() defines it, cell by cell.
Rgb hiddenOneByOne(const VisibilityAtlas& atlas,
                   const CellRadiance& light,
                   glm::vec3 place,
                   glm::vec3 normal,
                   float bias)
{
    glm::dvec3 sum(0.0);
    for (std::size_t i = 0; i < light.along.size(); ++i) {
        const HiddenShares shares = hiddenShares(atlas.silhouettes, i, place, bias);
        const float cosine = glm::dot(glm::vec3(atlas.silhouettes.directions[i]), normal);
        sum += glm::dvec3(light.along[i] * shares.along * std::max(0.0f, cosine));
        sum += glm::dvec3(light.against[i] * shares.against * std::max(0.0f, -cosine));
    }
    return Rgb(sum);
}

TEST(HiddenLight, FourLightsAtOnceAreTheirMix)
{
    const TriangleMesh mesh = shapes::chair();
    const VisibilityAtlas atlas = buildVisibilityAtlas(mesh, kSmall, silent);
    const glm::vec3 up(0.0f, 1.0f, 0.0f);
    CornerIrradiance corners;
    corners.along.resize(atlas.cells().pairCount());
    corners.against.resize(atlas.cells().pairCount());
    corners.sky_along.assign(corners.along.size(), 0.5f);
    corners.sky_against = corners.sky_along;
    std::vector<CellRadiance> lights;
    for (std::size_t corner = 0; corner < 4; ++corner) {
        lights.push_back(randomCells(atlas, 7 + corner));
        for (std::size_t i = 0; i < corners.along.size(); ++i) {
            const float cosine = static_cast<float>(atlas.silhouettes.directions[i].y);
            corners.along[i][corner] = std::max(0.0f, cosine) * lights[corner].along[i];
            corners.against[i][corner] = std::max(0.0f, -cosine) * lights[corner].against[i];
        }
    }
    const std::vector<glm::vec3> places = placesAround(0.9, 100);
    std::vector<std::array<float, 4>> weights;
    for (std::size_t i = 0; i < places.size(); ++i)
        weights.push_back({0.1f, 0.2f, 0.3f, 0.01f * static_cast<float>(i)});
    std::vector<HiddenIrradiance> hidden(places.size());
    hiddenIrradiance(atlas, corners, places, weights, hidden);
    for (std::size_t i = 0; i < places.size(); ++i) {
        Rgb expected(0.0f);
        for (std::size_t corner = 0; corner < 4; ++corner)
            expected +=
                weights[i][corner] * hiddenOneByOne(atlas, lights[corner], places[i], up, 0.0f);
        EXPECT_LT(glm::length(hidden[i].light - expected), 2e-5) << i;
        float sky = 0.0f;
        for (std::size_t pair = 0; pair < atlas.cells().pairCount(); ++pair) {
            const HiddenShares shares = hiddenShares(atlas.silhouettes, pair, places[i], 0.0f);
            sky += 0.5f * (shares.along + shares.against);
        }
        EXPECT_NEAR(hidden[i].sky, sky, 2e-5f * sky + 1e-4f) << i;
    }
    weights.pop_back();
    EXPECT_THROW(hiddenIrradiance(atlas, corners, places, weights, hidden), LogicError);
    corners.along.pop_back();
    weights.push_back({});
    EXPECT_THROW(hiddenIrradiance(atlas, corners, places, weights, hidden), LogicError);
}

TEST(HiddenLight, TurningTheObjectIsTurningTheLightBack)
{
    const TriangleMesh mesh = shapes::table();
    const double angle = 0.6;
    // world_from_object, columns.
    const glm::dmat3 turn(
        std::cos(angle), 0, -std::sin(angle), 0, 1, 0, std::sin(angle), 0, std::cos(angle));
    TriangleMesh turned = mesh;
    for (glm::vec3& p : turned.positions)
        p = glm::vec3(turn * glm::dvec3(p));
    const VisibilityAtlas atlas = buildVisibilityAtlas(mesh, {24, 64, 2}, silent);
    const VisibilityAtlas turned_atlas = buildVisibilityAtlas(turned, {24, 64, 2}, silent);
    const ObjectLight by_light = lit(mesh, atlas, lamps(), {}, glm::transpose(turn));
    const ObjectLight by_mesh = lit(turned, turned_atlas, lamps());
    std::vector<glm::vec3> floor;
    std::vector<glm::vec3> floor_in_object;
    std::vector<glm::vec3> floor_in_turned;
    for (int i = 0; i < 400; ++i) {
        const glm::dvec3 x(-1.0 + 0.1 * (i % 20), -0.001, -1.0 + 0.1 * (i / 20));
        floor_in_turned.push_back(by_mesh.local().localFrom(x));
        floor_in_object.push_back(by_light.local().localFrom(glm::transpose(turn) * x));
    }
    std::vector<Rgb> a(floor_in_object.size());
    std::vector<Rgb> b(floor_in_turned.size());
    hiddenIrradiance(by_light, floor_in_object, glm::vec3(0, 1, 0), a);
    hiddenIrradiance(by_mesh, floor_in_turned, glm::vec3(0, 1, 0), b);
    double square = 0.0;
    double most = 0.0;
    for (std::size_t i = 0; i < a.size(); ++i) {
        square += (a[i].g - b[i].g) * (a[i].g - b[i].g) / static_cast<double>(a.size());
        most = std::max<double>(most, b[i].g);
    }
    // Other directions and other texels: as far apart as each is from the truth.
    EXPECT_LT(std::sqrt(square), 0.015 * most);
}

TEST(HiddenLight, InsideAClosedBoxEverythingIsHidden)
{
    const TriangleMesh box = shapes::box(glm::vec3(-1.0f), glm::vec3(1.0f));
    const VisibilityAtlas atlas = buildVisibilityAtlas(box, kSmall, silent);
    const ObjectLight object = lit(box, atlas, lamps());
    const IrradianceVector total = object.light.total();
    for (const IrradianceVector& v : hiddenAt(object, placesAround(0.3, 33)))
        EXPECT_LT(distance(v, total), 1e-5 * sizeOf(total));
    for (const IrradianceVector& v : hiddenAt(object, placesAround(100.0, 33)))
        EXPECT_LT(sizeOf(v), 1e-2 * sizeOf(total)) << "far away hardly anything";
}

TEST(HiddenLight, ASunCastsADarkShadowWithASharpEdge)
{
    // One texel of 1e5 in a black sky, 45 degrees up over -z, one degree wide.
    EnvironmentMap map{Image<Rgb>(360, 180, Rgb(0.0f))};
    map.pixels(180, 44) = Rgb(1e5f);
    const TriangleMesh board = shapes::box({-1.0f, 1.0f, -1.0f}, {1.0f, 1.02f, 1.0f});
    const VisibilityAtlas atlas = buildVisibilityAtlas(board, kSmall, silent);
    const ObjectLight object = lit(board, atlas, map);
    const glm::vec3 up(0, 1, 0);
    const Rgb sun = object.light.total().along(up);
    std::vector<glm::vec3> line;
    for (int i = 0; i <= 400; ++i)
        line.push_back(object.local().localFrom({0.0, 0.0, -1.0 + 0.01 * i}));
    std::vector<Rgb> hidden(line.size());
    hiddenIrradiance(object, line, up, hidden);
    // The board's shadow lies on z = 0 (its front edge, seen 45 degrees up) to 2 + its thickness.
    for (int i = 0; i <= 400; ++i) {
        const double z = -1.0 + 0.01 * i;
        const double share = hidden[static_cast<std::size_t>(i)].g / sun.g;
        if (z < -0.07 || z > 2.09) {
            EXPECT_NEAR(share, 0.0, 1e-4) << z;
        }
        if (z > 0.07 && z < 1.93) {
            EXPECT_NEAR(share, 1.0, 1e-4) << z;
        }
    }
    // Half a sun at its edge.
    const auto at = std::ranges::find_if(hidden, [&](Rgb h) { return h.g > 0.5f * sun.g; });
    EXPECT_NEAR(-1.0 + 0.01 * static_cast<double>(at - hidden.begin()), 0.0, 0.03);
}

// As in pmndrs_park.hdr: all of the sun is in four texels of a sky that is nearly 10⁶ times as
// dark.
TEST(HiddenLight, ASunInFourTexelsCastsOneShadow)
{
    EnvironmentMap map{Image<Rgb>(1024, 512, Rgb(0.5f))};
    for (const glm::ivec2 at : {glm::ivec2(511, 127), {512, 127}, {511, 128}, {512, 128}})
        map.pixels(at.x, at.y) = Rgb(4e5f);
    const TriangleMesh board = shapes::box({-1.0f, 1.0f, -1.0f}, {1.0f, 1.02f, 1.0f});
    const VisibilityAtlas atlas = buildVisibilityAtlas(board, kSmall, silent);
    const ObjectLight object = lit(board, atlas, map);
    const glm::vec3 up(0, 1, 0);
    std::vector<glm::vec3> line;
    for (int i = 0; i <= 400; ++i)
        line.push_back(object.local().localFrom({0.0, 0.0, -1.0 + 0.01 * i}));
    std::vector<Rgb> hidden(line.size());
    hiddenIrradiance(object, line, up, hidden);
    // Irradiance of the sun, from the texels' own directions.
    double sun = 0.0;
    for (const int row : {127, 128})
        sun += 2.0 * 4e5 * environmentTexelSolidAngle(1024, 512, row) *
               environmentDirectionFromUv({0.5, (row + 0.5) / 512}).y;
    // The rest of the sky brings at most π/2.
    for (int i = 0; i <= 400; ++i) {
        const double z = -1.0 + 0.01 * i;
        const double found = hidden[static_cast<std::size_t>(i)].g;
        if (z < -0.07 || z > 2.09) {
            EXPECT_LT(found, 0.5 * pi) << z;
        }
        if (z > 0.07 && z < 1.93) {
            EXPECT_NEAR(found, sun, 0.5 * pi) << z;
        }
    }
    EXPECT_GT(sun, 8.0 * pi);
}

TEST(HiddenLight, FloorUnderATableEqualsRaysOfTheSameDirections)
{
    const TriangleMesh mesh = shapes::table();
    const VisibilityAtlas atlas = buildVisibilityAtlas(mesh, {16, 64, 2}, silent);
    EnvironmentMap window = lamps();
    for (Rgb& texel : window.pixels.pixels())
        texel = glm::min(texel, Rgb(4.0f));
    const ObjectLight object = lit(mesh, atlas, window, {.max_fine_directions = 0});
    const TriangleMesh* const pointer = &mesh;
    const RayScene rays(std::span<const TriangleMesh* const>(&pointer, 1));
    const glm::vec3 up(0, 1, 0);
    std::vector<glm::vec3> places;
    std::vector<double> truth;
    for (int i = 0; i < 600; ++i) {
        const glm::dvec3 x(-1.2 + 0.08 * (i % 30), -1e-4, -1.0 + 0.1 * (i / 30));
        places.push_back(object.local().localFrom(x));
        double hidden = 0.0;
        for (std::size_t k = 0; k < atlas.cells().pairCount(); ++k)
            for (const double sign : {1.0, -1.0}) {
                const IrradianceVector& light =
                    (sign > 0.0 ? object.light.along : object.light.against)[k];
                const double irradiance = light.along(up).g;
                if (irradiance > 0.0 && rays.occluded(x, sign * atlas.cells().direction(k)))
                    hidden += irradiance;
            }
        truth.push_back(hidden);
    }
    std::vector<Rgb> hidden(places.size());
    hiddenIrradiance(object, places, up, hidden);
    double square = 0.0;
    double most = 0.0;
    for (std::size_t i = 0; i < truth.size(); ++i) {
        square += (hidden[i].g - truth[i]) * (hidden[i].g - truth[i]) / 600.0;
        most = std::max(most, truth[i]);
    }
    // A window of 20 cells throws 20 hard shadows in the truth, here blurred by a texel (2 cm).
    EXPECT_LT(std::sqrt(square), 0.02 * most);
}

TEST(HiddenLight, RefusesPlacesThatAreNone)
{
    const TriangleMesh mesh = shapes::chair();
    const VisibilityAtlas atlas = buildVisibilityAtlas(mesh, {4, 32, 1}, silent);
    const ObjectLight object = lit(mesh, atlas, lamps());
    std::vector<glm::vec3> places(5, glm::vec3(1.0f));
    std::vector<Rgb> hidden(5);
    places[3].y = std::numeric_limits<float>::quiet_NaN();
    EXPECT_THROW(hiddenIrradiance(object, places, glm::vec3(0, 1, 0), hidden), LogicError);
    hiddenIrradiance(object, {}, glm::vec3(0, 1, 0), {});
}

}  // namespace
}  // namespace insitu
