#include "calib/line_segments.h"

#include "core/check.h"
#include "core/io/json.h"

#include <fmt/format.h>

#include <cmath>

namespace insitu {

namespace {

/// Points further out than this many picture sizes are slips of the pen, not drawn lines.
constexpr double kMaxPictureSizes = 100.0;
/// A shorter segment has no direction worth the name.
constexpr double kMinLengthPx = 1.0;
/// Half a picture's diagonal shrunk to two thirds: more is a fish-eye, which this model is not for.
constexpr double kMaxDivision = 0.5;

void checkPoint(glm::dvec2 point,
                const LineSet& lines,
                const std::string& source,
                const std::string& position)
{
    const double limit = kMaxPictureSizes * std::max(lines.width, lines.height);
    if (!std::isfinite(point.x) || !std::isfinite(point.y))
        throw InputError(source, position, "not a finite point");
    if (std::abs(point.x) > limit || std::abs(point.y) > limit)
        throw InputError(source,
                         position,
                         fmt::format("({}, {}) lies far outside the {}x{} picture",
                                     point.x,
                                     point.y,
                                     lines.width,
                                     lines.height));
}

void checkEnds(glm::dvec2 from_px,
               glm::dvec2 to_px,
               const LineSet& lines,
               const std::string& source,
               const std::string& position)
{
    checkPoint(from_px, lines, source, position + ".from_px");
    checkPoint(to_px, lines, source, position + ".to_px");
    const double length = glm::length(to_px - from_px);
    if (length < kMinLengthPx)
        throw InputError(source,
                         position,
                         fmt::format("only {:.3g} px long: no direction; mark it longer or remove "
                                     "it",
                                     length));
}

RoomAxis axisFrom(const JsonNode& node)
{
    const std::string text = node.text();
    if (text == "x") return RoomAxis::X;
    if (text == "y") return RoomAxis::Y;
    if (text == "z") return RoomAxis::Z;
    node.fail(fmt::format("\"{}\" is no axis; use \"x\", \"y\" (up) or \"z\"", text));
}

KnownLength lengthFrom(const JsonNode& node)
{
    node.expectKeys({"from_px", "to_px", "on", "metres", "note"});
    KnownLength length;
    length.from_px = node.at("from_px").vec2();
    length.to_px = node.at("to_px").vec2();
    length.metres = node.at("metres").positive();
    if (const auto on = node.find("on")) {
        const std::string text = on->text();
        if (text != "floor" && text != "vertical")
            on->fail(fmt::format("\"{}\" is unknown; use \"floor\" or \"vertical\"", text));
        length.on = text == "floor" ? KnownLength::On::Floor : KnownLength::On::Vertical;
    }
    return length;
}

void readScale(const JsonNode& root, LineSet& lines)
{
    const JsonNode scale = root.at("scale");
    scale.expectKeys({"camera_height_m", "camera_height_sigma_m", "lengths"});
    if (const auto height = scale.find("camera_height_m"))
        lines.camera_height_m = height->positive();
    if (const auto sigma = scale.find("camera_height_sigma_m"))
        lines.camera_height_sigma_m = sigma->positive();
    if (const auto lengths = scale.find("lengths"))
        for (std::size_t i = 0; i < lengths->size(); ++i)
            lines.lengths.push_back(lengthFrom(lengths->at(i)));
    if (!lines.camera_height_m && lines.lengths.empty())
        scale.fail("no scale: give \"camera_height_m\" or at least one of \"lengths\"");
}

}  // namespace

const char* axisName(RoomAxis axis)
{
    constexpr const char* kNames[] = {"x", "y", "z"};
    return kNames[static_cast<int>(axis)];
}

void LineSet::check(const std::string& source) const
{
    if (width <= 0 || height <= 0)
        throw InputError(
            source, "image", fmt::format("no picture has {}x{} pixels", width, height));
    for (std::size_t i = 0; i < segments.size(); ++i)
        checkEnds(
            segments[i].from_px, segments[i].to_px, *this, source, fmt::format("segments[{}]", i));
    checkPoint(origin_px, *this, source, "origin_px");
    for (std::size_t i = 0; i < lengths.size(); ++i) {
        const std::string position = fmt::format("scale.lengths[{}]", i);
        checkEnds(lengths[i].from_px, lengths[i].to_px, *this, source, position);
        if (!(lengths[i].metres > 0.0) || !std::isfinite(lengths[i].metres))
            throw InputError(source, position + ".metres", "must be a positive number of metres");
    }
    if (camera_height_m && (!(*camera_height_m > 0.0) || !std::isfinite(*camera_height_m)))
        throw InputError(source, "scale.camera_height_m", "must be a positive number of metres");
    if (!std::isfinite(distortion.division) || std::abs(distortion.division) > kMaxDivision)
        throw InputError(
            source, "distortion.division", fmt::format("must lie within ±{}", kMaxDivision));
    if (!(camera_height_sigma_m >= 0.0) || !std::isfinite(camera_height_sigma_m))
        throw InputError(source, "scale.camera_height_sigma_m", "must be >= 0 metres");
}

LineSet readLineSet(const std::filesystem::path& path)
{
    const Json json = readJson(path);
    const JsonNode root(json, path.string());
    root.expectKeys({"image", "segments", "origin_px", "scale", "distortion", "note"});
    LineSet lines;
    const JsonNode image = root.at("image");
    image.expectKeys({"width", "height"});
    lines.width = image.at("width").integer();
    lines.height = image.at("height").integer();
    const JsonNode segments = root.at("segments");
    for (std::size_t i = 0; i < segments.size(); ++i) {
        const JsonNode node = segments.at(i);
        node.expectKeys({"axis", "from_px", "to_px", "note"});
        lines.segments.push_back(
            {axisFrom(node.at("axis")), node.at("from_px").vec2(), node.at("to_px").vec2()});
    }
    lines.origin_px = root.at("origin_px").vec2();
    readScale(root, lines);
    if (const auto distortion = root.find("distortion")) {
        distortion->expectKeys({"division"});
        lines.distortion.division = distortion->at("division").number();
    }
    lines.check(path.string());
    return lines;
}

void checkLinesMatchPhoto(const LineSet& lines, int width, int height, const std::string& source)
{
    if (lines.width == width && lines.height == height) return;
    throw InputError(source,
                     "image",
                     fmt::format("the lines were marked in a {}x{} picture, but the photograph has "
                                 "{}x{} pixels; mark them in the upright photograph itself",
                                 lines.width,
                                 lines.height,
                                 width,
                                 height));
}

}  // namespace insitu
