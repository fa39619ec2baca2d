#pragma once

#include "capture/ball_outline.h"
#include "capture/light_probe.h"

#include <gtest/gtest.h>

namespace insitu {

/// Centre and radius are those of the ball within so many pixels.
inline void expectOutline(const BallOutlineResult& result, const MirrorBall& truth, double within)
{
    ASSERT_TRUE(result.outline);
    EXPECT_NEAR(result.outline->center_px.x, truth.center_px.x, within);
    EXPECT_NEAR(result.outline->center_px.y, truth.center_px.y, within);
    EXPECT_NEAR(result.outline->radius_px, truth.radius_px, within);
}

}  // namespace insitu
