#pragma once

#include "capture/ball_reflection.h"
#include "capture/light_probe.h"

#include <optional>

namespace insitu::detail {

/// InputError for a ball or a camera without meaning.
void checkBall(const MirrorBall& ball, glm::dvec3 camera_position);

/// A ball's outline as a camera sees it: an ellipse, whose centre is that of its bounding box.
struct ProjectedOutline {
    glm::dvec2 center{0.0};
    double radius = 0.0;  ///< mean
};

/// Picture of the ball -> radiance by direction from its centre. Refers to its arguments.
class BallPicture {
public:
    /// Finding "probe-outline-mismatch"; InputError when the camera does not see the ball.
    BallPicture(const Image<Rgb>& radiance,
                const MirrorBall& ball,
                const Camera& camera,
                const UnwrapOptions& options,
                Findings& findings);

    struct Sample {
        Rgb radiance{0.0f};
        glm::dvec2 pixel{0.0};  ///< of the given picture
        bool blind = false;     ///< not seen: radiance of the rim nearest to it
        bool outside = false;   ///< the place is outside the picture
    };
    [[nodiscard]] Sample seen(glm::dvec3 direction) const;

    /// So many sub-samples that neighbours are not more than about a pixel of the ball apart: for a
    /// far ball a direction at psi from the axis is stretched R / (2 cos(psi/2)) pixels per radian
    /// around the axis and R cos(psi/2) / 2 along, the first being the larger.
    [[nodiscard]] int places(glm::dvec3 direction, double texel_radians) const;

    /// Square of the pixels per radian along the direction away from the camera, the worse one
    /// (see places), less its value at the rim: 0 there and in the blind spot.
    [[nodiscard]] double resolution(glm::dvec3 direction) const;

private:
    const Image<Rgb>& radiance_;
    const MirrorBall& ball_;
    const Camera& camera_;
    const UnwrapOptions& options_;
    BallReflection reflection_;
    ProjectedOutline predicted_;
    double scale_;
    double rim_cosine_;  ///< of the angle from the axis at which the usable part ends
};

/// Shares of the sphere that the ball does not show, by the directions of a coarse map: findings
/// "probe-blind-spot" and "probe-outside-image".
void reportCoverage(const BallPicture& picture, Findings& findings);

}  // namespace insitu::detail
