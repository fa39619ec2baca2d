#include "calib/lens_distortion.h"

#include "core/camera.h"
#include "core/check.h"

#include <fmt/format.h>

namespace insitu {

namespace {

/// Above this magnification the model has left the lens it describes.
constexpr double kFold = 10.0;

}  // namespace

LineSet straightened(const LineSet& lines,
                     glm::dvec2 principal_px,
                     double division,
                     const std::string& source)
{
    Camera lens;
    lens.width = lines.width;
    lens.height = lines.height;
    lens.principal_px = principal_px;
    lens.division = division;
    LineSet result = lines;
    result.distortion = {};
    const auto straighten = [&](glm::dvec2& point) {
        const glm::dvec2 marked = point;
        point = lens.straightened(marked);
        if (glm::length(point - lens.principal_px) >
            kFold * glm::length(marked - lens.principal_px))
            throw InputError(source,
                             "distortion",
                             fmt::format("division {} folds the picture over at ({:.1f}, {:.1f})",
                                         lens.division,
                                         marked.x,
                                         marked.y));
    };
    for (LineSegment& segment : result.segments) {
        straighten(segment.from_px);
        straighten(segment.to_px);
        segment.via_px.clear();
    }
    return result;
}

}  // namespace insitu
