#include "calib/picture_drawing.h"

#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <cmath>
#include <vector>

namespace insitu {

namespace {

/// Nearer to the camera than this nothing is drawn, metres along the view.
constexpr double kNear = 0.02;
/// Straight lines of the world are drawn in so many pieces, for lenses that bend them.
constexpr int kPieces = 24;
/// Lines are cut to this many picture sizes around it, so that a far end costs no time.
constexpr double kMargin = 1.0;
/// Height of a capital of the font at scale 1, pixels.
constexpr double kCapital = 21.0;

bool finite(glm::dvec2 p)
{
    return std::isfinite(p.x) && std::isfinite(p.y);
}

void blend(EncodedImage& picture, int x, int y, double cover, const Ink& ink)
{
    glm::u16vec3& code = picture.codes(x, y);
    const auto share = static_cast<float>(std::clamp(cover, 0.0, 1.0) * ink.opacity);
    const glm::vec3 mixed =
        glm::vec3(code) * (1.0f - share) + ink.color * static_cast<float>(picture.max_code) * share;
    code = glm::u16vec3(mixed + 0.5f);
}

/// Liang–Barsky against the picture with a margin; false when nothing is left.
bool cut(const EncodedImage& picture, glm::dvec2& from, glm::dvec2& to)
{
    const glm::dvec2 size(picture.codes.width(), picture.codes.height());
    const glm::dvec2 low = -kMargin * size;
    const glm::dvec2 high = (1.0 + kMargin) * size;
    double enter = 0.0;
    double leave = 1.0;
    const glm::dvec2 way = to - from;
    for (int k = 0; k < 2; ++k)
        for (const double sign : {-1.0, 1.0}) {
            const double speed = sign * way[k];
            const double room = sign < 0.0 ? from[k] - low[k] : high[k] - from[k];
            if (speed == 0.0) {
                if (room < 0.0) return false;
            } else if (speed < 0.0) {
                enter = std::max(enter, room / speed);
            } else {
                leave = std::min(leave, room / speed);
            }
        }
    if (enter > leave) return false;
    const glm::dvec2 start = from;
    from = start + way * enter;
    to = start + way * leave;
    return true;
}

/// Calls visit(x, y, distance) for the pixels within `reach` of the segment.
template <class Visit>
void nearSegment(
    const EncodedImage& picture, glm::dvec2 from, glm::dvec2 to, double reach, Visit visit)
{
    const glm::dvec2 way = to - from;
    const double square = glm::dot(way, way);
    const bool steep = std::abs(way.y) > std::abs(way.x);
    const int along = steep ? 1 : 0;
    const int across = 1 - along;
    const int sizes[] = {picture.codes.width(), picture.codes.height()};
    const double slope = square > 0.0 ? way[across] / way[along] : 0.0;
    const double wide = reach * std::sqrt(1.0 + slope * slope) + 1.0;
    const int first =
        std::max(0, static_cast<int>(std::floor(std::min(from[along], to[along]) - reach)));
    const int last = std::min(
        sizes[along] - 1, static_cast<int>(std::ceil(std::max(from[along], to[along]) + reach)));
    for (int a = first; a <= last; ++a) {
        const double middle = from[across] + slope * (a + 0.5 - from[along]);
        const int low = std::max(0, static_cast<int>(std::floor(middle - wide)));
        const int high = std::min(sizes[across] - 1, static_cast<int>(std::ceil(middle + wide)));
        for (int c = low; c <= high; ++c) {
            glm::dvec2 p;
            p[along] = a + 0.5;
            p[across] = c + 0.5;
            const double t =
                square > 0.0 ? std::clamp(glm::dot(p - from, way) / square, 0.0, 1.0) : 0.0;
            visit(steep ? c : a, steep ? a : c, glm::length(p - from - way * t));
        }
    }
}

}  // namespace

void drawLine(EncodedImage& picture, glm::dvec2 from_px, glm::dvec2 to_px, const Ink& ink)
{
    const glm::dvec2 ends[] = {from_px, to_px};
    drawPolyline(picture, ends, ink);
}

void drawPolyline(EncodedImage& picture, std::span<const glm::dvec2> points_px, const Ink& ink)
{
    if (picture.codes.empty()) return;
    // Covered once where pieces meet: collected first, then blended.
    Image<float> cover;
    std::vector<glm::ivec2> touched;
    const double half = 0.5 * ink.width_px;
    for (std::size_t i = 1; i < points_px.size(); ++i) {
        glm::dvec2 from = points_px[i - 1];
        glm::dvec2 to = points_px[i];
        if (!finite(from) || !finite(to) || !cut(picture, from, to)) continue;
        if (cover.empty())
            cover = Image<float>(picture.codes.width(), picture.codes.height(), 0.0f);
        nearSegment(picture, from, to, half + 0.5, [&](int x, int y, double distance) {
            const auto share = static_cast<float>(std::clamp(half + 0.5 - distance, 0.0, 1.0));
            if (share <= cover(x, y)) return;
            if (cover(x, y) == 0.0f) touched.emplace_back(x, y);
            cover(x, y) = share;
        });
    }
    for (const glm::ivec2 p : touched)
        blend(picture, p.x, p.y, cover(p.x, p.y) * std::min(1.0, ink.width_px), ink);
}

void drawDot(EncodedImage& picture, glm::dvec2 center_px, double radius_px, const Ink& ink)
{
    Ink disc = ink;
    disc.width_px = 2.0 * radius_px;
    drawLine(picture, center_px, center_px, disc);
}

void drawLabel(EncodedImage& picture,
               glm::dvec2 at_px,
               const std::string& text,
               double height_px,
               const Ink& ink)
{
    if (!finite(at_px) || text.empty()) return;
    const double scale = height_px / kCapital;
    const int thick = std::max(1, static_cast<int>(std::lround(ink.width_px)));
    int below = 0;
    const cv::Size size = cv::getTextSize(text, cv::FONT_HERSHEY_SIMPLEX, scale, thick, &below);
    const int pad = thick + 2;
    cv::Mat mask = cv::Mat::zeros(size.height + below + 2 * pad, size.width + 2 * pad, CV_8U);
    cv::putText(mask,
                text,
                {pad, pad + size.height},
                cv::FONT_HERSHEY_SIMPLEX,
                scale,
                cv::Scalar(255),
                thick,
                cv::LINE_AA);
    const int left = static_cast<int>(std::lround(std::clamp(at_px.x, -1e6, 1e6))) - pad;
    const int top =
        static_cast<int>(std::lround(std::clamp(at_px.y, -1e6, 1e6))) - size.height - pad;
    for (int y = 0; y < mask.rows; ++y)
        for (int x = 0; x < mask.cols; ++x) {
            const int px = left + x;
            const int py = top + y;
            if (mask.at<std::uint8_t>(y, x) == 0 || px < 0 || py < 0 ||
                px >= picture.codes.width() || py >= picture.codes.height())
                continue;
            blend(picture, px, py, mask.at<std::uint8_t>(y, x) / 255.0, ink);
        }
}

void drawWorldLine(
    EncodedImage& picture, const Camera& camera, glm::dvec3 from_m, glm::dvec3 to_m, const Ink& ink)
{
    const double a = glm::dot(from_m - camera.position_m, camera.forward);
    const double b = glm::dot(to_m - camera.position_m, camera.forward);
    if (a < kNear && b < kNear) return;
    const glm::dvec3 way = to_m - from_m;
    if (a < kNear) from_m += way * ((kNear - a) / (b - a));
    if (b < kNear) to_m -= way * ((kNear - b) / (a - b));
    // Evenly in the picture, not in the world: a pinhole sees straight lines.
    const double near_inverse = 1.0 / std::max(kNear, a);
    const double far_inverse = 1.0 / std::max(kNear, b);
    std::vector<glm::dvec2> points;
    for (int i = 0; i <= kPieces; ++i) {
        const double t = static_cast<double>(i) / kPieces;
        const double share = t * far_inverse / ((1.0 - t) * near_inverse + t * far_inverse);
        if (const auto p = camera.project(from_m + (to_m - from_m) * share))
            points.push_back(*p);
        else if (!points.empty())
            break;
    }
    drawPolyline(picture, points, ink);
}

}  // namespace insitu
