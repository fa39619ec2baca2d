#pragma once

#include "composite/match/camera_match.h"
#include "core/response_curve.h"

#include <cstdint>

namespace insitu {

/// The noise of a photograph in its codes and in radiance; private to this module.
class PhotoNoise {
public:
    PhotoNoise(const GrainModel& grain,
               const ResponseCurve& response,
               double relative_exposure,
               int max_code)
        : grain_(grain),
          response_(response),
          relative_exposure_(relative_exposure),
          code_step_(255.0 / max_code)
    {
    }
    /// 8-bit code, fractional, of a radiance.
    [[nodiscard]] double codeOf(int channel, double radiance) const
    {
        return response_.encode(channel, radiance * relative_exposure_);
    }
    /// Rise of the code with the radiance there.
    [[nodiscard]] double slope(int channel, double code) const;
    /// Standard deviation that grain gives the code.
    [[nodiscard]] double codeSigma(int channel, double code) const
    {
        return grain_.sigmaAt(channel, code);
    }
    /// Variance of the radiance that decodes from it: grain and rounding.
    [[nodiscard]] double radianceVariance(int channel, double code) const;

private:
    const GrainModel& grain_;
    const ResponseCurve& response_;
    double relative_exposure_;
    double code_step_;  ///< of the photograph, in 8-bit codes
};

/// One channel of a changed pixel: radiances, and the variance of the renderer's own noise.
struct PixelChange {
    double before = 0.0;
    double after = 0.0;
    double object = 0.0;  ///< share of `after` that was rendered
    double object_variance = 0.0;
};

/// Gives changed pixels the grain they lack, dithers what has none, and rounds.
class GrainFinisher {
public:
    /// For the pixels that `influence` marks. Keeps references to the arguments.
    GrainFinisher(const CameraMatch& match,
                  const PhotoNoise& noise,
                  const Image<std::uint8_t>& influence);

    /// The code, of max_code steps. A rendered share has the renderer's noise alone; what is left
    /// of the photograph keeps its noise in proportion to its light.
    [[nodiscard]] std::uint16_t finish(
        int x, int y, int channel, const PixelChange& change, int max_code) const;

private:
    const CameraMatch& match_;
    const PhotoNoise& noise_;
    int x0_ = 0;
    int y0_ = 0;
    int width_ = 0;       ///< of the photograph
    Image<Rgb> texture_;  ///< over the box of what is influenced
};

}  // namespace insitu
