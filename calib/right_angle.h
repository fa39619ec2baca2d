#pragma once

#include "calib/manhattan_search.h"

/// Internal to calib/: whether the horizontal directions of an answer are at right angles. Not
/// installed.
namespace insitu::manhattan {

/// The answer again, with the angle between x and z left open.
struct RightAngle {
    double off = 0.0;    ///< by how much more than a right angle x and z enclose. Radians
    double sigma = 0.0;  ///< 1σ, the focal length's and the principal point's uncertainty included
    double focal_px = 0.0;
    double focal_sigma = 0.0;  ///< of ln f, when the right angle tells nothing
};

/// Two horizontal directions and no focal length: any angle between them goes with some focal
/// length, and most photographs of rooms are level enough that only the assumed right angle
/// decides. Here the angle is another unknown, and the uprights (with the principal point within
/// `principal_sigma`, a share of the long side) or a prior must tell the focal length. Without a
/// prior it is held by what lenses are in use.
///
/// frame   its columns are x, y up, z; which segment is of which axis stays as it says, since axes
///         that may go anywhere would follow the clutter
/// Gauss–Newton with numeric slopes.
[[nodiscard]] RightAngle rightAngle(const Task& task, const Frame& frame, double principal_sigma);

}  // namespace insitu::manhattan
