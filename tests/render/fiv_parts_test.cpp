#include "render/fiv/irradiance_cube.h"
#include "render/fiv/object_samples.h"
#include "render/fiv/object_sharing.h"
#include "render/fiv/sent_light.h"
#include "tests/render/insertion_rooms.h"
#include "tests/support/shapes.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace insitu {
namespace {

using std::numbers::pi;

ObjectScene greyBall()
{
    std::vector<ObjectScene::Object> objects;
    objects.push_back(
        {shapes::model(shapes::sphere({0, 0, 0}, 1.0f, 32), shapes::lambert(glm::vec3(0.5f)))});
    return ObjectScene(std::move(objects));
}

TEST(SentLight, IsTheRadianceOfSamplesNearbyThatFaceTheSameWay)
{
    const ObjectScene ball = greyBall();
    const std::vector<ObjectSample> samples = sampleObjects(ball, 300);
    SentLight sent(ball, samples);
    // One half of the ball sends 2, the other nothing.
    std::vector<Rgb> radiance;
    for (const ObjectSample& sample : samples) {
        // Nothing hides the outside of a ball from itself, and all of its inside.
        const bool outside = glm::dot(sample.point.geometric_normal, sample.point.position) > 0.0;
        EXPECT_EQ(sent.open(radiance.size()), outside ? 1.0f : 0.0f);
        radiance.emplace_back(sample.point.geometric_normal.y > 0.0 ? 2.0f : 0.0f);
    }
    const glm::dvec3 up(0.0, 1.0, 0.0);
    EXPECT_EQ(sent.at(up, up), Rgb(0.0f)) << "before update()";
    sent.update(radiance);
    EXPECT_NEAR(sent.at(up, up).g, 2.0f, 0.05f);
    EXPECT_NEAR(sent.at(-up, -up).g, 0.0f, 0.05f);
    const glm::dvec3 aside(1.0, 0.0, 0.0);
    EXPECT_NEAR(sent.at(aside, aside).g, 1.0f, 0.2f);
}

/// Points in the void, where nothing hides them.
struct Point {
    glm::dvec3 position, normal;
    double area = 0.0;
    float radiance = 0.0f;
};
SentLight sentBy(const std::vector<Point>& points)
{
    std::vector<ObjectSample> samples;
    std::vector<Rgb> radiance;
    for (const Point& point : points) {
        ObjectSample sample{{}, point.area};
        sample.point.position = point.position;
        sample.point.geometric_normal = point.normal;
        samples.push_back(sample);
        radiance.emplace_back(point.radiance);
    }
    SentLight sent(ObjectScene(std::vector<ObjectScene::Object>{}), samples);
    sent.update(radiance);
    return sent;
}

TEST(SentLight, WeighsWhatFacesAPlaceByItsFormFactor)
{
    const glm::dvec3 up(0.0, 1.0, 0.0);
    EXPECT_EQ(SentLight().seenFrom(glm::dvec3(0.0), up), Rgb(0.0f));
    const SentLight sent = sentBy({{{0.0, 0.1, 0.0}, -up, 0.01, 1.0f},
                                   {{0.0, 1.0, 0.0}, -up, 0.01, 5.0f},
                                   // A surface that looks away, and one below the horizon.
                                   {{0.1, 0.5, 0.0}, up, 1.0, 100.0f},
                                   {{0.0, -0.2, 0.0}, up, 1.0, 100.0f}});
    // Area over squared distance (plus area).
    const double near = 0.01 / (0.01 + 0.01);
    const double far = 0.01 / (1.0 + 0.01);
    EXPECT_NEAR(sent.seenFrom(glm::dvec3(0.0), up).g, (near + 5.0 * far) / (near + far), 1e-5);
    // Far away all points are as near as each other.
    EXPECT_NEAR(sent.seenFrom({0.0, -1000.0, 0.0}, up).g, 3.0, 0.01);
}

TEST(SentLight, EveryInstructionSetGivesTheSameBytes)
{
    std::vector<Point> points;
    for (int i = 0; i < 77; ++i) {
        const glm::dvec3 p(std::sin(3.0 * i), 0.5 + 0.4 * std::cos(5.0 * i), std::sin(7.0 * i));
        points.push_back({p, -glm::normalize(p), 0.01 + 0.001 * i, 0.1f * static_cast<float>(i)});
    }
    const SentLight sent = sentBy(points);
    const glm::dvec3 up(0.0, 1.0, 0.0);
    for (const double x : {-0.5, 0.0, 0.7}) {
        const glm::dvec3 place(x, 0.0, 0.1);
        const Rgb seen = sent.seenFrom(place, up, InstructionSet::Base);
        const Rgb at = sent.at(place, -up, InstructionSet::Base);
        EXPECT_NE(seen, Rgb(0.0f));
        EXPECT_NE(at, Rgb(0.0f));
        for (int isa = 1; isa <= static_cast<int>(bestInstructionSet()); ++isa) {
            EXPECT_EQ(sent.seenFrom(place, up, static_cast<InstructionSet>(isa)), seen) << isa;
            EXPECT_EQ(sent.at(place, -up, static_cast<InstructionSet>(isa)), at) << isa;
        }
    }
}

PlaceLight lightFrom(int face_size, const std::function<Rgb(glm::vec3)>& radiance)
{
    PlaceLight light;
    light.geometry = std::make_shared<CellGeometry>(DirectionCells{face_size});
    for (const glm::vec3& direction : light.geometry->directions)
        light.radiance.push_back(radiance(direction));
    light.change.resize(light.radiance.size(), Rgb(0.0f));
    return light;
}

// By the definition, each side by itself: what arrives, times the cosine, where that is positive.
TEST(IrradianceCube, IsTheSumOverCellsAboveEachHorizon)
{
    PlaceLight light = lightFrom(
        6, [](glm::vec3 d) { return Rgb(1.0f + d.x, d.y > 0.7f ? 50.0f : 0.0f, std::abs(d.z)); });
    for (std::size_t cell = 0; cell < light.change.size(); cell += 3)
        light.change[cell] = Rgb(-0.4f, 0.2f, -5.0f);
    const DirectionTable table = irradianceCube(light, 5);
    for (std::size_t i = 0; i < table.size(); ++i) {
        const glm::dvec3 normal = table.direction(i);
        glm::dvec3 expected(0.0);
        for (std::size_t cell = 0; cell < light.radiance.size(); ++cell) {
            const double cosine = glm::dot(normal, glm::dvec3(light.geometry->directions[cell]));
            const Rgb arriving = glm::max(light.radiance[cell] + light.change[cell], Rgb(0.0f));
            expected += glm::dvec3(arriving) * std::max(0.0, cosine) *
                        static_cast<double>(light.geometry->solid_angles[cell]);
        }
        // Half sums and half differences of floats: errors as of the whole sphere's light.
        EXPECT_LT(glm::length(glm::dvec3(table[i]) - expected), 5e-5) << i;
    }
}

TEST(IrradianceCube, OfAnEvenLightIsPi)
{
    const DirectionTable table =
        irradianceCube(lightFrom(16, [](glm::vec3) { return Rgb(1.0f); }), 16);
    for (const glm::dvec3& d : {glm::dvec3(0.2, 0.9, -0.4), glm::dvec3(-1.0, 0.02, 0.99)})
        EXPECT_NEAR(table.lookUp(glm::normalize(d)).g, pi, 0.005 * pi);
}

/// A row of pixels of one wall, each with rays that say it is open by this share.
std::vector<ObjectPixel> rowOf(const std::vector<float>& open)
{
    std::vector<ObjectPixel> pixels;
    for (std::size_t x = 0; x < open.size(); ++x) {
        ObjectPixel pixel;
        pixel.pixel = {static_cast<int>(x), 0};
        pixel.normal = {0.0f, 0.0f, 1.0f};
        pixel.depth_m = 2.0f;
        pixel.matt = Rgb(0.2f);
        pixel.matt_open = Rgb(0.6f);
        pixel.rays = {Rgb(4.0f), Rgb(4.0f * open[x]), Rgb(0.5f)};
        pixels.push_back(pixel);
    }
    return pixels;
}

std::vector<float> shared(const std::vector<ObjectPixel>& pixels)
{
    Image<Rgb> picture(static_cast<int>(pixels.size()), 1, Rgb(0.01f));
    addShared(pixels, picture);
    std::vector<float> values;
    for (const Rgb& value : picture.pixels())
        values.push_back(value.g - 0.01f - 0.2f * 0.5f);
    return values;
}

TEST(ObjectSharing, LikeNeighboursAgreeAndOthersDoNot)
{
    const std::vector<float> open = {1.0f, 0.0f, 1.0f, 0.0f, 1.0f, 0.0f, 1.0f, 0.0f};
    std::vector<ObjectPixel> pixels = rowOf(open);
    for (const float value : shared(pixels))
        EXPECT_NEAR(value, 0.6f * 0.5f, 0.06f);
    // Rays that bring more light count for more.
    pixels[0].rays = {Rgb(400.0f), Rgb(400.0f), Rgb(0.5f)};
    EXPECT_GT(shared(pixels)[1], 0.6f * 0.9f);
    // Each by itself: other objects, other depths, other normals, creases.
    const auto apart = [&](const std::function<void(ObjectPixel&, int)>& change) {
        pixels = rowOf(open);
        for (int x = 0; x < 8; ++x)
            change(pixels[static_cast<std::size_t>(x)], x);
        const std::vector<float> values = shared(pixels);
        for (std::size_t x = 0; x < 8; ++x)
            EXPECT_NEAR(values[x], 0.6f * open[x], 0.003f) << x;
    };
    apart([](ObjectPixel& p, int x) { p.object = static_cast<std::uint32_t>(x); });
    apart([](ObjectPixel& p, int x) { p.depth_m = std::exp2(static_cast<float>(x)); });
    apart([](ObjectPixel& p, int x) {
        p.normal = x % 2 == 0 ? glm::vec3(1.0f, 0.0f, 0.0f) : glm::vec3(0.0f, 1.0f, 0.0f);
    });
    apart([](ObjectPixel& p, int) { p.one_place = false; });
}

TEST(ObjectSharing, NoLightIsDarkAndNotANumber)
{
    std::vector<ObjectPixel> pixels = rowOf({1.0f, 1.0f});
    for (ObjectPixel& pixel : pixels)
        pixel.rays = {};
    Image<Rgb> picture(2, 1, Rgb(0.0f));
    addShared(pixels, picture);
    EXPECT_EQ(picture(0, 0), Rgb(0.0f));
    addShared({}, picture);
    EXPECT_EQ(picture(1, 0), Rgb(0.0f));
}

TEST(ObjectSharing, LobesShareAmongNormalsWithinTheirWidth)
{
    std::vector<ObjectPixel> pixels = rowOf({1.0f, 1.0f, 1.0f, 1.0f});
    for (std::size_t x = 0; x < 4; ++x) {
        pixels[x].matt = pixels[x].matt_open = Rgb(0.0f);
        pixels[x].roughness = 0.4f;
        pixels[x].glossy = Rgb(0.5f);
        pixels[x].gathered = Rgb(x % 2 == 0 ? 1.0f : 0.0f);
    }
    Image<Rgb> picture(4, 1, Rgb(0.0f));
    addShared(pixels, picture);
    EXPECT_NEAR(picture(1, 0).g, 0.5f, 0.15f);
    // A lobe eleven times narrower does not reach a normal 0.2 away.
    for (std::size_t x = 0; x < 4; ++x) {
        pixels[x].roughness = 0.12f;
        pixels[x].normal = glm::normalize(glm::vec3(0.2f * static_cast<float>(x), 0.0f, 1.0f));
    }
    picture = Image<Rgb>(4, 1, Rgb(0.0f));
    addShared(pixels, picture);
    EXPECT_NEAR(picture(1, 0).g, 0.0f, 1e-4f);
    EXPECT_NEAR(picture(2, 0).g, 1.0f, 1e-4f);
}

}  // namespace
}  // namespace insitu
