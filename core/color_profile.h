#pragma once

#include "core/image.h"
#include "core/response_curve.h"

#include <string>

namespace insitu {

/// How a picture's codes stand for colour: curves of the single channels, then a matrix. By
/// default sRGB, which pictures without a profile count as.
///
/// The curves are the profile's own. Where the camera's response is recovered or given, it stands
/// in their place (a camera does not follow the curve that it names), and the matrix stays.
struct ColorProfile {
    std::string name = "sRGB";
    /// Linear Rec. 709 (D65) from the picture's linear channels; invertible. White stays white.
    glm::dmat3 rec709_from_linear{1.0};
    /// The profile's curves, exposure 1 at the largest code.
    ResponseCurve transfer = ResponseCurve::srgb();
    /// The curves are what the sensor did (RAW): there is nothing to recover.
    bool transfer_is_response = false;

    [[nodiscard]] bool hasRec709Primaries() const { return rec709_from_linear == glm::dmat3(1.0); }
};

/// Whether codes of both mean the same: equal curves, and matrices within `tolerance` of each other
/// in every element (0: equal).
[[nodiscard]] bool sameColors(const ColorProfile& a, const ColorProfile& b, double tolerance = 0.0);

/// Multiplies every pixel by the matrix. A colour outside the primaries gets a negative channel,
/// which becomes 0. Returns the share of pixels where that took more than 1 % of the largest
/// channel, in [0, 1]. The identity changes nothing.
double convertPixels(Image<Rgb>& linear, const glm::dmat3& to_from_linear);

}  // namespace insitu
