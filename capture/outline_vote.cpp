#include "capture/outline_vote.h"

#include "core/parallel.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace insitu::detail {

using std::numbers::pi;

namespace {

/// Gradients below so many standard deviations are noise.
constexpr float kEdgeDeviations = 5.0f;
/// An edge so many times as strong as the picture's median has half of full weight: noise and fine
/// texture are many, and weak.
constexpr double kTypicalEdge = 2.0;
/// Two radii tried are so far apart, and cells so wide, as shares of the radius.
constexpr double kRadiusStep = 0.03;
constexpr double kCellShare = 0.04;
constexpr double kSmallestCell = 1.5;
/// Largest radius, as a share of the longer side: a ball that is half outside.
constexpr double kLargestRadius = 0.75;
/// Standard deviation of a pixel after the 1 2 1 filter both ways, and of its central difference.
constexpr float kGradientNoise = 0.27f;

/// 1 2 1 both ways, clamped at the edge.
Image<Rgb> smoothed(const OutlinePicture& picture, std::size_t frame)
{
    const int w = picture.width();
    const int h = picture.height();
    Image<Rgb> result(w, h);
    parallelFor(0, h, [&](std::int64_t row) {
        const int y = static_cast<int>(row);
        const auto across = [&](int x, int v) {
            return 0.25f * picture.at(frame, std::max(x - 1, 0), v) +
                   0.5f * picture.at(frame, x, v) +
                   0.25f * picture.at(frame, std::min(x + 1, w - 1), v);
        };
        for (int x = 0; x < w; ++x)
            result(x, y) = 0.25f * across(x, std::max(y - 1, 0)) + 0.5f * across(x, y) +
                           0.25f * across(x, std::min(y + 1, h - 1));
    });
    return result;
}

/// The strongest gradient of all frames and channels, in standard deviations of its noise.
Image<glm::vec2> strongestGradients(const OutlinePicture& picture)
{
    Image<glm::vec2> gradients(picture.width(), picture.height());
    for (std::size_t f = 0; f < picture.frames(); ++f) {
        const Image<Rgb> image = smoothed(picture, f);
        const Rgb scale = 1.0f / (kGradientNoise * picture.noise(f));
        parallelFor(1, picture.height() - 1, [&](std::int64_t row) {
            const int y = static_cast<int>(row);
            for (int x = 1; x + 1 < picture.width(); ++x) {
                const Rgb dx = 0.5f * scale * (image(x + 1, y) - image(x - 1, y));
                const Rgb dy = 0.5f * scale * (image(x, y + 1) - image(x, y - 1));
                for (int c = 0; c < 3; ++c) {
                    const glm::vec2 g(dx[c], dy[c]);
                    if (glm::dot(g, g) > glm::dot(gradients(x, y), gradients(x, y)))
                        gradients(x, y) = g;
                }
            }
        });
    }
    return gradients;
}

/// Votes of edges for centres at one radius.
class Ballot {
public:
    Ballot(glm::ivec2 size, double radius)
        : radius_(radius),
          cell_(std::max(kCellShare * radius, kSmallestCell)),
          votes_(static_cast<int>(size.x / cell_) + 1, static_cast<int>(size.y / cell_) + 1)
    {
    }

    void add(glm::dvec2 center, double weight)
    {
        const glm::dvec2 place = glm::floor(center / cell_);
        if (place.x < 0.0 || place.y < 0.0 || place.x >= votes_.width() ||
            place.y >= votes_.height())
            return;
        votes_(static_cast<int>(place.x), static_cast<int>(place.y)) += static_cast<float>(weight);
    }

    struct Choice {
        Circle circle;
        double share = 0.0;
    };
    /// Peaks of the votes, as shares of the circumference.
    void collect(std::vector<Choice>& choices) const
    {
        Image<float> sums(votes_.width(), votes_.height());
        for (int y = 0; y < votes_.height(); ++y)
            for (int x = 0; x < votes_.width(); ++x)
                sums(x, y) = around(votes_, x, y, [](float a, float b) { return a + b; });
        for (int y = 0; y < votes_.height(); ++y) {
            for (int x = 0; x < votes_.width(); ++x) {
                if (sums(x, y) <= 0.0f) continue;
                const float most =
                    around(sums, x, y, [](float a, float b) { return std::max(a, b); });
                if (sums(x, y) < most) continue;
                choices.push_back({{cell_ * glm::dvec2(x + 0.5, y + 0.5), radius_},
                                   sums(x, y) / (2.0 * pi * radius_)});
            }
        }
    }

private:
    template <class Join>
    [[nodiscard]] static float around(const Image<float>& image, int x, int y, Join join)
    {
        float result = 0.0f;
        for (int j = std::max(y - 1, 0); j <= std::min(y + 1, image.height() - 1); ++j)
            for (int i = std::max(x - 1, 0); i <= std::min(x + 1, image.width() - 1); ++i)
                result = join(result, image(i, j));
        return result;
    }

    double radius_;
    double cell_;
    Image<float> votes_;
};

bool sameCircle(const Circle& a, const Circle& b)
{
    const double near = 0.08 * std::max(a.radius, b.radius);
    return glm::length(a.center - b.center) < near && std::abs(a.radius - b.radius) < near;
}

}  // namespace

std::vector<Edge> thinEdges(const OutlinePicture& picture)
{
    const Image<glm::vec2> gradients = strongestGradients(picture);
    std::vector<Edge> edges;
    for (int y = 1; y + 1 < gradients.height(); ++y) {
        for (int x = 1; x + 1 < gradients.width(); ++x) {
            const glm::vec2 g = gradients(x, y);
            const float size = glm::length(g);
            if (size < kEdgeDeviations) continue;
            const glm::dvec2 n = glm::dvec2(g) / static_cast<double>(size);
            const glm::dvec2 middle(x + 0.5, y + 0.5);
            const auto sizeAt = [&](glm::dvec2 p) {
                const auto i = glm::ivec2(glm::floor(p));
                return glm::length(gradients(i.x, i.y));
            };
            const float before = sizeAt(middle - n);
            const float after = sizeAt(middle + n);
            if (size < after || size <= before) continue;
            const double shift = 0.5 * (before - after) / (before - 2.0 * size + after);
            edges.push_back({middle + std::clamp(shift, -0.5, 0.5) * n, n, size});
        }
    }
    if (edges.empty()) return edges;
    std::vector<double> sizes;
    for (const Edge& edge : edges)
        sizes.push_back(edge.weight);
    const auto middle = sizes.begin() + static_cast<std::ptrdiff_t>(sizes.size() / 2);
    std::ranges::nth_element(sizes, middle);
    const double typical = kTypicalEdge * *middle;
    for (Edge& edge : edges)
        edge.weight = edge.weight * edge.weight / (edge.weight * edge.weight + typical * typical);
    return edges;
}

std::vector<Circle> voteForCircles(const std::vector<Edge>& edges,
                                   glm::ivec2 picture_size,
                                   double smallest_radius,
                                   std::size_t count)
{
    std::vector<double> radii;
    const double largest = kLargestRadius * std::max(picture_size.x, picture_size.y);
    for (double r = smallest_radius; r < largest; r *= 1.0 + kRadiusStep)
        radii.push_back(r);
    std::vector<std::vector<Ballot::Choice>> found(radii.size());
    parallelFor(0, static_cast<std::int64_t>(radii.size()), [&](std::int64_t index) {
        const auto i = static_cast<std::size_t>(index);
        Ballot ballot(picture_size, radii[i]);
        for (const Edge& edge : edges) {
            ballot.add(edge.place + radii[i] * edge.normal, edge.weight);
            ballot.add(edge.place - radii[i] * edge.normal, edge.weight);
        }
        ballot.collect(found[i]);
    });

    // A large circle rarely comes about by chance, a small one often does.
    std::vector<Ballot::Choice> choices;
    for (const std::vector<Ballot::Choice>& list : found)
        choices.insert(choices.end(), list.begin(), list.end());
    std::ranges::stable_sort(choices, [](const Ballot::Choice& a, const Ballot::Choice& b) {
        return a.share * std::sqrt(a.circle.radius) > b.share * std::sqrt(b.circle.radius);
    });
    std::vector<Circle> circles;
    for (const Ballot::Choice& choice : choices) {
        if (circles.size() == count) break;
        const bool known = std::ranges::any_of(
            circles, [&](const Circle& other) { return sameCircle(other, choice.circle); });
        if (!known) circles.push_back(choice.circle);
    }
    return circles;
}

}  // namespace insitu::detail
