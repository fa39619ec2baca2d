#pragma once

#include "calib/camera_solve.h"
#include "calib/room_lines.h"
#include "core/photo.h"

#include <glm/glm.hpp>

#include <optional>
#include <string>

namespace insitu {

/// What a photograph alone cannot tell: where the world begins and how large it is.
struct AutomaticOptions {
    RoomLineOptions lines;
    /// Pixel of the world's origin, a floor point. Absent: below the middle, 85 % down.
    std::optional<glm::dvec2> origin_px;
    /// Height of the camera over the floor, metres, > 0. Absent: 1, so that lengths count in
    /// camera heights.
    std::optional<double> camera_height_m;
    double camera_height_sigma_m = 0.0;  ///< 1σ of it, 0 = exact
    /// An answer with objections is given, with a warning, instead of none.
    bool accept_doubtful = false;

    /// Every problem at once: "automatic-options", and those of the lines.
    [[nodiscard]] Findings validate() const;
};

/// A camera found without anything marked.
struct AutomaticCalibration {
    CameraEstimate camera;
    LineSet lines;    ///< what it rests on
    RoomLines found;  ///< with the doubts
};

/// The camera of a photograph from its own edges: findRoomLines, then calibrateCamera on the
/// segments found. The EXIF focal length is used when there is one (calib/exif_focal.h), in place
/// of it `options.exif_focal_px`; `segment_sigma_px` is measured here and not read.
///
/// The stated errors are those of calibrateCamera, or the doubts of findRoomLines where larger.
/// Findings, beside those of calibrateCamera:
///   automatic-lines      how many edges the answer rests on, and the doubts in numbers
///   automatic-second-directions  furniture or walls that stand askew, and by how much
///   automatic-doubtful   objections, with `accept_doubtful`
///   origin-assumed       no origin was given
///   scale-assumed        no camera height was given: lengths are in camera heights
/// Throws NoAnswerError (naming `source`) with the objections in numbers; InputError for unusable
/// options.
[[nodiscard]] AutomaticCalibration calibrateAutomatically(const Photo& photo,
                                                          CalibrationOptions options,
                                                          const AutomaticOptions& automatic,
                                                          const std::string& source);

/// calibrateCamera for a user's strokes, snapped to the edges beside them and completed with those
/// that agree (completeStrokes). "lines-completed" tells how many; "lines-not-completed" that the
/// strokes alone were used, since they give no direction to start from. InputError for strokes with
/// a lens distortion.
[[nodiscard]] AutomaticCalibration calibrateCompleted(const LineSet& strokes,
                                                      const Photo& photo,
                                                      CalibrationOptions options,
                                                      const RoomLineOptions& lines,
                                                      const std::string& source);

}  // namespace insitu
