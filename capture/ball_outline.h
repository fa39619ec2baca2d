#pragma once

#include "capture/bracket.h"
#include "core/camera.h"
#include "core/finding.h"
#include "core/image.h"

#include <glm/glm.hpp>

#include <optional>

namespace insitu {

/// Where a mirror ball's outline lies in a picture. Pixels of the picture that was searched (add
/// the crop's origin for pixels of the full frame), corner convention of core/camera.h.
struct BallOutline {
    glm::dvec2 center_px{0.0};
    double radius_px = 0.0;     ///< mean of the two half axes
    double axis_ratio = 1.0;    ///< shorter over longer half axis, (0, 1]; 1: a circle
    double axis_angle = 0.0;    ///< of the longer axis from +x towards +y. Radians, [0, pi)
    double center_sigma = 0.0;  ///< standard deviation of the centre, the worse axis. Pixels
    double radius_sigma = 0.0;  ///< standard deviation of the radius. Pixels
    /// Of the directions in which the outline lies inside the picture, the share that shows the rim
    /// there, above what chance would give. [0, 1]
    double inlier_share = 0.0;
    double visible_share = 1.0;  ///< of the outline, inside the picture. [0, 1]
};

/// How the outline is looked for.
struct BallOutlineOptions {
    /// A ball away from the camera's axis is seen as an ellipse. Off: a circle is fitted. An
    /// ellipse to start from keeps its shape, which a camera gives better than the picture
    /// (predictBallOutline).
    bool ellipse = false;
    /// Where to begin, right within a tenth of the radius. Absent: the whole picture is searched.
    std::optional<BallOutline> start;
    /// Off: `start` is the answer, and only its share of edges is measured.
    bool refine = true;
    /// Smallest radius looked for when the whole picture is searched, as a share of the picture's
    /// longer side. (0, 0.5]
    double smallest_radius = 0.03;

    /// Every problem at once: "ball-options".
    [[nodiscard]] Findings validate() const;
};

struct BallOutlineResult {
    std::optional<BallOutline> outline;
    /// "ball-not-found": no circle with enough edges; `outline` is empty.
    /// "ball-outline-weak": found, but few edges, little of it in the picture, or uncertain by more
    /// than 1 % of the radius.
    Findings findings;
};

/// Finds the mirror ball and its outline to a fraction of a pixel.
///
/// 1. The gradients of a reduced picture vote for circles (centre and radius) [DudHar72].
/// 2. Each candidate is judged by edges along radial scans, joined by RANSAC [FisBol81]: of the
///    edges of many rays a circle takes those that lie on it, so reflections inside, clutter
///    outside, a stand or a hand do not count.
/// 3. At full resolution the likeliest circle of all rays together: along a ray values wander with
///    the background's roughness outside, and inside with the angle by which the mirror turns the
///    ray, 2 sqrt(2 (1 - r/R)) from straight on, which shows the rim even of a perfect mirror
///    before a plain wall, and does not take the edge of the floor beside the rim for it.
/// 4. Its standard deviation is that of the answers that other draws of the outline's sectors of 10
///    degrees give, so that it holds second answers almost as likely, and 0.15 px for the model.
///
/// Radiance is looked at through its logarithm, a bracket in the codes of all its frames, all
/// channels. Centres outside the picture and balls below 12 pixels of radius are not looked for.
/// The search of the whole picture is one for circles: an ellipse whose half axes differ by more
/// than 2 % needs a start (predictBallOutline). The answer does not depend on threads.
/// InputError: empty picture, NaN or infinity, unusable options.
[[nodiscard]] BallOutlineResult findBallOutline(const Image<Rgb>& radiance,
                                                const BallOutlineOptions& options = {});
[[nodiscard]] BallOutlineResult findBallOutline(const Bracket& bracket,
                                                const BallOutlineOptions& options = {});

/// The outline, an ellipse, that a camera sees of a ball: where to start when it was photographed
/// by a camera that is known, from a place of the ball that is known about. InputError: the camera
/// is inside the ball or does not see all of it in front of it.
[[nodiscard]] BallOutline predictBallOutline(glm::dvec3 center_m,
                                             double radius_m,
                                             const Camera& camera);

}  // namespace insitu
