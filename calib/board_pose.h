#pragma once

#include "calib/camera_solve.h"
#include "calib/probe_pose.h"
#include "core/photo.h"

#include <glm/glm.hpp>

#include <array>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace insitu {

/// A printed board of ArUco markers in a photograph: where the camera was to it.
///
/// Common rules: the board's frame has its origin at the outer corner of the first marker, x along
/// the rows, y down the columns (as printed), metres; lenses as core/camera.h.

/// Markers 0, 1, 2 … of OpenCV's dictionary 4x4_50, row by row, with a black border of one field.
struct MarkerBoard {
    int columns = 5;         ///< 1 to 50
    int rows = 4;            ///< 1 to 50; columns · rows <= 50
    double marker_m = 0.03;  ///< side of a marker, > 0
    double gap_m = 0.006;    ///< between neighbours, > 0

    /// Every problem at once: "board-options".
    [[nodiscard]] Findings validate() const;
};

/// A marker's corner: on the board, and in the picture.
struct BoardCorner {
    glm::dvec2 on_board_m{0.0};
    glm::dvec2 seen_px{0.0};
};

/// The corners of the board's markers that are seen, to parts of a pixel; empty without any.
/// Source: [Garrido14], OpenCV's detector.
[[nodiscard]] std::vector<BoardCorner> findBoard(const EncodedImage& image,
                                                 const MarkerBoard& board);

/// A board before a camera.
struct BoardPose {
    glm::dmat3 camera_from_board{1.0};
    glm::dvec3 origin_m{0.0};  ///< of the board, in the camera's frame
    /// Of (a small turn in the camera's frame, origin_m), from the corners' own residuals.
    std::array<std::array<double, 6>, 6> covariance{};
    double sigma_px = 0.0;  ///< of a corner's coordinate, as the residuals show
    /// "board-ambiguous": the board tilted the other way fits nearly as well (it is far, small or
    /// seen from straight on).
    Findings findings;
};

/// Least squares over the corners' places: from the homography, both tilts tried.
/// Nothing with less than two markers' worth of corners (8) or when none converges.
/// Source: [Zhang00] section 3.1 for the pose from a homography.
[[nodiscard]] std::optional<BoardPose> boardPose(std::span<const BoardCorner> corners,
                                                 const Camera& lens);

/// A second camera, and a ball before it, brought into the room by a board that both pictures show.
struct BoardLocation {
    Camera close_up;  ///< in the world of the room's camera
    BallPlace ball;
    Findings findings;
};

/// room          the calibrated photograph, and the board's corners in it
/// close_lens    size, focal length and principal point of the other picture's camera (its EXIF);
///               close_focal_sigma its deviation, of ln f
/// ball          its outline in the other picture
/// The covariance is first order: outline, corners, and the room's camera by its full covariance,
/// which moves the board before it too.
/// NoAnswerError (naming `source`): a picture without enough of the board; those of placeBall.
[[nodiscard]] BoardLocation placeByBoard(const CameraEstimate& room,
                                         std::span<const BoardCorner> room_corners,
                                         const Camera& close_lens,
                                         double close_focal_sigma,
                                         std::span<const BoardCorner> close_corners,
                                         const SeenBall& ball,
                                         const std::string& source);

}  // namespace insitu
