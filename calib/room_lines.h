#pragma once

#include "calib/camera_errors.h"
#include "calib/line_segments.h"
#include "calib/orientation.h"
#include "calib/segment_detection.h"
#include "core/finding.h"
#include "core/photo.h"

#include <glm/glm.hpp>

#include <optional>
#include <string>
#include <vector>

namespace insitu {

/// How the room's directions are looked for in a photograph.
struct RoomLineOptions {
    SegmentDetectionOptions detection;
    /// The longest segments of an axis that are handed on, >= 2.
    int most_per_axis = 40;
    /// How far the optical axis may be from the picture's middle, 1σ as a share of the long side:
    /// what the answer moves by with it is part of its doubt. [0, 0.2]
    double principal_sigma = 0.01;
    /// Up by an accelerometer: helps to choose between answers, is no part of one.
    std::optional<Gravity> up;
    // What an answer must show to be vouched for. Chosen so that of the answers about photographs,
    // views made from them and panoramas few are wrong (docs/validation.md, bench/calib_auto).

    /// Largest doubt of the focal length when no prior tells it, σ of ln f. > 0
    double most_focal_doubt = 0.06;
    /// Largest doubt of the rotation. Degrees, > 0
    double most_rotation_doubt_deg = 2.0;
    /// Evidence (natural logarithm) by which every other answer must be worse, without a prior of
    /// the focal length and with one. >= 0
    double least_margin = 10.0;
    double least_margin_with_prior = 2.0;
    /// x and z must be at right angles for all that the edges alone say of the angle between them:
    /// no more than so many standard deviations off, unless that is less than a few degrees.
    /// Without a prior of the focal length the right angle is what decides it. > 0
    double most_angle_sigmas = 1.5;
    double most_angle_sigmas_with_prior = 3.0;
    double least_angle_off_deg = 3.0;
    /// Share of the edges, the long ones counting more, that must follow the room's axes. [0, 1]
    double least_explained = 0.45;

    /// Every problem at once: "room-line-options", and those of the detection.
    [[nodiscard]] Findings validate() const;
};

/// A second pair of horizontal directions at right angles that many edges run along: a wall or
/// furniture that stands askew. Not used in the answer.
struct SecondDirections {
    double turn_rad = 0.0;  ///< from x and z, counter-clockwise seen from above; (0, π/2)
    int segments = 0;
    double evidence = 0.0;  ///< natural logarithm, against edges of any direction
};

/// Segments of a photograph, each with its axis of the room, and how far they can be trusted.
struct RoomLines {
    std::vector<LineSegment> segments;
    double sigma_px = 1.0;  ///< of an end point, as the segments' own residuals show
    glm::dmat3 camera_from_world{1.0};
    double focal_px = 0.0;
    bool focal_at_limit = false;  ///< no lens fits: the focal length ran into the search's limits
    int detected = 0;             ///< segments in the picture, of any direction
    double explained = 0.0;       ///< share of them that follows an axis, by weight
    double margin = 0.0;          ///< evidence over the best other answer
    double focal_doubt = 0.0;     ///< σ of ln f
    double rotation_doubt = 0.0;  ///< radians, root mean square angle
    OrientationCovariance doubt{};
    std::optional<SecondDirections> second;
    /// What the edges alone say of the angle between x and z: by how much it is more than a right
    /// one, and how well they tell. Radians
    double angle_off = 0.0;
    double angle_sigma = 0.0;
    /// Why the answer should not be used; empty when it should.
    std::vector<std::string> objections;
};

/// Finds the edges that run along the room's three directions: y the one that is upright in the
/// picture, x the horizontal one that points right, z the other.
///
/// Edges (calib/segment_detection.h) are assigned by a search over all rotations and focal lengths
/// for the three directions at right angles that explain most of them, clutter allowed for; the
/// candidates are refined by expectation–maximisation over rotation and focal length. Principal
/// point: the picture's middle. Deterministic.
///
/// The doubts: the answer is found again with parts of the picture drawn anew with repetition (48
/// times, fixed seed) and with the principal point moved by `principal_sigma`; its scatter is the
/// doubt. Parts and not segments, since the edges of one thing that stands askew agree.
/// Rooms with more horizontal directions than two (Atlanta worlds): the strongest further pair is
/// told when its evidence is at least `least_margin`.
///
/// The objections compare margin, doubts, the angle between x and z and explained share with the
/// options. The focal length's
/// doubt does not count with a prior.
///
/// prior   focal length from EXIF; without one the picture must show it
/// Nothing when there are too few segments for any answer. InputError: unusable options.
/// Source: [CouYui03], [DenEld08] for Manhattan worlds; [EfrTib93] for the bootstrap.
[[nodiscard]] std::optional<RoomLines> findRoomLines(const EncodedImage& image,
                                                     const std::optional<FocalPrior>& prior,
                                                     const RoomLineOptions& options = {});

/// A user's few strokes put onto the edges beside them and completed with the detected edges that
/// follow the same three directions. A stroke without an edge nearby stays as it is.
struct CompletedLines {
    LineSet lines;
    double sigma_px = 1.0;          ///< of an end point, as the segments' own residuals show
    int snapped = 0;                ///< strokes that were moved onto an edge
    int added = 0;                  ///< segments that no stroke named
    OrientationCovariance doubt{};  ///< as in RoomLines
};

/// strokes   at least two of two axes, as for calib/camera_solve.h; distortion must be 0 (an edge
///           is bent in the picture, and straight only in the straightened one)
/// The strokes' directions come from findOrientation; nothing when it gives none.
[[nodiscard]] std::optional<CompletedLines> completeStrokes(const LineSet& strokes,
                                                            const EncodedImage& image,
                                                            const std::optional<FocalPrior>& prior,
                                                            const RoomLineOptions& options = {});

}  // namespace insitu
