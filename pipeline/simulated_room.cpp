#include "pipeline/simulated_room.h"

#include "pipeline/project_json.h"
#include "pipeline/room_keys.h"

#include <glm/glm.hpp>

#include <algorithm>
#include <cmath>

namespace insitu {

namespace {

/// Largest picture side and sample count that are accepted: typing errors should not cost a day.
constexpr int kMinSide = 8;
constexpr int kMaxSide = 16384;
constexpr int kMaxSamples = 1 << 20;

int readCount(const JsonNode& node, int lowest, int highest)
{
    const int value = node.integer();
    if (value < lowest || value > highest)
        node.fail(fmt::format("is {}; must lie in {} to {}", value, lowest, highest));
    return value;
}

double readNotNegative(const JsonNode& node)
{
    const double value = node.number();
    if (value < 0.0) node.fail(fmt::format("is {}; must not be negative", value));
    return value;
}

glm::vec3 readColor(const JsonNode& node)
{
    const glm::dvec3 color = node.vec3();
    for (std::size_t c = 0; c < 3; ++c)
        (void)readFraction(node.at(c));
    return glm::vec3(color);
}

glm::vec3 readLight(const JsonNode& node)
{
    const glm::dvec3 value = node.vec3();
    for (std::size_t c = 0; c < 3; ++c)
        (void)readNotNegative(node.at(c));
    return glm::vec3(value);
}

void readBoards(const JsonNode& node, SimulatedSurface& surface)
{
    node.expectKeys(keys::kBoards);
    surface.kind = SimulatedSurface::Kind::Boards;
    if (const auto v = node.find("width_m")) surface.board_width_m = v->positive();
    if (const auto v = node.find("length_m")) surface.board_length_m = v->positive();
    if (const auto v = node.find("variation")) surface.board_variation = readFraction(*v);
    if (const auto v = node.find("along"))
        surface.boards_along_x = readChoice(*v, {"x", "z"}) == "x";
}

SimulatedSurface readSurface(const JsonNode& node, const std::filesystem::path& folder)
{
    node.expectKeys(keys::kSurface);
    SimulatedSurface surface;
    const auto boards = node.find("boards");
    const auto checker = node.find("checker");
    const auto picture = node.find("picture");
    if (int(boards.has_value()) + int(checker.has_value()) + int(picture.has_value()) > 1)
        node.fail("has more than one of boards, checker and picture; keep one");
    if (picture) {
        surface.kind = SimulatedSurface::Kind::Picture;
        surface.picture = existingFile(*picture, folder);
        surface.color_linear = glm::vec3(1.0f);
    } else {
        surface.color_linear = readColor(node.at("color_linear"));
    }
    if (picture && node.has("color_linear"))
        surface.color_linear = readColor(node.at("color_linear"));
    if (boards) readBoards(*boards, surface);
    if (checker) {
        checker->expectKeys(keys::kChecker);
        surface.kind = SimulatedSurface::Kind::Checker;
        surface.second_linear = readColor(checker->at("second_linear"));
    }
    if (const auto v = node.find("size_m")) surface.size_m = v->positive();
    if (const auto v = node.find("roughness")) surface.roughness = float(readFraction(*v));
    if (const auto v = node.find("specular")) surface.specular = float(readFraction(*v));
    return surface;
}

void readBoxRoom(const JsonNode& node, const std::filesystem::path& folder, SimulatedRoom& room)
{
    node.expectKeys(keys::kSimulatedBox);
    room.box = readBox(node);
    if (std::abs(room.box.min_m.y) > 1e-9)
        node.at("min_m").fail(
            "the floor must lie at height 0: the world's origin is a floor point");
    const JsonNode surfaces = node.at("surfaces");
    surfaces.expectKeys(keys::kSurfaces);
    std::size_t i = 0;
    for (const std::string_view side : keys::kSurfaces)
        room.surfaces[i++] = readSurface(surfaces.at(side), folder);
}

SimulatedWindow readWindow(const JsonNode& node, const RoomBox& box)
{
    node.expectKeys(keys::kWindow);
    SimulatedWindow window;
    const std::string wall = readChoice(node.at("wall"), {"left", "right", "back", "front"});
    if (wall == "right") window.wall = RoomSide::Right;
    if (wall == "back") window.wall = RoomSide::Back;
    if (wall == "front") window.wall = RoomSide::Front;
    window.from_m = node.at("from_m").vec2();
    window.to_m = node.at("to_m").vec2();
    const int axis = window.wall == RoomSide::Left || window.wall == RoomSide::Right ? 2 : 0;
    const glm::dvec2 low{box.min_m[axis], box.min_m.y};
    const glm::dvec2 high{box.max_m[axis], box.max_m.y};
    for (int i = 0; i < 2; ++i)
        if (!(low[i] < window.from_m[i] && window.from_m[i] < window.to_m[i] &&
              window.to_m[i] < high[i]))
            node.fail("from_m must be below to_m in both coordinates, and both inside the wall");
    if (const auto v = node.find("reveal_m")) window.reveal_m = readNotNegative(*v);
    if (const auto v = node.find("frame_m")) window.frame_m = readNotNegative(*v);
    return window;
}

SimulatedLamp readLamp(const JsonNode& node)
{
    node.expectKeys(keys::kLamp);
    SimulatedLamp lamp{node.at("corner_m").vec3(),
                       node.at("edge_u_m").vec3(),
                       node.at("edge_v_m").vec3(),
                       readLight(node.at("radiance"))};
    if (glm::length(glm::cross(lamp.edge_u_m, lamp.edge_v_m)) < 1e-8)
        node.fail("the lamp has no area: its edges are parallel or of length 0");
    return lamp;
}

SimulatedFurniture readFurniture(const JsonNode& node, const std::filesystem::path& folder)
{
    node.expectKeys(keys::kFurniture);
    SimulatedFurniture furniture;
    furniture.object = readPlacedModel(node, folder);
    if (const auto v = node.find("material")) furniture.object.material = readMaterial(*v);
    if (const auto list = node.find("materials")) {
        if (!list->value().is_object()) list->fail("must be an object: material name to material");
        for (const auto& item : list->value().items())
            furniture.materials[item.key()] = readMaterial(list->at(item.key()));
    }
    if (const auto v = node.find("matte")) furniture.matte = v->boolean();
    furniture.name =
        node.has("name") ? node.at("name").text() : furniture.object.model.stem().string();
    if (const auto v = node.find("in_project")) furniture.in_project = v->boolean();
    return furniture;
}

void readLightAndSolids(const JsonNode& root,
                        const std::filesystem::path& folder,
                        SimulatedRoom& room)
{
    if (const auto windows = root.find("windows"))
        for (std::size_t i = 0; i < windows->size(); ++i)
            room.windows.push_back(readWindow(windows->at(i), room.box));
    if (const auto environment = root.find("environment")) {
        environment->expectKeys(keys::kEnvironment);
        room.environment = existingFile(environment->at("image"), folder);
        if (const auto v = environment->find("rotation_y_deg"))
            room.environment_rotation_deg = v->number();
        if (const auto v = environment->find("gain")) room.environment_gain = readLight(*v);
    }
    if (const auto lamps = root.find("lamps"))
        for (std::size_t i = 0; i < lamps->size(); ++i)
            room.lamps.push_back(readLamp(lamps->at(i)));
    if (room.lamps.empty() && (room.windows.empty() || !room.environment))
        root.fail("the room is dark: give a window and an environment, or a lamp");
    if (const auto boxes = root.find("boxes"))
        for (std::size_t i = 0; i < boxes->size(); ++i) {
            const JsonNode node = boxes->at(i);
            node.expectKeys(keys::kSolid);
            SimulatedBox box{readBox(node), readSurface(node.at("surface"), folder)};
            box.box.solid = true;
            if (const auto v = node.find("in_project")) box.in_project = v->boolean();
            room.boxes.push_back(std::move(box));
        }
    if (const auto furniture = root.find("furniture"))
        for (std::size_t i = 0; i < furniture->size(); ++i)
            room.furniture.push_back(readFurniture(furniture->at(i), folder));
}

bool inside(const RoomBox& box, glm::dvec3 p)
{
    return glm::all(glm::greaterThan(p, box.min_m)) && glm::all(glm::lessThan(p, box.max_m));
}

void readCamera(const JsonNode& node, SimulatedRoom& room)
{
    node.expectKeys(keys::kSimulatedCamera);
    const JsonNode position = node.at("position_m");
    const JsonNode target = node.at("target_m");
    const glm::dvec3 view = target.vec3() - position.vec3();
    if (!inside(room.box, position.vec3())) position.fail("the camera stands outside the room");
    // The frame of lines.json: x points right in the picture, z towards the viewer.
    if (!(-view.z > std::abs(view.x) && -view.z > std::abs(view.y)))
        target.fail(
            "the camera must look mostly towards -z, so that x points right in the picture");
    room.camera = Camera::lookAt(position.vec3(),
                                 target.vec3(),
                                 node.at("focal_px").positive(),
                                 readCount(node.at("width"), kMinSide, kMaxSide),
                                 readCount(node.at("height"), kMinSide, kMaxSide));
    const auto origin = room.camera.project(glm::dvec3(0.0));
    if (!origin || origin->x < 0 || origin->y < 0 || origin->x > room.camera.width ||
        origin->y > room.camera.height)
        target.fail("the world's origin, a floor point, must be seen in the picture");
}

void readSimulatedBall(const JsonNode& node, SimulatedRoom& room)
{
    node.expectKeys(keys::kSimulatedBall);
    MirrorBall& ball = room.ball;
    ball.center_m = node.at("center_m").vec3();
    ball.radius_m = node.at("radius_m").positive();
    if (const auto v = node.find("reflectance")) {
        ball.reflectance = v->positive();
        (void)readFraction(*v);
    }
    if (!inside(room.box, ball.center_m)) node.at("center_m").fail("lies outside the room");
    const JsonNode view = node.at("view_position_m");
    const auto addView = [&](const JsonNode& position) {
        const glm::dvec3 place = position.vec3();
        if (!inside(room.box, place)) position.fail("lies outside the room");
        if (glm::distance(place, ball.center_m) < 2.0 * ball.radius_m)
            position.fail("is too near the ball: keep at least two radii away");
        if (glm::length(glm::dvec2(place.x, place.z) -
                        glm::dvec2(ball.center_m.x, ball.center_m.z)) < ball.radius_m)
            position.fail("looks straight up or down at the ball: move it aside");
        room.ball_views_m.push_back(place);
    };
    addView(view);
    if (const auto more = node.find("further_view_positions_m"))
        for (std::size_t i = 0; i < more->size(); ++i)
            addView(more->at(i));
    if (const auto v = node.find("size_px")) room.ball_size_px = readCount(*v, kMinSide, kMaxSide);
    // The ball fills 1/1.15 of the frame, centred.
    ball.center_px = glm::dvec2(0.5 * room.ball_size_px);
    ball.radius_px = 0.5 * room.ball_size_px / 1.15;
}

void readBody(const JsonNode& node, SimulatedCameraBody& body)
{
    if (const auto response = node.find("response")) {
        response->expectKeys(keys::kResponse);
        const JsonNode gamma = response->at("gamma");
        const JsonNode contrast = response->at("contrast");
        body.response = {gamma.vec3(), contrast.vec3()};
        for (std::size_t c = 0; c < 3; ++c) {
            (void)gamma.at(c).positive();
            (void)readFraction(contrast.at(c));
        }
    }
    if (const auto v = node.find("read_noise")) body.read_noise = readNotNegative(*v);
    if (const auto v = node.find("photon_noise")) body.photon_noise = readNotNegative(*v);
    if (const auto v = node.find("blur_px")) body.blur_px = readNotNegative(*v);
    if (body.blur_px > 100.0) node.at("blur_px").fail("is more than 100 pixels");
    if (const auto v = node.find("jpeg_quality")) body.jpeg_quality = readCount(*v, 1, 100);
    if (const auto v = node.find("f_number")) body.f_number = v->positive();
    if (const auto v = node.find("iso")) body.iso = v->positive();
    if (const auto v = node.find("make")) body.make = v->text();
    if (const auto v = node.find("model")) body.model = v->text();
}

void readPhotography(const JsonNode& node, SimulatedRoom& room)
{
    node.expectKeys(keys::kPhotography);
    readBody(node, room.body);
    if (const auto v = node.find("plate_seconds")) room.plate_seconds = v->positive();
    const JsonNode times = node.at("ball_seconds");
    for (std::size_t i = 0; i < times.size(); ++i)
        room.ball_seconds.push_back(times.at(i).positive());
    if (room.ball_seconds.empty()) times.fail("is empty; name the exposure times of the bracket");
    if (const auto v = node.find("plate_percentile")) {
        room.plate_percentile = v->number();
        if (room.plate_percentile <= 0 || room.plate_percentile > 100)
            v->fail("must lie above 0, up to 100");
    }
    if (const auto v = node.find("plate_code")) {
        room.plate_code = v->number();
        if (room.plate_code < 1 || room.plate_code > 254) v->fail("must lie in 1 to 254");
    }
}

void readRender(const JsonNode& node, SimulatedRoom& room)
{
    node.expectKeys(keys::kRender);
    const auto count = [&](const char* key, int& value, int lowest, int highest) {
        if (const auto v = node.find(key)) value = readCount(*v, lowest, highest);
    };
    count("samples_per_pixel", room.samples_per_pixel, 1, kMaxSamples);
    count("ball_samples_per_pixel", room.ball_samples_per_pixel, 1, kMaxSamples);
    count("panorama_samples_per_pixel", room.panorama_samples_per_pixel, 1, kMaxSamples);
    count("panorama_width", room.panorama_width, 4, kMaxSide);
    count("max_bounces", room.max_bounces, 1, 1000);
    count("roulette_start", room.roulette_start, 0, 1000);
    if (const auto v = node.find("denoise")) room.denoise = v->boolean();
    count("truth_reduction", room.truth_reduction, 1, 64);
}

}  // namespace

SimulatedRoom readSimulatedRoom(const std::filesystem::path& path)
{
    const Json json = readJson(path);
    const JsonNode root(json, path.string());
    root.expectKeys(keys::kSimulatedRoom);
    (void)readChoice(root.at("format"), {"insitu-room"});
    if (root.at("version").integer() != 1)
        root.at("version").fail("this program reads version 1 of room files");

    SimulatedRoom room;
    room.file = std::filesystem::absolute(path).lexically_normal();
    const std::filesystem::path folder = room.file.parent_path();
    readBoxRoom(root.at("room"), folder, room);
    readLightAndSolids(root, folder, room);
    readCamera(root.at("camera"), room);
    room.object = readObject(root.at("object"), folder);
    readSimulatedBall(root.at("ball"), room);
    readPhotography(root.at("photography"), room);
    if (const auto lines = root.find("lines")) {
        lines->expectKeys(keys::kLines);
        if (const auto v = lines->find("noise_px")) room.line_noise_px = readNotNegative(*v);
    }
    if (const auto render = root.find("render")) readRender(*render, room);
    if (const auto seed = root.find("seed"))
        room.seed = static_cast<std::uint64_t>(readCount(*seed, 0, 1 << 30));
    return room;
}

SimulatedRoom resized(SimulatedRoom room, double factor)
{
    const auto scaled = [&](int value) {
        return std::max(kMinSide, static_cast<int>(std::lround(value * factor)));
    };
    Camera& camera = room.camera;
    const int width = scaled(camera.width);
    camera.focal_px *= static_cast<double>(width) / camera.width;
    camera.width = width;
    camera.height = scaled(camera.height);
    camera.principal_px = 0.5 * glm::dvec2(camera.width, camera.height);

    const int ball_size = scaled(room.ball_size_px);
    room.ball.radius_px *= static_cast<double>(ball_size) / room.ball_size_px;
    room.ball.center_px = glm::dvec2(0.5 * ball_size);
    room.ball_size_px = ball_size;
    room.panorama_width = std::max(4, static_cast<int>(std::lround(room.panorama_width * factor)));
    return room;
}

}  // namespace insitu
