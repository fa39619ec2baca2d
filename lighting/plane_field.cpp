#include "core/check.h"
#include "lighting/fiv_field.h"

#include <algorithm>
#include <cmath>

namespace insitu {

namespace {

constexpr std::uint32_t kFirstLevel = 2;
/// Tiles of more samples than this are visited in patches of 8 x 4, as neighbours should be.
constexpr int kPatchColumns = 8;
constexpr int kPatchRows = 4;

/// Samples of a tile, patch by patch: calls visit(column, row).
template <class Visit>
void forEachSample(std::uint32_t level, const Visit& visit)
{
    const int side = (1 << level) + 1;
    for (int top = 0; top < side; top += kPatchRows)
        for (int left = 0; left < side; left += kPatchColumns)
            for (int y = top; y < std::min(top + kPatchRows, side); ++y)
                for (int x = left; x < std::min(left + kPatchColumns, side); ++x)
                    visit(x, y);
}

std::size_t samplesOf(std::uint32_t level)
{
    const std::size_t side = (std::size_t{1} << level) + 1;
    return side * side;
}

/// Bilinear in a tile of 2^level intervals; s, t in [0, 1].
Rgb interpolate(const Rgb* samples, std::uint32_t level, double s, double t)
{
    const int intervals = 1 << level;
    const double x = s * intervals;
    const double y = t * intervals;
    const int i = std::clamp(static_cast<int>(x), 0, intervals - 1);
    const int j = std::clamp(static_cast<int>(y), 0, intervals - 1);
    const auto tx = static_cast<float>(x - i);
    const auto ty = static_cast<float>(y - j);
    const auto at = [&](int column, int row) {
        return samples[static_cast<std::size_t>(row) * static_cast<std::size_t>(intervals + 1) +
                       static_cast<std::size_t>(column)];
    };
    return (at(i, j) * (1.0f - tx) + at(i + 1, j) * tx) * (1.0f - ty) +
           (at(i, j + 1) * (1.0f - tx) + at(i + 1, j + 1) * tx) * ty;
}

/// Largest difference of a channel between a finer tile and its own coarser samples.
double errorOfCoarser(const std::vector<Rgb>& fine, std::uint32_t level)
{
    const int side = (1 << level) + 1;
    std::vector<Rgb> coarse;
    for (int y = 0; y < side; y += 2)
        for (int x = 0; x < side; x += 2)
            coarse.push_back(fine[static_cast<std::size_t>(y * side + x)]);
    double most = 0.0;
    for (int y = 0; y < side; ++y)
        for (int x = 0; x < side; ++x) {
            const Rgb expected = interpolate(coarse.data(),
                                             level - 1,
                                             static_cast<double>(x) / (side - 1),
                                             static_cast<double>(y) / (side - 1));
            const Rgb off = glm::abs(expected - fine[static_cast<std::size_t>(y * side + x)]);
            most = std::max<double>(most, std::max({off.r, off.g, off.b}));
        }
    return most;
}

/// Local places of the samples of some tiles, tile after tile.
std::vector<glm::vec3> samplePlaces(const LocalFrame& local,
                                    const ReceiverPlane& plane,
                                    std::size_t tiles_a_side,
                                    std::uint32_t level,
                                    const std::vector<std::size_t>& tiles)
{
    const auto intervals = static_cast<double>(1 << level);
    const double step = 1.0 / (static_cast<double>(tiles_a_side) * intervals);
    std::vector<glm::vec3> places;
    places.reserve(tiles.size() * samplesOf(level));
    for (const std::size_t tile : tiles)
        forEachSample(level, [&](int x, int y) {
            const double u = static_cast<double>(tile % tiles_a_side) * intervals + x;
            const double v = static_cast<double>(tile / tiles_a_side) * intervals + y;
            places.push_back(
                local.localFrom(plane.corner + u * step * plane.edge_u + v * step * plane.edge_v));
        });
    return places;
}

/// Whether a tile or one of its eight neighbours is marked.
bool anyAround(const std::vector<char>& marked, std::size_t side, std::size_t tile)
{
    const std::size_t column = tile % side;
    const std::size_t row = tile / side;
    for (std::size_t y = row == 0 ? 0 : row - 1; y <= std::min(row + 1, side - 1); ++y)
        for (std::size_t x = column == 0 ? 0 : column - 1; x <= std::min(column + 1, side - 1); ++x)
            if (marked[y * side + x] != 0) return true;
    return false;
}

}  // namespace

glm::dvec3 ReceiverPlane::normal() const
{
    return glm::normalize(glm::cross(edge_v, edge_u));
}

Findings PlaneFieldOptions::validate() const
{
    Findings problems;
    const auto require = [&](bool holds, const std::string& message) {
        if (!holds) problems.push_back({Severity::Error, "plane-field-options", message});
    };
    require(tiles >= 1 && tiles <= 256, fmt::format("tiles is {}, not in [1, 256]", tiles));
    require(max_error > 0.0, fmt::format("max_error is {}, not above 0", max_error));
    require(max_level >= 1 && max_level <= 8,
            fmt::format("max_level is {}, not in [1, 8]", max_level));
    require(bias_texels >= 0.0f && bias_texels <= 4.0f,
            fmt::format("bias_texels is {}, not in [0, 4]", bias_texels));
    return problems;
}

PlaneField::PlaneField(const ObjectLight& object,
                       const ReceiverPlane& plane,
                       const PlaneFieldOptions& options)
    : tiles_a_side_(options.tiles)
{
    requireValid(options.validate(), "plane field options");
    if (!(glm::length(glm::cross(plane.edge_u, plane.edge_v)) > 0.0))
        throw InputError("receiver plane", "its edges span no area");
    const glm::vec3 normal(plane.normal());
    const Rgb free = object.light.irradiance(normal);
    const double irradiance = static_cast<double>(std::max({free.r, free.g, free.b}));
    const double limit = options.max_error * irradiance;

    // Level by level: sample all tiles that are not good enough yet, see what their coarser samples
    // would have said. Neighbours of a poor tile are refined as well: what is small, a leg's
    // shadow, may lie between the samples of the one and show only in the other.
    const auto count = static_cast<std::size_t>(options.tiles) * options.tiles;
    std::vector<std::vector<Rgb>> sampled(count);
    std::vector<std::uint32_t> levels(count, kFirstLevel);
    std::vector<double> errors(count, 0.0);
    std::vector<std::size_t> active(count);
    for (std::size_t i = 0; i < count; ++i)
        active[i] = i;
    for (auto level = kFirstLevel; !active.empty(); ++level) {
        const std::vector<glm::vec3> places = samplePlaces(
            object.local(), plane, static_cast<std::size_t>(options.tiles), level, active);
        std::vector<Rgb> hidden(places.size());
        hiddenIrradiance(object, places, normal, hidden, options.bias_texels);

        std::vector<char> poor(count, 0);
        std::size_t from = 0;
        const int side = (1 << level) + 1;
        for (const std::size_t tile : active) {
            levels[tile] = level;
            sampled[tile].resize(samplesOf(level));
            forEachSample(level, [&](int x, int y) {
                sampled[tile][static_cast<std::size_t>(y * side + x)] = hidden[from++];
            });
            const double error = errorOfCoarser(sampled[tile], level);
            if (irradiance > 0.0) errors[tile] = error / irradiance;
            poor[tile] = error > limit && static_cast<int>(level) < options.max_level ? 1 : 0;
        }
        std::erase_if(active, [&](std::size_t tile) {
            return !anyAround(poor, static_cast<std::size_t>(options.tiles), tile);
        });
    }
    largest_error_ = *std::ranges::max_element(errors);
    for (std::size_t tile = 0; tile < count; ++tile) {
        tiles_.push_back({static_cast<std::uint32_t>(samples_.size()), levels[tile]});
        samples_.insert(samples_.end(), sampled[tile].begin(), sampled[tile].end());
    }
}

Rgb PlaneField::at(glm::dvec2 uv) const
{
    const glm::dvec2 place = glm::clamp(uv, 0.0, 1.0) * static_cast<double>(tiles_a_side_);
    const int column = std::min(static_cast<int>(place.x), tiles_a_side_ - 1);
    const int row = std::min(static_cast<int>(place.y), tiles_a_side_ - 1);
    const Tile& tile = tiles_[static_cast<std::size_t>(row * tiles_a_side_ + column)];
    return interpolate(samples_.data() + tile.first, tile.level, place.x - column, place.y - row);
}

}  // namespace insitu
