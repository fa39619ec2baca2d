// How exactly a mirror ball's picture becomes an environment, on balls traced ray by ray: for many
// sizes, distances and places in the picture, the error of directions and of irradiance; for noise
// and clutter, the error of the outline that is found. With folders of truth rooms: the outline's
// error in their brackets instead.

#include "capture/ball_outline.h"
#include "capture/light_probe.h"
#include "capture/radiance_capture.h"
#include "core/check.h"
#include "core/io/json.h"
#include "core/random.h"
#include "tests/capture/synthetic_ball.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <numbers>
#include <vector>

namespace {

using namespace insitu;
using std::numbers::pi;

constexpr glm::dvec3 kCenter(0.1, 0.9, -0.2);
constexpr double kRadius = 0.06;

struct Shot {
    MirrorBall ball;
    Camera camera;
    glm::ivec2 crop{0};
    int side = 0;
};

/// A ball of `radius_px` seen from `distance` radii, `off_axis` radians from the camera's axis.
Shot shoot(double radius_px, double distance, double off_axis)
{
    Shot shot;
    shot.ball.center_m = kCenter;
    shot.ball.radius_m = kRadius;
    shot.ball.radius_px = radius_px;
    const glm::dvec3 view =
        kCenter + distance * kRadius * glm::normalize(glm::dvec3(-0.5, 0.3, 1.0));
    shot.camera = ballCamera(shot.ball, view, 0, 0);
    const glm::dvec3 forward = shot.camera.forward;
    const glm::dvec3 aim = std::cos(off_axis) * forward + std::sin(off_axis) * shot.camera.right;
    shot.camera.right = glm::normalize(glm::cross(aim, shot.camera.up));
    shot.camera.forward = aim;
    const Silhouette outline = silhouetteOf(shot.ball, shot.camera);
    shot.ball.center_px = outline.center;
    shot.ball.radius_px = 0.5 * (outline.longer + outline.shorter);
    shot.side = static_cast<int>(2.0 * outline.longer * 1.25) + 20;
    shot.crop = glm::ivec2(glm::floor(outline.center - 0.5 * shot.side));
    return shot;
}

/// Of six normals and three channels the worst, relative.
double irradianceError(const EnvironmentMap& light, const EnvironmentMap& truth)
{
    double worst = 0.0;
    for (int axis = 0; axis < 3; ++axis) {
        for (const double sign : {1.0, -1.0}) {
            glm::dvec3 normal(0.0);
            normal[axis] = sign;
            const glm::dvec3 ratio = irradiance(light, normal) / irradiance(truth, normal);
            for (int c = 0; c < 3; ++c)
                worst = std::max(worst, std::abs(ratio[c] - 1.0));
        }
    }
    return worst;
}

void printUnwrap(double radius_px, double distance, double off_axis_deg)
{
    const Shot shot = shoot(radius_px, distance, off_axis_deg * pi / 180.0);
    const auto render = [&](const Surroundings& surroundings) {
        return renderBall(shot.ball,
                          shot.camera,
                          surroundings,
                          shot.crop,
                          glm::ivec2(shot.side),
                          Rgb(0.0f),
                          surroundings);
    };
    UnwrapOptions options;
    options.width = 256;
    options.crop_origin_px = shot.crop;
    options.distance_to_room = distanceToWalls;
    const EnvironmentMap directions =
        unwrapMirrorBall(render([&](glm::dvec3 origin, glm::dvec3 d) {
                             const glm::dvec3 hit = origin + d * distanceToWalls(origin, d);
                             return colourOf(glm::normalize(hit - kCenter));
                         }),
                         shot.ball,
                         shot.camera,
                         options)
            .environment;
    const glm::dvec3 axis = glm::normalize(shot.camera.position_m - kCenter);
    // The blind spot: behind the ball, and what the rim's 1.25 pixels show.
    const double rim = 2.0 * std::asin(1.0 - 1.25 / radius_px) - std::asin(1.0 / distance);
    std::vector<double> errors;
    for (int y = 0; y < 128; ++y) {
        for (int x = 0; x < 256; ++x) {
            const glm::dvec3 d = environmentDirectionFromUv({(x + 0.5) / 256, (y + 0.5) / 128});
            if (glm::dot(d, axis) < std::cos(rim - 0.03)) continue;
            const double cosine = glm::dot(d, vectorOf(directions.pixels(x, y)));
            errors.push_back(std::acos(std::min(cosine, 1.0)) * 180.0 / pi);
        }
    }
    std::ranges::sort(errors);
    EnvironmentMap light =
        unwrapMirrorBall(render(roomRadiance), shot.ball, shot.camera, options).environment;
    const EnvironmentMap truth = panorama(roomRadiance, kCenter, 256);
    const double worst = irradianceError(light, truth);
    // What of it comes from light that this view cannot see.
    for (int y = 0; y < 128; ++y)
        for (int x = 0; x < 256; ++x) {
            const glm::dvec3 d = environmentDirectionFromUv({(x + 0.5) / 256, (y + 0.5) / 128});
            if (glm::dot(d, axis) < std::cos(rim)) light.pixels(x, y) = truth.pixels(x, y);
        }
    const double worst_seen = irradianceError(light, truth);
    fmt::print("{:6.0f} {:8.0f} {:8.0f} | {:8.4f} {:8.4f} {:8.4f} | {:8.3f} {:8.3f}\n",
               radius_px,
               distance,
               off_axis_deg,
               errors[errors.size() / 2],
               errors[errors.size() * 95 / 100],
               errors[errors.size() * 99 / 100],
               100.0 * worst,
               100.0 * worst_seen);
}

void addNoise(Image<Rgb>& image, double share)
{
    for (std::size_t i = 0; i < image.pixelCount(); ++i) {
        RandomStream random(5, i, 0);
        for (int c = 0; c < 3; ++c) {
            float& value = image.pixels()[i][c];
            value = std::max(value * (1.0f + static_cast<float>(share * random.normal())), 0.0f);
        }
    }
}

/// A stand below the ball and a hand beside it: flat patches in front of its outline.
void addClutter(Image<Rgb>& image, const Shot& shot)
{
    const glm::dvec2 middle = shot.ball.center_px - glm::dvec2(shot.crop);
    for (int y = 0; y < image.height(); ++y) {
        for (int x = 0; x < image.width(); ++x) {
            const glm::dvec2 p = (glm::dvec2(x + 0.5, y + 0.5) - middle) / shot.ball.radius_px;
            if (std::abs(p.x) < 0.3 && p.y > 0.93) image(x, y) = Rgb(0.02f);
            const glm::dvec2 hand = p - glm::dvec2(-1.0, 0.4);
            if (std::abs(hand.x - 0.5 * hand.y) < 0.15 && std::abs(hand.y) < 0.3)
                image(x, y) = Rgb(0.5f, 0.35f, 0.3f);
        }
    }
}

void printOutline(
    double radius_px, double off_axis_deg, double noise, bool clutter, double reflectance)
{
    Shot shot = shoot(radius_px, 12.0, off_axis_deg * pi / 180.0);
    shot.ball.reflectance = reflectance;
    Image<Rgb> picture = renderBall(shot.ball,
                                    shot.camera,
                                    roomRadiance,
                                    shot.crop,
                                    glm::ivec2(shot.side),
                                    Rgb(0.0f),
                                    roomRadiance,
                                    4);
    addNoise(picture, noise);
    if (clutter) addClutter(picture, shot);
    BallOutlineOptions options;
    if (off_axis_deg > 0.0) {
        options.ellipse = true;
        options.start = predictBallOutline(
            shot.ball.center_m + 0.05 * kRadius * shot.camera.up, kRadius, shot.camera);
        options.start->center_px -= glm::dvec2(shot.crop);
    }
    const auto start = std::chrono::steady_clock::now();
    const BallOutlineResult result = findBallOutline(picture, options);
    const double seconds =
        std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    fmt::print("{:6.0f} {:8.0f} {:6.1f} {:6.2f} {:>8} | ",
               radius_px,
               off_axis_deg,
               reflectance,
               noise,
               clutter ? "yes" : "no");
    if (!result.outline) {
        fmt::print("not found\n");
        return;
    }
    const BallOutline& ball = *result.outline;
    fmt::print("{:8.3f} {:8.3f} {:8.3f} {:8.3f} | {:5.2f} {:5.2f} {}\n",
               glm::length(ball.center_px + glm::dvec2(shot.crop) - shot.ball.center_px),
               ball.center_sigma,
               ball.radius_px - shot.ball.radius_px,
               ball.radius_sigma,
               ball.inlier_share,
               seconds,
               result.findings.empty() ? "" : result.findings[0].code);
}

/// The ball of a truth room, whose project gives its outline exactly.
void printRoom(const std::filesystem::path& folder)
{
    const Json project = readJson(folder / "project.json");
    const Json& probe = project.at("light").at("probe");
    std::vector<std::filesystem::path> images;
    for (const Json& image : probe.at("images"))
        images.push_back(folder / image.get<std::string>());
    const Json& ball = probe.at("ball");
    const glm::dvec2 center(ball.at("center_px").at(0).get<double>(),
                            ball.at("center_px").at(1).get<double>());
    const Image<Rgb> radiance = captureRadiance(readBracket(images), {}, {}).merged.radiance.pixels;
    const BallOutlineResult result = findBallOutline(radiance);
    if (!result.outline) {
        fmt::print("{}: not found\n", folder.filename().string());
        return;
    }
    fmt::print(
        "{}: centre {:.3f} px off (sigma {:.3f}), radius {:+.3f} px ({:.3f}), share {:.2f} {}\n",
        folder.filename().string(),
        glm::length(result.outline->center_px - center),
        result.outline->center_sigma,
        result.outline->radius_px - ball.at("radius_px").get<double>(),
        result.outline->radius_sigma,
        result.outline->inlier_share,
        result.findings.empty() ? "" : result.findings[0].code);
}

}  // namespace

int main(int argc, char** argv)
{
    try {
        for (int i = 1; i < argc; ++i)
            printRoom(argv[i]);
        if (argc > 1) return 0;
        fmt::print(
            "radius distance off-axis | direction error, degrees     | irradiance, worst %\n"
            "    px    radii  degrees |   median      95%      99%   |      all  without the blind "
            "spot's error\n");
        for (const double radius_px : {50.0, 120.0, 300.0, 700.0})
            for (const double distance : {3.0, 8.0, 15.0})
                printUnwrap(radius_px, distance, 0.0);
        printUnwrap(120.0, 15.0, 15.0);
        printUnwrap(120.0, 15.0, 25.0);
        fmt::print(
            "\nradius off-axis mirror  noise  clutter | centre    sigma    radius    sigma | share "
            "seconds\n");
        // A perfect mirror before a plain wall hardly differs from it at its rim.
        for (const double reflectance : {0.6, 1.0}) {
            for (const double radius_px : {50.0, 120.0, 300.0, 700.0}) {
                printOutline(radius_px, 0.0, 0.0, false, reflectance);
                printOutline(radius_px, 0.0, 0.03, false, reflectance);
                printOutline(radius_px, 0.0, 0.03, true, reflectance);
                printOutline(radius_px, 0.0, 0.15, true, reflectance);
            }
            printOutline(120.0, 20.0, 0.03, false, reflectance);
            printOutline(120.0, 20.0, 0.03, true, reflectance);
        }
    } catch (const std::exception& error) {
        fmt::print(stderr, "{}\n", error.what());
        return 1;
    }
    return 0;
}
