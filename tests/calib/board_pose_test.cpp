#include "calib/board_pose.h"

#include "capture/ball_outline.h"
#include "core/random.h"
#include "tests/calib/drawn_board.h"
#include "tests/calib/synthetic_room.h"
#include "tests/support/errors.h"

#include <gmock/gmock.h>

namespace insitu {
namespace {

using ::testing::HasSubstr;

using namespace drawn_board;

std::vector<BoardCorner> exactCorners(const Laid& laid, const Camera& camera)
{
    std::vector<BoardCorner> corners;
    const double pitch = kBoard.marker_m + kBoard.gap_m;
    for (int r = 0; r < kBoard.rows; ++r)
        for (int c = 0; c < kBoard.columns; ++c)
            for (const glm::dvec2 k : {glm::dvec2(0, 0), {1, 0}, {1, 1}, {0, 1}}) {
                const glm::dvec2 p = glm::dvec2(c, r) * pitch + k * kBoard.marker_m;
                corners.push_back({p, *camera.project(laid.at(p))});
            }
    return corners;
}

void addNoise(std::vector<BoardCorner>& corners, double sigma, RandomStream& random)
{
    for (BoardCorner& corner : corners)
        corner.seen_px += sigma * glm::dvec2(random.normal(), random.normal());
}

TEST(FindBoard, CornersAreWhereTheyWerePrinted)
{
    const Laid laid;
    const Camera camera = closeCamera();
    const auto found = findBoard(photograph(laid, camera), kBoard);
    ASSERT_GE(found.size(), 40u);
    double squares = 0.0;
    for (const BoardCorner& corner : found) {
        const glm::dvec2 off = corner.seen_px - *camera.project(laid.at(corner.on_board_m));
        squares += glm::dot(off, off) / static_cast<double>(2 * found.size());
    }
    // What OpenCV's refinement leaves on sharp drawn corners.
    EXPECT_LT(std::sqrt(squares), 0.25);
    const auto pose = boardPose(found, camera);
    ASSERT_TRUE(pose);
    const glm::dmat3 camera_from_world =
        glm::transpose(glm::dmat3(camera.right, -camera.up, camera.forward));
    const glm::dvec3 origin = camera_from_world * (laid.origin - camera.position_m);
    EXPECT_LT(glm::length(pose->origin_m - origin), 0.003 * glm::length(origin));
    EXPECT_TRUE(findBoard(photograph(laid, camera), MarkerBoard{1, 1, 0.05, 0.01}).size() == 4);
    EncodedImage blank;
    blank.codes = Image<glm::u16vec3>(100, 100, glm::u16vec3(99));
    EXPECT_TRUE(findBoard(blank, kBoard).empty());
}

TEST(BoardPose, ExactCornersGiveTheExactPose)
{
    RandomStream random(3, 0, 0);
    for (int i = 0; i < 30; ++i) {
        Laid laid;
        const glm::dvec3 tilt(0.8 * random.normal(), 0.8 * random.normal(), random.normal());
        laid.x = glm::normalize(glm::dvec3(1.0, 0.3 * tilt.x, 0.3 * tilt.y));
        laid.y =
            glm::normalize(glm::cross(glm::normalize(glm::dvec3(0.2 * tilt.z, -1.0, 0.3)), laid.x));
        const Camera camera = roomCamera();
        const auto pose = boardPose(exactCorners(laid, camera), camera);
        ASSERT_TRUE(pose) << i;
        const glm::dmat3 camera_from_world =
            glm::transpose(glm::dmat3(camera.right, -camera.up, camera.forward));
        EXPECT_LT(glm::length(pose->camera_from_board[0] - camera_from_world * laid.x), 1e-7) << i;
        EXPECT_LT(
            glm::length(pose->origin_m - camera_from_world * (laid.origin - camera.position_m)),
            1e-7)
            << i;
    }
    EXPECT_FALSE(boardPose({}, roomCamera()));
}

TEST(BoardPose, AFarBoardSeenFromStraightOnMayTiltEitherWay)
{
    Laid laid;
    const Camera camera = Camera::lookAt({0.2, 6.0, 0.03}, {0.2, 0.75, 0.02}, 1100.0, 900, 700);
    auto corners = exactCorners(laid, camera);
    RandomStream random(5, 0, 0);
    addNoise(corners, 0.3, random);
    const auto pose = boardPose(corners, camera);
    ASSERT_TRUE(pose);
    EXPECT_TRUE(hasFinding(pose->findings, "board-ambiguous"));
    auto near = exactCorners(laid, closeCamera());
    addNoise(near, 0.3, random);
    EXPECT_FALSE(hasFinding(boardPose(near, closeCamera())->findings, "board-ambiguous"));
}

/// A ball beside the board, photographed from near: its place in the room and how often the stated
/// deviation covers the truth.
TEST(PlaceByBoard, TheBallIsWhereItIsAndTheDeviationsHold)
{
    const Laid laid;
    CameraEstimate room;
    room.camera = roomCamera();
    const Camera close = closeCamera();
    const glm::dvec3 center(0.25, 0.81, -0.12);
    const double radius = 0.06;
    const BallOutline outline = predictBallOutline(center, radius, close);
    Camera lens;
    lens.width = close.width;
    lens.height = close.height;
    lens.focal_px = close.focal_px;
    lens.principal_px = close.principal_px;
    SeenBall ball;
    ball.center_px = outline.center_px;
    ball.radius_px = outline.radius_px;
    ball.radius_m = radius;
    const BoardLocation exact = placeByBoard(
        room, exactCorners(laid, room.camera), lens, 0.0, exactCorners(laid, close), ball, "t");
    EXPECT_LT(glm::length(exact.ball.center_m - center), 1e-4);  // the outline is of 3600 points
    EXPECT_LT(glm::length(exact.close_up.position_m - close.position_m), 1e-6);
    EXPECT_LT(synthetic::rotationError(exact.close_up, close), 1e-7);

    RandomStream random(7, 0, 0);
    constexpr int kDraws = 300;
    int within = 0;
    for (int i = 0; i < kDraws; ++i) {
        auto in_room = exactCorners(laid, room.camera);
        auto in_close = exactCorners(laid, close);
        addNoise(in_room, 0.3, random);
        addNoise(in_close, 0.3, random);
        Camera guessed = lens;
        guessed.focal_px *= 1.0 + 0.01 * random.normal();
        SeenBall seen = ball;
        seen.center_sigma_px = 0.3;
        seen.radius_sigma_px = 0.3;
        seen.center_px += 0.3 * glm::dvec2(random.normal(), random.normal());
        seen.radius_px += 0.3 * random.normal();
        const BoardLocation found = placeByBoard(room, in_room, guessed, 0.01, in_close, seen, "t");
        for (int k = 0; k < 3; ++k)
            within += std::abs(found.ball.center_m[k] - center[k]) < found.ball.sigma_m[k] ? 1 : 0;
    }
    // Three coordinates share the errors: four binomial deviations of 300 draws.
    EXPECT_NEAR(within / (3.0 * kDraws), 0.683, 0.11);
}

TEST(PlaceByBoard, WithoutABoardThereIsNoAnswer)
{
    CameraEstimate room;
    room.camera = roomCamera();
    const auto corners = exactCorners({}, room.camera);
    SeenBall ball;
    ball.radius_px = 10.0;
    ball.radius_m = 0.05;
    EXPECT_THAT(inputErrorOf([&] {
                    (void)placeByBoard(room, corners, room.camera, 0.0, {}, ball, "close.jpg");
                }),
                HasSubstr("other picture"));
    const MarkerBoard bad{60, 0, -1.0, 0.0};
    EXPECT_EQ(bad.validate().size(), 3u);
    EXPECT_THAT(inputErrorOf([&] { (void)findBoard({}, bad); }), HasSubstr("60 x 0"));
}

}  // namespace
}  // namespace insitu
