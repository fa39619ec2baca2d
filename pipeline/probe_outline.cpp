#include "pipeline/probe_outline.h"

#include "capture/ball_outline.h"

#include <fmt/format.h>

#include <algorithm>

namespace insitu {

bool findProbeOutline(const Image<Rgb>& radiance,
                      glm::dvec2 crop_origin_px,
                      MirrorBall& ball,
                      Findings& findings)
{
    constexpr double kUselessSigma = 0.05;  // share of the radius
    BallOutlineResult found = findBallOutline(radiance);
    if (!found.outline) return false;
    const BallOutline& outline = *found.outline;
    if (std::max(outline.center_sigma, outline.radius_sigma) > kUselessSigma * outline.radius_px)
        return false;
    append(findings, std::move(found.findings));  // a doubtful one says so
    ball.center_px = outline.center_px + crop_origin_px;
    ball.radius_px = outline.radius_px;
    findings.push_back(
        {Severity::Info,
         "probe-outline-found",
         fmt::format("the ball's outline was found: {}; standard deviations {:.2f} and {:.2f} px",
                     outlineText(ball),
                     outline.center_sigma,
                     outline.radius_sigma)});
    return true;
}

std::string outlineText(const MirrorBall& ball)
{
    return fmt::format("centre ({:.1f}, {:.1f}), radius {:.1f} px",
                       ball.center_px.x,
                       ball.center_px.y,
                       ball.radius_px);
}

}  // namespace insitu
