#include "pipeline/simulated_lines.h"

#include "core/random.h"

#include <glm/glm.hpp>

#include <algorithm>
#include <cmath>
#include <optional>

namespace insitu {

namespace {

constexpr std::size_t kMostPerAxis = 6;
/// Shorter pieces than this share of the picture's diagonal are not worth marking.
constexpr double kShortestShare = 0.06;
constexpr int kSteps = 400;

struct Edge {
    glm::dvec3 from{0.0}, to{0.0};
    RoomAxis axis = RoomAxis::X;
};

void addBoxEdges(const BoundingBox& box, std::vector<Edge>& edges)
{
    const auto corner = [&](int index) {
        return glm::dvec3(index & 1 ? box.max.x : box.min.x,
                          index & 2 ? box.max.y : box.min.y,
                          index & 4 ? box.max.z : box.min.z);
    };
    for (int i = 0; i < 8; ++i)
        for (int axis = 0; axis < 3; ++axis)
            if (!(i & (1 << axis)))
                edges.push_back({corner(i), corner(i | (1 << axis)), static_cast<RoomAxis>(axis)});
}

void addWindowEdges(const std::vector<glm::dvec3>& corners, std::vector<Edge>& edges)
{
    for (std::size_t i = 0; i < corners.size(); ++i) {
        const glm::dvec3 from = corners[i];
        const glm::dvec3 to = corners[(i + 1) % corners.size()];
        const glm::dvec3 size = glm::abs(to - from);
        const RoomAxis axis = size.y > size.x && size.y > size.z ? RoomAxis::Y
                              : size.x > size.z                  ? RoomAxis::X
                                                                 : RoomAxis::Z;
        edges.push_back({from, to, axis});
    }
}

/// Is the point in the picture, with nothing in front of it? An edge lies on surfaces: the last
/// centimetre before it does not count.
std::optional<glm::dvec2> visiblePixel(const Camera& camera, const ObjectScene& scene, glm::dvec3 p)
{
    constexpr double kSlackM = 0.01;
    const auto pixel = camera.project(p);
    if (!pixel || pixel->x < 0.0 || pixel->y < 0.0 || pixel->x > camera.width ||
        pixel->y > camera.height)
        return std::nullopt;
    const glm::dvec3 ray = p - camera.position_m;
    const double distance = glm::length(ray);
    if (distance <= kSlackM ||
        scene.occluded(camera.position_m, ray / distance, distance - kSlackM))
        return std::nullopt;
    return pixel;
}

/// The longest visible piece of an edge.
std::optional<LineSegment> visiblePiece(const Edge& edge,
                                        const Camera& camera,
                                        const ObjectScene& scene)
{
    std::optional<LineSegment> best;
    glm::dvec2 start{0.0};
    bool in_piece = false;
    double best_length = 0.0;
    for (int i = 0; i <= kSteps; ++i) {
        const glm::dvec3 p = glm::mix(edge.from, edge.to, static_cast<double>(i) / kSteps);
        const auto pixel = visiblePixel(camera, scene, p);
        if (!pixel) {
            in_piece = false;
            continue;
        }
        if (!in_piece) start = *pixel;
        in_piece = true;
        const double length = glm::distance(start, *pixel);
        if (length <= best_length) continue;
        best_length = length;
        best = LineSegment{edge.axis, start, *pixel};
    }
    return best;
}

double length(const LineSegment& segment)
{
    return glm::distance(segment.from_px, segment.to_px);
}

}  // namespace

std::vector<LineSegment> trueEdges(const SimulatedRoom& room, const SimulatedScene& scene)
{
    std::vector<Edge> edges;
    addBoxEdges({room.box.min_m, room.box.max_m}, edges);
    for (const SimulatedWindow& window : room.windows)
        addWindowEdges(windowCorners(room.box, window), edges);
    for (const SolidBounds& solid : scene.solids)
        if (solid.has_edges) addBoxEdges(solid.box, edges);

    const double shortest = kShortestShare * std::hypot(room.camera.width, room.camera.height);
    std::vector<LineSegment> pieces;
    for (const Edge& edge : edges)
        if (const auto piece = visiblePiece(edge, room.camera, scene.without);
            piece && length(*piece) >= shortest)
            pieces.push_back(*piece);
    std::stable_sort(pieces.begin(), pieces.end(), [](const auto& a, const auto& b) {
        return length(a) > length(b);
    });

    std::vector<LineSegment> kept;
    for (const LineSegment& piece : pieces)
        if (std::count_if(kept.begin(), kept.end(), [&](const LineSegment& other) {
                return other.axis == piece.axis;
            }) < static_cast<std::ptrdiff_t>(kMostPerAxis))
            kept.push_back(piece);
    return kept;
}

LineSet markedLines(const SimulatedRoom& room, const std::vector<LineSegment>& edges)
{
    LineSet lines;
    lines.width = room.camera.width;
    lines.height = room.camera.height;
    lines.camera_height_m = room.camera.position_m.y;
    // A stream of its own: pixel numbers of the pictures stay far below.
    RandomStream random(room.seed, ~std::uint64_t{0}, 0);
    const auto marked = [&](glm::dvec2 pixel) {
        const double x = pixel.x + room.line_noise_px * random.normal();
        const double y = pixel.y + room.line_noise_px * random.normal();
        return glm::clamp(glm::dvec2(x, y), glm::dvec2(0.0), glm::dvec2(lines.width, lines.height));
    };
    for (const LineSegment& edge : edges)
        lines.segments.push_back({edge.axis, marked(edge.from_px), marked(edge.to_px)});
    lines.origin_px = marked(room.camera.project(glm::dvec3(0.0)).value());
    return lines;
}

}  // namespace insitu
