#include "lighting/visibility_atlas.h"

#include "core/parallel.h"
#include "core/random.h"
#include "reconstruct/ray_scene.h"
#include "tests/lighting/furniture_shapes.h"
#include "tests/support/errors.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/tolerance.h"

#include <gmock/gmock.h>

#include <cstring>
#include <fstream>
#include <numbers>

namespace insitu {
namespace {

using std::numbers::pi;
using testing::HasSubstr;

constexpr AtlasOptions kCoarse{.face_size = 8, .resolution = 64, .samples = 2};

Progress silent;

glm::dvec3 randomDirection(RandomStream& random)
{
    return glm::normalize(glm::dvec3(random.normal(), random.normal(), random.normal()));
}

bool sameBytes(const SilhouetteSet& a, const SilhouetteSet& b)
{
    const auto same = [](const auto& x, const auto& y) {
        return x.size() == y.size() &&
               std::memcmp(x.data(), y.data(), x.size() * sizeof(x[0])) == 0;
    };
    return a.resolution == b.resolution && same(a.directions, b.directions) &&
           same(a.frames, b.frames) && same(a.coverage, b.coverage) && same(a.depths, b.depths);
}

/// How masks agree with rays, over all directions whose ray passes the bounding sphere.
struct Agreement {
    int rays = 0;
    int wrong = 0;
    double excess = 0.0;  ///< of the hidden shares' sum
};
Agreement againstRays(const TriangleMesh& mesh,
                      const VisibilityAtlas& atlas,
                      std::span<const glm::dvec3> places)
{
    const TriangleMesh* const pointer = &mesh;
    const RayScene rays(std::span<const TriangleMesh* const>(&pointer, 1));
    const LocalFrame& local = atlas.silhouettes.local;
    Agreement found;
    for (const glm::dvec3& x : places)
        for (std::size_t i = 0; i < 2 * atlas.cells().pairCount(); ++i) {
            const glm::dvec3 d = atlas.cells().direction(i / 2) * (i % 2 == 0 ? 1.0 : -1.0);
            const glm::dvec3 to_center = local.center - x;
            const double along = glm::dot(to_center, d);
            const double miss = glm::dot(to_center, to_center) - along * along;
            // The outline is blurred by a texel: what it spills over the sphere counts as well.
            if (miss > 1.1 * local.radius * local.radius) continue;
            const bool hidden = rays.occluded(x, d);
            const float share = hiddenShare(atlas, local.localFrom(x), d);
            ++found.rays;
            found.wrong += (share >= 0.5f) != hidden ? 1 : 0;
            found.excess += share - (hidden ? 1.0 : 0.0);
        }
    return found;
}

std::vector<glm::dvec3> placesAround(const LocalFrame& local, double radii, int count)
{
    std::vector<glm::dvec3> places;
    for (int i = 0; i < count; ++i) {
        RandomStream random(7, 0, static_cast<std::uint64_t>(i));
        places.push_back(local.center + randomDirection(random) * (radii * local.radius));
    }
    return places;
}

TEST(DirectionCells, CoverTheSphereOnce)
{
    for (const int n : {2, 5, 32}) {
        const DirectionCells cells{n};
        double sum = 0.0;
        for (std::size_t i = 0; i < cells.pairCount(); ++i) {
            sum += 2.0 * cells.solidAngle(i);
            EXPECT_EQ(cells.cellAt(cells.direction(i)), (DirectedPair{i, 0}));
            EXPECT_EQ(cells.cellAt(-3.0 * cells.direction(i)), (DirectedPair{i, 1}));
        }
        EXPECT_NEAR(sum, 4.0 * pi, 1e-10);
    }
    // A face's middle 2 x 2 cells of 2 x 2: a quarter of a sixth of the sphere each.
    EXPECT_NEAR(DirectionCells{2}.solidAngle(0), 4.0 * pi / 24.0, tolerance::kDouble);
}

TEST(VisibilityAtlas, SphereHidesItsCone)
{
    const VisibilityAtlas atlas =
        buildVisibilityAtlas(shapes::sphere({1, 2, 3}, 0.5f, 48), {16, 64, 2}, silent);
    EXPECT_NEAR(atlas.silhouettes.local.radius, 0.5, 1e-6);
    for (const double radii : {1.2, 2.0, 5.0}) {
        const int places = 40;
        double hidden = 0.0;
        float least_inside = 1.0f;
        float most_outside = 0.0f;
        float lights_side = 0.0f;
        for (std::size_t k = 0; k < places * atlas.cells().pairCount(); ++k) {
            const std::size_t i = k / places;
            RandomStream random(11, 0, k % places);
            const glm::dvec3 place = randomDirection(random) * radii;
            const glm::vec3 x(place);
            const HiddenShares shares = hiddenShares(atlas.silhouettes, i, x);
            const glm::dvec3 d = atlas.cells().direction(i);
            const double miss = glm::length(place - d * glm::dot(place, d));
            const float share = std::max(shares.along, shares.against);
            // Blurred by a texel and a half, on the diagonal; beyond that exact.
            if (miss < 0.93) least_inside = std::min(least_inside, share);
            if (miss > 1.07) most_outside = std::max(most_outside, share);
            lights_side =
                std::max(lights_side, glm::dot(d, place) > 0.0 ? shares.along : shares.against);
            hidden += (shares.along + shares.against) * atlas.cells().solidAngle(i) / places;
        }
        EXPECT_NEAR(least_inside, 1.0f, tolerance::kFloat) << radii;
        EXPECT_EQ(most_outside, 0.0f) << radii;
        EXPECT_EQ(lights_side, 0.0f) << radii << ", the light stands on the place's side";
        // The cone's solid angle; the cells that its edge cuts leave a random error.
        const double cone = 2.0 * pi * (1.0 - std::sqrt(1.0 - 1.0 / (radii * radii)));
        EXPECT_NEAR(hidden / cone, 1.0, 0.03) << radii;
    }
    // In the middle everything is hidden.
    for (std::size_t i = 0; i < atlas.cells().pairCount(); ++i) {
        const HiddenShares shares = hiddenShares(atlas.silhouettes, i, glm::vec3(0.0f));
        EXPECT_EQ(shares.along, 1.0f);
        EXPECT_EQ(shares.against, 1.0f);
    }
}

TEST(VisibilityAtlas, AgreesWithRays)
{
    const std::pair<const char*, TriangleMesh> hard[] = {{"table", shapes::table()},
                                                         {"chair", shapes::chair()},
                                                         {"open box", shapes::openBox()},
                                                         {"ball", shapes::sphere({}, 1.0f, 40)}};
    for (const auto& [name, mesh] : hard) {
        const VisibilityAtlas atlas = buildVisibilityAtlas(mesh, kCoarse, silent);
        for (const double radii : {0.35, 0.7, 1.05, 2.0}) {
            const Agreement found =
                againstRays(mesh, atlas, placesAround(atlas.silhouettes.local, radii, 60));
            // Legs of 2 cm are little more than a texel wide: a chair's are off more often.
            const double share = std::string_view(name) == "chair" ? 0.015 : 0.01;
            EXPECT_LE(found.wrong, share * found.rays) << name << " at " << radii << " radii";
            // Unbiased: errors on both sides of the outline cancel.
            EXPECT_NEAR(found.excess / found.rays, 0.0, 0.004) << name << " at " << radii;
        }
    }
}

TEST(VisibilityAtlas, AgreesWithRaysOnTheFloorAtContact)
{
    for (const TriangleMesh& mesh : {shapes::table(), shapes::chair()}) {
        const VisibilityAtlas atlas = buildVisibilityAtlas(mesh, kCoarse, silent);
        std::vector<glm::dvec3> places;
        RandomStream random(3, 0, 0);
        for (int i = 0; i < 150; ++i)
            places.emplace_back(1.4 * random.uniform() - 0.7, -1e-4, 1.0 * random.uniform() - 0.5);
        const Agreement found = againstRays(mesh, atlas, places);
        EXPECT_LE(found.wrong, 0.01 * found.rays);
        EXPECT_NEAR(found.excess / found.rays, 0.0, 0.004);
    }
}

TEST(VisibilityAtlas, PlacesOnAndJustInsideASurface)
{
    // A cube from -1 to 1; the silhouettes along x and y are filled squares of known depth.
    const TriangleMesh cube = shapes::box(glm::vec3(-1.0f), glm::vec3(1.0f));
    const std::vector<glm::dvec3> up = {{0, 1, 0}};
    const SilhouetteSet set = drawSilhouettes(cube, up, 64, 2, silent);
    const float texel = 2.0f / 62.0f;
    const auto hidden = [&](float y, float bias) {
        return hiddenShares(set, 0, set.local.localFrom({0.3, y, 0.2}), bias).along;
    };
    // On the surface the answer is undecided; half a texel of bias decides for the light.
    EXPECT_NEAR(hidden(1.0f, 0.0f), 0.5f, 1e-3);
    EXPECT_NEAR(hidden(1.0f, 0.5f), 0.0f, 1e-3);
    EXPECT_EQ(hidden(1.0f + 0.6f * texel, 0.0f), 0.0f);
    EXPECT_EQ(hidden(1.0f - 0.6f * texel, 0.0f), 1.0f);
    EXPECT_EQ(hidden(1.0f - 1.1f * texel, 0.5f), 1.0f);
    // Under the cube, as far as one likes; above it never.
    EXPECT_EQ(hidden(-1.0f, 0.5f), 1.0f);
    EXPECT_EQ(hidden(-1000.0f, 0.5f), 1.0f);
    EXPECT_EQ(hidden(1000.0f, 0.0f), 0.0f);
}

TEST(VisibilityAtlas, DoesNotDependOnScaleOrPlace)
{
    const TriangleMesh mesh = shapes::chair();
    const AtlasOptions options{4, 32, 2};
    const VisibilityAtlas atlas = buildVisibilityAtlas(mesh, options, silent);
    for (const float scale : {0.0009765625f, 1024.0f}) {
        TriangleMesh scaled = mesh;
        for (glm::vec3& p : scaled.positions)
            p *= scale;
        // Powers of two change no digit.
        EXPECT_TRUE(sameBytes(atlas.silhouettes,
                              buildVisibilityAtlas(scaled, options, silent).silhouettes));
    }
    TriangleMesh far = mesh;
    for (glm::vec3& p : far.positions)
        p += glm::vec3(1000.0f, -2000.0f, 500.0f);
    const VisibilityAtlas moved = buildVisibilityAtlas(far, options, silent);
    // Vertices 2 km away are rounded to 0.12 mm, 1/100 of a texel here.
    double difference = 0.0;
    for (std::size_t i = 0; i < atlas.silhouettes.coverage.size(); ++i)
        difference += std::abs(atlas.silhouettes.coverage[i] - moved.silhouettes.coverage[i]);
    EXPECT_LT(difference / 255.0 / static_cast<double>(atlas.silhouettes.coverage.size()), 0.003);
}

TEST(VisibilityAtlas, IsPlacedExactly)
{
    const TriangleMesh mesh = shapes::chair();
    const VisibilityAtlas atlas = buildVisibilityAtlas(mesh, {8, 64, 2}, silent);
    const Placement placement{{0.1, 0.2, -0.3}, 2.5, 0.8, {100.0, 3.0, -50.0}};
    const VisibilityAtlas world = placedAtlas(atlas, placement, placed(mesh, placement));
    const glm::dmat3 turn = placement.worldFromModelRotation();
    double hidden = 0.0;
    for (int i = 0; i < 2000; ++i) {
        RandomStream random(20261126, 0, static_cast<std::uint64_t>(i));
        const glm::dvec3 x = randomDirection(random) * random.uniformDouble();
        const glm::dvec3 d = randomDirection(random);
        const float expected = hiddenShare(atlas, atlas.silhouettes.local.localFrom(x), d);
        const float found =
            hiddenShare(world, world.silhouettes.local.localFrom(placement.apply(x)), turn * d);
        EXPECT_NEAR(found, expected, 1e-3) << "place " << i;
        hidden += static_cast<double>(expected);
    }
    EXPECT_GT(hidden, 50.0);  // it was asked where it hides something
    // The box is the one of the turned chair.
    const LocalFrame frame = localFrame(placed(mesh, placement));
    const glm::dvec3 reach = frame.radius * glm::dvec3(frame.half_extent);
    const glm::dvec3 found =
        world.silhouettes.local.radius * glm::dvec3(world.silhouettes.local.half_extent);
    for (int axis = 0; axis < 3; ++axis)
        EXPECT_NEAR(found[axis], reach[axis], 0.03);
}

TEST(VisibilityAtlas, SameBytesForOneThreadAndMany)
{
    const TriangleMesh mesh = shapes::sphere({0, 0, 0}, 1.0f, 20);
    setThreadCount(1);
    const VisibilityAtlas one = buildVisibilityAtlas(mesh, kCoarse, silent);
    setThreadCount(0);
    EXPECT_TRUE(
        sameBytes(one.silhouettes, buildVisibilityAtlas(mesh, kCoarse, silent).silhouettes));
}

TEST(VisibilityAtlas, ReportsAndStops)
{
    struct Stopping : Progress {
        double last = 0.0;
        double stop_at = 2.0;
        void report(std::string_view, double fraction) override { last = std::max(last, fraction); }
        [[nodiscard]] bool cancelled() const override { return last >= stop_at; }
    };
    Stopping runs;
    const TriangleMesh mesh = shapes::box(glm::vec3(-1.0f), glm::vec3(1.0f));
    (void)buildVisibilityAtlas(mesh, kCoarse, runs);
    EXPECT_EQ(runs.last, 1.0);
    Stopping stops;
    stops.stop_at = 0.2;
    EXPECT_THROW((void)buildVisibilityAtlas(mesh, kCoarse, stops), CancelledError);
    EXPECT_LT(stops.last, 0.9);
}

TEST(VisibilityAtlas, RefusesBadOptions)
{
    const TriangleMesh mesh = shapes::box(glm::vec3(-1.0f), glm::vec3(1.0f));
    const auto errorOf = [&](const AtlasOptions& options) {
        return inputErrorOf([&] { (void)buildVisibilityAtlas(mesh, options, silent); });
    };
    const std::string all = errorOf({1, 8, 9});
    EXPECT_THAT(all, HasSubstr("face_size is 1"));
    EXPECT_THAT(all, HasSubstr("resolution is 8"));
    EXPECT_THAT(all, HasSubstr("samples is 9"));
    EXPECT_THAT(errorOf({128, 512, 1}), HasSubstr("too large"));
    EXPECT_TRUE(AtlasOptions{}.validate().empty());
    EXPECT_THROW((void)buildVisibilityAtlas(TriangleMesh{}, kCoarse, silent), LogicError);
}

TEST(VisibilityAtlas, DefaultKeepsWithin64MB)
{
    const AtlasOptions options;
    const std::size_t texel = sizeof(std::uint8_t) + sizeof(DepthSpan);
    const auto side = static_cast<std::size_t>(options.resolution);
    EXPECT_LE(DirectionCells{options.face_size}.pairCount() * side * side * texel, 64'000'000u);
}

class AtlasFile : public testing::Test {
protected:
    TriangleMesh mesh_ = shapes::table();
    AtlasOptions options_{4, 32, 2};
    TemporaryFolder folder_;
    VisibilityAtlas truth_ = buildVisibilityAtlas(mesh_, options_, silent);

    CachedAtlas cached() { return cachedVisibilityAtlas(mesh_, options_, folder_.path(), silent); }
    std::filesystem::path path() { return atlasFile(mesh_, options_, folder_.path()); }
    void damage(std::streamoff at, char flip)
    {
        std::fstream file(path(), std::ios::in | std::ios::out | std::ios::binary);
        file.seekg(at, at < 0 ? std::ios::end : std::ios::beg);
        char byte = 0;
        file.get(byte);
        file.seekp(at, at < 0 ? std::ios::end : std::ios::beg);
        file.put(static_cast<char>(byte ^ flip));
    }
    /// The next use rebuilds and tells, the one after reads again.
    void expectRepaired(const std::string& what)
    {
        const CachedAtlas repaired = cached();
        EXPECT_FALSE(repaired.from_file) << what;
        EXPECT_TRUE(hasFinding(repaired.findings, "atlas-file-damaged")) << what;
        EXPECT_TRUE(sameBytes(repaired.atlas.silhouettes, truth_.silhouettes)) << what;
        const CachedAtlas again = cached();
        EXPECT_TRUE(again.from_file) << what;
        EXPECT_TRUE(again.findings.empty()) << what;
    }
};

TEST_F(AtlasFile, IsFoundAgain)
{
    const CachedAtlas first = cached();
    EXPECT_FALSE(first.from_file);
    EXPECT_TRUE(first.findings.empty());
    const CachedAtlas second = cached();
    EXPECT_TRUE(second.from_file);
    EXPECT_TRUE(sameBytes(second.atlas.silhouettes, truth_.silhouettes));
    EXPECT_EQ(second.atlas.silhouettes.local.radius, truth_.silhouettes.local.radius);
    EXPECT_EQ(folder_.size(), 1u) << "nothing temporary stays";
}

TEST_F(AtlasFile, AnotherMeshOrOtherOptionsAreAnotherFile)
{
    (void)cached();
    TriangleMesh moved = mesh_;
    moved.positions[0].x += 0.001f;
    EXPECT_NE(atlasFile(moved, options_, folder_.path()), path());
    EXPECT_NE(atlasFile(mesh_, {4, 32, 3}, folder_.path()), path());
    EXPECT_FALSE(cachedVisibilityAtlas(moved, options_, folder_.path(), silent).from_file);
}

TEST_F(AtlasFile, DamageIsNoticedAndRepaired)
{
    (void)cached();
    damage(0, 1);
    expectRepaired("magic");
    damage(8, 1);
    expectRepaired("version");
    damage(40, 1);
    expectRepaired("centre");
    damage(-1, 1);
    expectRepaired("last byte");
    damage(5000, 4);
    expectRepaired("a texel");
    std::filesystem::resize_file(path(), 1000);
    expectRepaired("cut off");
    std::filesystem::resize_file(path(), 0);
    expectRepaired("empty");
    std::filesystem::remove(path());
    std::filesystem::create_directory(path());
    EXPECT_TRUE(hasFinding(cached().findings, "atlas-file-damaged")) << "a folder in its place";
}

TEST_F(AtlasFile, AFolderThatCannotBeWrittenCostsOnlyTime)
{
    const std::filesystem::path file = folder_.add("file", std::string_view("x"));
    const CachedAtlas made = cachedVisibilityAtlas(mesh_, options_, file, silent);
    EXPECT_TRUE(hasFinding(made.findings, "atlas-not-kept"));
    EXPECT_TRUE(sameBytes(made.atlas.silhouettes, truth_.silhouettes));
}

}  // namespace
}  // namespace insitu
