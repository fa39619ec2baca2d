#include "core/io/image_io.h"
#include "tests/capture/expect_outline.h"
#include "tests/support/data.h"

#include <gmock/gmock.h>

#include <cmath>
#include <filesystem>

namespace insitu {
namespace {

// The circle was measured by hand there; the truth room's is exact.
TEST(BallPhotographs, TheirOutlinesAreFound)
{
    INSITU_NEEDS_DATA();
    const std::filesystem::path living = dataFolder() / "brackets" / "ball_olapietka_livingroom";
    const BallOutlineResult small = findBallOutline(
        readBracket({living / "raw1.jpg", living / "raw2.jpg", living / "raw3.jpg"}));
    MirrorBall ball;
    ball.center_px = {754.0, 549.0};
    ball.radius_px = 72.0;
    expectOutline(small, ball, 3.0);  // as good as the hand that measured

    // Noise, JPEG, and walls behind that the rim hardly differs from; in room c the edge of a
    // sunlit floor runs along the rim, 5 pixels inside it.
    for (const char* name : {"truth-room-a", "truth-room-b", "truth-room-c"}) {
        SCOPED_TRACE(name);
        const std::filesystem::path room = dataFolder() / name;
        const BallOutlineResult exact = findBallOutline(
            readBracket({room / "ball_1_8.jpg", room / "ball_1_32.jpg", room / "ball_1_128.jpg"}));
        ball.center_px = {300.0, 300.0};
        ball.radius_px = 260.8;
        expectOutline(exact, ball, 1.3);  // room c: 1.0, with a standard deviation that says so
        ASSERT_TRUE(exact.outline);
        EXPECT_LT(glm::length(exact.outline->center_px - ball.center_px),
                  2.5 * exact.outline->center_sigma);
        EXPECT_LT(std::abs(exact.outline->radius_px - ball.radius_px),
                  2.5 * exact.outline->radius_sigma);
    }
}

}  // namespace
}  // namespace insitu
