#include "calib/camera_problem.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>

namespace insitu::calibration {

namespace {

/// Two marks of one point differ by less than this many σ in 99 of 100 cases (Rayleigh, σ√2).
constexpr double kCornerSigmas = 4.3;

struct End {
    std::size_t segment;
    bool is_to;
    glm::dvec2 place;
};

std::vector<End> usedEnds(const LineSet& lines, const Choice& choice)
{
    std::vector<End> ends;
    for (std::size_t i = 0; i < lines.segments.size(); ++i) {
        if (!choice.used_segments[i]) continue;
        ends.push_back({i, false, lines.segments[i].from_px});
        ends.push_back({i, true, lines.segments[i].to_px});
    }
    return ends;
}

/// Indices of ends that were marked at one point: at most one of each axis, near each other.
std::vector<std::vector<std::size_t>> cornersOf(const LineSet& lines,
                                                const std::vector<End>& ends,
                                                double radius)
{
    struct Pair {
        double distance;
        std::size_t a, b;
    };
    std::vector<Pair> pairs;
    for (std::size_t a = 0; a < ends.size(); ++a)
        for (std::size_t b = a + 1; b < ends.size(); ++b)
            if (const double d = glm::length(ends[a].place - ends[b].place); d < radius)
                pairs.push_back({d, a, b});
    std::stable_sort(pairs.begin(), pairs.end(), [](const Pair& p, const Pair& q) {
        return p.distance < q.distance;
    });

    std::vector<std::vector<std::size_t>> groups(ends.size());
    std::vector<std::size_t> group_of(ends.size());
    for (std::size_t i = 0; i < ends.size(); ++i) {
        groups[i] = {i};
        group_of[i] = i;
    }
    const auto axis = [&](std::size_t end) { return lines.segments[ends[end].segment].axis; };
    for (const Pair& pair : pairs) {
        auto& into = groups[group_of[pair.a]];
        auto& from = groups[group_of[pair.b]];
        const bool distinct = std::none_of(into.begin(), into.end(), [&](std::size_t i) {
            return std::any_of(
                from.begin(), from.end(), [&](std::size_t j) { return axis(i) == axis(j); });
        });
        if (!distinct) continue;
        for (const std::size_t moved : from) {
            into.push_back(moved);
            group_of[moved] = group_of[pair.a];
        }
        from.clear();
    }
    return groups;
}

/// Adds observations and equations to a problem.
class Poser {
public:
    Poser(const LineSet& lines, const Choice& choice) : lines_(lines), choice_(choice) {}

    Posed run()
    {
        frame();
        priors();
        segments();
        for (const auto& line : lines_.straight_lines)
            straightLine(line, points(line), -1);
        shapes();
        worldPoint(lines_.origin_px, glm::dvec3(0.0), 0.0, -1);
        for (std::size_t i = 0; i < lines_.points.size(); ++i)
            worldPoint(lines_.points[i].at_px,
                       lines_.points[i].position_m,
                       lines_.points[i].sigma_m,
                       static_cast<int>(i));
        lengths();
        return std::move(posed_);
    }

private:
    Problem& problem() { return posed_.problem; }

    void add(Kind kind, std::vector<int> observations, int index, int rows, int item)
    {
        Constraint constraint;
        constraint.kind = kind;
        constraint.index = index;
        constraint.observations = std::move(observations);
        constraint.rows = rows;
        constraint.item = item;
        problem().constraints.push_back(std::move(constraint));
    }

    void number(int unknown, double value, double sigma)
    {
        add(Kind::Number, {problem().observe(value, sigma)}, unknown, 1, -1);
    }

    std::vector<int> points(const std::vector<glm::dvec2>& places, int ends = 1)
    {
        std::vector<int> result;
        const double sigma = choice_.sigma_px / std::sqrt(ends);
        for (const glm::dvec2& place : places) {
            result.push_back(problem().observe(place.x, sigma));
            result.push_back(problem().observe(place.y, sigma));
        }
        return result;
    }

    void frame()
    {
        problem().half_diagonal_px = 0.5 * std::hypot(lines_.width, lines_.height);
        const double long_side = std::max(lines_.width, lines_.height);
        problem().shortest_focal_px = kShortestFocal * long_side;
        problem().longest_focal_px = kLongestFocal * long_side;
        problem().free.fill(true);
        for (int i = 0; i < 2; ++i)
            problem().free[kPrincipal + i] = choice_.principal_sigma_px > 0.0;
        problem().free[kDivision] = choice_.division_sigma.has_value();
        problem().free[kPosition + 1] =
            !lines_.camera_height_m || lines_.camera_height_sigma_m > 0.0;
    }

    void priors()
    {
        if (choice_.focal)
            number(kLogFocal, std::log(choice_.focal->focal_px), choice_.focal->sigma);
        for (int i = 0; i < 2 && choice_.principal_sigma_px > 0.0; ++i)
            number(kPrincipal + i, choice_.principal_px[i], choice_.principal_sigma_px);
        if (choice_.division_sigma)
            number(kDivision, lines_.distortion.division, *choice_.division_sigma);
        if (lines_.camera_height_m && lines_.camera_height_sigma_m > 0.0)
            number(kPosition + 1, *lines_.camera_height_m, lines_.camera_height_sigma_m);
        if (!lines_.gravity) return;
        const Eigen::Vector3d up =
            Eigen::Vector3d(lines_.gravity->up.x, lines_.gravity->up.y, lines_.gravity->up.z)
                .normalized();
        const double sigma = lines_.gravity->sigma_rad;
        const int first = problem().observe(0.0, sigma);
        add(Kind::Gravity, {first, problem().observe(0.0, sigma)}, 0, 2, -1);
        const Eigen::Vector3d across = up.unitOrthogonal();
        problem().constraints.back().across = {across, up.cross(across)};
    }

    /// Every inner point is on the line through the first and the last.
    void straightLine(const std::vector<glm::dvec2>& line, const std::vector<int>& at, int item)
    {
        for (std::size_t i = 1; i + 1 < line.size(); ++i) {
            const std::size_t last = 2 * (line.size() - 1);
            add(Kind::StraightLine,
                {at[0], at[1], at[2 * i], at[2 * i + 1], at[last], at[last + 1]},
                0,
                1,
                item);
        }
    }

    void segments()
    {
        const std::vector<End> ends = usedEnds(lines_, choice_);
        const double radius = choice_.shared_corners ? kCornerSigmas * choice_.sigma_px : 0.0;
        std::vector<std::array<int, 4>> at(lines_.segments.size());
        for (const auto& group : cornersOf(lines_, ends, radius)) {
            if (group.empty()) continue;
            glm::dvec2 mean(0.0);
            for (const std::size_t end : group)
                mean += ends[end].place / static_cast<double>(group.size());
            const std::vector<int> point = points({mean}, static_cast<int>(group.size()));
            posed_.corner_freedom += 2.0 * static_cast<double>(group.size() - 1);
            for (const std::size_t end : group) {
                const glm::dvec2 off = (ends[end].place - mean) / choice_.sigma_px;
                posed_.corner_cost += glm::dot(off, off);
                const std::size_t first = ends[end].is_to ? 2 : 0;
                at[ends[end].segment][first] = point[0];
                at[ends[end].segment][first + 1] = point[1];
            }
        }
        for (std::size_t i = 0; i < lines_.segments.size(); ++i)
            segment(lines_.segments[i], at[i], static_cast<int>(i));
    }

    /// An unused segment stays in the problem, to be predicted, with ends of its own.
    void segment(const LineSegment& segment, std::array<int, 4> at, int item)
    {
        const bool used = choice_.used_segments[item];
        if (!used) {
            const std::vector<int> own = points({segment.from_px, segment.to_px});
            std::copy(own.begin(), own.end(), at.begin());
        }
        add(Kind::AlongAxis, {at.begin(), at.end()}, static_cast<int>(segment.axis), 1, item);
        problem().constraints.back().used = used;
        if (!used || segment.via_px.empty()) return;
        std::vector<glm::dvec2> line{segment.from_px};
        line.insert(line.end(), segment.via_px.begin(), segment.via_px.end());
        line.push_back(segment.to_px);
        std::vector<int> all{at[0], at[1]};
        for (const int one : points(segment.via_px))
            all.push_back(one);
        all.push_back(at[2]);
        all.push_back(at[3]);
        straightLine(line, all, item);
    }

    void shapes()
    {
        for (std::size_t i = 0; i < lines_.rectangles.size(); ++i) {
            const MarkedRectangle& one = lines_.rectangles[i];
            const int rows = 1 + (one.ratio > 0.0 ? 1 : 0) + (one.on_floor ? 2 : 0);
            add(one.on_floor ? Kind::FloorRectangle : Kind::Rectangle,
                points({one.corners_px.begin(), one.corners_px.end()}),
                0,
                rows,
                static_cast<int>(i));
            problem().constraints.back().ratio = one.ratio;
        }
        for (std::size_t i = 0; i < lines_.right_angles.size(); ++i) {
            const FloorRightAngle& one = lines_.right_angles[i];
            add(Kind::FloorRightAngle,
                points({one.corner_px, one.first_px, one.second_px}),
                0,
                1,
                static_cast<int>(i));
        }
    }

    void worldPoint(glm::dvec2 at_px, glm::dvec3 position_m, double sigma_m, int item)
    {
        std::vector<int> observations = points({at_px});
        for (int i = 0; i < 3; ++i)
            observations.push_back(problem().observe(position_m[i], sigma_m));
        add(Kind::WorldPoint, std::move(observations), 0, 2, item);
    }

    void lengths()
    {
        for (std::size_t i = 0; i < lines_.lengths.size(); ++i) {
            const KnownLength& one = lines_.lengths[i];
            std::vector<int> observations = points({one.from_px, one.to_px});
            observations.push_back(problem().observe(one.metres, choice_.length_sigmas_m[i]));
            add(one.on == KnownLength::On::Floor ? Kind::FloorLength : Kind::UprightLength,
                std::move(observations),
                0,
                1,
                static_cast<int>(i));
        }
    }

    const LineSet& lines_;
    const Choice& choice_;
    Posed posed_;
};

}  // namespace

Posed pose(const LineSet& lines, const Choice& choice)
{
    return Poser(lines, choice).run();
}

}  // namespace insitu::calibration
