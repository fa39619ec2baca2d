#include "render/fiv/receiver_light.h"

#include "core/parallel.h"

#include <algorithm>
#include <cmath>

namespace insitu {

namespace {

/// Nodes lie this far off their surface and its edges, metres.
constexpr double kOff = 0.01;
/// A node that sees more of the backs of surfaces than this is inside furniture or a wall.
constexpr double kInside = 0.2;
/// Changes below this share of the irradiance are none.
constexpr float kLeastChange = 1e-4f;

struct NodeGrid {
    int columns = 1;
    int rows = 1;
};

NodeGrid gridOf(const ProxyFace& face, double spacing)
{
    const auto count = [&](glm::dvec3 edge) {
        return std::max(1, static_cast<int>(std::ceil(glm::length(edge) / spacing)));
    };
    return {count(face.edge_u), count(face.edge_v)};
}

}  // namespace

ReceiverLight::ReceiverLight(const FivScene& scene, double node_spacing_m)
    : scene_(scene), spacing_(node_spacing_m)
{
}

std::size_t ReceiverLight::nodeAt(const ReceiverPlace& place, int column, int row)
{
    const ProxyFace& face = scene_.room.proxy().faces()[place.face];
    const bool front = glm::dot(face.normal, place.normal) > 0.0;
    const std::uint64_t key = (static_cast<std::uint64_t>(place.face) << 33U) |
                              (static_cast<std::uint64_t>(column) << 17U) |
                              (static_cast<std::uint64_t>(row) << 1U) | (front ? 1U : 0U);
    const auto [found, is_new] = index_.try_emplace(key, nodes_.size());
    if (is_new) {
        const NodeGrid grid = gridOf(face, spacing_);
        const auto inset = [](int i, int count, glm::dvec3 edge) {
            const double off = std::min(0.5, kOff / std::max(glm::length(edge), kOff));
            return std::clamp(static_cast<double>(i) / count, off, 1.0 - off);
        };
        const glm::dvec2 uv(inset(column, grid.columns, face.edge_u),
                            inset(row, grid.rows, face.edge_v));
        Node node;
        node.normal = place.normal;
        node.position = scene_.room.proxy().pointOn(place.face, uv) + kOff * place.normal;
        nodes_.push_back(std::move(node));
    }
    return found->second;
}

void ReceiverLight::look(Node& node) const
{
    if (scene_.light != FivLight::Room) node.position = scene_.frame().center;
    const glm::vec3 normal(node.normal);
    node.light = lookAround(scene_.room, scene_.spots, node.position, scene_.cells, normal);
    node.light.setChange(scene_.room_change);
    const auto [without, change] = node.light.irradiance(normal);
    node.open = {without, change};
    node.usable = node.light.inside_share < kInside || scene_.light != FivLight::Room;
}

void ReceiverLight::evaluate(const Node& node,
                             std::span<const Use> uses,
                             std::span<const ReceiverPlace> places,
                             std::span<ReceiverIrradiance> slots) const
{
    if (scene_.light == FivLight::Cube) {
        for (const Use& use : uses)
            slots[use.slot] = {node.open.without, Rgb(0.0f)};
        return;
    }
    std::vector<glm::vec3> local(uses.size());
    for (std::size_t i = 0; i < uses.size(); ++i)
        local[i] = scene_.frame().localFrom(places[uses[i].place].point);
    const HideableLight light = hideableLight(scene_, scene_.atlas, node.light);
    const glm::vec3 normal(node.normal);
    std::vector<Rgb> lost(uses.size(), Rgb(0.0f));
    std::vector<Rgb> gained(uses.size(), Rgb(0.0f));
    hiddenIrradiance(light.lost, local, normal, lost);
    if (light.gains) hiddenIrradiance(light.gained, local, normal, gained);
    for (std::size_t i = 0; i < uses.size(); ++i)
        slots[uses[i].slot] = {node.open.without, node.open.change - lost[i] + gained[i]};
}

std::vector<ReceiverIrradiance> ReceiverLight::cells(std::span<const ReceiverPlace> places)
{
    constexpr std::size_t kCorners = 4;
    std::vector<std::size_t> node_of(kCorners * places.size());
    std::vector<float> weights(kCorners * places.size());
    const std::size_t known = nodes_.size();
    for (std::size_t i = 0; i < places.size(); ++i) {
        const ReceiverPlace& place = places[i];
        const NodeGrid grid = gridOf(scene_.room.proxy().faces()[place.face], spacing_);
        const double u = std::clamp(place.uv.x, 0.0, 1.0) * grid.columns;
        const double v = std::clamp(place.uv.y, 0.0, 1.0) * grid.rows;
        const int column = std::min(static_cast<int>(u), grid.columns - 1);
        const int row = std::min(static_cast<int>(v), grid.rows - 1);
        for (std::size_t corner = 0; corner < kCorners; ++corner) {
            const int right = static_cast<int>(corner % 2);
            const int below = static_cast<int>(corner / 2);
            const std::size_t slot = kCorners * i + corner;
            node_of[slot] = nodeAt(place, column + right, row + below);
            weights[slot] = static_cast<float>((right ? u - column : column + 1 - u) *
                                               (below ? v - row : row + 1 - v));
        }
    }
    std::vector<std::vector<Use>> uses(nodes_.size());
    for (std::size_t slot = 0; slot < node_of.size(); ++slot)
        if (weights[slot] > 0.0f) uses[node_of[slot]].push_back({slot / kCorners, slot});

    std::vector<ReceiverIrradiance> slots(node_of.size());
    parallelFor(0, static_cast<std::int64_t>(nodes_.size()), [&](std::int64_t number) {
        const std::size_t n = static_cast<std::size_t>(number);
        if (uses[n].empty()) return;
        Node& node = nodes_[n];
        if (n >= known || node.light.radiance.empty()) {
            look(node);
            if (!node.usable) {
                // What uses it is seen by the camera, so it is not inside anything.
                node.position = places[uses[n].front().place].point + kOff * node.normal;
                look(node);
                node.usable = true;
            }
        }
        evaluate(node, uses[n], places, slots);
    });

    std::vector<ReceiverIrradiance> result(places.size());
    for (std::size_t slot = 0; slot < slots.size(); ++slot) {
        if (!(weights[slot] > 0.0f)) continue;
        ReceiverIrradiance& sum = result[slot / kCorners];
        sum.without += weights[slot] * slots[slot].without;
        sum.change += weights[slot] * slots[slot].change;
    }
    for (ReceiverIrradiance& r : result)
        if (glm::all(glm::lessThan(glm::abs(r.change), kLeastChange * r.without)))
            r.change = Rgb(0.0f);
    return result;
}

ReceiverIrradiance ReceiverLight::spots(const ReceiverPlace& place) const
{
    glm::dvec3 without(0.0);
    glm::dvec3 change(0.0);
    const glm::dvec3 start = offsetOrigin(place.point, place.normal, place.normal);
    for (const LightSpot& spot : scene_.spots.spots()) {
        const auto arriving = reach(scene_.room, spot, start);
        if (!arriving) continue;
        const double cosine = glm::dot(arriving->direction, place.normal);
        if (cosine <= 0.0) continue;
        without += arriving->irradiance * cosine;
        if (scene_.light != FivLight::Cube && scene_.mayMeetObjects(start, arriving->direction) &&
            scene_.objects.occluded(start, arriving->direction, arriving->distance_m))
            change -= arriving->irradiance * cosine;
    }
    return {Rgb(without), Rgb(change)};
}

bool ReceiverLight::mayShade(const ReceiverPlace& place) const
{
    for (const LightSpot& spot : scene_.spots.spots()) {
        const glm::dvec3 direction = spot.far ? spot.at : glm::normalize(spot.at - place.point);
        if (glm::dot(direction, place.normal) > 0.0 &&
            scene_.mayMeetObjects(place.point, direction))
            return true;
    }
    return false;
}

}  // namespace insitu
