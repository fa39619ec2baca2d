#pragma once

#include "calib/camera_solve.h"
#include "core/finding.h"

#include <glm/glm.hpp>

#include <string>

namespace insitu {

/// A ball's outline in a photograph (capture/ball_outline.h finds it), and the ball's size.
struct SeenBall {
    glm::dvec2 center_px{0.0};     ///< centre of the outline, an ellipse; not the ball's own centre
    double radius_px = 0.0;        ///< mean of its two half axes, > 0
    double center_sigma_px = 0.0;  ///< 1σ of each coordinate, >= 0
    double radius_sigma_px = 0.0;  ///< 1σ, >= 0
    double radius_m = 0.0;         ///< of the ball, > 0
    double radius_sigma_m = 0.0;   ///< 1σ, >= 0
};

/// Where a ball is in the room.
struct BallPlace {
    glm::dvec3 center_m{0.0};
    /// Covariance from outline, size and camera, m². World axes.
    glm::dmat3 covariance{0.0};
    glm::dvec3 sigma_m{0.0};  ///< square roots of its diagonal
    double distance_m = 0.0;  ///< of the centre from the camera
    double distance_sigma_m = 0.0;
    Findings findings;
};

/// The ball's centre from its outline.
///
/// A ball of radius R at the distance D is seen under the cone of half angle α, sin α = R/D. For a
/// centre at the angle θ off the optical axis the outline is an ellipse with, q = cos²θ − sin²α,
///   centre      f sin θ cos θ / q from the principal point, further out than the ball's own centre
///   half axes   f sin α cos α / q towards it, f sin α / √q across
/// which is solved for centre and distance by Newton's method. Not square pixels count as square,
/// and a lens that bends lines is undone at the outline's centre: right to a share (r/R_half)² of λ
/// of the radius, r the outline's radius and R_half half the diagonal.
///
/// The covariance is first order: outline and size as given, the camera's errors by its full
/// covariance (calib/camera_errors.h).
///
/// Findings:
///   probe-place-weak    the distance is uncertain by more than 5 %
///   probe-below-floor   the ball reaches below the floor y = 0 by more than 3 of its σ
/// InputError (naming `source`): values that are not finite or not positive. NoAnswerError: an
/// outline that no ball in front of the camera has (wider than a half space). Source: the ellipse
/// is the plane section of the cone, derived at the function.
[[nodiscard]] BallPlace placeBall(const CameraEstimate& camera,
                                  const SeenBall& ball,
                                  const std::string& source);

}  // namespace insitu
