#include "render/fiv/receiver_light.h"

#include "core/parallel.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace insitu {

namespace {

/// Nodes lie this far off their surface and its edges, metres.
constexpr double kOff = 0.01;
/// A node that sees more of the backs of surfaces than this is inside furniture or a wall.
constexpr double kInside = 0.2;
/// ... which this many cells along a cube's face tell.
constexpr int kFewCells = 6;
/// Rays along a cell's side where pixels ask: at the edges of windows the light of a cell is mixed.
constexpr int kRaysAlong = 2;
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
    : scene_(scene),
      spacing_(node_spacing_m),
      few_cells_(std::make_shared<CellGeometry>(DirectionCells{kFewCells}))
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
        node.reach_m =
            glm::length(face.edge_u) / grid.columns + glm::length(face.edge_v) / grid.rows + kOff;
        nodes_.push_back(std::move(node));
    }
    return found->second;
}

/// Finds out where the node looks from.
void ReceiverLight::settle(Node& node, const ReceiverPlace& seen) const
{
    if (scene_.light != FivLight::Room) {
        node.position = scene_.frame().center;
        return;
    }
    const LookOptions limits{.horizon_normal = glm::vec3(node.normal)};
    const PlaceLight few = lookAround(scene_.room, scene_.spots, node.position, few_cells_, limits);
    // What uses it is seen from within the room, so it is not inside anything.
    if (few.inside_share >= kInside) node.position = seen.point + kOff * node.normal;
}

void ReceiverLight::lookTowardObjects(Node& node, int rays_along) const
{
    node.rays_along = rays_along;
    node.looks.clear();
    LookOptions limits = scene_.limitsTowardObjects(node.position, node.reach_m);
    limits.horizon_normal = glm::vec3(node.normal);
    const CellGeometry& cells = *scene_.cells;
    for (std::uint32_t cell = 0; cell < cells.directions.size(); ++cell) {
        const glm::vec3 direction = cells.directions[cell];
        if (!limits.hold(direction)) continue;
        Look look;
        look.cell = cell;
        look.weight = glm::dot(direction, limits.horizon_normal.value()) * cells.solid_angles[cell];
        const int rays = rays_along * rays_along;
        const float share = 1.0f / static_cast<float>(rays);
        for (int ray = 0; ray < rays; ++ray) {
            const glm::dvec3 toward = cells.cells.directionOfRay(cell, ray, rays_along);
            const RoomLight::Arrival arrival = scene_.room.arrive(node.position, toward);
            // Furniture of the room that stands before the objects hides them.
            if (arrival.distance_m < scene_.distanceToObjects(node.position, toward)) continue;
            look.beyond += share;
            if (!scene_.spots.holds(arrival, toward)) look.radiance += share * arrival.radiance;
            look.end = endOf(arrival);
        }
        if (look.beyond > 0.0f) node.looks.push_back(look);
    }
}

void ReceiverLight::lookAroundFrom(Node& node) const
{
    node.around = lookAround(scene_.room,
                             scene_.spots,
                             node.position,
                             scene_.coarse_cells,
                             {.horizon_normal = glm::vec3(node.normal), .rays_along = kRaysAlong});
}

void ReceiverLight::update(Node& node) const
{
    if (!node.around.radiance.empty()) {
        node.around.setChange(scene_.room_change);
        const auto [without, change] = node.around.irradiance(glm::vec3(node.normal));
        node.open = {without, change};
    }
    for (Look& look : node.looks) {
        const Rgb change = look.end.lookUp(scene_.room_change);
        look.loss = look.weight * (look.radiance + look.beyond * change);
    }
}

void ReceiverLight::update()
{
    parallelFor(0, static_cast<std::int64_t>(nodes_.size()), [&](std::int64_t i) {
        update(nodes_[static_cast<std::size_t>(i)]);
    });
}

void ReceiverLight::look(std::span<const Square> squares,
                         std::span<const ReceiverPlace> places,
                         bool around)
{
    const int rays_along = around ? kRaysAlong : 1;
    // The first place that uses each node.
    std::vector<std::size_t> seen(nodes_.size(), places.size());
    for (const Square& square : squares)
        for (const std::size_t node : square.nodes)
            seen[node] = std::min(seen[node], square.places.front());
    parallelFor(0, static_cast<std::int64_t>(nodes_.size()), [&](std::int64_t i) {
        const auto at = static_cast<std::size_t>(i);
        Node& node = nodes_[at];
        const bool toward = node.rays_along < rays_along;
        const bool open = around && node.around.radiance.empty();
        if (seen[at] == places.size() || (!toward && !open)) return;
        if (node.rays_along == 0) settle(node, places[seen[at]]);
        if (toward) lookTowardObjects(node, rays_along);
        if (open) lookAroundFrom(node);
        update(node);
    });
}

std::vector<Rgb> ReceiverLight::hidden(const Square& square,
                                       std::span<const ReceiverPlace> places) const
{
    const std::size_t count = square.places.size();
    std::vector<Rgb> lost(count, Rgb(0.0f));
    if (scene_.light == FivLight::Cube) return lost;
    const std::size_t pairs = scene_.atlas.cells().pairCount();
    CornerIrradiance light;
    light.along.resize(pairs);
    light.against.resize(pairs);
    light.sky_along.resize(pairs, 0.0f);
    light.sky_against.resize(pairs, 0.0f);
    for (std::size_t corner = 0; corner < 4; ++corner)
        for (const Look& look : nodes_[square.nodes[corner]].looks) {
            const bool along = look.cell % 2 == 0;
            (along ? light.along : light.against)[look.cell / 2][corner] = look.loss;
            (along ? light.sky_along : light.sky_against)[look.cell / 2] +=
                0.25f * look.weight * look.beyond;
        }
    std::vector<glm::vec3> local(count);
    for (std::size_t i = 0; i < count; ++i)
        local[i] = scene_.frame().localFrom(places[square.places[i]].point);
    std::vector<HiddenIrradiance> hidden(count);
    hiddenIrradiance(scene_.atlas, light, local, square.weights, hidden);
    for (std::size_t i = 0; i < count; ++i) {
        const ReceiverPlace& place = places[square.places[i]];
        lost[i] = hidden[i].light;
        if (hidden[i].sky > 0.0f)
            lost[i] -= hidden[i].sky * scene_.sent.seenFrom(place.point, place.normal);
    }
    return lost;
}

std::vector<ReceiverLight::Square> ReceiverLight::squaresOf(std::span<const ReceiverPlace> places)
{
    std::vector<Square> squares;
    std::unordered_map<std::uint64_t, std::size_t> index;
    for (std::size_t i = 0; i < places.size(); ++i) {
        const ReceiverPlace& place = places[i];
        const NodeGrid grid = gridOf(scene_.room.proxy().faces()[place.face], spacing_);
        const double u = std::clamp(place.uv.x, 0.0, 1.0) * grid.columns;
        const double v = std::clamp(place.uv.y, 0.0, 1.0) * grid.rows;
        const int column = std::min(static_cast<int>(u), grid.columns - 1);
        const int row = std::min(static_cast<int>(v), grid.rows - 1);
        const std::array<std::size_t, 4> nodes = {nodeAt(place, column, row),
                                                  nodeAt(place, column + 1, row),
                                                  nodeAt(place, column, row + 1),
                                                  nodeAt(place, column + 1, row + 1)};
        // Squares are told apart by their first node: it has a side and a place on the grid.
        const auto [found, is_new] = index.try_emplace(nodes[0], squares.size());
        if (is_new) squares.push_back({nodes, {}, {}});
        Square& square = squares[found->second];
        const auto s = static_cast<float>(u - column);
        const auto t = static_cast<float>(v - row);
        square.places.push_back(i);
        square.weights.push_back({(1.0f - s) * (1.0f - t), s * (1.0f - t), (1.0f - s) * t, s * t});
    }
    return squares;
}

std::vector<ReceiverIrradiance> ReceiverLight::cells(std::span<const ReceiverPlace> places)
{
    const std::vector<Square> squares = squaresOf(places);
    look(squares, places, /*around=*/true);
    std::vector<ReceiverIrradiance> result(places.size());
    parallelFor(0, static_cast<std::int64_t>(squares.size()), [&](std::int64_t number) {
        const Square& square = squares[static_cast<std::size_t>(number)];
        const std::vector<Rgb> lost = hidden(square, places);
        for (std::size_t i = 0; i < lost.size(); ++i) {
            ReceiverIrradiance sum;
            for (std::size_t corner = 0; corner < 4; ++corner) {
                const ReceiverIrradiance& open = nodes_[square.nodes[corner]].open;
                sum.without += square.weights[i][corner] * open.without;
                sum.change += square.weights[i][corner] * open.change;
            }
            sum.change -= lost[i];
            if (scene_.light == FivLight::Cube ||
                glm::all(glm::lessThan(glm::abs(sum.change), kLeastChange * sum.without)))
                sum.change = Rgb(0.0f);
            result[square.places[i]] = sum;
        }
    });
    return result;
}

std::vector<Rgb> ReceiverLight::directChange(std::span<const ReceiverPlace> places)
{
    const std::vector<Square> squares = squaresOf(places);
    look(squares, places, /*around=*/false);
    std::vector<Rgb> result(places.size());
    parallelFor(0, static_cast<std::int64_t>(squares.size()), [&](std::int64_t number) {
        const Square& square = squares[static_cast<std::size_t>(number)];
        const std::vector<Rgb> lost = hidden(square, places);
        for (std::size_t i = 0; i < lost.size(); ++i)
            result[square.places[i]] = spots(places[square.places[i]]).change - lost[i];
    });
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

FaceGrid<Rgb> roomChange(const FivScene& scene, ReceiverLight& light)
{
    FaceGrid<Rgb> change = scene.room.cellReflectance();
    std::vector<ReceiverPlace> places;
    std::vector<std::size_t> cells;
    for (std::size_t cell = 0; cell < change.size(); ++cell) {
        const Rgb reflectance = change[cell];
        if (!change.valid(cell) || reflectance == Rgb(0.0f)) continue;
        const auto texel = change.texel(cell);
        const glm::dvec2 uv = change.uv(texel, glm::dvec2(0.5));
        places.push_back({scene.room.proxy().pointOn(texel.face, uv),
                          scene.room.proxy().faces()[texel.face].normal,
                          texel.face,
                          uv});
        cells.push_back(cell);
    }
    const std::vector<Rgb> direct = light.directChange(places);
    for (std::size_t i = 0; i < cells.size(); ++i)
        change[cells[i]] *= direct[i] / std::numbers::pi_v<float>;
    return change;
}

}  // namespace insitu
