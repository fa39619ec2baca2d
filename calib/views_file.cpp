#include "calib/exif_focal.h"
#include "calib/room_views.h"
#include "core/check.h"
#include "core/io/image_io.h"
#include "core/io/json.h"

#include <fmt/format.h>

#include <cmath>
#include <set>

namespace insitu {

namespace {

namespace fs = std::filesystem;

constexpr int kVersion = 1;

std::size_t indexOf(const JsonNode& node, const std::vector<std::string>& names, const char* what)
{
    const std::string name = node.text();
    for (std::size_t i = 0; i < names.size(); ++i)
        if (names[i] == name) return i;
    node.fail(fmt::format("\"{}\" is no {} of this file", name, what));
}

RoomView viewFrom(const JsonNode& node, const fs::path& folder)
{
    node.expectKeys({"name", "image", "lines", "camera", "note"});
    RoomView view;
    view.name = node.at("name").text();
    view.lines = readLineSet(folder / node.at("lines").text());
    if (const auto camera = node.find("camera")) view.camera = camera->text();
    if (const auto image = node.find("image")) {
        view.image = folder / image->text();
        const Photo photo = readPhoto(view.image);
        const int width = photo.image.codes.width();
        const int height = photo.image.codes.height();
        checkLinesMatchPhoto(view.lines, width, height, node.at("lines").text());
        view.exif = focalFromExif(photo.metadata, width, height);
    }
    return view;
}

SharedPoint pointFrom(const JsonNode& node, const std::vector<std::string>& views)
{
    node.expectKeys({"name", "floor", "seen_px", "note"});
    SharedPoint point;
    point.name = node.at("name").text();
    if (const auto floor = node.find("floor")) point.on_floor = floor->boolean();
    const JsonNode seen = node.at("seen_px");
    if (!seen.value().is_object()) seen.fail("must be an object: the view's name and the pixel");
    for (const auto& entry : seen.value().items()) {
        const Json name = entry.key();
        const std::size_t view =
            indexOf(JsonNode(name, seen.file(), seen.position()), views, "view");
        point.seen_px[view] = seen.at(entry.key()).vec2();
    }
    return point;
}

bool finite(glm::dvec2 p)
{
    return std::isfinite(p.x) && std::isfinite(p.y);
}

}  // namespace

void RoomViews::check(const std::string& source) const
{
    if (views.empty()) throw InputError(source, "views", "there must be at least one");
    std::set<std::string> names;
    for (std::size_t i = 0; i < views.size(); ++i) {
        const std::string position = fmt::format("views[{}]", i);
        if (!names.insert(views[i].name).second)
            throw InputError(
                source, position, fmt::format("the name \"{}\" is taken", views[i].name));
        views[i].lines.check(source + ": " + views[i].name);
        if (views[i].lines.distortion.division != 0.0)
            throw InputError(
                source, position, "lenses that bend lines cannot be joined; undistort the picture");
    }
    for (std::size_t i = 0; i < points.size(); ++i) {
        const std::string position = fmt::format("points[{}].seen_px", i);
        for (const auto& [view, pixel] : points[i].seen_px)
            if (view >= views.size() || !finite(pixel))
                throw InputError(source, position, "names no view, or a place that is not finite");
        const std::size_t least = points[i].on_floor ? 1 : 2;
        if (points[i].seen_px.size() < least)
            throw InputError(source,
                             position,
                             fmt::format("\"{}\" must be seen by at least {} view{}",
                                         points[i].name,
                                         least,
                                         least == 1 ? "" : "s"));
    }
    for (std::size_t i = 0; i < lengths.size(); ++i) {
        const SharedLength& length = lengths[i];
        if (length.from >= points.size() || length.to >= points.size() ||
            length.from == length.to || !std::isfinite(length.metres + length.sigma_m) ||
            !(length.metres > 0.0) || !(length.sigma_m > 0.0))
            throw InputError(source,
                             fmt::format("lengths[{}]", i),
                             "needs two different points and positive metres and sigma_m");
    }
}

RoomViews readRoomViews(const fs::path& path)
{
    const Json json = readJson(path);
    const JsonNode root(json, path.string());
    root.expectKeys({"format", "version", "views", "points", "lengths", "note"});
    if (root.at("format").text() != "insitu-views")
        root.at("format").fail("must be \"insitu-views\"");
    if (root.at("version").integer() != kVersion)
        root.at("version").fail(fmt::format("only version {} is known", kVersion));
    RoomViews room;
    std::vector<std::string> names;
    const JsonNode views = root.at("views");
    for (std::size_t i = 0; i < views.size(); ++i) {
        room.views.push_back(viewFrom(views.at(i), path.parent_path()));
        names.push_back(room.views.back().name);
    }
    std::vector<std::string> point_names;
    if (const auto points = root.find("points"))
        for (std::size_t i = 0; i < points->size(); ++i) {
            room.points.push_back(pointFrom(points->at(i), names));
            point_names.push_back(room.points.back().name);
        }
    if (const auto lengths = root.find("lengths"))
        for (std::size_t i = 0; i < lengths->size(); ++i) {
            const JsonNode node = lengths->at(i);
            node.expectKeys({"from", "to", "metres", "sigma_m", "note"});
            SharedLength length;
            length.from = indexOf(node.at("from"), point_names, "point");
            length.to = indexOf(node.at("to"), point_names, "point");
            length.metres = node.at("metres").positive();
            if (const auto sigma = node.find("sigma_m")) length.sigma_m = sigma->positive();
            room.lengths.push_back(length);
        }
    room.check(path.string());
    return room;
}

}  // namespace insitu
