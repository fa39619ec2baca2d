#include "calib/segment_detection.h"

#include "calib/edge_fit.h"
#include "core/check.h"

#include <fmt/format.h>
#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <cmath>

namespace insitu {

namespace {

/// The detector's own reduction before it takes gradients, against aliasing [Gioi10].
constexpr double kDetectorScale = 0.8;
/// Its points count from pixel centres of the reduced picture, half a pixel from ours.
constexpr double kCenterShift = 0.5 / kDetectorScale;
/// How far an edge may lie from where the detector saw it, working pixels.
constexpr double kReach = 2.5;

/// Grey codes, 0 to 255, of the encoded picture, reduced to the working size.
cv::Mat reducedGrey(const EncodedImage& image, double scale)
{
    const Image<glm::u16vec3>& codes = image.codes;
    cv::Mat grey(codes.height(), codes.width(), CV_32F);
    for (int y = 0; y < codes.height(); ++y) {
        const auto row = codes.row(y);
        auto* out = grey.ptr<float>(y);
        for (int x = 0; x < codes.width(); ++x) {
            const glm::vec3 code = glm::vec3(row[static_cast<std::size_t>(x)]);
            out[x] = (0.299f * code.r + 0.587f * code.g + 0.114f * code.b) * 255.0f /
                     static_cast<float>(image.max_code);
        }
    }
    if (scale >= 1.0) return grey;
    cv::Mat reduced;
    const cv::Size size(std::max(1, static_cast<int>(std::lround(codes.width() * scale))),
                        std::max(1, static_cast<int>(std::lround(codes.height() * scale))));
    cv::resize(grey, reduced, size, 0.0, 0.0, cv::INTER_AREA);
    return reduced;
}

Image<float> toImage(const cv::Mat& grey)
{
    Image<float> image(grey.cols, grey.rows);
    for (int y = 0; y < grey.rows; ++y)
        std::copy_n(grey.ptr<float>(y), grey.cols, image.row(y).begin());
    return image;
}

std::vector<DetectedSegment> rawSegments(const cv::Mat& grey)
{
    cv::Mat codes;
    grey.convertTo(codes, CV_8U);
    std::vector<cv::Vec4f> found;
    cv::createLineSegmentDetector(cv::LSD_REFINE_STD, kDetectorScale)->detect(codes, found);
    std::vector<DetectedSegment> segments;
    for (const cv::Vec4f& ends : found)
        segments.push_back({glm::dvec2(ends[0], ends[1]) + kCenterShift,
                            glm::dvec2(ends[2], ends[3]) + kCenterShift,
                            1.0});
    return segments;
}

}  // namespace

Findings SegmentDetectionOptions::validate() const
{
    Findings problems;
    const auto refuse = [&](const std::string& message) {
        problems.push_back({Severity::Error, "segment-options", message});
    };
    if (working_side_px < 64)
        refuse(fmt::format("working_side_px is {}, must be at least 64", working_side_px));
    if (!(shortest > 0.0 && shortest <= 0.5))
        refuse(fmt::format("shortest is {}, must lie in (0, 0.5]", shortest));
    if (most_segments <= 0)
        refuse(fmt::format("most_segments is {}, must be positive", most_segments));
    return problems;
}

std::vector<DetectedSegment> detectSegments(const EncodedImage& image,
                                            const SegmentDetectionOptions& options)
{
    requireValid(options.validate(), "segment detection options");
    if (image.codes.empty()) throw InputError("segment detection", "the picture is empty");
    const int width = image.codes.width();
    const int height = image.codes.height();
    const double scale =
        std::min(1.0, options.working_side_px / static_cast<double>(std::max(width, height)));
    const cv::Mat reduced = reducedGrey(image, scale);
    const Image<float> grey = toImage(reduced);

    const double shortest = options.shortest * std::hypot(reduced.cols, reduced.rows);
    std::vector<DetectedSegment> fitted;
    for (const DetectedSegment& raw : rawSegments(reduced)) {
        // Pieces of half the length may still join to one that counts.
        if (raw.length() < 0.5 * shortest) continue;
        if (const auto edge = edges::fitEdge(grey, raw, kReach)) fitted.push_back(*edge);
    }
    std::vector<DetectedSegment> segments = edges::joinPieces(std::move(fitted), grey);
    std::erase_if(segments, [&](const DetectedSegment& s) { return s.length() < shortest; });
    if (segments.size() > static_cast<std::size_t>(options.most_segments))
        segments.resize(static_cast<std::size_t>(options.most_segments));
    // The two directions were rounded to whole pixels separately.
    const glm::dvec2 back(width / static_cast<double>(reduced.cols),
                          height / static_cast<double>(reduced.rows));
    for (DetectedSegment& segment : segments) {
        segment.from_px *= back;
        segment.to_px *= back;
        segment.sigma_px *= back.x;
    }
    return segments;
}

}  // namespace insitu
