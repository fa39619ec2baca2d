#include "calib/board_pose.h"

#include "calib/camera_errors.h"
#include "core/check.h"

#include <Eigen/Dense>
#include <fmt/format.h>
#include <glm/gtc/quaternion.hpp>

#include <algorithm>
#include <cmath>

namespace insitu {

namespace {

constexpr std::size_t kFewestCorners = 8;
constexpr int kSteps = 50;
constexpr double kDifference = 1e-6;
/// The other tilt must fit this much worse to be ruled out.
constexpr double kAmbiguous = 2.0;
/// No detector places corners better than this, pixels.
constexpr double kFinestPx = 0.02;

struct Pose {
    glm::dmat3 turn{1.0};
    glm::dvec3 origin{0.0};
};

glm::dmat3 rotation(glm::dvec3 vector)
{
    const double angle = glm::length(vector);
    if (angle == 0.0) return glm::dmat3(1.0);
    return glm::mat3_cast(glm::angleAxis(angle, vector / angle));
}

Pose moved(const Pose& pose, const Eigen::Matrix<double, 6, 1>& step)
{
    return {rotation({step(0), step(1), step(2)}) * pose.turn,
            pose.origin + glm::dvec3(step(3), step(4), step(5))};
}

/// Differences to the straight pixels of the corners; nothing when one is not in front.
std::optional<Eigen::VectorXd> residuals(std::span<const BoardCorner> corners,
                                         const Camera& lens,
                                         const Pose& pose)
{
    Eigen::VectorXd off(2 * static_cast<Eigen::Index>(corners.size()));
    for (std::size_t i = 0; i < corners.size(); ++i) {
        const glm::dvec3 p = pose.turn * glm::dvec3(corners[i].on_board_m, 0.0) + pose.origin;
        if (!(p.z > 1e-9)) return std::nullopt;
        const glm::dvec2 seen = lens.straightened(corners[i].seen_px);
        const glm::dvec2 there = lens.focal_px * glm::dvec2(p) / p.z + lens.principal_px;
        off(2 * static_cast<Eigen::Index>(i)) = there.x - seen.x;
        off(2 * static_cast<Eigen::Index>(i) + 1) = there.y - seen.y;
    }
    return off;
}

std::optional<Eigen::MatrixXd> slopes(std::span<const BoardCorner> corners,
                                      const Camera& lens,
                                      const Pose& pose)
{
    Eigen::MatrixXd jacobian(2 * static_cast<Eigen::Index>(corners.size()), 6);
    for (int k = 0; k < 6; ++k) {
        Eigen::Matrix<double, 6, 1> step = Eigen::Matrix<double, 6, 1>::Zero();
        step(k) = kDifference;
        const auto high = residuals(corners, lens, moved(pose, step));
        const auto low = residuals(corners, lens, moved(pose, -step));
        if (!high || !low) return std::nullopt;
        jacobian.col(k) = (*high - *low) / (2.0 * kDifference);
    }
    return jacobian;
}

struct Fitted {
    Pose pose;
    double squares = 0.0;
};

/// Levenberg–Marquardt.
std::optional<Fitted> fit(std::span<const BoardCorner> corners, const Camera& lens, Pose pose)
{
    auto off = residuals(corners, lens, pose);
    if (!off) return std::nullopt;
    double damping = 1e-3;
    for (int i = 0; i < kSteps; ++i) {
        const auto jacobian = slopes(corners, lens, pose);
        if (!jacobian) return std::nullopt;
        Eigen::Matrix<double, 6, 6> normal = jacobian->transpose() * *jacobian;
        const Eigen::Matrix<double, 6, 1> gradient = jacobian->transpose() * *off;
        normal.diagonal() *= 1.0 + damping;
        const Eigen::Matrix<double, 6, 1> step = -normal.ldlt().solve(gradient);
        if (!step.allFinite()) return std::nullopt;
        const Pose next = moved(pose, step);
        const auto there = residuals(corners, lens, next);
        if (there && there->squaredNorm() < off->squaredNorm()) {
            pose = next;
            off = there;
            damping = std::max(1e-12, damping * 0.1);
        } else {
            damping *= 10.0;
            if (damping > 1e8) break;
        }
        if (step.norm() < 1e-14) break;
    }
    return Fitted{pose, off->squaredNorm()};
}

/// Picture ~ H (x, y, 1) in units of the focal length, by the direct linear transform.
glm::dmat3 homography(std::span<const BoardCorner> corners, const Camera& lens)
{
    double reach = 0.0;
    for (const BoardCorner& corner : corners)
        reach = std::max(reach, glm::length(corner.on_board_m));
    Eigen::MatrixXd rows(2 * static_cast<Eigen::Index>(corners.size()), 9);
    for (std::size_t i = 0; i < corners.size(); ++i) {
        const glm::dvec2 a = corners[i].on_board_m / reach;
        const glm::dvec2 b =
            (lens.straightened(corners[i].seen_px) - lens.principal_px) / lens.focal_px;
        const auto r = 2 * static_cast<Eigen::Index>(i);
        rows.row(r) << a.x, a.y, 1, 0, 0, 0, -b.x * a.x, -b.x * a.y, -b.x;
        rows.row(r + 1) << 0, 0, 0, a.x, a.y, 1, -b.y * a.x, -b.y * a.y, -b.y;
    }
    const Eigen::JacobiSVD<Eigen::MatrixXd> svd(rows, Eigen::ComputeFullV);
    const Eigen::VectorXd h = svd.matrixV().col(8);
    // Column-major, the columns for x and y in metres.
    return {glm::dvec3(h(0), h(3), h(6)) / reach,
            glm::dvec3(h(1), h(4), h(7)) / reach,
            glm::dvec3(h(2), h(5), h(8))};
}

Pose startOf(const glm::dmat3& h)
{
    const double scale = (h[2].z < 0.0 ? -2.0 : 2.0) / (glm::length(h[0]) + glm::length(h[1]));
    const glm::dvec3 x = glm::normalize(h[0] * scale);
    const glm::dvec3 y = glm::normalize(h[1] * scale - x * glm::dot(x, h[1] * scale));
    return {{x, y, glm::cross(x, y)}, h[2] * scale};
}

/// The board tilted the other way against the line of sight through its middle.
Pose mirrored(const Pose& pose, glm::dvec2 middle)
{
    const glm::dvec3 there = pose.turn * glm::dvec3(middle, 0.0) + pose.origin;
    const glm::dvec3 sight = glm::normalize(there);
    const glm::dvec3 normal = pose.turn[2];
    const glm::dvec3 axis = glm::cross(normal, sight);
    const double sine = glm::length(axis);
    if (sine < 1e-6) return pose;
    const double angle = 2.0 * std::atan2(sine, glm::dot(normal, sight));
    Pose other;
    other.turn = rotation(axis / sine * angle) * pose.turn;
    other.origin = there - other.turn * glm::dvec3(middle, 0.0);
    return other;
}

Pose poseOf(const BoardPose& pose)
{
    return {pose.camera_from_board, pose.origin_m};
}

/// The other picture's camera in the room.
Camera closeUp(const Camera& camera,
               const Pose& board_before_room,
               const Camera& lens,
               const Pose& board_before_lens)
{
    const glm::dmat3 world_from_room(camera.right, -camera.up, camera.forward);
    const glm::dmat3 world_from_board = world_from_room * board_before_room.turn;
    const glm::dvec3 board_origin = camera.position_m + world_from_room * board_before_room.origin;
    const glm::dmat3 world_from_lens = world_from_board * glm::transpose(board_before_lens.turn);
    Camera result = lens;
    result.right = world_from_lens[0];
    result.up = -world_from_lens[1];
    result.forward = world_from_lens[2];
    result.position_m = board_origin - world_from_lens * board_before_lens.origin;
    return result;
}

}  // namespace

std::optional<BoardPose> boardPose(std::span<const BoardCorner> corners, const Camera& lens)
{
    if (corners.size() < kFewestCorners) return std::nullopt;
    glm::dvec2 middle(0.0);
    for (const BoardCorner& corner : corners)
        middle += corner.on_board_m / static_cast<double>(corners.size());
    auto best = fit(corners, lens, startOf(homography(corners, lens)));
    if (!best) return std::nullopt;
    auto other = fit(corners, lens, mirrored(best->pose, middle));
    if (other && other->squares < best->squares) std::swap(*best, *other);

    BoardPose result;
    const double freedom = 2.0 * static_cast<double>(corners.size()) - 6.0;
    result.camera_from_board = best->pose.turn;
    result.origin_m = best->pose.origin;
    result.sigma_px = std::max(kFinestPx, std::sqrt(best->squares / freedom));
    const auto jacobian = slopes(corners, lens, best->pose);
    if (!jacobian) return std::nullopt;
    const Eigen::Matrix<double, 6, 6> covariance =
        (jacobian->transpose() * *jacobian).inverse() * (result.sigma_px * result.sigma_px);
    if (!covariance.allFinite()) return std::nullopt;
    for (int r = 0; r < 6; ++r)
        for (int c = 0; c < 6; ++c)
            result.covariance[static_cast<std::size_t>(r)][static_cast<std::size_t>(c)] =
                covariance(r, c);
    const bool same =
        !other || glm::dot(other->pose.turn[2], best->pose.turn[2]) > std::cos(glm::radians(0.5));
    const double floor = freedom * kFinestPx * kFinestPx;
    if (!same && other->squares < kAmbiguous * kAmbiguous * std::max(best->squares, floor))
        result.findings.push_back(
            {Severity::Warning,
             "board-ambiguous",
             fmt::format(
                 "the board tilted the other way fits nearly as well ({:.2f} against {:.2f} "
                 "px): photograph it from nearer and more aslant",
                 std::sqrt(other->squares / freedom),
                 std::sqrt(best->squares / freedom))});
    return result;
}

BoardLocation placeByBoard(const CameraEstimate& room,
                           std::span<const BoardCorner> room_corners,
                           const Camera& close_lens,
                           double close_focal_sigma,
                           std::span<const BoardCorner> close_corners,
                           const SeenBall& ball,
                           const std::string& source)
{
    const auto before_room = boardPose(room_corners, room.camera);
    const auto before_lens = boardPose(close_corners, close_lens);
    if (!before_room || !before_lens)
        throw NoAnswerError(source,
                            fmt::format("the board is not seen well enough in {}: at least two "
                                        "markers are needed",
                                        before_room ? "the other picture" : "the photograph"));
    const auto place = [&](const Camera& camera,
                           const Pose& room_pose,
                           const Camera& lens,
                           const Pose& lens_pose) {
        CameraEstimate exact;
        exact.camera = closeUp(camera, room_pose, lens, lens_pose);
        return placeBall(exact, ball, source);
    };
    const Pose room_pose = poseOf(*before_room);
    const Pose lens_pose = poseOf(*before_lens);
    BoardLocation result;
    result.close_up = closeUp(room.camera, room_pose, close_lens, lens_pose);
    result.ball = place(room.camera, room_pose, close_lens, lens_pose);
    append(result.findings, before_room->findings);
    append(result.findings, before_lens->findings);
    append(result.findings, result.ball.findings);

    glm::dmat3& covariance = result.ball.covariance;
    const glm::dvec3 center = result.ball.center_m;
    const auto add = [&](glm::dvec3 off) { covariance += glm::outerProduct(off, off); };
    // Board poses: along the columns of the covariance's root.
    for (const bool in_room : {true, false}) {
        Eigen::Matrix<double, 6, 6> m;
        const auto& from = in_room ? before_room->covariance : before_lens->covariance;
        for (int r = 0; r < 6; ++r)
            for (int c = 0; c < 6; ++c)
                m(r, c) = from[static_cast<std::size_t>(r)][static_cast<std::size_t>(c)];
        const Eigen::Matrix<double, 6, 6> root = m.llt().matrixL();
        for (int k = 0; k < 6; ++k) {
            const Pose off = moved(in_room ? room_pose : lens_pose, root.col(k));
            add(place(room.camera, in_room ? off : room_pose, close_lens, in_room ? lens_pose : off)
                    .center_m -
                center);
        }
    }
    // The cameras: the board's place before each follows from what they are.
    const auto with = [&](const Camera& camera, const Camera& lens) {
        const auto a = boardPose(room_corners, camera);
        const auto b = boardPose(close_corners, lens);
        if (!a || !b) throw NoAnswerError(source, "the board's place does not converge");
        return place(camera, poseOf(*a), lens, poseOf(*b)).center_m;
    };
    covariance +=
        covarianceFromCamera(room, [&](const Camera& camera) { return with(camera, close_lens); });
    CameraEstimate lens_estimate;
    lens_estimate.camera = close_lens;
    lens_estimate.focal_sigma_px = close_focal_sigma * close_lens.focal_px.x;
    covariance += covarianceFromCamera(lens_estimate,
                                       [&](const Camera& lens) { return with(room.camera, lens); });
    for (int k = 0; k < 3; ++k)
        result.ball.sigma_m[k] = std::sqrt(covariance[k][k]);
    return result;
}

}  // namespace insitu
