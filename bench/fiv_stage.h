#pragma once

#include "core/parallel.h"
#include "evaluate/error_metrics.h"
#include "lighting/fiv_field.h"
#include "lighting/hidden_light.h"
#include "reconstruct/ray_scene.h"

#include <functional>
#include <optional>
#include <vector>

/// An object on a floor whose irradiance several techniques compute.
namespace insitu::fiv_bench {

inline const glm::vec3 kUp(0.0f, 1.0f, 0.0f);

/// Floor places under and around an object, in its own units.
struct Floor {
    int side = 80;
    glm::dvec3 corner{0.0};
    double extent = 0.0;

    [[nodiscard]] glm::dvec3 place(int x, int y) const
    {
        return corner + glm::dvec3((x + 0.5) * extent / side, 0.0, (y + 0.5) * extent / side);
    }
    /// Local places, in tiles of 8 x 4, and where each belongs.
    void tiled(const LocalFrame& local,
               std::vector<glm::vec3>& places,
               std::vector<glm::ivec2>& pixels) const
    {
        for (int top = 0; top < side; top += 4)
            for (int left = 0; left < side; left += 8)
                for (int y = top; y < std::min(top + 4, side); ++y)
                    for (int x = left; x < std::min(left + 8, side); ++x) {
                        places.push_back(local.localFrom(place(x, y)));
                        pixels.emplace_back(x, y);
                    }
    }
};

/// An object on its floor with everything that techniques need of it.
struct Stage {
    TriangleMesh mesh;
    std::optional<RayScene> rays;
    VisibilityAtlas atlas;
    double atlas_s = 0.0;
    Floor floor;
    std::vector<glm::vec3> places;
    std::vector<glm::ivec2> pixels;

    /// `sunk`: how much of the sphere's diameter lies below the floor.
    void put(double floor_y, double offset_radii)
    {
        const LocalFrame& local = atlas.silhouettes.local;
        floor.extent = 5.0 * local.radius;
        floor.corner =
            local.center +
            glm::dvec3(-0.5 * floor.extent + offset_radii * local.radius, 0.0, -0.5 * floor.extent);
        floor.corner.y = floor_y - 1e-4 * local.radius;
        places.clear();
        pixels.clear();
        floor.tiled(local, places, pixels);
    }
    [[nodiscard]] const LocalFrame& local() const { return atlas.silhouettes.local; }
};

/// A picture of the floor's irradiance.
using Picture = Image<Rgb>;

inline Picture pictureOf(const Floor& floor, const std::function<Rgb(glm::dvec3)>& shade)
{
    Picture picture(floor.side, floor.side);
    parallelFor(0, floor.side, [&](std::int64_t y) {
        for (int x = 0; x < floor.side; ++x)
            picture(x, static_cast<int>(y)) = shade(floor.place(x, static_cast<int>(y)));
    });
    return picture;
}

inline double nrmse(const Picture& truth, const Picture& picture)
{
    return compareImages(truth, picture)->nrmse;
}

inline Picture exactPicture(const Stage& stage, const ObjectLight& object)
{
    std::vector<Rgb> hidden(stage.places.size());
    hiddenIrradiance(object, stage.places, kUp, hidden);
    const Rgb free = object.light.irradiance(kUp);
    Picture picture(stage.floor.side, stage.floor.side);
    for (std::size_t i = 0; i < hidden.size(); ++i)
        picture(stage.pixels[i].x, stage.pixels[i].y) = free - hidden[i];
    return picture;
}

inline Picture shellPicture(const Stage& stage, const ObjectLight& object, const ShellField& field)
{
    std::vector<Rgb> hidden(stage.places.size());
    field.hiddenIrradiance(stage.places, std::vector<glm::vec3>(stage.places.size(), kUp), hidden);
    const Rgb free = object.light.irradiance(kUp);
    Picture picture(stage.floor.side, stage.floor.side);
    for (std::size_t i = 0; i < hidden.size(); ++i)
        picture(stage.pixels[i].x, stage.pixels[i].y) = free - hidden[i];
    return picture;
}

inline ReceiverPlane planeOf(const Floor& floor)
{
    return {floor.corner, {floor.extent, 0.0, 0.0}, {0.0, 0.0, floor.extent}};
}

inline Picture planePicture(const Stage& stage, const ObjectLight& object, const PlaneField& field)
{
    const Rgb free = object.light.irradiance(kUp);
    const double side = stage.floor.side;
    Picture picture(stage.floor.side, stage.floor.side);
    for (const glm::ivec2 p : stage.pixels)
        picture(p.x, p.y) = free - field.at({(p.x + 0.5) / side, (p.y + 0.5) / side});
    return picture;
}

}  // namespace insitu::fiv_bench
