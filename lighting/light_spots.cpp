#include "lighting/light_spots.h"

#include "core/color.h"
#include "lighting/direction_cells.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace insitu {

namespace {

/// Directions along the side of a cube's face with which all light is estimated.
constexpr int kGrid = 24;
/// A lamp is what is seen this near (relative) to its place.
constexpr double kSlack = 2e-3;

/// A texel of concentrated light.
struct Item {
    LightSpot spot;
    glm::dvec3 direction{0.0};  ///< from the reference
    double weight = 0.0;        ///< luminous irradiance at the reference
};

/// Items that one spot will stand for.
struct Group {
    std::vector<Item> items;
    glm::dvec3 mean{0.0};
    double weight = 0.0;
    double blame = 0.0;  ///< weight times spread

    explicit Group(std::vector<Item> members) : items(std::move(members))
    {
        for (const Item& item : items) {
            weight += item.weight;
            mean += item.weight * item.direction;
        }
        mean /= weight;
        double square = 0.0;
        for (const Item& item : items) {
            const glm::dvec3 off = item.direction - mean;
            square += item.weight * glm::dot(off, off);
        }
        if (items.size() > 1) blame = std::sqrt(square * weight);
    }

    [[nodiscard]] LightSpot spot() const
    {
        LightSpot sum{items.front().spot.far, {}, items.front().spot.normal, {}};
        double all = 0.0;
        for (const Item& item : items) {
            const double power = luminance(Rgb(item.spot.power));
            sum.at += power * item.spot.at;
            sum.power += item.spot.power;
            all += power;
        }
        sum.at = sum.far ? glm::normalize(sum.at) : sum.at / all;
        return sum;
    }
};

/// Across the widest axis, at the mean; nothing when the items lie in one place.
std::optional<std::pair<Group, Group>> cut(const Group& group)
{
    glm::dvec3 square(0.0);
    for (const Item& item : group.items) {
        const glm::dvec3 off = item.direction - group.mean;
        square += item.weight * off * off;
    }
    const int axis =
        square.x >= square.y && square.x >= square.z ? 0 : (square.y >= square.z ? 1 : 2);
    std::vector<Item> below;
    std::vector<Item> above;
    for (const Item& item : group.items)
        (item.direction[axis] < group.mean[axis] ? below : above).push_back(item);
    if (below.empty() || above.empty()) return std::nullopt;
    return std::pair(Group(std::move(below)), Group(std::move(above)));
}

std::vector<LightSpot> cluster(std::vector<std::vector<Item>> sources,
                               double limit,
                               std::size_t most)
{
    std::vector<Group> groups;
    for (std::vector<Item>& items : sources)
        if (!items.empty()) groups.emplace_back(std::move(items));
    while (!groups.empty() && groups.size() < most) {
        const auto worst = std::ranges::max_element(groups, {}, &Group::blame);
        if (!(worst->blame > limit)) break;
        auto halves = cut(*worst);
        if (!halves) {
            worst->blame = 0.0;
            continue;
        }
        *worst = std::move(halves->first);
        groups.push_back(std::move(halves->second));
    }
    std::vector<LightSpot> spots;
    for (const Group& group : groups)
        spots.push_back(group.spot());
    return spots;
}

/// The reference and places around it in the same room: far light that none of them sees is not
/// worth a spot.
std::vector<glm::dvec3> placesAround(const RoomLight& room, glm::dvec3 reference)
{
    std::vector<glm::dvec3> places = {reference};
    for (const double distance : {0.7, 1.5})
        for (int turn = 0; turn < 8; ++turn) {
            const double angle = turn * std::numbers::pi / 4.0;
            const glm::dvec3 direction(std::cos(angle), 0.0, std::sin(angle));
            const auto wall = room.intersect(reference, direction);
            if (!wall || wall->distance_m > distance)
                places.push_back(reference + distance * direction);
        }
    return places;
}

/// Marks texels above the threshold and their neighbours, since radiance is looked up bilinearly.
std::vector<std::uint8_t> brightFarTexels(const Image<Rgb>& far, double threshold)
{
    std::vector<std::uint8_t> marks(far.pixelCount(), 0);
    for (int y = 0; y < far.height(); ++y)
        for (int x = 0; x < far.width(); ++x) {
            if (luminance(far(x, y)) <= threshold) continue;
            for (int j = std::max(0, y - 1); j <= std::min(far.height() - 1, y + 1); ++j)
                for (int i = x - 1; i <= x + 1; ++i)
                    marks[static_cast<std::size_t>(j * far.width() +
                                                   (i + far.width()) % far.width())] = 1;
        }
    return marks;
}

std::vector<std::uint8_t> brightSurfaceTexels(const FaceGrid<Rgb>& radiance, double threshold)
{
    std::vector<std::uint8_t> marks(radiance.size(), 0);
    for (std::size_t face = 0; face < radiance.faceCount(); ++face) {
        const int columns = radiance.columns(face);
        const int rows = radiance.rows(face);
        const auto at = [&](int column, int row) {
            return radiance.firstOf(face) + static_cast<std::size_t>(row * columns + column);
        };
        for (int row = 0; row < rows; ++row)
            for (int column = 0; column < columns; ++column) {
                if (!radiance.valid(at(column, row)) ||
                    luminance(radiance[at(column, row)]) <= threshold)
                    continue;
                for (int j = std::max(0, row - 1); j <= std::min(rows - 1, row + 1); ++j)
                    for (int i = std::max(0, column - 1); i <= std::min(columns - 1, column + 1);
                         ++i)
                        marks[at(i, j)] = 1;
            }
    }
    return marks;
}

std::vector<Item> farItems(const Image<Rgb>& far,
                           const std::vector<std::uint8_t>& marks,
                           double total)
{
    std::vector<Item> items;
    for (std::size_t i = 0; i < marks.size(); ++i) {
        if (!marks[i]) continue;
        const int x = static_cast<int>(i) % far.width();
        const int y = static_cast<int>(i) / far.width();
        const glm::dvec3 direction =
            environmentDirectionFromUv({(x + 0.5) / far.width(), (y + 0.5) / far.height()});
        const glm::dvec3 power =
            glm::dvec3(far(x, y)) * environmentTexelSolidAngle(far.width(), far.height(), y);
        const double weight = luminance(Rgb(power));
        if (weight > 0.0)
            items.push_back({{true, direction, {}, power}, direction, weight / total});
    }
    return items;
}

std::vector<Item> surfaceItems(const RoomLight& room,
                               std::size_t face,
                               const std::vector<std::uint8_t>& marks,
                               glm::dvec3 reference,
                               double total)
{
    const FaceGrid<Rgb>& radiance = room.surfaceRadiance();
    const ProxyFace& f = room.proxy().faces()[face];
    const double area = glm::length(glm::cross(f.edge_u, f.edge_v)) /
                        (static_cast<double>(radiance.columns(face)) * radiance.rows(face));
    std::vector<Item> items;
    for (const std::size_t i : radiance.texelsOf(face)) {
        if (!marks[i] || !radiance.valid(i)) continue;
        const glm::dvec3 place = room.proxy().pointOn(face, radiance.centerUv(i));
        const double distance = std::max(glm::length(place - reference), 0.05);
        const glm::dvec3 power = glm::dvec3(radiance[i]) * area;
        const double cosine = std::abs(glm::dot(place - reference, f.normal)) / distance;
        const double weight =
            luminance(Rgb(power)) * std::max(cosine, 0.05) / (distance * distance);
        if (weight > 0.0)
            items.push_back(
                {{false, place, f.normal, power}, (place - reference) / distance, weight / total});
    }
    return items;
}

}  // namespace

LightSpots::LightSpots(const RoomLight& room, glm::dvec3 reference, const LightSpotOptions& options)
    : room_(&room)
{
    if (options.max_spots <= 0) return;
    const DirectionCells cells{kGrid};
    double total = 0.0;
    for (std::size_t pair = 0; pair < cells.pairCount(); ++pair)
        for (const double side : {1.0, -1.0})
            total += cells.solidAngle(pair) *
                     luminance(room.incident(reference, side * cells.direction(pair)).radiance);
    if (!(total > 0.0)) return;
    const double threshold = options.least_share * total / options.cell_solid_angle;
    far_ = brightFarTexels(room.outside().pixels, threshold);
    surface_ = brightSurfaceTexels(room.surfaceRadiance(), threshold);

    // One group for what is far and one for each face, so that a spot lies on one plane.
    std::vector<std::vector<Item>> sources;
    sources.push_back(farItems(room.outside().pixels, far_, total));
    std::erase_if(sources[0], [places = placesAround(room, reference), &room](const Item& item) {
        return std::ranges::none_of(places, [&](glm::dvec3 place) {
            const auto hit = room.intersect(place, item.direction);
            return !hit || hit->opening;
        });
    });
    for (std::size_t face = 0; face < room.surfaceRadiance().faceCount(); ++face)
        sources.push_back(surfaceItems(room, face, surface_, reference, total));
    spots_ = cluster(
        std::move(sources), options.spread_tolerance, static_cast<std::size_t>(options.max_spots));
}

bool LightSpots::holds(const RoomLight::Arrival& arrival, glm::dvec3 direction) const
{
    if (spots_.empty()) return false;
    if (arrival.hit && !arrival.hit->opening)
        return surface_[room_->surfaceRadiance().texelAt(arrival.hit->face, arrival.hit->uv)] != 0;
    const Image<Rgb>& far = room_->outside().pixels;
    const glm::ivec2 texel = environmentTexelAt(far.width(), far.height(), direction);
    return far_[static_cast<std::size_t>(texel.y * far.width() + texel.x)] != 0;
}

std::optional<SpotArrival> reach(const RoomLight& room, const LightSpot& spot, glm::dvec3 place)
{
    if (spot.far) {
        const auto hit = room.intersect(place, spot.at);
        if (hit && !hit->opening) return std::nullopt;
        return SpotArrival{spot.at, kInfinity, spot.power};
    }
    const glm::dvec3 way = spot.at - place;
    const double distance = glm::length(way);
    if (!(distance > 0.0)) return std::nullopt;
    const glm::dvec3 direction = way / distance;
    const double cosine = -glm::dot(direction, spot.normal);
    if (!(std::abs(cosine) > 0.0)) return std::nullopt;
    const auto hit = room.intersect(place, direction);
    if (hit && hit->distance_m < distance * (1.0 - kSlack)) return std::nullopt;
    return SpotArrival{
        direction, distance, spot.power * (std::abs(cosine) / (distance * distance))};
}

}  // namespace insitu
