#include "lighting/silhouette_raster.h"

#include "core/check.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace insitu {

namespace {

using Point = float __attribute__((vector_size(16)));
using Mask = int __attribute__((vector_size(16)));

constexpr float kNothingNear = std::numeric_limits<float>::max();
constexpr float kNothingFar = -std::numeric_limits<float>::max();
/// In samples: neighbours that share an edge may compute it a rounding apart; rather draw a sample
/// twice than leave a hole.
constexpr float kEdgeSlack = 1e-3f;
/// Twice the area, in samples², below which a triangle is seen from its edge.
constexpr float kEdgeOnArea = 1e-5f;
/// Smallest extent of an outline, in radii: an object without thickness has some along its plane.
constexpr double kMinExtent = 1e-4;

Point smaller(Point a, Point b)
{
    return a < b ? a : b;
}
Point larger(Point a, Point b)
{
    return a > b ? a : b;
}

/// Place on a Z-order curve through the local cube [-1, 1]³: neighbours in space are neighbours in
/// memory.
std::uint64_t alongCurve(glm::vec3 p)
{
    std::uint64_t place = 0;
    constexpr int kBits = 10;
    for (int axis = 0; axis < 3; ++axis) {
        const float unit = std::clamp(0.5f * p[axis] + 0.5f, 0.0f, 1.0f);
        const auto cell = static_cast<std::uint64_t>(unit * ((1 << kBits) - 1));
        for (int bit = 0; bit < kBits; ++bit)
            place |= ((cell >> bit) & 1u) << (3 * bit + axis);
    }
    return place;
}

/// The box around a triangle, with the samples whose centre (k + 0.5) lies in it.
struct Box {
    Point low, high;
    Mask first, last;  ///< `last` is one past the last

    Box(const Point& a, const Point& b, const Point& c)
        : low(smaller(smaller(a, b), c)),
          high(larger(larger(a, b), c)),
          first(__builtin_convertvector(low + (0.5f - kEdgeSlack), Mask)),
          last(__builtin_convertvector(high + (0.5f + kEdgeSlack), Mask))
    {
    }
    [[nodiscard]] Mask size() const { return last - first; }
};

/// Two unit vectors across a unit direction. Source: [Duff17].
void basisAcross(glm::dvec3 d, glm::dvec3& u, glm::dvec3& v)
{
    const double sign = std::copysign(1.0, d.z);
    const double a = -1.0 / (sign + d.z);
    const double b = d.x * d.y * a;
    u = {1.0 + sign * d.x * d.x * a, sign * b, -sign * d.x};
    v = {b, sign + d.y * d.y * a, -d.y};
}

}  // namespace

RasterMesh rasterMesh(const TriangleMesh& mesh, const LocalFrame& local)
{
    struct Placed {
        std::uint64_t place = 0;
        glm::uvec3 triangle{0};
    };
    std::vector<Placed> placed;
    placed.reserve(mesh.triangles.size());
    for (const glm::uvec3& t : mesh.triangles) {
        glm::vec3 sum(0.0f);
        for (int corner = 0; corner < 3; ++corner) {
            INSITU_CHECK(t[corner] < mesh.positions.size(), "vertex {}", t[corner]);
            sum += local.localFrom(mesh.positions[t[corner]]);
        }
        if (std::isfinite(sum.x) && std::isfinite(sum.y) && std::isfinite(sum.z))
            placed.push_back({alongCurve(sum / 3.0f), t});
    }
    std::ranges::stable_sort(placed, {}, &Placed::place);

    RasterMesh made;
    constexpr auto kUnused = std::numeric_limits<std::uint32_t>::max();
    std::vector<std::uint32_t> renamed(mesh.positions.size(), kUnused);
    const auto rename = [&](std::uint32_t i) {
        if (renamed[i] == kUnused) {
            renamed[i] = static_cast<std::uint32_t>(made.x.size());
            const glm::vec3 p = local.localFrom(mesh.positions[i]);
            made.x.push_back(p.x);
            made.y.push_back(p.y);
            made.z.push_back(p.z);
        }
        return renamed[i];
    };
    made.triangles.reserve(placed.size());
    for (const Placed& item : placed) {
        const std::uint32_t a = rename(item.triangle.x);
        const std::uint32_t b = rename(item.triangle.y);
        made.triangles.emplace_back(a, b, rename(item.triangle.z));
    }
    return made;
}

SilhouetteRaster::SilhouetteRaster(const RasterMesh& mesh, int resolution, int samples)
    : mesh_(mesh),
      resolution_(resolution),
      samples_(samples),
      side_(resolution * samples),
      points_(mesh.x.size()),
      near_(static_cast<std::size_t>(side_) * static_cast<std::size_t>(side_)),
      far_(near_.size())
{
}

SilhouetteFrame SilhouetteRaster::project(glm::dvec3 direction)
{
    glm::dvec3 u, v;
    basisAcross(direction, u, v);
    const auto row = [&](int axis) {
        return Point{static_cast<float>(u[axis]),
                     static_cast<float>(v[axis]),
                     static_cast<float>(direction[axis]),
                     0.0f};
    };
    const Point from_x = row(0);
    const Point from_y = row(1);
    const Point from_z = row(2);
    Point low = Point{} + kNothingNear;
    Point high = Point{} + kNothingFar;
    for (std::size_t i = 0; i < points_.size(); ++i) {
        const Point p = mesh_.x[i] * from_x + mesh_.y[i] * from_y + mesh_.z[i] * from_z;
        points_[i] = p;
        low = smaller(low, p);
        high = larger(high, p);
    }

    // The outline spans all but the outer ring of texels, the depth all codes but the outermost.
    const auto stretch = [&](int axis, double from, double to) {
        const double extent = std::max(static_cast<double>(high[axis]) - low[axis], kMinExtent);
        const double scale = (to - from) / extent;
        const double middle = 0.5 * (static_cast<double>(low[axis]) + high[axis]);
        return glm::dvec2(scale, 0.5 * (from + to) - scale * middle);
    };
    const glm::dvec2 x = stretch(0, samples_, side_ - samples_);
    const glm::dvec2 y = stretch(1, samples_, side_ - samples_);
    const glm::dvec2 z = stretch(2, kMinDepthCode, kMaxDepthCode);
    const Point scale{
        static_cast<float>(x[0]), static_cast<float>(y[0]), static_cast<float>(z[0]), 0.0f};
    const Point offset{
        static_cast<float>(x[1]), static_cast<float>(y[1]), static_cast<float>(z[1]), 0.0f};
    for (Point& p : points_)
        p = p * scale + offset;

    SilhouetteFrame frame;
    frame.column_axis = glm::vec3(u * (x[0] / samples_));
    frame.column_offset = static_cast<float>(x[1] / samples_ - 0.5);
    frame.row_axis = glm::vec3(v * (y[0] / samples_));
    frame.row_offset = static_cast<float>(y[1] / samples_ - 0.5);
    frame.depth_axis = glm::vec3(direction * z[0]);
    frame.depth_offset = static_cast<float>(z[1]);
    frame.texel_depth = static_cast<float>(z[0] * samples_ * 0.5 * (1.0 / x[0] + 1.0 / y[0]));
    return frame;
}

/// Sorts some triangles by how many samples their box may hold: most of a fine mesh's hold none.
/// Without branches, since what a triangle holds cannot be foreseen.
SilhouetteRaster::Sorted SilhouetteRaster::sortTriangles(std::size_t begin, std::size_t end)
{
    Sorted count;
    const Point* const points = points_.data();
    for (std::size_t i = begin; i < end; ++i) {
        const glm::uvec3& t = mesh_.triangles[i];
        const Mask size = Box(points[t.x], points[t.y], points[t.z]).size();
        const auto index = static_cast<std::uint32_t>(i);
        small_[count.small] = index;
        large_[count.large] = index;
        const Mask positive = size > 0;  // all bits set where true
        const Mask above_two = size > 2;
        const int holds = positive[0] & positive[1];
        const int wide = above_two[0] | above_two[1];
        count.small += static_cast<std::size_t>(holds & ~wide & 1);
        count.large += static_cast<std::size_t>(holds & wide & 1);
    }
    return count;
}

/// A triangle whose box holds at most two rows and columns of samples: all four at once.
void SilhouetteRaster::fillSmall(const Point& a, const Point& b, const Point& c)
{
    const Box box(a, b, c);
    const int last = side_ - 2;
    const int column = std::clamp(box.first[0], 0, last);
    const int row = std::clamp(box.first[1], 0, last);
    const float left = static_cast<float>(column) + 0.5f;
    const float top = static_cast<float>(row) + 0.5f;
    const Point x{left, left + 1.0f, left, left + 1.0f};
    const Point y{top, top, top + 1.0f, top + 1.0f};

    const Point ab = b - a;
    const Point ac = c - a;
    const Point bc = c - b;
    const float area = ab[0] * ac[1] - ac[0] * ab[1];
    const float turn = std::copysign(1.0f, area);
    // Seen from its edge it holds no sample, and its plane says nothing about depth.
    const bool edge_on = std::abs(area) < kEdgeOnArea;
    const float slack = edge_on
                            ? kNothingNear
                            : -kEdgeSlack * (box.high[0] - box.low[0] + box.high[1] - box.low[1]);
    // Twice the areas of the triangles that the sample makes with each edge.
    const Point from_ax = x - a[0];
    const Point from_ay = y - a[1];
    const Point area_ab = turn * (ab[0] * from_ay - ab[1] * from_ax);
    const Point area_ca = turn * (ac[1] * from_ax - ac[0] * from_ay);
    const Point area_bc = turn * (bc[0] * (y - b[1]) - bc[1] * (x - b[0]));
    const Point least = smaller(smaller(area_ab, area_ca), area_bc);
    const Mask inside = least >= slack;

    const float share = turn / area;
    const Point depth =
        smaller(larger(a[2] + (area_ca * ab[2] + area_ab * ac[2]) * share, Point{} + box.low[2]),
                Point{} + box.high[2]);
    const Point as_near = inside ? depth : Point{} + kNothingNear;
    const Point as_far = inside ? depth : Point{} + kNothingFar;
    const auto side = static_cast<std::size_t>(side_);
    const std::size_t i = static_cast<std::size_t>(row) * side + static_cast<std::size_t>(column);
    float* const near = near_.data() + i;
    float* const far = far_.data() + i;
    const Point new_near = smaller(Point{near[0], near[1], near[side], near[side + 1]}, as_near);
    const Point new_far = larger(Point{far[0], far[1], far[side], far[side + 1]}, as_far);
    near[0] = new_near[0];
    near[1] = new_near[1];
    near[side] = new_near[2];
    near[side + 1] = new_near[3];
    far[0] = new_far[0];
    far[1] = new_far[1];
    far[side] = new_far[2];
    far[side + 1] = new_far[3];
}

/// Sets the samples whose centre lies in the triangle, row by row.
void SilhouetteRaster::fillLarge(const Point& a, const Point& b, const Point& c)
{
    const Box box(a, b, c);
    const Point ab = b - a;
    const Point ac = c - a;
    const float area = ab[0] * ac[1] - ac[0] * ab[1];
    if (std::abs(area) < kEdgeOnArea) return;
    const float slope_x = (ab[2] * ac[1] - ac[2] * ab[1]) / area;
    const float slope_y = (ac[2] * ab[0] - ab[2] * ac[0]) / area;

    // Of each edge: whether the inside lies left of it (+1) or right of it (-1), where it crosses.
    const Point* const corners[4] = {&a, &b, &c, &a};
    const float turn = std::copysign(1.0f, area);
    float rise[3], slope[3], start[3];
    for (int e = 0; e < 3; ++e) {
        const Point& p = *corners[e];
        const Point d = *corners[e + 1] - p;
        rise[e] = d[1] * turn;
        slope[e] = d[1] != 0.0f ? d[0] / d[1] : 0.0f;
        start[e] = p[0] - slope[e] * p[1];
    }
    const int last_row = std::min(box.last[1], side_);
    for (int row = std::max(box.first[1], 0); row < last_row; ++row) {
        const float y = static_cast<float>(row) + 0.5f;
        float from = box.low[0];
        float to = box.high[0];
        for (int e = 0; e < 3; ++e) {
            const float x = start[e] + slope[e] * y;
            if (rise[e] > 0.0f) to = std::min(to, x);
            if (rise[e] < 0.0f) from = std::max(from, x);
        }
        const int begin = std::max(static_cast<int>(from + (0.5f - kEdgeSlack)), 0);
        const int end = std::min(static_cast<int>(to + (0.5f + kEdgeSlack)), side_);
        const std::size_t base = static_cast<std::size_t>(row) * static_cast<std::size_t>(side_);
        for (int column = begin; column < end; ++column) {
            const float x = static_cast<float>(column) + 0.5f;
            const float depth = std::clamp(
                a[2] + slope_x * (x - a[0]) + slope_y * (y - a[1]), box.low[2], box.high[2]);
            const std::size_t i = base + static_cast<std::size_t>(column);
            near_[i] = std::min(near_[i], depth);
            far_[i] = std::max(far_[i], depth);
        }
    }
}

void SilhouetteRaster::resolve(std::uint8_t* coverage, DepthSpan* depths) const
{
    const auto side = static_cast<std::size_t>(side_);
    const auto samples = static_cast<std::size_t>(samples_);
    const auto resolution = static_cast<std::size_t>(resolution_);
    for (std::size_t row = 0; row < resolution; ++row)
        for (std::size_t column = 0; column < resolution; ++column) {
            int covered = 0;
            float near = 0.0f;
            float far = 0.0f;
            for (std::size_t j = 0; j < samples; ++j) {
                const std::size_t base = (row * samples + j) * side + column * samples;
                for (std::size_t i = base; i < base + samples; ++i) {
                    const bool hit = far_[i] >= near_[i];
                    covered += hit ? 1 : 0;
                    near += hit ? near_[i] : 0.0f;
                    far += hit ? far_[i] : 0.0f;
                }
            }
            const std::size_t texel = row * resolution + column;
            const int all = samples_ * samples_;
            coverage[texel] = static_cast<std::uint8_t>((255 * covered + all / 2) / all);
            if (covered == 0) {
                depths[texel] = DepthSpan{};
                continue;
            }
            const float share = 1.0f / static_cast<float>(covered);
            depths[texel] = {static_cast<std::uint16_t>(near * share + 0.5f),
                             static_cast<std::uint16_t>(far * share + 0.5f)};
        }
}

SilhouetteFrame SilhouetteRaster::draw(glm::dvec3 direction,
                                       std::uint8_t* coverage,
                                       DepthSpan* depths)
{
    const SilhouetteFrame frame = project(direction);
    std::ranges::fill(near_, kNothingNear);
    std::ranges::fill(far_, kNothingFar);
    const auto fill = [this](std::uint32_t index, auto method) {
        const glm::uvec3& t = mesh_.triangles[index];
        (this->*method)(points_[t.x], points_[t.y], points_[t.z]);
    };
    const std::size_t all = mesh_.triangles.size();
    for (std::size_t begin = 0; begin < all; begin += kBatch) {
        const Sorted count = sortTriangles(begin, std::min(begin + kBatch, all));
        for (std::size_t i = 0; i < count.small; ++i)
            fill(small_[i], &SilhouetteRaster::fillSmall);
        for (std::size_t i = 0; i < count.large; ++i)
            fill(large_[i], &SilhouetteRaster::fillLarge);
    }
    resolve(coverage, depths);
    return frame;
}

}  // namespace insitu
