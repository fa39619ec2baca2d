#pragma once

#include "calib/camera_errors.h"
#include "calib/manhattan_search.h"

/// Internal to calib/: how far an answer can be trusted. Not installed.
namespace insitu::manhattan {

struct Doubt {
    double focal = 0.0;     ///< σ of ln f
    double rotation = 0.0;  ///< radians
    OrientationCovariance covariance{};
};

/// Scatter of the frame when the picture's parts are drawn anew with repetition, which shows what
/// hangs on a few of them, together with what the principal point's error does.
///
/// Drawn are squares of a sixth of the long side with all segments whose middle is in them, not the
/// segments one by one: edges of one thing share its direction, and a thing that stands askew would
/// vouch for itself. Draws that leave the focal length open count as if nothing but what lenses are
/// in use were known of it.
///
/// principal_sigma   of each coordinate, share of the long side
/// Source: [EfrTib93] chapter 6 for the bootstrap, 8.6 for drawing blocks of what hangs together;
/// fixed seed, deterministic.
[[nodiscard]] Doubt doubtOf(const Task& task, const Frame& frame, double principal_sigma);

}  // namespace insitu::manhattan
