#pragma once

#include "capture/bracket.h"
#include "core/parallel.h"
#include "core/random.h"
#include "tests/capture/synthetic_bracket.h"

#include <glm/glm.hpp>

#include <algorithm>
#include <cmath>
#include <functional>
#include <utility>
#include <vector>

namespace insitu {

/// Radiance at continuous coordinates of the reference picture: known between the pixels too.
using ContinuousScene = std::function<glm::dvec3(double x, double y)>;

/// A wall hung with `count` rectangles of all sizes, each with its own radiance over five orders of
/// magnitude and a fine texture; a few are lamps.
class RectangleScene {
public:
    RectangleScene(double width, double height, std::uint64_t seed, int count = 110)
    {
        RandomStream random(seed, 0, 0);
        const double side = std::max(width, height);
        for (int i = 0; i < count; ++i) {
            Rectangle r;
            // The scene goes on beyond the picture: what comes in at its border is unknown too.
            r.center = {(random.uniformDouble() * 1.6 - 0.3) * width,
                        (random.uniformDouble() * 1.6 - 0.3) * height};
            const double size = side * 0.2 * std::pow(random.uniformDouble(), 2.0) + 3.0;
            r.half = {size * (0.3 + random.uniformDouble()), size * (0.3 + random.uniformDouble())};
            const double angle = random.uniformDouble() * 6.283;
            r.across = {std::cos(angle), std::sin(angle)};
            const double level = std::pow(10.0, -2.6 + 2.2 * random.uniformDouble());
            r.radiance =
                (i % 23 == 0 ? 60.0 : 1.0) * level *
                glm::dvec3(
                    0.7 + 0.3 * random.uniformDouble(), 1.0, 0.6 + 0.4 * random.uniformDouble());
            r.frequency = 0.15 + 0.5 * random.uniformDouble();
            rectangles_.push_back(r);
        }
    }

    [[nodiscard]] glm::dvec3 operator()(double x, double y) const
    {
        glm::dvec3 radiance(0.02, 0.022, 0.02);
        for (const Rectangle& r : rectangles_) {
            const glm::dvec2 d = glm::dvec2(x, y) - r.center;
            if (std::max(std::abs(d.x), std::abs(d.y)) > r.half.x + r.half.y + 1.0) continue;
            const double u = glm::dot(d, r.across);
            const double v = d.y * r.across.x - d.x * r.across.y;
            // Outlines are soft over about a pixel, as a lens leaves them.
            const double inside = std::min(r.half.x - std::abs(u), r.half.y - std::abs(v)) + 0.5;
            if (inside <= 0.0) continue;
            const double texture =
                1.0 + 0.25 * std::sin(r.frequency * u) * std::sin(1.3 * r.frequency * v);
            radiance = glm::mix(radiance, texture * r.radiance, std::min(inside, 1.0));
        }
        return radiance;
    }

private:
    struct Rectangle {
        glm::dvec2 center;
        glm::dvec2 half;
        glm::dvec2 across;
        glm::dvec3 radiance;
        double frequency = 0.0;
    };
    std::vector<Rectangle> rectangles_;
};

/// The scene as a frame sees it, each pixel a mean of 2 x 2 places.
inline Image<Rgb> viewOf(const ContinuousScene& scene,
                         int width,
                         int height,
                         const glm::dmat3& frame_from_reference)
{
    Image<Rgb> view(width, height);
    const glm::dmat3 reference_from_frame = glm::inverse(frame_from_reference);
    parallelFor(0, height, [&](std::int64_t row) {
        const int y = static_cast<int>(row);
        for (int x = 0; x < width; ++x) {
            glm::dvec3 sum(0.0);
            for (int j = 0; j < 2; ++j) {
                for (int i = 0; i < 2; ++i) {
                    const glm::dvec3 at = reference_from_frame *
                                          glm::dvec3(x + 0.5 * i + 0.25, y + 0.5 * j + 0.25, 1.0);
                    sum += scene(at.x / at.z, at.y / at.z);
                }
            }
            view(x, y) = Rgb(0.25 * sum);
        }
    });
    return view;
}

/// A hand-held bracket: one frame an exposure, longest first, each from where its transform says.
inline Bracket photographHandheld(const ContinuousScene& scene,
                                  int width,
                                  int height,
                                  const std::vector<glm::dmat3>& frame_from_reference,
                                  const std::vector<double>& seconds,
                                  SyntheticCamera camera)
{
    std::vector<BracketFrame> frames;
    for (std::size_t k = 0; k < seconds.size(); ++k) {
        camera.seed += 1000;
        const Image<Rgb> view = viewOf(scene, width, height, frame_from_reference[k]);
        frames.push_back(std::move(photograph(view, {seconds[k]}, camera).frames.front()));
        frames.back().name = fmt::format("frame_{}", k);
    }
    return makeBracket(std::move(frames));
}

/// An 8-bit camera with a contrast curve (an S in codes over a power) and plenty of noise.
inline SyntheticCamera contrastyCamera(std::uint64_t seed)
{
    SyntheticCamera camera;
    camera.curve = [](int channel, double e) {
        const double power = std::pow(e, 1.0 / (2.0 + 0.1 * channel));
        return power + 0.35 * power * (1.0 - power) * (2.0 * power - 1.0);
    };
    camera.read_variance = 4e-6;
    camera.shot_variance = 1.0 / 3000.0;
    camera.seed = seed;
    return camera;
}

/// Shift in pixels and rotation about the middle of the picture.
inline glm::dmat3 rigidMotion(int width, int height, glm::dvec2 shift, double angle)
{
    const glm::dvec2 middle(0.5 * width, 0.5 * height);
    const double c = std::cos(angle);
    const double s = std::sin(angle);
    glm::dmat3 m(c, s, 0.0, -s, c, 0.0, 0.0, 0.0, 1.0);
    const glm::dvec2 moved(c * middle.x - s * middle.y, s * middle.x + c * middle.y);
    m[2] = glm::dvec3(middle + shift - moved, 1.0);
    return m;
}

/// A camera of focal length `focal_px` that turns: up, to the side and about its axis, radians.
inline glm::dmat3 turnedCamera(int width, int height, double focal_px, glm::dvec3 turn)
{
    const glm::dmat3 k(focal_px, 0.0, 0.0, 0.0, focal_px, 0.0, 0.5 * width, 0.5 * height, 1.0);
    const auto about = [](int axis, double angle) {
        glm::dmat3 r(1.0);
        const int a = (axis + 1) % 3;
        const int b = (axis + 2) % 3;
        r[a][a] = r[b][b] = std::cos(angle);
        r[a][b] = std::sin(angle);
        r[b][a] = -std::sin(angle);
        return r;
    };
    return k * about(0, turn.x) * about(1, turn.y) * about(2, turn.z) * glm::inverse(k);
}

/// How far two transforms put the corners of a picture apart, pixels: the largest of four.
inline double cornerError(const glm::dmat3& a, const glm::dmat3& b, int width, int height)
{
    double worst = 0.0;
    for (const double x : {0.0, static_cast<double>(width)}) {
        for (const double y : {0.0, static_cast<double>(height)}) {
            const glm::dvec3 in_a = a * glm::dvec3(x, y, 1.0);
            const glm::dvec3 in_b = b * glm::dvec3(x, y, 1.0);
            worst =
                std::max(worst, glm::length(glm::dvec2(in_a) / in_a.z - glm::dvec2(in_b) / in_b.z));
        }
    }
    return worst;
}

}  // namespace insitu
