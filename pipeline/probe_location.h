#pragma once

#include "calib/board_pose.h"
#include "calib/probe_pose.h"
#include "capture/ball_outline.h"
#include "pipeline/project.h"

#include <optional>
#include <string>

namespace insitu {

/// A mirror ball found in a photograph, and where it is in the room.
struct LocatedBall {
    BallOutline outline;
    BallPlace place;
    Findings findings;
};

/// Finds the ball's outline (capture/ball_outline.h) in a photograph by the calibrated camera and
/// from it the ball's centre in the room (calib/probe_pose.h).
///
/// with_ball   the view of `camera`, with the ball in it
/// near        where the ball is seen, right within a tenth of its radius; absent: the whole
/// picture
///             is searched for a ball of at least 3 % of the long side
/// Findings: those of both. NoAnswerError when there is no outline; InputError for a picture of
/// another size than the camera's.
[[nodiscard]] LocatedBall locateBall(const Photo& with_ball,
                                     const CameraEstimate& camera,
                                     double radius_m,
                                     double radius_sigma_m,
                                     const std::optional<BallOutline>& near,
                                     const std::string& source);

/// The same for a close-up by any camera, when both pictures show a printed board
/// (calib/board_pose.h): its outline is looked for in the close-up, whose focal length EXIF tells.
/// InputError without it.
///
/// room_photo   the calibrated photograph, or the same view with the board in it
struct BallByBoard {
    BallOutline outline;     ///< in the close-up
    BoardLocation location;  ///< the ball's place, and the close-up's camera in the room
    Findings findings;
};
[[nodiscard]] BallByBoard locateBallByBoard(const Photo& room_photo,
                                            const CameraEstimate& camera,
                                            const Photo& close_up,
                                            const MarkerBoard& board,
                                            double radius_m,
                                            double radius_sigma_m,
                                            const std::optional<BallOutline>& near,
                                            const std::string& source);

/// Puts the probe of a project that says `"center_m": "from-outline"` where its ball's outline says
/// it is; others are left as they are. The outline in the file counts as half a pixel uncertain.
/// Findings of placeBall, and "probe-from-outline" with place and deviation.
[[nodiscard]] Findings placeProbeFromOutline(const CameraEstimate& camera, Project& project);

}  // namespace insitu
