#include "pipeline/reference_capture.h"

#include "tests/support/tolerance.h"

#include <gtest/gtest.h>

#include <numbers>

namespace insitu {
namespace {

using std::numbers::pi;

const glm::dvec3 kProbe(1.0, 2.0, 3.0);
const Image<Rgb> kNothingClipped;

ProjectReference card(glm::dvec2 from, glm::dvec2 size)
{
    ProjectReference reference;
    reference.area_from_px = from;
    reference.area_size_px = size;
    reference.reflectance = {0.5, 0.25, 0.2};
    return reference;
}

/// Grey 0.1, in the middle 10 x 10 pixels of a card.
Image<Rgb> picture()
{
    Image<Rgb> image(40, 30, Rgb(0.1f));
    for (int y = 10; y < 20; ++y)
        for (int x = 15; x < 25; ++x)
            image(x, y) = Rgb(0.5f, 0.5f, 0.4f);
    return image;
}

TEST(MeasureReference, ACardsIrradianceIsPiTimesItsRadianceOverItsReflectance)
{
    const Image<Rgb> image = picture();
    Findings findings;
    // The picture is a crop: its first pixel is (100, 200) of the full frame.
    const ReferenceGroup group =
        measureReference(card({115, 210}, {10, 10}),
                         {image, kNothingClipped, {100, 200}, nullptr, "p"},
                         kProbe,
                         findings);
    ASSERT_EQ(group.places.size(), 1u);
    EXPECT_EQ(group.places[0].position_m, kProbe);
    EXPECT_FALSE(group.scale_free);
    const glm::dvec3 expected = pi * glm::dvec3(1.0, 2.0, 2.0);
    for (int c = 0; c < 3; ++c)
        EXPECT_NEAR(group.places[0].irradiance[c], expected[c], tolerance::kFloat * expected[c]);
    EXPECT_TRUE(findings.empty());
}

TEST(MeasureReference, AnUnevenCardIsTold)
{
    const Image<Rgb> image = picture();
    Findings findings;
    (void)measureReference(
        card({15, 12}, {16, 4}), {image, kNothingClipped, {}, nullptr, "p"}, kProbe, findings);
    EXPECT_TRUE(hasFinding(findings, "light-reference-uneven"));
}

// A ball lit by 1 + 0.5 n.x, seen off the picture's middle.
TEST(MeasureReference, ABallTellsTheIrradianceOfItsNormals)
{
    const Camera camera = Camera::lookAt({0, 0, 2}, {0, 0, 0}, 600.0, 300, 200);
    const glm::dvec3 middle(0.15, -0.05, 0.0);
    const double radius = 0.1;
    Image<Rgb> image(300, 200);
    for (int y = 0; y < 200; ++y)
        for (int x = 0; x < 300; ++x) {
            const glm::dvec3 d = camera.rayDirection({x + 0.5, y + 0.5});
            const glm::dvec3 from = camera.position_m - middle;
            const double b = glm::dot(d, from);
            const double q = b * b - glm::dot(from, from) + radius * radius;
            if (q <= 0.0) continue;
            const glm::dvec3 normal = (from + (-b - std::sqrt(q)) * d) / radius;
            image(x, y) = Rgb(static_cast<float>(0.4 / pi * (1.0 + 0.5 * normal.x)));
        }
    ProjectReference ball;
    ball.kind = ReferenceKind::Ball;
    ball.center_px = *camera.project(middle);
    const double distance = glm::length(camera.position_m - middle);
    ball.radius_px = 600.0 * std::tan(std::asin(radius / distance));
    ball.reflectance = glm::dvec3(0.4);
    Findings findings;
    const ReferenceGroup group =
        measureReference(ball, {image, kNothingClipped, {}, &camera, "p"}, kProbe, findings);
    ASSERT_GT(group.places.size(), 80u);
    for (const LightReference& place : group.places)
        // The outline is an ellipse, longer by 0.3 %; patches turn by 0.15.
        EXPECT_NEAR(place.irradiance.g, 1.0 + 0.5 * place.normal.x, 0.01);
}

TEST(PhotographedReferences, TakeThePhotographsCardAndRefuseAClippedOne)
{
    ProjectProbe probe;
    probe.center_m = kProbe;
    probe.references = {card({15, 10}, {10, 10})};
    const Image<Rgb> image = picture();
    EncodedImage codes;
    codes.codes = Image<glm::u16vec3>(40, 30, glm::u16vec3(120));
    Findings findings;
    const auto measured = [&] {
        return photographedReferences(probe, codes, image, Camera{}, "plate.jpg", findings);
    };
    EXPECT_TRUE(measured().empty());  // of the probe's own pictures
    probe.references[0].source = ProjectReference::Source::Photo;
    ASSERT_EQ(measured().size(), 1u);
    EXPECT_NEAR(measured()[0].places[0].irradiance.r, pi, tolerance::kFloat * pi);
    codes.codes(20, 15) = glm::u16vec3(255, 100, 100);
    codes.codes(21, 15) = glm::u16vec3(255, 100, 100);
    EXPECT_THROW((void)measured(), InputError);
}

TEST(GivenReferences, ReadingsInLuxShareTheirUnit)
{
    ProjectReference lux;
    lux.kind = ReferenceKind::Illuminance;
    lux.irradiance = glm::dvec3(500.0);
    ProjectReference number;
    number.kind = ReferenceKind::Irradiance;
    number.irradiance = {1.0, 2.0, 3.0};
    number.position_m = glm::dvec3(0.5);
    const auto groups = givenReferences({lux, number, lux, card({0, 0}, {1, 1})}, kProbe);
    ASSERT_EQ(groups.size(), 2u);
    EXPECT_EQ(groups[0].places[0].position_m, glm::dvec3(0.5));
    EXPECT_FALSE(groups[0].luminance_only);
    EXPECT_EQ(groups[1].places.size(), 2u);
    EXPECT_TRUE(groups[1].scale_free && groups[1].luminance_only);
    EXPECT_EQ(groups[1].places[0].position_m, kProbe);
}

}  // namespace
}  // namespace insitu
