#include "calib/line_segments.h"

#include "core/check.h"
#include "core/io/json.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace insitu {

namespace {

/// Points further out than this many picture sizes are slips of the pen, not drawn lines.
constexpr double kMaxPictureSizes = 100.0;
/// A shorter segment has no direction worth the name.
constexpr double kMinLengthPx = 1.0;
/// Half a picture's diagonal shrunk to two thirds: more is a fish-eye, which this model is not for.
constexpr double kMaxDivision = 0.5;
constexpr double kRadiansPerDegree = std::numbers::pi / 180.0;

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

bool isSigma(double value)
{
    return value >= 0.0 && std::isfinite(value);
}

void checkShapes(const LineSet& lines, const std::string& source)
{
    const auto checkAll = [&](const auto& points, const std::string& position) {
        for (std::size_t k = 0; k < points.size(); ++k)
            checkPoint(points[k], lines, source, fmt::format("{}[{}]", position, k));
    };
    for (std::size_t i = 0; i < lines.segments.size(); ++i)
        checkAll(lines.segments[i].via_px, fmt::format("segments[{}].points_px", i));
    for (std::size_t i = 0; i < lines.straight_lines.size(); ++i)
        checkAll(lines.straight_lines[i], fmt::format("straight_lines[{}].points_px", i));
    for (std::size_t i = 0; i < lines.rectangles.size(); ++i) {
        const MarkedRectangle& one = lines.rectangles[i];
        const std::string position = fmt::format("rectangles[{}].", i);
        checkAll(one.corners_px, position + "corners_px");
        if (!isSigma(one.ratio)) throw InputError(source, position + "ratio", "must be above 0");
        // All turns the same way: convex, and the corners in order.
        int turns = 0;
        for (std::size_t k = 0; k < 4; ++k) {
            const glm::dvec2 here = one.corners_px[(k + 1) % 4];
            const glm::dvec2 a = here - one.corners_px[k];
            const glm::dvec2 b = one.corners_px[(k + 2) % 4] - here;
            const double turn = a.x * b.y - a.y * b.x;
            turns += turn > 0.0 ? 1 : turn < 0.0 ? -1 : 0;
        }
        if (std::abs(turns) != 4)
            throw InputError(source,
                             position + "corners_px",
                             "are no convex quadrilateral; name the corners in order around it");
    }
    for (std::size_t i = 0; i < lines.right_angles.size(); ++i) {
        const FloorRightAngle& one = lines.right_angles[i];
        const std::string position = fmt::format("right_angles[{}]", i);
        checkEnds(one.corner_px, one.first_px, lines, source, position);
        checkEnds(one.corner_px, one.second_px, lines, source, position);
    }
}

void checkHints(const LineSet& lines, const std::string& source)
{
    for (std::size_t i = 0; i < lines.points.size(); ++i) {
        const KnownPoint& one = lines.points[i];
        const std::string position = fmt::format("points[{}].", i);
        checkPoint(one.at_px, lines, source, position + "at_px");
        const glm::dvec3 p = one.position_m;
        if (!std::isfinite(p.x) || !std::isfinite(p.y) || !std::isfinite(p.z))
            throw InputError(source, position + "position_m", "not a finite point");
        if (!isSigma(one.sigma_m)) throw InputError(source, position + "sigma_m", "must be >= 0");
    }
    for (std::size_t i = 0; i < lines.lengths.size(); ++i)
        if (!isSigma(lines.lengths[i].sigma_m))
            throw InputError(
                source, fmt::format("scale.lengths[{}].sigma_m", i), "must be >= 0 metres");
    if (!isSigma(lines.distortion.sigma))
        throw InputError(source, "distortion.sigma", "must be >= 0");
    if (const auto& one = lines.principal_point) {
        checkPoint(one->px, lines, source, "principal_point.px");
        if (!isSigma(one->sigma_px))
            throw InputError(source, "principal_point.sigma_px", "must be >= 0");
    }
    if (const auto& one = lines.gravity) {
        const double size = glm::length(one->up);
        if (!(size > 0.0) || !std::isfinite(size))
            throw InputError(source, "gravity.up_in_camera", "is no direction");
        if (!(one->sigma_rad > 0.0) || !std::isfinite(one->sigma_rad))
            throw InputError(source, "gravity.sigma_deg", "must be above 0");
    }
}

RoomAxis axisFrom(const JsonNode& node)
{
    const std::string text = node.text();
    if (text == "x") return RoomAxis::X;
    if (text == "y") return RoomAxis::Y;
    if (text == "z") return RoomAxis::Z;
    node.fail(fmt::format("\"{}\" is no axis; use \"x\", \"y\" (up) or \"z\"", text));
}

std::vector<glm::dvec2> pointsFrom(const JsonNode& node, std::size_t least)
{
    std::vector<glm::dvec2> points;
    for (std::size_t i = 0; i < node.size(); ++i)
        points.push_back(node.at(i).vec2());
    if (points.size() < least)
        node.fail(fmt::format("needs at least {} points, has {}", least, points.size()));
    return points;
}

LineSegment segmentFrom(const JsonNode& node)
{
    node.expectKeys({"axis", "from_px", "to_px", "points_px", "note"});
    LineSegment segment;
    segment.axis = axisFrom(node.at("axis"));
    if (const auto traced = node.find("points_px")) {
        if (node.find("from_px") || node.find("to_px"))
            traced->fail("give either \"points_px\" or \"from_px\" and \"to_px\"");
        const std::vector<glm::dvec2> points = pointsFrom(*traced, 2);
        segment.from_px = points.front();
        segment.to_px = points.back();
        segment.via_px.assign(points.begin() + 1, points.end() - 1);
        return segment;
    }
    segment.from_px = node.at("from_px").vec2();
    segment.to_px = node.at("to_px").vec2();
    return segment;
}

MarkedRectangle rectangleFrom(const JsonNode& node)
{
    node.expectKeys({"corners_px", "ratio", "on", "note"});
    const JsonNode corners = node.at("corners_px");
    const std::vector<glm::dvec2> points = pointsFrom(corners, 4);
    if (points.size() != 4) corners.fail("a rectangle has four corners");
    MarkedRectangle rectangle;
    std::copy(points.begin(), points.end(), rectangle.corners_px.begin());
    if (const auto ratio = node.find("ratio")) rectangle.ratio = ratio->positive();
    if (const auto on = node.find("on")) {
        if (on->text() != "floor") on->fail("use \"floor\", or leave it out for any plane");
        rectangle.on_floor = true;
    }
    return rectangle;
}

KnownPoint pointFrom(const JsonNode& node)
{
    node.expectKeys({"at_px", "position_m", "sigma_m", "note"});
    KnownPoint point{node.at("at_px").vec2(), node.at("position_m").vec3(), 0.0};
    if (const auto sigma = node.find("sigma_m")) point.sigma_m = sigma->positive();
    return point;
}

void readShapes(const JsonNode& root, LineSet& lines)
{
    if (const auto list = root.find("straight_lines"))
        for (std::size_t i = 0; i < list->size(); ++i) {
            const JsonNode node = list->at(i);
            node.expectKeys({"points_px", "note"});
            lines.straight_lines.push_back(pointsFrom(node.at("points_px"), 3));
        }
    if (const auto list = root.find("rectangles"))
        for (std::size_t i = 0; i < list->size(); ++i)
            lines.rectangles.push_back(rectangleFrom(list->at(i)));
    if (const auto list = root.find("right_angles"))
        for (std::size_t i = 0; i < list->size(); ++i) {
            const JsonNode node = list->at(i);
            node.expectKeys({"corner_px", "first_px", "second_px", "note"});
            lines.right_angles.push_back({node.at("corner_px").vec2(),
                                          node.at("first_px").vec2(),
                                          node.at("second_px").vec2()});
        }
    if (const auto list = root.find("points"))
        for (std::size_t i = 0; i < list->size(); ++i)
            lines.points.push_back(pointFrom(list->at(i)));
}

void readCameraHints(const JsonNode& root, LineSet& lines)
{
    if (const auto node = root.find("distortion")) {
        node->expectKeys({"division", "sigma"});
        lines.distortion.division = node->at("division").number();
        if (const auto sigma = node->find("sigma")) lines.distortion.sigma = sigma->positive();
    }
    if (const auto node = root.find("principal_point")) {
        node->expectKeys({"px", "sigma_px", "note"});
        lines.principal_point = KnownPrincipalPoint{node->at("px").vec2(), 0.0};
        if (const auto sigma = node->find("sigma_px"))
            lines.principal_point->sigma_px = sigma->positive();
    }
    if (const auto node = root.find("gravity")) {
        node->expectKeys({"up_in_camera", "sigma_deg", "note"});
        lines.gravity = Gravity{node->at("up_in_camera").vec3(), Gravity{}.sigma_rad};
        if (const auto sigma = node->find("sigma_deg"))
            lines.gravity->sigma_rad = sigma->positive() * kRadiansPerDegree;
    }
}

KnownLength lengthFrom(const JsonNode& node)
{
    node.expectKeys({"from_px", "to_px", "on", "metres", "sigma_m", "note"});
    KnownLength length;
    length.from_px = node.at("from_px").vec2();
    length.to_px = node.at("to_px").vec2();
    length.metres = node.at("metres").positive();
    if (const auto sigma = node.find("sigma_m")) length.sigma_m = sigma->positive();
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
    checkShapes(*this, source);
    checkHints(*this, source);
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
    root.expectKeys({"image",
                     "segments",
                     "origin_px",
                     "scale",
                     "distortion",
                     "straight_lines",
                     "rectangles",
                     "right_angles",
                     "points",
                     "principal_point",
                     "gravity",
                     "note"});
    LineSet lines;
    const JsonNode image = root.at("image");
    image.expectKeys({"width", "height"});
    lines.width = image.at("width").integer();
    lines.height = image.at("height").integer();
    const JsonNode segments = root.at("segments");
    for (std::size_t i = 0; i < segments.size(); ++i)
        lines.segments.push_back(segmentFrom(segments.at(i)));
    lines.origin_px = root.at("origin_px").vec2();
    readScale(root, lines);
    readShapes(root, lines);
    readCameraHints(root, lines);
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
