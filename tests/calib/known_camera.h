#pragma once

#include "calib/camera_solve.h"

#include <cstdint>
#include <vector>

namespace insitu::synthetic {

/// What stands for the bytes of a photograph; camera files keep them unread.
inline const std::vector<std::uint8_t> kPicture = {0x89, 'P', 'N', 'G', 1, 2, 3};

/// 1000x600, stands at (1, 2, 3), looks along −x with its up along +y, so that its right is −z.
/// The optical axis meets the picture 50 px right of and 30 px above the middle.
inline Camera knownCamera()
{
    Camera camera;
    camera.width = 1000;
    camera.height = 600;
    camera.focal_px = {800.0, 800.0};
    camera.principal_px = {550.0, 270.0};
    camera.position_m = {1.0, 2.0, 3.0};
    camera.forward = {-1.0, 0.0, 0.0};
    camera.up = {0.0, 1.0, 0.0};
    camera.right = {0.0, 0.0, -1.0};
    return camera;
}

inline CameraEstimate estimateOf(const Camera& camera)
{
    CameraEstimate estimate;
    estimate.camera = camera;
    return estimate;
}

}  // namespace insitu::synthetic
