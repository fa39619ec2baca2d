#include "pipeline/probe_location.h"

#include "core/io/image_io.h"
#include "tests/support/data.h"
#include "tests/support/errors.h"

#include <gmock/gmock.h>

namespace insitu {
namespace {

using ::testing::HasSubstr;

CameraEstimate levelCamera(int width, int height, double focal_px)
{
    CameraEstimate estimate;
    estimate.camera = Camera::lookAt({0.0, 1.2, 2.0}, {0.0, 1.2, 0.0}, focal_px, width, height);
    estimate.position_sigma_m = glm::dvec3(0.01);
    return estimate;
}

/// A picture of a ball that mirrors a room with a bright and a dark side, before a grey wall.
Photo ballPicture(const Camera& camera, glm::dvec3 center, double radius)
{
    Photo photo;
    photo.image.codes = Image<glm::u16vec3>(camera.width, camera.height);
    for (int y = 0; y < camera.height; ++y)
        for (int x = 0; x < camera.width; ++x) {
            double code = 0.0;
            for (int i = 0; i < 9; ++i) {
                const glm::dvec3 ray =
                    camera.rayDirection({x + (1 + 2 * (i % 3)) / 6.0, y + (1 + 2 * (i / 3)) / 6.0});
                const glm::dvec3 to = center - camera.position_m;
                const double along = glm::dot(to, ray);
                const double miss = glm::dot(to, to) - along * along;
                double value = 120.0 + 30.0 * std::sin(20.0 * ray.x) * std::sin(14.0 * ray.y);
                if (miss < radius * radius) {
                    const double t = along - std::sqrt(radius * radius - miss);
                    const glm::dvec3 normal = (camera.position_m + ray * t - center) / radius;
                    const glm::dvec3 away = ray - 2.0 * glm::dot(ray, normal) * normal;
                    value = 60.0 + 90.0 * (away.x > 0.0) + 40.0 * (away.y > 0.2) +
                            30.0 * (away.z > 0.0);
                }
                code += value / 9.0;
            }
            photo.image.codes(x, y) = glm::u16vec3(static_cast<std::uint16_t>(code + 0.5));
        }
    return photo;
}

TEST(LocateBall, ABallInThePictureIsFoundAndPlaced)
{
    const CameraEstimate camera = levelCamera(500, 400, 420.0);
    const glm::dvec3 center(0.35, 0.9, 0.6);
    const double radius = 0.12;
    const Photo photo = ballPicture(camera.camera, center, radius);
    const LocatedBall found = locateBall(photo, camera, radius, 0.0, std::nullopt, "ball.png");
    // Outlines are found within 0.1 px (docs/validation.md); this one has 35 px.
    EXPECT_NEAR(glm::length(found.place.center_m - center), 0.0, 0.02);
    for (int k = 0; k < 3; ++k)
        EXPECT_LT(std::abs(found.place.center_m[k] - center[k]), 4.0 * found.place.sigma_m[k]) << k;
}

TEST(LocateBall, WhatIsNoSuchPictureIsRefused)
{
    const CameraEstimate camera = levelCamera(200, 160, 200.0);
    Photo photo;
    photo.image.codes = Image<glm::u16vec3>(200, 160, glm::u16vec3(90));
    EXPECT_THROW((void)locateBall(photo, camera, 0.1, 0.0, std::nullopt, "wall.png"),
                 NoAnswerError);
    photo.image.codes = Image<glm::u16vec3>(100, 80, glm::u16vec3(90));
    EXPECT_THAT(
        inputErrorOf([&] { (void)locateBall(photo, camera, 0.1, 0.0, std::nullopt, "small.png"); }),
        HasSubstr("200x160"));
}

TEST(LocateBall, ACloseUpNeedsAFocalLengthAndTheBoard)
{
    const CameraEstimate camera = levelCamera(500, 400, 420.0);
    const glm::dvec3 center(0.35, 0.9, 0.6);
    Photo photo = ballPicture(camera.camera, center, 0.12);
    const auto errorOf = [&] {
        return inputErrorOf([&] {
            (void)locateBallByBoard(
                photo, camera, photo, MarkerBoard{}, 0.12, 0.0, std::nullopt, "close.png");
        });
    };
    EXPECT_THAT(errorOf(), HasSubstr("EXIF"));
    photo.metadata.focal_mm = 30.0;
    photo.metadata.focal_35mm = 30.0;
    EXPECT_THAT(errorOf(), HasSubstr("board"));
}

TEST(LocateBall, AProjectsProbeIsPlacedOnlyWhenAsked)
{
    const CameraEstimate camera = levelCamera(500, 400, 420.0);
    const glm::dvec3 center(0.35, 0.9, 0.6);
    const BallOutline outline = predictBallOutline(center, 0.12, camera.camera);
    Project project;
    project.light.probe.emplace();
    ProjectProbe& probe = *project.light.probe;
    probe.center_m = glm::dvec3(7.0);
    probe.views.emplace_back();
    MirrorBall& ball = probe.views[0].ball;
    ball.center_px = outline.center_px;
    ball.radius_px = outline.radius_px;
    ball.radius_m = 0.12;
    EXPECT_TRUE(placeProbeFromOutline(camera, project).empty());
    EXPECT_EQ(probe.center_m, glm::dvec3(7.0));
    probe.center_from_outline = true;
    EXPECT_TRUE(hasFinding(placeProbeFromOutline(camera, project), "probe-from-outline"));
    EXPECT_NEAR(glm::length(probe.center_m - center), 0.0, 1e-4);
    EXPECT_EQ(ball.center_m, probe.center_m);
    EXPECT_EQ(project.light.center_m, probe.center_m);
}

}  // namespace
}  // namespace insitu
