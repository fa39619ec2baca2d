#include "pipeline/probe_location.h"

#include "calib/exif_focal.h"
#include "core/check.h"
#include "core/response_curve.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace insitu {

namespace {

/// Standard deviation of an outline that a project file states, centre and radius. Pixels
constexpr double kGivenSigma = 0.5;

SeenBall seenBall(const BallOutline& outline, double radius_m, double radius_sigma_m)
{
    SeenBall ball;
    ball.center_px = outline.center_px;
    ball.radius_px = outline.radius_px;
    ball.center_sigma_px = outline.center_sigma;
    ball.radius_sigma_px = outline.radius_sigma;
    ball.radius_m = radius_m;
    ball.radius_sigma_m = radius_sigma_m;
    return ball;
}

/// Light as sRGB says: the outline is looked for in its logarithm, where the curve hardly matters.
Image<Rgb> radianceOf(const EncodedImage& image)
{
    const ResponseCurve curve = ResponseCurve::srgb();
    const int shift = image.max_code == 255 ? 0 : 8;
    Image<Rgb> radiance(image.codes.width(), image.codes.height());
    for (int y = 0; y < radiance.height(); ++y)
        for (int x = 0; x < radiance.width(); ++x)
            for (int c = 0; c < 3; ++c) {
                const auto code = static_cast<std::size_t>(image.codes(x, y)[c] >> shift);
                radiance(x, y)[c] =
                    static_cast<float>(curve.exposure[static_cast<std::size_t>(c)][code]);
            }
    return radiance;
}

BallOutline outlineIn(const Image<Rgb>& radiance,
                      const BallOutlineOptions& options,
                      const std::string& source,
                      Findings& findings)
{
    BallOutlineResult found = findBallOutline(radiance, options);
    findings = std::move(found.findings);
    if (!found.outline)
        throw NoAnswerError(source,
                            findings.empty() ? "no ball was found" : findings.front().message);
    return *found.outline;
}

}  // namespace

LocatedBall locateBall(const Photo& with_ball,
                       const CameraEstimate& camera,
                       double radius_m,
                       double radius_sigma_m,
                       const std::optional<BallOutline>& near,
                       const std::string& source)
{
    const Image<Rgb> radiance = radianceOf(with_ball.image);
    if (radiance.width() != camera.camera.width || radiance.height() != camera.camera.height)
        throw InputError(source,
                         fmt::format("has {}x{} pixels, the calibrated photograph {}x{}: the ball "
                                     "must be seen by the same camera from the same place",
                                     radiance.width(),
                                     radiance.height(),
                                     camera.camera.width,
                                     camera.camera.height));
    LocatedBall result;
    BallOutlineOptions options;
    options.start = near;
    if (!near) {
        // The search is one for circles; the ellipse that such a ball has is then refined.
        options.start = outlineIn(radiance, options, source, result.findings);
    }
    const BallPlace rough =
        placeBall(camera, seenBall(*options.start, radius_m, radius_sigma_m), source);
    BallOutline ellipse = predictBallOutline(rough.center_m, radius_m, camera.camera);
    ellipse.center_px = options.start->center_px;
    ellipse.radius_px = options.start->radius_px;
    options.start = ellipse;
    options.ellipse = true;
    result.outline = outlineIn(radiance, options, source, result.findings);
    result.place = placeBall(camera, seenBall(result.outline, radius_m, radius_sigma_m), source);
    append(result.findings, result.place.findings);
    return result;
}

BallByBoard locateBallByBoard(const Photo& room_photo,
                              const CameraEstimate& camera,
                              const Photo& close_up,
                              const MarkerBoard& board,
                              double radius_m,
                              double radius_sigma_m,
                              const std::optional<BallOutline>& near,
                              const std::string& source)
{
    const int width = close_up.image.codes.width();
    const int height = close_up.image.codes.height();
    const auto exif = focalFromExif(close_up.metadata, width, height);
    if (!exif)
        throw InputError(source,
                         "the close-up has no focal length in EXIF, without which the board does "
                         "not tell where its camera was");
    CameraEstimate lens;
    lens.camera =
        Camera::lookAt(glm::dvec3(0.0), glm::dvec3(0.0, 0.0, -1.0), exif->focal_px, width, height);
    const std::vector<BoardCorner> in_room = findBoard(room_photo.image, board);
    const std::vector<BoardCorner> in_close = findBoard(close_up.image, board);
    // The outline as the close-up's own camera sees it; where that is does not matter for it.
    LocatedBall ball = locateBall(close_up, lens, radius_m, radius_sigma_m, near, source);
    BallByBoard result;
    result.outline = ball.outline;
    result.location = placeByBoard(camera,
                                   in_room,
                                   lens.camera,
                                   exif->sigma,
                                   in_close,
                                   seenBall(ball.outline, radius_m, radius_sigma_m),
                                   source);
    std::erase_if(ball.findings, [](const Finding& finding) {
        return finding.code == "probe-below-floor" || finding.code == "probe-place-weak";
    });
    result.findings = std::move(ball.findings);
    append(result.findings, result.location.findings);
    return result;
}

Findings placeProbeFromOutline(const CameraEstimate& camera, Project& project)
{
    if (!project.light.probe || !project.light.probe->center_from_outline) return {};
    ProjectProbe& probe = *project.light.probe;
    BallOutline outline;
    const auto view = std::ranges::find_if(
        probe.views, [](const ProjectView& v) { return !v.view_position_m && !v.find_outline; });
    INSITU_CHECK(
        view != probe.views.end(), "{}", "the ball is not seen by the photograph's camera");
    outline.center_px = view->ball.center_px;
    outline.radius_px = view->ball.radius_px;
    outline.center_sigma = kGivenSigma;
    outline.radius_sigma = kGivenSigma;
    BallPlace place =
        placeBall(camera, seenBall(outline, view->ball.radius_m, 0.0), project.file.string());
    probe.center_m = place.center_m;
    for (ProjectView& each : probe.views)
        each.ball.center_m = place.center_m;
    project.light.center_m = place.center_m;
    Findings findings = std::move(place.findings);
    findings.push_back({Severity::Info,
                        "probe-from-outline",
                        fmt::format("the ball's outline puts it at ({:.3f}, {:.3f}, {:.3f}) m ± "
                                    "({:.3f}, {:.3f}, {:.3f})",
                                    place.center_m.x,
                                    place.center_m.y,
                                    place.center_m.z,
                                    place.sigma_m.x,
                                    place.sigma_m.y,
                                    place.sigma_m.z)});
    return findings;
}

}  // namespace insitu
