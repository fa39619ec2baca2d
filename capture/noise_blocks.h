#pragma once

#include "capture/bracket.h"
#include "core/response_curve.h"

#include <array>
#include <cstdint>
#include <vector>

namespace insitu {

/// One channel of a block of 16x16 pixels in two frames of one scene, as exposures: second moments
/// of both after a plane was taken out of each.
struct NoiseBlock {
    /// Blocks span several of JPEG's 8x8, whose own means are coded too.
    static constexpr int kSide = 16;
    /// Pixels less the plane that is taken out.
    static constexpr double kFreedoms = kSide * kSide - 3;

    double x1 = 0.0;  ///< mean exposure in the longer frame
    double x2 = 0.0;  ///< in the shorter frame
    double z1 = 0.0;  ///< their codes, 8-bit steps
    double z2 = 0.0;
    double var1 = 0.0;
    double var2 = 0.0;  ///< of rho x_2
    double covariance = 0.0;
    double neighbours = 0.0;  ///< mean product of residuals side by side
    double rho = 1.0;
    double flatness = 0.0;  ///< variance of the best mean of both, over what noise explains

    [[nodiscard]] double residual() const { return var1 + var2 - 2.0 * covariance; }
};

/// Reads blocks; safe to share between threads.
class NoiseBlockReader {
public:
    /// Keeps a reference to `response`.
    NoiseBlockReader(const ResponseCurve& response, int max_code);

    /// At most `most` blocks, evenly from the whole picture, for each channel those whose codes are
    /// away from black and clipping in both frames. None when a frame has another max_code.
    [[nodiscard]] std::array<std::vector<NoiseBlock>, 3> read(const BracketFrame& longer,
                                                              const BracketFrame& shorter,
                                                              std::int64_t most) const;

private:
    using Samples = std::array<double, NoiseBlock::kSide * NoiseBlock::kSide>;

    /// Codes of one channel of a block as exposures times `factor`; false when one is unusable.
    [[nodiscard]] bool readSamples(
        const EncodedImage& image, int x0, int y0, int c, double factor, Samples& samples) const;

    const ResponseCurve& response_;
    int max_code_;
    std::array<std::vector<double>, 3> exposure_;  ///< by code
};

}  // namespace insitu
