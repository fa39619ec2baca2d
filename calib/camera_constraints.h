#pragma once

#include <Eigen/Geometry>
#include <ceres/jet.h>

#include <cmath>

/// Internal to calib/: what a camera says about points of a picture, as equations that are zero.
/// Written for plain numbers and for ceres::Jet, so that derivatives are automatic. Not installed.
///
/// Points are pixels as marked; `Lens` straightens them (core/camera.h). Every equation returns
/// false where it means nothing: a floor point above the horizon, a point behind the camera.
namespace insitu::calibration {

template <typename T>
using Vec2 = Eigen::Matrix<T, 2, 1>;
template <typename T>
using Vec3 = Eigen::Matrix<T, 3, 1>;

/// A camera whose numbers may carry derivatives.
template <typename T>
struct View {
    Eigen::Matrix<T, 3, 3> camera_from_world;
    T log_focal;
    T focal;
    Vec2<T> principal;
    T division;
    double square_half_diagonal = 1.0;
    Vec3<T> position;

    /// Where a lens without distortion shows the marked point, relative to the principal point.
    [[nodiscard]] Vec2<T> straight(const T* pixel) const
    {
        const Vec2<T> off(pixel[0] - principal[0], pixel[1] - principal[1]);
        const T divisor = 1.0 + division * (off.squaredNorm() / square_half_diagonal);
        return off / divisor;
    }
    /// Direction in the world of what is seen at a marked point, not normalised.
    [[nodiscard]] Vec3<T> ray(const T* pixel) const
    {
        const Vec2<T> at = straight(pixel);
        return camera_from_world.transpose() * Vec3<T>(at[0], at[1], focal);
    }
};

/// Rays that fall less than this share of their length meet the floor too far away to be measured.
inline constexpr double kHorizon = 1e-3;

template <typename T>
T crossOf(const Vec2<T>& a, const Vec2<T>& b)
{
    return a[0] * b[1] - a[1] * b[0];
}

/// The segment between two points runs along room axis `axis`.
///
/// With the vanishing point v = (f d.x, f d.y; d.z), the matrix D of the rows v.xy − a v.z and
/// v.xy − b v.z has a determinant d.z · q, q = v.xy × (a − b) + d.z a × b, which is finite for
/// parallel lines, and q / |D| is the ends' distance from the best line through v but for a factor
/// that is 1 to first order.
template <typename T>
bool alongAxis(const View<T>& view, int axis, const T* x, T* out)
{
    const Vec3<T> d = view.camera_from_world.col(axis);
    const Vec2<T> a = view.straight(x);
    const Vec2<T> b = view.straight(x + 2);
    const Vec2<T> v(view.focal * d[0], view.focal * d[1]);
    const T q = crossOf<T>(v, a - b) + d[2] * crossOf(a, b);
    const T square = (v - a * d[2]).squaredNorm() + (v - b * d[2]).squaredNorm();
    using std::sqrt;
    if (!(square > 0.0)) return false;
    out[0] = q / sqrt(square);
    return true;
}

/// Three points lie on one line of the room: the middle one's distance from the others' line.
template <typename T>
bool straightLine(const View<T>& view, const T* x, T* out)
{
    const Vec2<T> from = view.straight(x);
    const Vec2<T> along = view.straight(x + 4) - from;
    const T square = along.squaredNorm();
    using std::sqrt;
    if (!(square > 0.0)) return false;
    out[0] = crossOf<T>(along, view.straight(x + 2) - from) / sqrt(square);
    return true;
}

/// A point at x[2..4] in the world is seen at x[0..1]: both straight coordinates.
template <typename T>
bool worldPoint(const View<T>& view, const T* x, T* out)
{
    const Vec3<T> d = view.camera_from_world * (Vec3<T>(x[2], x[3], x[4]) - view.position);
    if (!(d[2] > 1e-9)) return false;
    const Vec2<T> seen = view.straight(x);
    out[0] = seen[0] - view.focal * d[0] / d[2];
    out[1] = seen[1] - view.focal * d[1] / d[2];
    return true;
}

/// Floor point seen at a marked pixel, relative to the camera, for a camera 1 above the floor.
template <typename T>
bool onFloor(const View<T>& view, const T* pixel, Vec3<T>& point)
{
    using std::sqrt;
    const Vec3<T> ray = view.ray(pixel);
    if (!(ray[1] < -kHorizon * sqrt(ray.squaredNorm()))) return false;
    point = ray / -ray[1];
    return true;
}

/// A length on the floor in units of the camera's height.
template <typename T>
bool floorLength(const View<T>& view, const T* x, T& per_height)
{
    using std::sqrt;
    Vec3<T> from;
    Vec3<T> to;
    if (!onFloor(view, x, from) || !onFloor(view, x + 2, to)) return false;
    const T square = (to - from).squaredNorm();
    if (!(square > 0.0)) return false;
    per_height = sqrt(square);
    return true;
}

/// The same of an upright from a floor point: the height at which the ray to its upper end is
/// horizontally nearest to the vertical.
template <typename T>
bool uprightLength(const View<T>& view, const T* x, T& per_height)
{
    Vec3<T> from;
    if (!onFloor(view, x, from)) return false;
    const Vec3<T> ray = view.ray(x + 2);
    const T level = ray[0] * ray[0] + ray[2] * ray[2];
    if (!(level > 0.0)) return false;
    const T along = (ray[0] * from[0] + ray[2] * from[2]) / level;
    per_height = along * ray[1] + 1.0;
    return along > 0.0 && per_height > 0.0;
}

/// Metres of a length (x[4]) against what the camera's height makes of it.
template <typename T>
bool knownLength(const View<T>& view, bool upright, const T* x, T* out)
{
    T per_height;
    if (!(upright ? uprightLength(view, x, per_height) : floorLength(view, x, per_height)))
        return false;
    out[0] = view.position[1] * per_height - x[4];
    return true;
}

/// Two lines on the floor from x[0..1] to x[2..3] and to x[4..5] are at right angles: the cosine.
template <typename T>
bool floorRightAngle(const View<T>& view, const T* x, T* out)
{
    using std::sqrt;
    Vec3<T> corner;
    Vec3<T> a;
    Vec3<T> b;
    if (!onFloor(view, x, corner) || !onFloor(view, x + 2, a) || !onFloor(view, x + 4, b))
        return false;
    a -= corner;
    b -= corner;
    const T squares = a.squaredNorm() * b.squaredNorm();
    if (!(squares > 0.0)) return false;
    out[0] = a.dot(b) / sqrt(squares);
    return true;
}

/// Two sides of a rectangle, up to a common factor, from its four corners in order.
///
/// With rays r_i and corners s_i r_i, s_0 r_0 − s_1 r_1 + s_2 r_2 − s_3 r_3 = 0 makes a
/// parallelogram; by Cramer's rule s_0 = [r_1 r_2 r_3], s_1 = [r_0 r_2 r_3] and so on.
template <typename T>
bool rectangleSides(const View<T>& view, const T* x, Vec3<T>& first, Vec3<T>& second)
{
    Vec3<T> r[4];
    for (int i = 0; i < 4; ++i) {
        const Vec2<T> at = view.straight(x + 2 * i);
        r[i] = Vec3<T>(at[0] / view.focal, at[1] / view.focal, T(1.0));
    }
    const auto volume = [&](int a, int b, int c) { return r[a].dot(r[b].cross(r[c])); };
    const T s[4] = {volume(1, 2, 3), volume(0, 2, 3), volume(0, 1, 3), volume(0, 1, 2)};
    const bool positive = s[0] > 0.0;
    for (const T& one : s)
        if (!(positive ? one > 0.0 : one < 0.0)) return false;
    first = r[1] * s[1] - r[0] * s[0];
    second = r[3] * s[3] - r[0] * s[0];
    return first.squaredNorm() > 0.0 && second.squaredNorm() > 0.0;
}

/// Rows: cosine between the sides; ln of their ratio against `ratio` (> 0); both sides' slopes
/// against the floor. The last three only where asked.
template <typename T>
bool rectangle(const View<T>& view, double ratio, bool on_floor, const T* x, T* out)
{
    using std::log;
    using std::sqrt;
    Vec3<T> first;
    Vec3<T> second;
    if (!rectangleSides(view, x, first, second)) return false;
    const T width = sqrt(first.squaredNorm());
    const T height = sqrt(second.squaredNorm());
    int row = 0;
    out[row++] = first.dot(second) / (width * height);
    if (ratio > 0.0) out[row++] = log(width / height) - std::log(ratio);
    if (on_floor) {
        const Vec3<T> up = view.camera_from_world.col(1);
        out[row++] = up.dot(first) / width;
        out[row++] = up.dot(second) / height;
    }
    return true;
}

}  // namespace insitu::calibration
