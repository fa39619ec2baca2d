#pragma once

#include "core/camera.h"
#include "core/environment_map.h"
#include "core/finding.h"
#include "core/image.h"

#include <glm/glm.hpp>

#include <functional>

namespace insitu {

/// A mirror ball in a photograph.
struct MirrorBall {
    glm::dvec2 center_px{0.0};  ///< of the outline, pixels of the full frame
    double radius_px = 0.0;     ///< of the outline (its mean when it is an ellipse), > 0
    double radius_m = 0.0;      ///< > 0
    double reflectance = 1.0;   ///< of the mirror, (0, 1]
    glm::dvec3 center_m{0.0};   ///< where the ball's centre was in the room
};

/// The camera that looked at the ball from `position_m`: towards its centre, Y up, focal length
/// radius_px / tan(asin(radius_m / distance)), principal point at center_px.
[[nodiscard]] Camera ballCamera(const MirrorBall& ball,
                                glm::dvec3 position_m,
                                int width,
                                int height);

struct UnwrapOptions {
    int width =
        0;  ///< of the equirectangular map; its height is half. 0: chosen from the ball's size
    /// Pixel of the full frame that is pixel (0,0) of the given image (a crop).
    glm::dvec2 crop_origin_px{0.0};
    /// Distance in metres to what is seen from a point in a direction (the room proxy), so that the
    /// reflected rays, which start on the ball and not at its centre, are put where they belong.
    /// Absent: everything is far away.
    std::function<double(glm::dvec3 origin, glm::dvec3 direction)> distance_to_room;
};

struct LightProbe {
    EnvironmentMap environment;  ///< as seen from the ball's centre, world directions
    glm::dvec3 center_m{0.0};
    Findings findings;
};

/// Mirror-ball picture (radiance) -> equirectangular environment, exact for a ball at finite
/// distance; every texel is an average over its solid angle. The blind spot behind the ball takes
/// the radiance at the ball's rim nearest in direction; finding "probe-blind-spot" (share of the
/// sphere).
[[nodiscard]] LightProbe unwrapMirrorBall(const Image<Rgb>& radiance,
                                          const MirrorBall& ball,
                                          const Camera& camera,
                                          const UnwrapOptions& options);

}  // namespace insitu
