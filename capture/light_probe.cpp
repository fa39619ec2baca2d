#include "capture/light_probe.h"

#include "capture/ball_picture.h"
#include "capture/probe_checks.h"
#include "capture/texel_average.h"
#include "core/check.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace insitu {

using std::numbers::pi;

Camera ballCamera(
    const MirrorBall& ball, glm::dvec3 position_m, int width, int height, glm::dvec3 up)
{
    detail::checkBall(ball, position_m);
    const double up_length = glm::length(up);
    if (!(std::isfinite(up_length) && up_length > 0.0))
        throw InputError("light probe", "the up direction is not a direction");
    const glm::dvec3 to_camera = position_m - ball.center_m;
    const double distance = glm::length(to_camera);
    if (std::abs(glm::dot(to_camera, up)) > (1.0 - 1e-9) * distance * up_length)
        throw InputError("light probe",
                         "the ball was seen from straight above or below: which way is up in the "
                         "picture is not known; give the camera's up direction");
    const double sine = ball.radius_m / distance;
    const double focal = ball.radius_px * std::sqrt(1.0 - sine * sine) / sine;
    Camera camera;
    camera.width = width;
    camera.height = height;
    camera.focal_px = glm::dvec2(focal);
    camera.principal_px = ball.center_px;
    camera.position_m = position_m;
    camera.forward = glm::normalize(ball.center_m - position_m);
    camera.right = glm::normalize(glm::cross(camera.forward, up));
    camera.up = glm::cross(camera.right, camera.forward);
    return camera;
}

LightProbe unwrapMirrorBall(const Image<Rgb>& radiance,
                            const MirrorBall& ball,
                            const Camera& camera,
                            const UnwrapOptions& options)
{
    detail::checkRadiance(radiance);
    detail::checkMapWidth(options.width);
    detail::checkBall(ball, camera.position_m);
    LightProbe probe;
    probe.center_m = ball.center_m;
    const detail::BallPicture picture(radiance, ball, camera, options, probe.findings);
    // Two normals one pixel apart in the ball's middle reflect into directions 2 / R apart.
    const int width =
        options.width > 0 ? options.width : detail::widthForResolution(2.0 / ball.radius_px);

    const auto places = [&](glm::dvec3 direction) {
        return picture.places(direction, 2.0 * pi / width);
    };
    probe.environment.pixels = detail::averageOverTexels(
        width, places, [&](glm::dvec3 d) { return picture.seen(d).radiance; });
    if (options.clipped != nullptr) {
        const Image<Rgb>& clipped = *options.clipped;
        INSITU_CHECK(clipped.sameSize(radiance), "{}x{}", clipped.width(), clipped.height());
        Findings reported;  // as of the whole radiance
        const detail::BallPicture part(clipped, ball, camera, options, reported);
        probe.environment.clipped = detail::averageOverTexels(
            width, places, [&](glm::dvec3 d) { return part.seen(d).radiance; });
    }
    detail::reportCoverage(picture, probe.findings);
    return probe;
}

}  // namespace insitu
