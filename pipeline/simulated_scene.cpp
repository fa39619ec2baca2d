#include "pipeline/simulated_scene.h"

#include "core/io/image_io.h"
#include "pipeline/project.h"
#include "pipeline/surface_builder.h"

#include <glm/glm.hpp>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

namespace insitu {

namespace {

/// A wall as a rectangle: corner, direction of growing horizontal coordinate, up, and outwards.
struct Wall {
    glm::dvec3 corner{0.0}, along{0.0}, up{0.0}, outwards{0.0};
    glm::dvec2 origin{0.0};  ///< horizontal coordinate and height of the corner
};

Wall wallOf(const RoomBox& box, RoomSide side)
{
    const glm::dvec3 size = box.max_m - box.min_m;
    Wall wall;
    wall.corner = box.min_m;
    wall.up = {0.0, size.y, 0.0};
    const bool along_z = side == RoomSide::Left || side == RoomSide::Right;
    wall.along = along_z ? glm::dvec3(0.0, 0.0, size.z) : glm::dvec3(size.x, 0.0, 0.0);
    wall.origin = {along_z ? box.min_m.z : box.min_m.x, box.min_m.y};
    switch (side) {
        case RoomSide::Left:
            wall.outwards = {-1.0, 0.0, 0.0};
            break;
        case RoomSide::Right:
            wall.outwards = {1.0, 0.0, 0.0};
            wall.corner.x = box.max_m.x;
            break;
        case RoomSide::Back:
            wall.outwards = {0.0, 0.0, -1.0};
            break;
        default:
            wall.outwards = {0.0, 0.0, 1.0};
            wall.corner.z = box.max_m.z;
            break;
    }
    return wall;
}

struct Hole {
    glm::dvec3 corner{0.0}, along{0.0}, up{0.0}, outwards{0.0};
};

Hole holeOf(const RoomBox& box, const SimulatedWindow& window)
{
    const Wall wall = wallOf(box, window.wall);
    const glm::dvec3 along = glm::normalize(wall.along);
    const glm::dvec2 offset = window.from_m - wall.origin;
    const glm::dvec2 size = window.to_m - window.from_m;
    return {wall.corner + along * offset.x + glm::dvec3(0.0, offset.y, 0.0),
            along * size.x,
            glm::dvec3(0.0, size.y, 0.0),
            wall.outwards};
}

void addWall(SurfaceBuilder& builder, const SimulatedRoom& room, RoomSide side)
{
    const Wall wall = wallOf(room.box, side);
    const SimulatedSurface& surface = room.surfaces[static_cast<std::size_t>(side)];
    std::vector<std::pair<glm::dvec2, glm::dvec2>> holes;
    for (const SimulatedWindow& window : room.windows)
        if (window.wall == side)
            holes.emplace_back(window.from_m - wall.origin, window.to_m - wall.origin);
    builder.addRectangle(surface, wall.corner, wall.along, wall.up, holes);
}

/// The wall's thickness around a hole, and a window frame with one mullion at half its depth.
void addReveal(SurfaceBuilder& builder, const SimulatedRoom& room, const SimulatedWindow& window)
{
    if (window.reveal_m <= 0.0) return;
    SimulatedSurface white;
    white.color_linear = glm::vec3(0.8f);
    const Hole hole = holeOf(room.box, window);
    const glm::dvec3 out = hole.outwards * window.reveal_m;
    builder.addRectangle(white, hole.corner, hole.along, out);
    builder.addRectangle(white, hole.corner + hole.up, hole.along, out);
    builder.addRectangle(white, hole.corner, hole.up, out);
    builder.addRectangle(white, hole.corner + hole.along, hole.up, out);

    const double bar = window.frame_m;
    const glm::dvec2 size = window.to_m - window.from_m;
    if (bar <= 0.0 || size.x < 4.0 * bar || size.y < 4.0 * bar) return;
    const glm::dvec3 x = glm::normalize(hole.along);
    const glm::dvec3 y{0.0, 1.0, 0.0};
    const glm::dvec3 depth = hole.outwards * std::min(bar, 0.5 * window.reveal_m);
    const glm::dvec3 base = hole.corner + out - depth;
    const auto addBar = [&](glm::dvec2 from, glm::dvec2 to) {
        builder.addBox(white, base + x * from.x + y * from.y, base + x * to.x + y * to.y + depth);
    };
    addBar({0.0, 0.0}, {bar, size.y});
    addBar({size.x - bar, 0.0}, {size.x, size.y});
    addBar({bar, 0.0}, {size.x - bar, bar});
    addBar({bar, size.y - bar}, {size.x - bar, size.y});
    addBar({0.5 * (size.x - bar), bar}, {0.5 * (size.x + bar), size.y - bar});
}

Model buildShell(const SimulatedRoom& room)
{
    SurfaceBuilder builder(room.seed);
    const glm::dvec3 low = room.box.min_m;
    const glm::dvec3 size = room.box.max_m - low;
    const glm::dvec3 x{size.x, 0.0, 0.0};
    const glm::dvec3 z{0.0, 0.0, size.z};
    builder.addRectangle(room.surfaces[0], low, x, z);
    builder.addRectangle(room.surfaces[1], low + glm::dvec3(0.0, size.y, 0.0), x, z);
    for (const RoomSide side : {RoomSide::Left, RoomSide::Right, RoomSide::Back, RoomSide::Front})
        addWall(builder, room, side);
    for (const SimulatedWindow& window : room.windows)
        addReveal(builder, room, window);
    for (const SimulatedBox& box : room.boxes)
        builder.addBox(box.surface, box.box.min_m, box.box.max_m);
    return builder.take();
}

PlacedModel loadFurniture(const SimulatedFurniture& furniture)
{
    PlacedModel loaded = loadObject(furniture.object);
    Model& model = loaded.model;
    for (Material& material : model.materials) {
        const auto found = furniture.materials.find(material.name);
        if (found == furniture.materials.end()) continue;
        const std::string name = material.name;
        material = found->second;
        material.name = name;
    }
    if (furniture.matte)
        for (Material& material : model.materials) {
            material.metallic = material.specular = 0.0f;
            material.metallic_roughness_texture = kNoTexture;
        }
    return loaded;
}

/// The environment turned about +Y, multiplied by the gain.
EnvironmentMap loadEnvironment(const SimulatedRoom& room)
{
    EnvironmentMap result;
    if (!room.environment) return result;
    const EnvironmentMap source{readRadiance(*room.environment).pixels};
    result.pixels = Image<Rgb>(source.pixels.width(), source.pixels.height());
    const double angle = room.environment_rotation_deg * std::numbers::pi / 180.0;
    for (int y = 0; y < source.pixels.height(); ++y)
        for (int x = 0; x < source.pixels.width(); ++x) {
            const glm::dvec3 d = environmentDirectionFromUv(
                {(x + 0.5) / source.pixels.width(), (y + 0.5) / source.pixels.height()});
            // Turning the map by +angle means looking up by -angle.
            const glm::dvec3 turned{std::cos(angle) * d.x - std::sin(angle) * d.z,
                                    d.y,
                                    std::sin(angle) * d.x + std::cos(angle) * d.z};
            result.pixels(x, y) = lookUp(source, turned) * room.environment_gain;
        }
    return result;
}

EnvironmentLight buildLight(const SimulatedRoom& room)
{
    std::vector<Portal> portals;
    if (room.environment)
        for (const SimulatedWindow& window : room.windows) {
            const Hole hole = holeOf(room.box, window);
            portals.push_back(
                {{hole.corner + hole.outwards * window.reveal_m, hole.along, hole.up}});
        }
    std::vector<AreaLamp> lamps;
    for (const SimulatedLamp& lamp : room.lamps)
        lamps.push_back({{lamp.corner_m, lamp.edge_u_m, lamp.edge_v_m}, lamp.radiance, false});
    return EnvironmentLight(loadEnvironment(room), std::move(portals), std::move(lamps));
}

}  // namespace

std::vector<glm::dvec3> windowCorners(const RoomBox& box, const SimulatedWindow& window)
{
    const Hole hole = holeOf(box, window);
    return {hole.corner,
            hole.corner + hole.along,
            hole.corner + hole.along + hole.up,
            hole.corner + hole.up};
}

SimulatedScene buildScene(const SimulatedRoom& room)
{
    std::vector<SolidBounds> solids;
    for (const SimulatedBox& box : room.boxes)
        solids.push_back({box.box.name, {box.box.min_m, box.box.max_m}, true, box.in_project});

    std::vector<ObjectScene::Object> objects;
    objects.push_back({buildShell(room), {}});
    for (const SimulatedFurniture& furniture : room.furniture) {
        objects.push_back(loadFurniture(furniture));
        const auto& [model, placement] = objects.back();
        solids.push_back({furniture.name,
                          boundingBox(placed(model.mesh, placement)),
                          false,
                          furniture.in_project});
    }
    std::vector<ObjectScene::Object> with = objects;
    with.push_back(loadObject(room.object));
    return {ObjectScene(std::move(objects)),
            ObjectScene(std::move(with)),
            buildLight(room),
            std::move(solids)};
}

}  // namespace insitu
