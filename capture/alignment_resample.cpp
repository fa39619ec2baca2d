#include "capture/alignment.h"
#include "capture/matched_pyramid.h"
#include "core/check.h"
#include "core/parallel.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace insitu {

namespace {

/// Cubic convolution with a = -1/2 [Keys81], section III: weights of the taps at -1, 0, 1, 2.
std::array<float, 4> cubicWeights(float t)
{
    const float u = 1.0f - t;
    return {-0.5f * t * u * u,
            1.0f + t * t * (1.5f * t - 2.5f),
            1.0f + u * u * (1.5f * u - 2.5f),
            -0.5f * u * t * t};
}

/// One frame that is looked at from elsewhere.
class FrameSampler {
public:
    explicit FrameSampler(const BracketFrame& frame)
        : frame_(frame), clip_code_(static_cast<int>(detail::kClipShare * frame.image.max_code))
    {
    }

    struct Sample {
        glm::u16vec3 code{0};
        bool excluded = true;
    };

    /// At continuous coordinates of the frame.
    [[nodiscard]] Sample at(double x, double y) const
    {
        const Image<glm::u16vec3>& codes = frame_.image.codes;
        const int max_code = frame_.image.max_code;
        Sample sample;
        sample.code = glm::u16vec3(static_cast<std::uint16_t>(max_code));
        const double column = x - 0.5;
        const double row = y - 0.5;
        if (!(column >= 0.0 && row >= 0.0 && column <= codes.width() - 1.0 &&
              row <= codes.height() - 1.0))
            return sample;
        const int x0 = std::min(static_cast<int>(column), std::max(codes.width() - 2, 0));
        const int y0 = std::min(static_cast<int>(row), std::max(codes.height() - 2, 0));
        const auto tx = static_cast<float>(column - x0);
        const auto ty = static_cast<float>(row - y0);
        Taps taps;
        for (int j = 0; j < 4; ++j) {
            for (int i = 0; i < 4; ++i) {
                const int px = std::clamp(x0 + i - 1, 0, codes.width() - 1);
                const int py = std::clamp(y0 + j - 1, 0, codes.height() - 1);
                const std::size_t tap = static_cast<std::size_t>(4 * j + i);
                taps.code[tap] = codes(px, py);
                const bool inner = (i == 1 || i == 2) && (j == 1 || j == 2) &&
                                   isNear(i == 1 ? tx : 1.0f - tx) &&
                                   isNear(j == 1 ? ty : 1.0f - ty);
                if (frame_.excluded.empty() || frame_.excluded(px, py) == 0) continue;
                if (inner) return sample;
                taps.outer_excluded = true;
            }
        }
        sample.excluded = false;
        for (int c = 0; c < 3; ++c)
            sample.code[c] = static_cast<std::uint16_t>(interpolate(taps, c, tx, ty));
        return sample;
    }

private:
    struct Taps {
        std::array<glm::u16vec3, 16> code;
        bool outer_excluded = false;
    };

    /// Does a neighbour at this distance count? Not one a whole pixel away, up to rounding.
    [[nodiscard]] static bool isNear(float distance) { return distance < 0.999f; }

    [[nodiscard]] int interpolate(const Taps& taps, int c, float tx, float ty) const
    {
        int lowest = frame_.image.max_code;
        int highest = 0;
        for (const glm::u16vec3& code : taps.code) {
            lowest = std::min<int>(lowest, code[c]);
            highest = std::max<int>(highest, code[c]);
        }
        const auto code = [&](int i, int j) {
            return static_cast<int>(taps.code[static_cast<std::size_t>(4 * j + i)][c]);
        };
        for (int j = 1; j <= 2; ++j)
            for (int i = 1; i <= 2; ++i)
                if (code(i, j) > clip_code_ && isNear(i == 1 ? tx : 1.0f - tx) &&
                    isNear(j == 1 ? ty : 1.0f - ty))
                    return frame_.image.max_code;
        // A clipped or excluded tap farther out would pull through its negative weight: leave the
        // outer taps out.
        const bool bilinear = highest > clip_code_ || taps.outer_excluded;
        const std::array<float, 4> wx =
            bilinear ? std::array<float, 4>{0.0f, 1.0f - tx, tx, 0.0f} : cubicWeights(tx);
        const std::array<float, 4> wy =
            bilinear ? std::array<float, 4>{0.0f, 1.0f - ty, ty, 0.0f} : cubicWeights(ty);
        float sum = 0.0f;
        for (int j = 0; j < 4; ++j)
            for (int i = 0; i < 4; ++i)
                sum += wx[static_cast<std::size_t>(i)] * wy[static_cast<std::size_t>(j)] *
                       static_cast<float>(code(i, j));
        return std::clamp(static_cast<int>(std::lround(sum)), lowest, highest);
    }

    const BracketFrame& frame_;
    int clip_code_;
};

BracketFrame resampled(const BracketFrame& frame, const glm::dmat3& frame_from_reference)
{
    const int width = frame.image.codes.width();
    const int height = frame.image.codes.height();
    BracketFrame result;
    result.name = frame.name;
    result.relative_exposure = frame.relative_exposure;
    result.image.max_code = frame.image.max_code;
    result.image.codes = Image<glm::u16vec3>(width, height);
    result.excluded = Image<std::uint8_t>(width, height);
    const FrameSampler sampler(frame);
    parallelFor(0, height, [&](std::int64_t row) {
        const int y = static_cast<int>(row);
        for (int x = 0; x < width; ++x) {
            const glm::dvec3 at = frame_from_reference * glm::dvec3(x + 0.5, y + 0.5, 1.0);
            FrameSampler::Sample sample;
            sample.code = glm::u16vec3(static_cast<std::uint16_t>(frame.image.max_code));
            if (at.z > 0.0) sample = sampler.at(at.x / at.z, at.y / at.z);
            result.image.codes(x, y) = sample.code;
            result.excluded(x, y) = sample.excluded ? 1 : 0;
        }
    });
    return result;
}

}  // namespace

Bracket applyAlignment(Bracket bracket, const Alignment& alignment)
{
    INSITU_CHECK(alignment.frame_from_reference.size() == bracket.frames.size(),
                 "{} transforms for {} frames",
                 alignment.frame_from_reference.size(),
                 bracket.frames.size());
    for (std::size_t k = 0; k < bracket.frames.size(); ++k) {
        const glm::dmat3& transform = alignment.frame_from_reference[k];
        for (int column = 0; column < 3; ++column)
            for (int row = 0; row < 3; ++row)
                INSITU_CHECK(std::isfinite(transform[column][row]), "frame {}", k);
        if (transform == glm::dmat3(1.0)) continue;
        bracket.frames[k] = resampled(bracket.frames[k], transform);
    }
    return bracket;
}

}  // namespace insitu
