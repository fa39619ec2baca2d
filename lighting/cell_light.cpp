#include "lighting/cell_light.h"

#include "core/check.h"
#include "core/color.h"
#include "core/parallel.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace insitu {

using std::numbers::pi;

namespace {

/// Rows of the map that are summed together: fixed, so that threads do not matter.
constexpr int kBlocks = 16;

/// Light of a set of directions with what its spread needs.
struct Moments {
    glm::dmat3 vector{0.0};  ///< column a channel: Σ L ω ΔΩ
    double weight = 0.0;     ///< Σ Y ΔΩ
    glm::dvec3 mean{0.0};    ///< Σ Y ω ΔΩ

    void add(glm::dvec3 direction, glm::dvec3 power, double luminous)
    {
        for (int c = 0; c < 3; ++c)
            vector[c] += power[c] * direction;
        weight += luminous;
        mean += luminous * direction;
    }
    void add(const Moments& other)
    {
        vector += other.vector;
        weight += other.weight;
        mean += other.mean;
    }
    /// Σ Y |ω − d|² ΔΩ for a unit d: the angles' mean square times the weight, as they are small.
    [[nodiscard]] double squareAround(glm::dvec3 d) const
    {
        return std::max(0.0, 2.0 * (weight - glm::dot(mean, d)));
    }
    [[nodiscard]] IrradianceVector rounded() const
    {
        return {{glm::vec3(vector[0]), glm::vec3(vector[1]), glm::vec3(vector[2])}};
    }
};

/// A part of a texel: where it is on the map and seen from the object, what it sends.
struct Spot {
    glm::dvec2 uv{0.0};
    glm::dvec3 direction{0.0};
    glm::dvec3 power{0.0};
    double luminous = 0.0;
};

class Texels {
public:
    Texels(const EnvironmentMap& environment, const glm::dmat3& object_from_world, int face_size)
        : image_(environment.pixels), rotation_(object_from_world)
    {
        // At least two parts a cell and axis; the cells of a cube are narrowest at its corners.
        const double cell = 0.5 * pi / face_size * 0.6;
        const double texel = pi / std::max(image_.height(), 1);
        parts_ = std::clamp(static_cast<int>(std::ceil(2.0 * texel / cell)), 1, 64);
    }

    /// Calls visit(spot) for every part of every texel of a row that shines.
    template <class Visit>
    void row(int y, const Visit& visit) const
    {
        const int width = image_.width() * parts_;
        const int height = image_.height() * parts_;
        for (int j = 0; j < parts_; ++j) {
            const int row = y * parts_ + j;
            const double solid_angle = environmentTexelSolidAngle(width, height, row);
            for (int x = 0; x < image_.width(); ++x) {
                const Rgb radiance = image_(x, y);
                if (radiance == Rgb(0.0f)) continue;
                const glm::dvec3 power = glm::dvec3(radiance) * solid_angle;
                const double luminous = luminance(radiance) * solid_angle;
                for (int i = 0; i < parts_; ++i) {
                    const glm::dvec2 uv((x * parts_ + i + 0.5) / width, (row + 0.5) / height);
                    visit(Spot{uv, rotation_ * environmentDirectionFromUv(uv), power, luminous});
                }
            }
        }
    }

    /// Angle of a part's side.
    [[nodiscard]] double partAngle() const { return pi / (image_.height() * parts_); }

    /// A part that is bright enough to throw a shadow of its own, cut again into kCuts² spots: it
    /// is an area, not a point.
    void cutInto(std::vector<Spot>& spots, const Spot& whole) const
    {
        const glm::dvec2 size(1.0 / (image_.width() * parts_), 1.0 / (image_.height() * parts_));
        for (int j = 0; j < kCuts; ++j)
            for (int i = 0; i < kCuts; ++i) {
                const glm::dvec2 off((i + 0.5) / kCuts - 0.5, (j + 0.5) / kCuts - 0.5);
                const glm::dvec2 uv = whole.uv + off * size;
                spots.push_back({uv,
                                 rotation_ * environmentDirectionFromUv(uv),
                                 whole.power / double{kCuts * kCuts},
                                 whole.luminous / double{kCuts * kCuts}});
            }
    }

private:
    static constexpr int kCuts = 4;
    const Image<Rgb>& image_;
    glm::dmat3 rotation_;
    int parts_ = 1;
};

void requireRadiance(const Image<Rgb>& image)
{
    for (int y = 0; y < image.height(); ++y)
        for (int x = 0; x < image.width(); ++x)
            for (int c = 0; c < 3; ++c) {
                const float value = image(x, y)[c];
                if (!std::isfinite(value) || value < 0.0f)
                    throw InputError("environment",
                                     fmt::format("({}, {})", x, y),
                                     fmt::format("radiance {} is not a finite number >= 0", value));
            }
}

std::size_t slotOf(DirectedPair cell)
{
    return 2 * cell.pair + static_cast<std::size_t>(cell.side);
}

std::vector<Moments> sumCells(const Texels& texels, int height, DirectionCells cells)
{
    std::vector<std::vector<Moments>> parts(kBlocks);
    parallelFor(0, kBlocks, [&](std::int64_t block) {
        auto& sums = parts[static_cast<std::size_t>(block)];
        sums.resize(2 * cells.pairCount());
        const int begin = static_cast<int>(height * block / kBlocks);
        const int end = static_cast<int>(height * (block + 1) / kBlocks);
        for (int y = begin; y < end; ++y)
            texels.row(y, [&](const Spot& spot) {
                sums[slotOf(cells.cellAt(spot.direction))].add(
                    spot.direction, spot.power, spot.luminous);
            });
    });
    for (int block = 1; block < kBlocks; ++block)
        for (std::size_t i = 0; i < parts[0].size(); ++i)
            parts[0][i].add(parts[static_cast<std::size_t>(block)][i]);
    return std::move(parts[0]);
}

glm::dvec3 directionOf(DirectionCells cells, std::size_t slot)
{
    return cells.direction(slot / 2) * (slot % 2 == 0 ? 1.0 : -1.0);
}

/// A group of spots that one direction will stand for.
struct Group {
    std::vector<Spot> spots;
    Moments moments;
    glm::dvec3 direction{0.0};
    double blame = 0.0;  ///< luminous weight times spread

    explicit Group(std::vector<Spot> members) : spots(std::move(members))
    {
        for (const Spot& spot : spots)
            moments.add(spot.direction, spot.power, spot.luminous);
        direction = glm::normalize(moments.mean);
        if (spots.size() > 1) blame = std::sqrt(moments.squareAround(direction) * moments.weight);
    }
};

/// Cuts across the axis along which the group is widest, at its mean.
std::pair<std::vector<Spot>, std::vector<Spot>> cut(std::vector<Spot> spots, glm::dvec3 center)
{
    glm::dvec3 square(0.0);
    for (const Spot& spot : spots) {
        const glm::dvec3 off = spot.direction - center;
        square += spot.luminous * off * off;
    }
    const int axis =
        square.x >= square.y && square.x >= square.z ? 0 : (square.y >= square.z ? 1 : 2);
    const auto middle = std::stable_partition(spots.begin(), spots.end(), [&](const Spot& spot) {
        return spot.direction[axis] < center[axis];
    });
    std::vector<Spot> second(middle, spots.end());
    spots.erase(middle, spots.end());
    return {std::move(spots), std::move(second)};
}

/// Cells whose light their own direction does not stand for, the worst first, at most `most`.
std::vector<std::size_t> concentratedCells(const std::vector<Moments>& sums,
                                           DirectionCells cells,
                                           double limit,
                                           std::size_t most)
{
    struct Suspect {
        std::size_t slot = 0;
        double blame = 0.0;
    };
    std::vector<Suspect> suspects;
    for (std::size_t i = 0; i < sums.size(); ++i) {
        const double square = sums[i].squareAround(directionOf(cells, i));
        const double blame = std::sqrt(square * sums[i].weight);
        if (blame > limit) suspects.push_back({i, blame});
    }
    std::ranges::stable_sort(suspects, std::greater{}, &Suspect::blame);
    suspects.resize(std::min(suspects.size(), most));
    std::vector<std::size_t> slots;
    for (const Suspect& suspect : suspects)
        slots.push_back(suspect.slot);
    return slots;
}

/// The light of each of these cells as a group of spots.
std::vector<Group> groupsOf(const std::vector<std::size_t>& slots,
                            const Texels& texels,
                            int height,
                            DirectionCells cells,
                            double limit)
{
    if (slots.empty()) return {};
    std::vector<int> group_of(2 * cells.pairCount(), -1);
    for (std::size_t i = 0; i < slots.size(); ++i)
        group_of[slots[i]] = static_cast<int>(i);
    std::vector<std::vector<Spot>> spots(slots.size());
    for (int y = 0; y < height; ++y)
        texels.row(y, [&](const Spot& spot) {
            const int group = group_of[slotOf(cells.cellAt(spot.direction))];
            if (group < 0) return;
            auto& members = spots[static_cast<std::size_t>(group)];
            if (spot.luminous * texels.partAngle() > limit)
                texels.cutInto(members, spot);
            else
                members.push_back(spot);
        });
    std::vector<Group> groups;
    for (std::vector<Spot>& members : spots)
        groups.emplace_back(std::move(members));
    return groups;
}

/// Splits groups, always the one to blame most, until none is above `limit` or there are enough.
std::vector<Group> refine(std::vector<Group> groups, std::size_t most, double limit)
{
    const auto less = [](const Group& a, const Group& b) { return a.blame < b.blame; };
    std::ranges::make_heap(groups, less);
    while (!groups.empty() && groups.size() < most && groups.front().blame > limit) {
        std::ranges::pop_heap(groups, less);
        const Group widest = std::move(groups.back());
        groups.pop_back();
        auto [first, second] = cut(widest.spots, widest.moments.mean / widest.moments.weight);
        const bool apart = !first.empty() && !second.empty();
        for (std::vector<Spot>* half : {&first, &second}) {
            if (half->empty()) continue;
            groups.emplace_back(std::move(*half));
            // Spots that rounding does not tell apart stay together.
            if (!apart) groups.back().blame = 0.0;
            std::ranges::push_heap(groups, less);
        }
    }
    return groups;
}

}  // namespace

Findings LightSplitOptions::validate() const
{
    Findings problems;
    if (max_fine_directions < 0)
        problems.push_back(
            {Severity::Error,
             "light-split-options",
             fmt::format("max_fine_directions is {}, below 0", max_fine_directions)});
    if (!(spread_tolerance >= 0.0))
        problems.push_back({Severity::Error,
                            "light-split-options",
                            fmt::format("spread_tolerance is {}, below 0", spread_tolerance)});
    return problems;
}

IrradianceVector CellLight::total() const
{
    std::array<glm::dvec3, 3> sum{glm::dvec3(0.0), glm::dvec3(0.0), glm::dvec3(0.0)};
    for (const auto* list : {&along, &against, &fine})
        for (const IrradianceVector& v : *list)
            for (std::size_t c = 0; c < 3; ++c)
                sum[c] += glm::dvec3(v.channels[c]);
    return {{glm::vec3(sum[0]), glm::vec3(sum[1]), glm::vec3(sum[2])}};
}

Rgb CellLight::irradiance(glm::vec3 unit_normal) const
{
    glm::dvec3 sum(0.0);
    for (const auto* list : {&along, &against, &fine})
        for (const IrradianceVector& v : *list)
            sum += glm::dvec3(glm::max(v.along(unit_normal), Rgb(0.0f)));
    return Rgb(sum);
}

CellLight splitLight(const EnvironmentMap& environment,
                     const glm::dmat3& object_from_world,
                     DirectionCells cells,
                     const LightSplitOptions& options)
{
    requireValid(options.validate(), "light split options");
    requireRadiance(environment.pixels);
    const Texels texels(environment, object_from_world, cells.face_size);
    const int height = environment.pixels.height();
    std::vector<Moments> sums = sumCells(texels, height, cells);

    double weight = 0.0;
    for (const Moments& cell : sums)
        weight += cell.weight;
    const double limit = options.spread_tolerance * weight;
    const std::vector<std::size_t> suspects = concentratedCells(
        sums, cells, limit, static_cast<std::size_t>(options.max_fine_directions));
    const std::vector<Group> groups = refine(groupsOf(suspects, texels, height, cells, limit),
                                             static_cast<std::size_t>(options.max_fine_directions),
                                             limit);

    CellLight light;
    double square = 0.0;
    for (const Group& group : groups) {
        light.fine_directions.push_back(group.direction);
        light.fine.push_back(group.moments.rounded());
        square += group.moments.squareAround(group.direction);
    }
    for (const std::size_t slot : suspects)
        sums[slot] = Moments{};
    light.along.resize(cells.pairCount());
    light.against.resize(cells.pairCount());
    for (std::size_t i = 0; i < sums.size(); ++i) {
        (i % 2 == 0 ? light.along : light.against)[i / 2] = sums[i].rounded();
        square += sums[i].squareAround(directionOf(cells, i));
    }
    light.spread_rad = weight > 0.0 ? std::sqrt(square / weight) : 0.0;
    return light;
}

}  // namespace insitu
