#include "render/fiv/object_pixels.h"

#include "core/parallel.h"
#include "lighting/see_through.h"
#include "render/fiv/object_sharing.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace insitu {

namespace {

constexpr int kTile = 64;
/// Of a place, to the light and over the hemisphere.
constexpr int kRays = 12;
/// Rays of every pixel that may show an object, and those added where it shows something else too.
constexpr int kInner = 4;
constexpr int kAll = 16;
/// Points of one pixel share their irradiance when their normals are nearer than this cosine and
/// their distances than this share.
constexpr double kSameNormal = 0.95;
constexpr double kSameDistance = 0.01;

/// Rotated grid of 4, then the other places of a grid of 16 that has them.
glm::dvec2 subPixel(int i)
{
    constexpr std::array<int, kAll> kOrder = {1, 7, 8, 14, 0, 2, 3, 4, 5, 6, 9, 10, 11, 12, 13, 15};
    const int cell = kOrder[static_cast<std::size_t>(i)];
    return {(cell % 4 + 0.5) / 4.0, (cell / 4 + 0.5) / 4.0};
}

/// Points of objects in one pixel that are shaded, and the places in a tile's list that light them.
struct PixelPoints {
    glm::ivec2 pixel{0};
    std::vector<SurfacePoint> points;
    std::vector<glm::dvec3> toward_camera;
    std::vector<std::size_t> place;  ///< one a point
    float alpha = 0.0f;
};

class Tracer {
public:
    Tracer(const Camera& camera, const FivScene& scene) : camera_(camera), scene_(scene) {}

    [[nodiscard]] std::optional<ProxyHit> surface(glm::ivec2 pixel, glm::dvec3 direction) const
    {
        const RoomLight& room = scene_.room;
        return room.seesThrough(pixel.x, pixel.y)
                   ? intersectBehindBoxes(room.proxy(), camera_.position_m, direction)
                   : room.proxy().intersect(camera_.position_m, direction);
    }
    [[nodiscard]] glm::dvec3 direction(glm::ivec2 pixel, glm::dvec2 inside) const
    {
        return camera_.rayDirection(glm::dvec2(pixel) + inside);
    }
    [[nodiscard]] std::optional<SurfacePoint> object(glm::dvec3 direction,
                                                     const std::optional<ProxyHit>& surface) const
    {
        if (!scene_.mayMeetObjects(camera_.position_m, direction)) return std::nullopt;
        return scene_.objects.intersect(
            camera_.position_m, direction, surface ? surface->distance_m : kInfinity);
    }
    static void keep(const std::optional<ProxyHit>& surface, std::optional<ReceiverPlace>& receiver)
    {
        if (surface && !surface->opening && !receiver)
            receiver = {surface->point, surface->normal, surface->face, surface->uv};
    }

    /// Fills `seen` and `receiver`; false when no object is seen.
    bool trace(glm::ivec2 pixel,
               PixelPoints& seen,
               float& depth_m,
               std::optional<ReceiverPlace>& receiver) const
    {
        const glm::dvec3 middle = direction(pixel, glm::dvec2(0.5));
        const auto behind = surface(pixel, middle);
        // The bounding sphere with some room for the pixel's own size.
        if (!scene_.mayMeetObjects(camera_.position_m, middle) &&
            !scene_.mayMeetObjects(camera_.position_m, direction(pixel, {0.0, 0.0})) &&
            !scene_.mayMeetObjects(camera_.position_m, direction(pixel, {1.0, 1.0}))) {
            keep(behind, receiver);
            return false;
        }
        double nearest = kInfinity;
        int covered = 0;
        int rays = kInner;
        for (int i = 0; i < rays; ++i) {
            const glm::dvec3 toward = direction(pixel, subPixel(i));
            const auto wall = surface(pixel, toward);
            const auto point = object(toward, wall);
            if (point) {
                ++covered;
                nearest = std::min(nearest, point->distance_m);
                if (i < kInner || seen.points.empty()) {
                    seen.points.push_back(*point);
                    seen.toward_camera.push_back(-toward);
                }
            } else {
                keep(wall, receiver);
            }
            if (i + 1 == kInner && covered > 0 && covered < kInner) rays = kAll;
        }
        if (covered == 0) {
            receiver.reset();
            keep(behind, receiver);
            return false;
        }
        seen.pixel = pixel;
        seen.alpha = static_cast<float>(covered) / static_cast<float>(rays);
        depth_m = static_cast<float>(nearest);
        return true;
    }

private:
    const Camera& camera_;
    const FivScene& scene_;
};

/// Points that lie on one smooth piece of surface are lit as their mean.
void listPlaces(PixelPoints& pixel, std::vector<ObjectShading::Place>& places)
{
    const glm::dvec2 shift = LobeDraw::of(pixel.pixel, 0).shift;
    const SurfacePoint& first = pixel.points.front();
    ObjectShading::Place mean = ObjectShading::placeOf(first);
    mean.shift = shift;
    bool together = true;
    for (std::size_t i = 1; i < pixel.points.size() && together; ++i) {
        const SurfacePoint& point = pixel.points[i];
        together = point.object == first.object &&
                   glm::dot(point.shading_normal, first.shading_normal) > kSameNormal &&
                   glm::dot(point.geometric_normal, first.geometric_normal) > kSameNormal &&
                   std::abs(point.distance_m - first.distance_m) < kSameDistance * first.distance_m;
        mean.normal += point.shading_normal;
    }
    if (together) {
        // A place on the surface itself, not between its points.
        mean.normal = glm::normalize(mean.normal);
        places.push_back(mean);
        pixel.place.assign(pixel.points.size(), places.size() - 1);
        return;
    }
    for (const SurfacePoint& point : pixel.points) {
        pixel.place.push_back(places.size());
        places.push_back(ObjectShading::placeOf(point));
        places.back().shift = shift + 0.25 * static_cast<double>(pixel.place.size());
    }
}

}  // namespace

std::vector<std::optional<ReceiverPlace>> renderObjectPixels(const Camera& camera,
                                                             const FivScene& scene,
                                                             const ObjectShading& shading,
                                                             RenderLayers& layers,
                                                             Progress& progress)
{
    const int width = camera.width;
    const int height = camera.height;
    std::vector<std::optional<ReceiverPlace>> receivers(layers.alpha.pixelCount());
    const int columns = (width + kTile - 1) / kTile;
    const int rows = (height + kTile - 1) / kTile;
    const Tracer tracer(camera, scene);
    std::vector<std::vector<ObjectPixel>> tiles(static_cast<std::size_t>(columns) *
                                                static_cast<std::size_t>(rows));
    parallelFor(0, static_cast<std::int64_t>(columns) * rows, [&](std::int64_t tile) {
        if (progress.cancelled()) return;
        const int x0 = static_cast<int>(tile) % columns * kTile;
        const int y0 = static_cast<int>(tile) / columns * kTile;
        std::vector<PixelPoints> pixels;
        std::vector<ObjectShading::Place> places;
        // Blocks of 8 x 4 pixels: places next to each other in the list are neighbours.
        for (int block = 0; block < kTile * kTile / 32; ++block)
            for (int i = 0; i < 32; ++i) {
                const glm::ivec2 pixel(x0 + block % (kTile / 8) * 8 + i % 8,
                                       y0 + block / (kTile / 8) * 4 + i / 8);
                if (pixel.x >= width || pixel.y >= height) continue;
                PixelPoints seen;
                float depth_m = 0.0f;
                auto& receiver = receivers[static_cast<std::size_t>(pixel.y * width + pixel.x)];
                if (!tracer.trace(pixel, seen, depth_m, receiver)) continue;
                layers.depth_m(pixel.x, pixel.y) = depth_m;
                listPlaces(seen, places);
                pixels.push_back(std::move(seen));
            }
        const auto received = shading.receive(places, kRays);
        for (const PixelPoints& seen : pixels) {
            const auto count = static_cast<float>(seen.points.size());
            const SurfacePoint& first = seen.points.front();
            ObjectPixel sums;
            sums.pixel = seen.pixel;
            sums.normal = glm::vec3(first.shading_normal);
            sums.depth_m = static_cast<float>(first.distance_m);
            sums.roughness = first.material.roughness;
            sums.object = static_cast<std::uint32_t>(first.object);
            sums.one_place = seen.place.front() == seen.place.back();
            Rgb radiance(0.0f);
            for (std::size_t i = 0; i < seen.points.size(); ++i)
                shading.add(seen.points[i],
                            seen.toward_camera[i],
                            received[seen.place[i]],
                            LobeDraw::of(seen.pixel, static_cast<int>(i)),
                            sums,
                            radiance);
            sums.rays = 1.0f / count * sums.rays;
            const float share = seen.alpha / count;
            for (Rgb* sum : {&sums.matt, &sums.matt_open, &sums.glossy, &sums.gathered})
                *sum *= share;
            layers.alpha(seen.pixel.x, seen.pixel.y) = seen.alpha;
            layers.object(seen.pixel.x, seen.pixel.y) = radiance * share;
            tiles[static_cast<std::size_t>(tile)].push_back(sums);
        }
    });
    progress.checkpoint();
    std::vector<ObjectPixel> all;
    for (const std::vector<ObjectPixel>& tile : tiles)
        all.insert(all.end(), tile.begin(), tile.end());
    addShared(all, layers.object);
    return receivers;
}

}  // namespace insitu
