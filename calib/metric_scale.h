#pragma once

#include "calib/line_segments.h"
#include "calib/orientation.h"
#include "core/camera.h"
#include "core/finding.h"

#include <glm/glm.hpp>

#include <string>

namespace insitu {

/// Where a camera of known rotation and focal length stands, in metres.
struct CameraPlace {
    glm::dvec3 position_m{0.0};
    glm::dvec3 position_sigma_m{0.0};
    Findings findings;
};

/// The ray through the origin's pixel meets the floor at the world's origin, hence
/// position = −h/ray.y · ray for a camera height h; h is given, or fitted to the known lengths by
/// least squares, each weighted by what the errors of its marked ends do to it. Errors of rotation,
/// focal length, marked points and height are propagated to first order with central differences.
///
/// camera        rotation, focal length and principal point are read
/// orientation   whose covariance belongs to that rotation and focal length
/// Findings: "scale-disagrees" when a given height and known lengths contradict each other, or the
/// lengths one another.
/// Throws NoAnswerError when the origin or the floor end of a length lies on or above the horizon,
/// or a vertical length has no height.
[[nodiscard]] CameraPlace placeCamera(const LineSet& lines,
                                      const Camera& camera,
                                      const OrientationEstimate& orientation,
                                      double sigma_px,
                                      const std::string& source);

}  // namespace insitu
