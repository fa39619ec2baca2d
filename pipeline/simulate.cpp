#include "pipeline/simulate.h"

#include "core/parallel.h"
#include "core/random.h"
#include "pipeline/camera_simulator.h"
#include "pipeline/denoise.h"
#include "render/path_tracer.h"

#include <glm/glm.hpp>

#include <cmath>
#include <functional>
#include <optional>
#include <string>

namespace insitu {

namespace {

/// Renders through the library's progress, as one part of a longer work.
class PartOfProgress : public Progress {
public:
    PartOfProgress(Progress& whole, double from, double to) : whole_(whole), from_(from), to_(to) {}
    void report(std::string_view stage, double fraction) override
    {
        whole_.report(stage, std::lerp(from_, to_, fraction));
    }
    [[nodiscard]] bool cancelled() const override { return whole_.cancelled(); }

private:
    Progress& whole_;
    double from_, to_;
};

struct Ray {
    glm::dvec3 origin{0.0}, direction{0.0};
    float weight = 1.0f;  ///< of the radiance found
};
/// A ray through a place of the picture, in pixels.
using RayThrough = std::function<Ray(glm::dvec2)>;

Rgb radianceAlong(const SimulatedScene& scene,
                  const Ray& ray,
                  const PathOptions& options,
                  RandomStream& random)
{
    const auto point = scene.without.intersect(ray.origin, ray.direction);
    const IncidentLight behind = scene.light.incident(ray.origin, ray.direction);
    if (!point || behind.distance_m < point->distance_m) return behind.radiance;
    return tracePath(scene.without, scene.light, *point, -ray.direction, options, random);
}

Image<Rgb> renderRays(const SimulatedScene& scene,
                      glm::ivec2 size,
                      const RayThrough& rayThrough,
                      int samples,
                      const SimulatedRoom& room,
                      Progress& progress,
                      const char* stage)
{
    constexpr int kRowsAtOnce = 16;
    const PathOptions options{room.max_bounces, room.roulette_start};
    Image<Rgb> image(size.x, size.y);
    for (int first = 0; first < size.y; first += kRowsAtOnce) {
        progress.checkpoint();
        progress.report(stage, static_cast<double>(first) / size.y);
        parallelFor(first, std::min(first + kRowsAtOnce, size.y), [&](std::int64_t row) {
            const int y = static_cast<int>(row);
            for (int x = 0; x < size.x; ++x) {
                const auto pixel = static_cast<std::uint64_t>(row * size.x + x);
                glm::dvec3 sum{0.0};
                for (int i = 0; i < samples; ++i) {
                    RandomStream random(room.seed, pixel, static_cast<std::uint64_t>(i));
                    const glm::dvec2 jitter(random.uniform2());
                    const Ray ray = rayThrough(glm::dvec2(x, y) + jitter);
                    sum += ray.weight * radianceAlong(scene, ray, options, random);
                }
                image(x, y) = Rgb(sum / static_cast<double>(samples));
            }
        });
    }
    progress.report(stage, 1.0);
    return image;
}

/// A camera ray, reflected at the ball when it meets it.
Ray ballRay(const SimulatedRoom& room, const Camera& camera, glm::dvec2 pixel)
{
    const glm::dvec3 direction = camera.rayDirection(pixel);
    const glm::dvec3 from_center = camera.position_m - room.ball.center_m;
    const double b = glm::dot(from_center, direction);
    const double c = glm::dot(from_center, from_center) - room.ball.radius_m * room.ball.radius_m;
    const double discriminant = b * b - c;
    if (discriminant < 0.0) return {camera.position_m, direction, 1.0f};
    const glm::dvec3 point = camera.position_m + (-b - std::sqrt(discriminant)) * direction;
    const glm::dvec3 normal = glm::normalize(point - room.ball.center_m);
    return {point,
            glm::normalize(glm::reflect(direction, normal)),
            static_cast<float>(room.ball.reflectance)};
}

/// Coverage on a regular grid of sub-pixels: nearest surface is the object's.
Image<float> renderCoverage(const SimulatedRoom& room, const SimulatedScene& scene)
{
    constexpr int kGrid = 4;
    const Camera& camera = room.camera;
    const std::size_t object = scene.with.bounds().size() - 1;
    Image<float> coverage(camera.width, camera.height);
    parallelFor(0, camera.height, [&](std::int64_t row) {
        for (int x = 0; x < camera.width; ++x) {
            int count = 0;
            for (int i = 0; i < kGrid * kGrid; ++i) {
                const glm::dvec2 pixel{x + (i % kGrid + 0.5) / kGrid,
                                       static_cast<double>(row) + (i / kGrid + 0.5) / kGrid};
                const auto hit =
                    scene.with.intersect(camera.position_m, camera.rayDirection(pixel));
                if (hit && hit->object == object) ++count;
            }
            coverage(x, static_cast<int>(row)) = static_cast<float>(count) / (kGrid * kGrid);
        }
    });
    return coverage;
}

Image<Rgb> finish(RenderedImage image, const ObjectScene& scene, const SimulatedRoom& room)
{
    if (!room.denoise) return std::move(image.radiance);
    return denoised(image, scene, room.camera);
}

SimulatedShot takeShot(const SimulatedRoom& room,
                       const SimulatedCapture& capture,
                       const Image<Rgb>& radiance,
                       std::string name,
                       double seconds,
                       double focal_px,
                       std::uint64_t shot)
{
    return {std::move(name),
            seconds,
            photograph(radiance, room.body, capture.sensor_scale, seconds, room.seed, shot),
            simulatedExif(room.body, seconds, focal_px, radiance.width())};
}

/// "ball_1_32.jpg" for 1/32 s, "ball_2.jpg" for 2 s; "ball2_1_32.jpg" in the second view.
std::string ballName(std::size_t view, double seconds)
{
    const std::string ball = view == 0 ? "ball" : fmt::format("ball{}", view + 1);
    if (seconds >= 1.0) return fmt::format("{}_{:g}.jpg", ball, seconds);
    return fmt::format("{}_1_{:g}.jpg", ball, std::round(1.0 / seconds * 1000.0) / 1000.0);
}

Camera ballViewCamera(const SimulatedRoom& room, std::size_t view)
{
    return ballCamera(room.ball, room.ball_views_m[view], room.ball_size_px, room.ball_size_px);
}

}  // namespace

SimulatedTruth renderRoom(const SimulatedRoom& room,
                          const SimulatedScene& scene,
                          Progress& progress)
{
    RenderOptions options;
    options.samples_per_pixel = room.samples_per_pixel;
    options.seed = room.seed;
    options.path = {room.max_bounces, room.roulette_start};

    SimulatedTruth truth;
    PartOfProgress plate(progress, 0.0, 0.4);
    truth.plate = finish(
        renderScene(scene.without, scene.light, room.camera, options, plate), scene.without, room);
    PartOfProgress with(progress, 0.4, 0.8);
    truth.with =
        finish(renderScene(scene.with, scene.light, room.camera, options, with), scene.with, room);
    truth.coverage = renderCoverage(room, scene);

    const auto views = static_cast<double>(room.ball_views_m.size());
    for (std::size_t view = 0; view < room.ball_views_m.size(); ++view) {
        const Camera camera = ballViewCamera(room, view);
        const double done = static_cast<double>(view) / views;
        PartOfProgress ball(
            progress, std::lerp(0.8, 0.93, done), std::lerp(0.8, 0.93, done + 1.0 / views));
        truth.balls.push_back(renderRays(
            scene,
            glm::ivec2(room.ball_size_px),
            [&](glm::dvec2 pixel) { return ballRay(room, camera, pixel); },
            room.ball_samples_per_pixel,
            room,
            ball,
            "ball"));
    }

    PartOfProgress panorama(progress, 0.93, 1.0);
    const glm::dvec2 size{room.panorama_width, room.panorama_width / 2};
    truth.panorama = renderRays(
        scene,
        glm::ivec2(size),
        [&](glm::dvec2 pixel) {
            return Ray{room.ball.center_m, environmentDirectionFromUv(pixel / size)};
        },
        room.panorama_samples_per_pixel,
        room,
        panorama,
        "panorama");
    return truth;
}

SimulatedCapture simulate(const SimulatedRoom& room, Progress& progress)
{
    const SimulatedScene scene = buildScene(room);
    SimulatedCapture capture;
    capture.solids = scene.solids;
    capture.edges = trueEdges(room, scene);
    capture.lines = markedLines(room, capture.edges);
    for (const RoomAxis axis : {RoomAxis::X, RoomAxis::Y, RoomAxis::Z}) {
        const auto count =
            std::count_if(capture.edges.begin(), capture.edges.end(), [&](const LineSegment& edge) {
                return edge.axis == axis;
            });
        if (count < 2)
            capture.findings.push_back(
                {Severity::Warning,
                 "simulate-few-lines",
                 fmt::format("only {} visible edges along {}: the camera may not be recoverable; "
                             "turn or move it",
                             count,
                             "xyz"[static_cast<int>(axis)])});
    }
    capture.truth = renderRoom(room, scene, progress);
    capture.sensor_scale = sensorScale(capture.truth.plate, room, room.plate_seconds);

    const double focal = room.camera.focal_px.x;
    capture.plate =
        takeShot(room, capture, capture.truth.plate, "plate.jpg", room.plate_seconds, focal, 1);
    capture.with =
        takeShot(room, capture, capture.truth.with, "truth.jpg", room.plate_seconds, focal, 2);
    std::uint64_t shot = 3;
    for (std::size_t view = 0; view < room.ball_views_m.size(); ++view) {
        const double ball_focal = ballViewCamera(room, view).focal_px.x;
        std::vector<SimulatedShot>& bracket = capture.brackets.emplace_back();
        for (const double seconds : room.ball_seconds)
            bracket.push_back(takeShot(room,
                                       capture,
                                       capture.truth.balls[view],
                                       ballName(view, seconds),
                                       seconds,
                                       ball_focal,
                                       shot++));
    }
    return capture;
}

}  // namespace insitu
