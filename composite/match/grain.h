#pragma once

#include "core/finding.h"
#include "core/photo.h"
#include "core/response_curve.h"

#include <glm/glm.hpp>

#include <array>
#include <vector>

namespace insitu {

/// Variance of rounding to whole 8-bit codes.
inline constexpr double kRoundingVariance = 1.0 / 12.0;

/// Noise of one photograph as its pixels show it: after demosaicing, the camera's own smoothing and
/// JPEG.
///
/// A code is its expectation plus sigma(level) · n, n of unit variance in each channel and
/// correlated between neighbours and channels as the photograph's noise is. Rounding to codes is
/// not part of it.
struct GrainModel {
    /// Levels at which `sigma` stands: the middles of this many equal ranges of [0, 255].
    static constexpr int kLevels = 32;
    /// Standard deviation by channel and level, steps of 8-bit codes, >= 0.
    std::array<std::array<double, kLevels>, 3> sigma{};
    /// Taps that make n out of white noise of unit variance: rows of a square, side 2·radius + 1.
    std::vector<glm::mat3> kernel{glm::mat3(1.0f)};
    int radius = 0;

    /// Standard deviation at a code in [0, 255], linear between levels.
    [[nodiscard]] double sigmaAt(int channel, double code) const;
};

struct GrainEstimate {
    GrainModel model;
    /// Share of the photograph's blocks that are flat enough to tell noise from texture.
    double flat_fraction = 0.0;
    Findings findings;  ///< "grain-unknown": fewer than 40 flat blocks; the model then adds nothing
};

/// Noise against level and its correlation, from the photograph itself.
///
/// Blocks of 16×16 pixels lose a plane; what is left is noise where it is as small as that of the
/// flattest blocks of the same level, else texture. The level's dependence follows the sensor,
///     var(z) = (a + b E(z)) (dz/dE)² + q,   E the response's exposure,
/// with a measured correction by level (JPEG and noise reduction bend it). Correlation up to 4
/// pixels is the normalised residuals' own. Within 12 % of the truth (6 % rms) at every level
/// of simulated photographs of which half is flat. Depends on nothing but its arguments.
/// Sources: [LiuFreSze06] section 2 for levels, [Foi08] equation 1 for the sensor.
[[nodiscard]] GrainEstimate estimateGrain(const EncodedImage& photo, const ResponseCurve& response);

/// n for the pixels of a rectangle of the photograph, x0 <= x < x0 + width, y likewise: a function
/// of (seed, pixel) alone, so that rectangles agree where they overlap.
[[nodiscard]] Image<Rgb> grainTexture(
    const GrainModel& model, int x0, int y0, int width, int height, std::uint64_t seed);

}  // namespace insitu
