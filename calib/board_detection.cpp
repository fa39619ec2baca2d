#include "calib/board_pose.h"

#include <fmt/format.h>
#include <opencv2/aruco.hpp>
#include <opencv2/imgproc.hpp>

namespace insitu {

namespace {

/// OpenCV counts from pixel centres.
constexpr double kCenterShift = 0.5;
constexpr int kMostMarkers = 50;

}  // namespace

Findings MarkerBoard::validate() const
{
    Findings problems;
    const auto check = [&](bool good, const std::string& message) {
        if (!good) problems.push_back({Severity::Error, "board-options", message});
    };
    check(columns >= 1 && rows >= 1 && columns <= kMostMarkers && rows <= kMostMarkers &&
              columns * rows <= kMostMarkers,
          fmt::format("a board of {} x {} markers; 1 to {} in all are possible",
                      columns,
                      rows,
                      kMostMarkers));
    check(marker_m > 0.0 && marker_m < 1e3, "marker_m must be positive");
    check(gap_m > 0.0 && gap_m < 1e3, "gap_m must be positive");
    return problems;
}

std::vector<BoardCorner> findBoard(const EncodedImage& image, const MarkerBoard& board)
{
    requireValid(board.validate(), "marker board");
    const Image<glm::u16vec3>& codes = image.codes;
    if (codes.empty()) return {};
    cv::Mat grey(codes.height(), codes.width(), CV_8U);
    for (int y = 0; y < codes.height(); ++y)
        for (int x = 0; x < codes.width(); ++x) {
            const glm::dvec3 code(codes(x, y));
            grey.at<std::uint8_t>(y, x) = static_cast<std::uint8_t>(
                (0.299 * code.r + 0.587 * code.g + 0.114 * code.b) * 255.0 / image.max_code + 0.5);
        }
    const auto dictionary = cv::aruco::getPredefinedDictionary(cv::aruco::DICT_4X4_50);
    const auto parameters = cv::aruco::DetectorParameters::create();
    parameters->cornerRefinementMethod = cv::aruco::CORNER_REFINE_SUBPIX;
    std::vector<std::vector<cv::Point2f>> found;
    std::vector<int> ids;
    cv::aruco::detectMarkers(grey, dictionary, found, ids, parameters);

    std::vector<BoardCorner> corners;
    const double pitch = board.marker_m + board.gap_m;
    for (std::size_t i = 0; i < ids.size(); ++i) {
        if (ids[i] < 0 || ids[i] >= board.columns * board.rows) continue;
        const glm::dvec2 first(pitch * (ids[i] % board.columns), pitch * (ids[i] / board.columns));
        const glm::dvec2 around[] = {{0, 0}, {1, 0}, {1, 1}, {0, 1}};
        for (std::size_t k = 0; k < 4; ++k)
            corners.push_back({first + around[k] * board.marker_m,
                               glm::dvec2(found[i][k].x, found[i][k].y) + kCenterShift});
    }
    return corners;
}

}  // namespace insitu
