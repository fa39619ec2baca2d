#include "calib/lens_distortion.h"

#include "core/check.h"

#include <fmt/format.h>

namespace insitu {

namespace {

/// Below this share of magnification the model has left the lens it describes.
constexpr double kFold = 0.1;

glm::dvec2 middle(const LineSet& lines)
{
    return glm::dvec2(lines.width, lines.height) * 0.5;
}

/// 1 + λ r²/R².
double divisor(double radius_px, const LineSet& lines)
{
    const double half_diagonal = glm::length(middle(lines));
    const double relative = radius_px / half_diagonal;
    return 1.0 + lines.distortion.division * relative * relative;
}

}  // namespace

glm::dvec2 straightened(glm::dvec2 pixel, const LineSet& lines)
{
    if (lines.distortion.division == 0.0) return pixel;
    const glm::dvec2 off = pixel - middle(lines);
    const double scale = divisor(lines.distortion.unchanged_radius_px, lines);
    return middle(lines) + off * (scale / divisor(glm::length(off), lines));
}

LineSet straightened(const LineSet& lines, const std::string& source)
{
    LineSet result = lines;
    result.distortion = {};
    const auto straighten = [&](glm::dvec2& point) {
        if (divisor(glm::length(point - middle(lines)), lines) < kFold)
            throw InputError(source,
                             "distortion",
                             fmt::format("division {} folds the picture over at ({:.1f}, {:.1f})",
                                         lines.distortion.division,
                                         point.x,
                                         point.y));
        point = straightened(point, lines);
    };
    for (LineSegment& segment : result.segments) {
        straighten(segment.from_px);
        straighten(segment.to_px);
    }
    for (KnownLength& length : result.lengths) {
        straighten(length.from_px);
        straighten(length.to_px);
    }
    straighten(result.origin_px);
    return result;
}

Findings distortionFindings(const LineSet& lines)
{
    if (lines.distortion.division == 0.0) return {};
    const double at_corner = glm::length(straightened(glm::dvec2(0.0), lines));
    const double at_origin = glm::length(straightened(lines.origin_px, lines) - lines.origin_px);
    return {
        {Severity::Warning,
         "lens-distortion-approximated",
         fmt::format("the lens bends lines; the camera that is used does not: it is right {:.0f} "
                     "px from the picture's middle, off by {:.1f} px at the origin and by {:.1f} "
                     "px in the corners. Better: straighten the photograph first",
                     lines.distortion.unchanged_radius_px,
                     at_origin,
                     at_corner)}};
}

}  // namespace insitu
