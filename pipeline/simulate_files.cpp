#include "core/io/image_io.h"
#include "core/io/json.h"
#include "pipeline/camera_simulator.h"
#include "pipeline/simulate.h"

#include <glm/glm.hpp>

#include <algorithm>
#include <cmath>

namespace insitu {

namespace {

Json list(glm::dvec2 v)
{
    return Json::array({v.x, v.y});
}
Json list(glm::dvec3 v)
{
    return Json::array({v.x, v.y, v.z});
}

Json segmentsJson(const std::vector<LineSegment>& segments, bool rounded)
{
    // Marked lines are written as a user's program would: hundredths of a pixel.
    const auto point = [&](glm::dvec2 p) {
        return list(rounded ? glm::round(p * 100.0) / 100.0 : p);
    };
    Json result = Json::array();
    for (const LineSegment& segment : segments)
        result.push_back({{"axis", std::string(1, "xyz"[static_cast<int>(segment.axis)])},
                          {"from_px", point(segment.from_px)},
                          {"to_px", point(segment.to_px)}});
    return result;
}

Json linesJson(const LineSet& lines)
{
    return {{"image", {{"width", lines.width}, {"height", lines.height}}},
            {"segments", segmentsJson(lines.segments, true)},
            {"origin_px", list(glm::round(lines.origin_px * 100.0) / 100.0)},
            {"scale", {{"camera_height_m", *lines.camera_height_m}}}};
}

Json materialJson(const Material& material)
{
    // Floats as the shortest decimal that a reader turns into the same float.
    const auto exact = [](float value) { return std::stod(fmt::format("{}", value)); };
    return {{"base_color_linear",
             Json::array({exact(material.base_color.r),
                          exact(material.base_color.g),
                          exact(material.base_color.b)})},
            {"roughness", exact(material.roughness)},
            {"metallic", exact(material.metallic)},
            {"specular", exact(material.specular)}};
}

Json objectJson(const ProjectObject& object, const std::filesystem::path& folder)
{
    Json json = {{"model", std::filesystem::proximate(object.model, folder).generic_string()},
                 {"pivot", object.pivot_bottom_center ? "bottom-center" : "origin"},
                 {"position_m", list(object.position_m)},
                 {"rotation_y_deg", object.rotation_y_deg},
                 {"scale", object.scale}};
    if (object.material) json["material"] = materialJson(*object.material);
    return json;
}

Json roomJson(const SimulatedCapture& capture, const SimulatedRoom& room)
{
    Json items = Json::array();
    items.push_back(
        {{"type", "box"}, {"min_m", list(room.box.min_m)}, {"max_m", list(room.box.max_m)}});
    if (room.environment)
        for (const SimulatedWindow& window : room.windows) {
            Json corners = Json::array();
            for (const glm::dvec3 corner : windowCorners(room.box, window))
                corners.push_back(list(corner));
            items.push_back({{"type", "opening"}, {"corners_m", corners}});
        }
    for (const SolidBounds& solid : capture.solids)
        if (solid.in_project)
            items.push_back({{"type", "box"},
                             {"solid", true},
                             {"name", solid.name},
                             {"min_m", list(solid.box.min)},
                             {"max_m", list(solid.box.max)}});
    return items;
}

Json projectJson(const SimulatedCapture& capture,
                 const SimulatedRoom& room,
                 const std::filesystem::path& folder)
{
    Json views = Json::array();
    for (std::size_t view = 0; view < capture.brackets.size(); ++view) {
        Json images = Json::array();
        for (const SimulatedShot& shot : capture.brackets[view])
            images.push_back(shot.name);
        views.push_back({{"images", images},
                         {"ball",
                          {{"center_px", list(room.ball.center_px)},
                           {"radius_px", room.ball.radius_px},
                           {"radius_m", room.ball.radius_m},
                           {"reflectance", room.ball.reflectance}}},
                         {"view", {{"position_m", list(room.ball_views_m[view])}}}});
    }
    Json probe = {{"kind", "mirror-ball"}, {"center_m", list(room.ball.center_m)}};
    if (views.size() == 1)
        probe.update(views[0]);
    else
        probe["views"] = views;
    return {{"format", "insitu-project"},
            {"version", 1},
            {"photo", {{"image", capture.plate.name}}},
            {"camera", {{"lines", "lines.json"}}},
            {"light", {{"probe", probe}}},
            {"room", roomJson(capture, room)},
            {"objects", Json::array({objectJson(room.object, folder)})}};
}

Json responseJson(const SimulatedCapture& capture, const SimulatedCameraBody& body)
{
    Json curves = Json::array();
    for (int c = 0; c < 3; ++c) {
        Json curve = Json::array();
        for (int i = 0; i < 256; ++i)
            curve.push_back(std::round(encodeTone(body.response, c, i / 255.0) * 1e7) / 1e7);
        curves.push_back(curve);
    }
    return {{"comment",
             "Z/255 = curve(exposure), exposure = radiance * sensor_scale * seconds, clipped at 1; "
             "256 samples over exposure 0..1 per channel RGB"},
            {"sensor_scale", capture.sensor_scale},
            {"gamma", list(body.response.gamma)},
            {"contrast", list(body.response.contrast)},
            {"read_noise", body.read_noise},
            {"photon_noise", body.photon_noise},
            {"blur_px", body.blur_px},
            {"curve", curves}};
}

Json truthJson(const SimulatedCapture& capture,
               const SimulatedRoom& room,
               const std::filesystem::path& folder)
{
    const Camera& camera = room.camera;
    Json seconds = Json::array();
    for (const SimulatedShot& shot : capture.brackets[0])
        seconds.push_back(shot.seconds);
    Json views = Json::array();
    for (const glm::dvec3 view : room.ball_views_m)
        views.push_back(list(view));
    return {
        {"image", {{"width", camera.width}, {"height", camera.height}}},
        {"camera",
         {{"fx_px", camera.focal_px.x},
          {"fy_px", camera.focal_px.y},
          {"cx_px", camera.principal_px.x},
          {"cy_px", camera.principal_px.y},
          {"position_in_world_m", list(camera.position_m)},
          {"right_in_world", list(camera.right)},
          {"up_in_world", list(camera.up)},
          {"forward_in_world", list(camera.forward)}}},
        {"ball",
         {{"center_in_world_m", list(room.ball.center_m)},
          {"radius_m", room.ball.radius_m},
          {"reflectance", room.ball.reflectance},
          {"camera_position_in_world_m", views[0]},
          {"camera_positions_in_world_m", views}}},
        {"object", objectJson(room.object, folder / "truth")},
        {"true_edges", segmentsJson(capture.edges, false)},
        {"true_origin_px", list(*camera.project(glm::dvec3(0.0)))},
        {"line_noise_px", room.line_noise_px},
        {"frame_note", "the same world frame as lines.json and project.json"},
        {"linear_reduction", room.truth_reduction},
        {"response", responseJson(capture, room.body)},
        {"exposure_seconds",
         {{"plate", capture.plate.seconds}, {"truth", capture.with.seconds}, {"ball", seconds}}}};
}

/// Block means; the last column and row of blocks may be cut off by the picture's border.
Image<Rgb> reduced(const Image<Rgb>& image, int factor)
{
    if (factor == 1) return image;
    Image<Rgb> result(std::max(image.width() / factor, 1), std::max(image.height() / factor, 1));
    for (int y = 0; y < result.height(); ++y)
        for (int x = 0; x < result.width(); ++x) {
            glm::dvec3 sum{0.0};
            double count = 0.0;
            for (int sy = y * factor; sy < std::min((y + 1) * factor, image.height()); ++sy)
                for (int sx = x * factor; sx < std::min((x + 1) * factor, image.width()); ++sx) {
                    sum += glm::dvec3(image(sx, sy));
                    count += 1.0;
                }
            result(x, y) = Rgb(sum / count);
        }
    return result;
}

EncodedImage maskImage(const Image<float>& coverage)
{
    EncodedImage mask;
    mask.codes = Image<glm::u16vec3>(coverage.width(), coverage.height());
    for (std::size_t i = 0; i < coverage.pixelCount(); ++i)
        mask.codes.pixels()[i] =
            glm::u16vec3(static_cast<std::uint16_t>(std::lround(255.0f * coverage.pixels()[i])));
    return mask;
}

/// The judge reads one folder: the plate is linked into it.
void linkPlate(const std::filesystem::path& folder, const std::string& name)
{
    const std::filesystem::path link = folder / "truth" / name;
    std::filesystem::remove(link);
    std::error_code no_links;
    std::filesystem::create_symlink(std::filesystem::path("..") / name, link, no_links);
    if (no_links) std::filesystem::copy_file(folder / name, link);
}

}  // namespace

void writeCapture(const SimulatedCapture& capture,
                  const SimulatedRoom& room,
                  const std::filesystem::path& folder)
{
    const std::filesystem::path out = std::filesystem::absolute(folder).lexically_normal();
    const std::filesystem::path truth = out / "truth";
    std::filesystem::create_directories(truth);
    const auto writeShot = [&](const std::filesystem::path& where, const SimulatedShot& shot) {
        writeEncoded(where / shot.name, shot.image, shot.exif, room.body.jpeg_quality);
    };
    writeShot(out, capture.plate);
    for (const std::vector<SimulatedShot>& bracket : capture.brackets)
        for (const SimulatedShot& shot : bracket)
            writeShot(out, shot);
    writeJson(out / "lines.json", linesJson(capture.lines));
    writeJson(out / "project.json", projectJson(capture, room, out));

    const int factor = room.truth_reduction;
    const bool half = true;
    writeShot(truth, capture.with);
    writeEncoded(truth / "object_mask.png", maskImage(capture.truth.coverage));
    writeRadiance(truth / "plate_linear.exr", reduced(capture.truth.plate, factor), half);
    writeRadiance(truth / "truth_linear.exr", reduced(capture.truth.with, factor), half);
    writeRadiance(truth / "pano_linear.exr", capture.truth.panorama, half);
    writeJson(truth / "truth.json", truthJson(capture, room, out));
    linkPlate(out, capture.plate.name);
}

}  // namespace insitu
