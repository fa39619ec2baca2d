#pragma once

#include "calib/board_pose.h"
#include "core/camera.h"
#include "core/photo.h"

#include <glm/glm.hpp>
#include <opencv2/aruco.hpp>

#include <cmath>
#include <cstdint>
#include <vector>

namespace insitu::drawn_board {

inline const MarkerBoard kBoard{4, 3, 0.05, 0.012};

/// The board lies in the room: its origin, and the directions of its x and y.
struct Laid {
    glm::dvec3 origin{0.1, 0.75, -0.1};
    glm::dvec3 x = glm::normalize(glm::dvec3(1.0, 0.0, 0.25));
    glm::dvec3 y = glm::normalize(glm::dvec3(-0.25, 0.0, 1.0));

    [[nodiscard]] glm::dvec3 at(glm::dvec2 on_board) const
    {
        return origin + x * on_board.x + y * on_board.y;
    }
};

/// A matt ball.
struct DrawnBall {
    glm::dvec3 center{0.0};
    double radius_m = 0.0;  ///< 0: none
};

/// The printed board, and a ball before it, as a camera sees them, 5 x 5 samples a pixel.
inline EncodedImage photograph(const Laid& laid, const Camera& camera, const DrawnBall& ball = {})
{
    const auto dictionary = cv::aruco::getPredefinedDictionary(cv::aruco::DICT_4X4_50);
    std::vector<cv::Mat> markers(static_cast<std::size_t>(kBoard.columns * kBoard.rows));
    for (std::size_t i = 0; i < markers.size(); ++i)
        cv::aruco::drawMarker(dictionary, static_cast<int>(i), 60, markers[i]);
    const double pitch = kBoard.marker_m + kBoard.gap_m;
    const glm::dvec3 normal = glm::cross(laid.x, laid.y);
    const auto shade = [&](glm::dvec2 pixel) {
        const glm::dvec3 ray = camera.rayDirection(pixel);
        const glm::dvec3 to_ball = ball.center - camera.position_m;
        const glm::dvec3 aside = to_ball - ray * glm::dot(to_ball, ray);
        if (glm::length(aside) < ball.radius_m) return 45.0;
        const double t = glm::dot(laid.origin - camera.position_m, normal) / glm::dot(ray, normal);
        if (t <= 0.0) return 120.0;
        const glm::dvec3 off = camera.position_m + ray * t - laid.origin;
        const glm::dvec2 p(glm::dot(off, laid.x), glm::dot(off, laid.y));
        const int c = static_cast<int>(std::floor(p.x / pitch));
        const int r = static_cast<int>(std::floor(p.y / pitch));
        const glm::dvec2 in = p - glm::dvec2(c, r) * pitch;
        if (p.x < -0.02 || p.y < -0.02 || c > kBoard.columns || r > kBoard.rows) return 120.0;
        if (c < 0 || r < 0 || c >= kBoard.columns || r >= kBoard.rows || in.x >= kBoard.marker_m ||
            in.y >= kBoard.marker_m)
            return 220.0;
        const cv::Mat& marker = markers[static_cast<std::size_t>(r * kBoard.columns + c)];
        const int mx = static_cast<int>(in.x / kBoard.marker_m * 60.0);
        const int my = static_cast<int>(in.y / kBoard.marker_m * 60.0);
        return marker.at<std::uint8_t>(my, mx) > 0 ? 220.0 : 30.0;
    };
    EncodedImage image;
    image.codes = Image<glm::u16vec3>(camera.width, camera.height);
    for (int y = 0; y < camera.height; ++y)
        for (int x = 0; x < camera.width; ++x) {
            double sum = 0.0;
            for (int i = 0; i < 25; ++i)
                sum += shade({x + 0.1 + 0.2 * (i % 5), y + 0.1 + 0.2 * (i / 5)}) / 25.0;
            image.codes(x, y) = glm::u16vec3(static_cast<std::uint16_t>(sum + 0.5));
        }
    return image;
}

inline Camera roomCamera()
{
    return Camera::lookAt({0.9, 1.5, 1.6}, {0.2, 0.7, 0.0}, 1100.0, 900, 700);
}

inline Camera closeCamera()
{
    return Camera::lookAt({-0.25, 1.15, 0.55}, {0.2, 0.8, 0.0}, 1400.0, 900, 700);
}

}  // namespace insitu::drawn_board
