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

/// The camera that looked at the ball from `position_m`: towards its centre, focal length
/// radius_px / tan(asin(radius_m / distance)), principal point at center_px. `up` is the world
/// direction that points upwards in the picture: Y for a camera held level, another one for a
/// camera that was rolled. A camera inside the ball, or one that looks along `up`, is an
/// InputError.
[[nodiscard]] Camera ballCamera(const MirrorBall& ball,
                                glm::dvec3 position_m,
                                int width,
                                int height,
                                glm::dvec3 up = {0.0, 1.0, 0.0});

struct UnwrapOptions {
    int width =
        0;  ///< of the equirectangular map; its height is half. 0: chosen from the ball's size
    /// Pixel of the full frame that is pixel (0,0) of the given image (a crop).
    glm::dvec2 crop_origin_px{0.0};
    /// Distance in metres to what is seen from a point in a direction (the room proxy), so that the
    /// reflected rays, which start on the ball and not at its centre, are put where they belong.
    /// Called from several threads; infinity where nothing is near. Absent: everything is far away.
    std::function<double(glm::dvec3 origin, glm::dvec3 direction)> distance_to_room;
    /// The part of the picture's radiance that is only a lower bound, of its size; it becomes
    /// EnvironmentMap::clipped. Absent: none.
    const Image<Rgb>* clipped = nullptr;
};

struct LightProbe {
    EnvironmentMap environment;  ///< as seen from the ball's centre, world directions
    glm::dvec3 center_m{0.0};
    Findings findings;
};

/// Mirror-ball picture (radiance) -> equirectangular environment, exact for a ball at finite
/// distance; every texel is an average over its solid angle. The blind spot behind the ball takes
/// the radiance at the ball's rim nearest in direction; finding "probe-blind-spot" (share of the
/// sphere). The outermost 1.25 pixels of the outline mix ball and background and are not used.
///
/// The ball's outline as `camera` sees it is moved and scaled onto the measured one (center_px,
/// radius_px), which takes out small errors of the camera; when they differ by more than 2 % of
/// the radius, finding "probe-outline-mismatch". "probe-outside-image": the picture cuts the ball.
/// InputError: a ball or camera without meaning, an image with NaN or infinity.
[[nodiscard]] LightProbe unwrapMirrorBall(const Image<Rgb>& radiance,
                                          const MirrorBall& ball,
                                          const Camera& camera,
                                          const UnwrapOptions& options);

/// An equirectangular picture, resampled by area to `width` (0: as it is). It must be twice as
/// wide as high (InputError).
[[nodiscard]] LightProbe probeFromLatLong(const Image<Rgb>& radiance, int width);

/// An angular map: a square picture whose inscribed disc shows the whole sphere, distance from the
/// middle proportional to the angle from −z, +x to the right, +y up. Width 0: the picture's
/// resolution. Source: [Debevec98], the "light probe" format of his gallery.
[[nodiscard]] LightProbe probeFromAngularMap(const Image<Rgb>& radiance, int width);

/// A cube cross: the cube's inner side unfolded, seen from inside, faces square. The middle face of
/// the arms looks along −z, as the centre of the other formats does.
///   4 x 3 faces           3 x 4 faces [Debevec98]
///        +y                    +y
///   −x   −z   +x   +z     −x   −z   +x
///        −y                    −y
///                              +z, upside down
/// Every two faces that touch go on into each other. Which of the two is told by the picture's
/// shape; another one is an InputError. What is outside the faces is not looked at. Resampled by
/// area; width 0: the picture's resolution.
[[nodiscard]] LightProbe probeFromCubeCross(const Image<Rgb>& radiance, int width);

enum class CubeLayout { Horizontal, Vertical };

/// The same pictures from an environment, every pixel an average over its area, black outside the
/// faces or the disc. `face` pixels a side, `side` of the whole square: in [2, 8192] (InputError).
[[nodiscard]] Image<Rgb> cubeCross(const EnvironmentMap& environment, CubeLayout layout, int face);
[[nodiscard]] Image<Rgb> angularMap(const EnvironmentMap& environment, int side);

}  // namespace insitu
