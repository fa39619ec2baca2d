#pragma once

#include "calib/camera_solve.h"
#include "calib/line_segments.h"
#include "calib/picture_drawing.h"
#include "core/photo.h"

#include <array>
#include <optional>

namespace insitu {

/// What an overlay shows and how.
struct OverlayOptions {
    /// Distance of the floor grid's lines, metres; absent: 0.5, or more where the floor is seen
    /// from far. > 0
    std::optional<double> grid_step_m;
    /// How far the grid reaches from the origin, in steps. > 0
    int grid_reach = 8;
    /// Residuals are drawn so many times as large. > 0
    double exaggeration = 10.0;
    /// Ellipses show so many standard deviations. > 0
    double ellipse_sigmas = 2.0;

    /// Every problem at once: "overlay-options".
    [[nodiscard]] Findings validate() const;
};

/// Colours of the axes: x red, y green, z blue.
[[nodiscard]] glm::vec3 axisColor(RoomAxis axis);
/// Width of a line that can be seen in a picture of this size, pixels.
[[nodiscard]] double lineWidth(const EncodedImage& picture);

/// The photograph, dimmed, with what a calibration says about it:
///   - the segments in their axis' colour, and at their ends whiskers across: the distance from the
///     line through their middle and the vanishing point, exaggerated;
///   - the horizon (yellow);
///   - the floor y = 0 as a grid in metres, the lines through the origin stronger, with the world's
///     axes standing at the origin, half a metre long;
///   - how far off things on the floor may be (white ellipses, at the corners of every second
///   field);
///   - how far off things that stand on the floor may be (placementSigma): ellipses on every second
///     corner of the grid;
///   - a line of figures.
/// The room or anything else is drawn over it with calib/picture_drawing.h.
///
/// lines   may be empty (a camera from a file); the size is that of the photograph
/// InputError: unusable options, or a camera of another size than the photograph.
[[nodiscard]] EncodedImage drawCalibration(const EncodedImage& photo,
                                           const CameraEstimate& estimate,
                                           const std::vector<LineSegment>& lines,
                                           const OverlayOptions& options = {});

}  // namespace insitu
