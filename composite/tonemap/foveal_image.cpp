#include "composite/tonemap/foveal_image.h"

#include "core/check.h"
#include "core/parallel.h"

#include <opencv2/core.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

namespace insitu::tonemap {

namespace {

constexpr double kDegree = 0.01745;  ///< as in equation 5.1

CellCover coverOf(int pixels, int cells)
{
    CellCover cover;
    for (int i = 0; i < cells; ++i) {
        const double from = static_cast<double>(i) * pixels / cells;
        const double to = static_cast<double>(i + 1) * pixels / cells;
        const int first = static_cast<int>(from);
        const int last = std::min(pixels - 1, static_cast<int>(std::ceil(to)) - 1);
        cover.first.push_back(first);
        cover.last.push_back(last);
        cover.first_weight.push_back(static_cast<float>(std::min(to, first + 1.0) - from));
        cover.last_weight.push_back(static_cast<float>(to - last));
    }
    return cover;
}

template <class Get>
Rgb coveredMean(const CellCover& cover, std::size_t cell, const Get& get)
{
    const int first = cover.first[cell];
    const int last = cover.last[cell];
    Rgb sum = cover.first_weight[cell] * get(first);
    float weight = cover.first_weight[cell];
    for (int i = first + 1; i < last; ++i)
        sum += get(i);
    weight += static_cast<float>(std::max(0, last - first - 1));
    if (last > first) {
        sum += cover.last_weight[cell] * get(last);
        weight += cover.last_weight[cell];
    }
    return sum / weight;
}

/// Spectrum times the kernel's, and back.
void convolve(cv::Mat& plane, const Image<float>& spectrum, int rows)
{
    cv::dft(plane, plane, 0, rows);
    for (int y = 0; y < plane.rows; ++y) {
        cv::Vec2f* const line = plane.ptr<cv::Vec2f>(y);
        const auto factors = spectrum.row(y);
        for (int x = 0; x < plane.cols; ++x)
            line[x] *= factors[static_cast<std::size_t>(x)];
    }
    cv::dft(plane, plane, cv::DFT_INVERSE | cv::DFT_SCALE);
}

}  // namespace

FovealImage::FovealImage(int scene_width, int scene_height, double field_of_view)
{
    const double across = 2.0 * std::tan(0.5 * field_of_view) / kDegree;
    const double down = across * scene_height / scene_width;
    const int width = std::clamp(static_cast<int>(std::lround(across)), 1, scene_width);
    const int height = std::clamp(static_cast<int>(std::lround(down)), 1, scene_height);
    columns_ = coverOf(scene_width, width);
    rows_ = coverOf(scene_height, height);
    image_ = Image<Rgb>(width, height);
}

void FovealImage::add(const SceneStrip& strip)
{
    const auto begin = std::ranges::lower_bound(rows_.last, strip.first);
    const auto end = std::ranges::lower_bound(rows_.first, strip.end());
    std::vector<Rgb> left_line;
    float left_weight = 0.0f;
    parallelFor(begin - rows_.last.begin(), end - rows_.first.begin(), [&](std::int64_t row) {
        const auto y = static_cast<std::size_t>(row);
        // Rows first: long lines.
        std::vector<Rgb> line(static_cast<std::size_t>(strip.width()), Rgb(0.0f));
        float weights = 0.0f;
        if (rows_.first[y] < strip.first) {
            line = open_line_;
            weights = open_weight_;
        }
        for (int k = std::max(rows_.first[y], strip.first);
             k <= std::min(rows_.last[y], strip.end() - 1);
             ++k) {
            const float weight = k == rows_.first[y]  ? rows_.first_weight[y]
                                 : k == rows_.last[y] ? rows_.last_weight[y]
                                                      : 1.0f;
            weights += weight;
            const auto source = strip.row(k);
            for (std::size_t x = 0; x < line.size(); ++x)
                line[x] += weight * source[x];
        }
        if (rows_.last[y] >= strip.end()) {
            // Cells share at most a row, so that one of them is left open.
            left_line = std::move(line);
            left_weight = weights;
            return;
        }
        for (int x = 0; x < image_.width(); ++x)
            image_(x, static_cast<int>(row)) =
                coveredMean(columns_,
                            static_cast<std::size_t>(x),
                            [&](int i) { return line[static_cast<std::size_t>(i)]; }) /
                weights;
    });
    open_line_ = std::move(left_line);
    open_weight_ = left_weight;
}

VeilKernel::VeilKernel(int width, int height) : weights_(width, height)
{
    // Room for the kernel's reach, so that the cyclic sum does not come around.
    const auto padded = [](int pixels) {
        return cv::getOptimalDFTSize(pixels + std::min(pixels, 90));
    };
    const cv::Size size(padded(width), padded(height));
    // Its middle at (0, 0), cyclic; the place itself is left out.
    cv::Mat kernel(size, CV_32FC2);
    parallelFor(0, size.height, [&](std::int64_t row) {
        const int y = static_cast<int>(row);
        for (int x = 0; x < size.width; ++x) {
            const double degrees =
                std::hypot(std::min(x, size.width - x), std::min(y, size.height - y));
            const bool counts = degrees > 0.0 && degrees < 90.0;
            const double weight = counts ? std::cos(degrees * kDegree) / (degrees * degrees) : 0.0;
            kernel.at<cv::Vec2f>(y, x) = {static_cast<float>(weight), 0.0f};
        }
    });
    cv::dft(kernel, kernel);
    spectrum_ = Image<float>(size.width, size.height);
    for (int y = 0; y < size.height; ++y)
        for (int x = 0; x < size.width; ++x)
            spectrum_(x, y) = kernel.at<cv::Vec2f>(y, x)[0];

    cv::Mat ones = cv::Mat::zeros(size, CV_32FC2);
    ones(cv::Rect(0, 0, width, height)).setTo(cv::Scalar(1.0, 0.0));
    convolve(ones, spectrum_, height);
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x)
            weights_(x, y) = ones.at<cv::Vec2f>(y, x)[0];
}

Image<Rgb> VeilKernel::veil(const Image<Rgb>& foveal) const
{
    INSITU_CHECK(isFor(foveal), "{}x{}", foveal.width(), foveal.height());
    // Two real images in a complex one: red and green.
    std::array<cv::Mat, 2> planes;
    parallelFor(0, 2, [&](std::int64_t pair) {
        cv::Mat& plane = planes[static_cast<std::size_t>(pair)];
        plane = cv::Mat::zeros(cv::Size(spectrum_.width(), spectrum_.height()), CV_32FC2);
        for (int y = 0; y < foveal.height(); ++y) {
            cv::Vec2f* const line = plane.ptr<cv::Vec2f>(y);
            for (int x = 0; x < foveal.width(); ++x) {
                const Rgb& c = foveal(x, y);
                line[x] = pair == 0 ? cv::Vec2f(c.r, c.g) : cv::Vec2f(c.b, 0.0f);
            }
        }
        convolve(plane, spectrum_, foveal.height());
    });
    Image<Rgb> veil(foveal.width(), foveal.height());
    for (int y = 0; y < foveal.height(); ++y)
        for (int x = 0; x < foveal.width(); ++x) {
            const cv::Vec2f red_green = planes[0].at<cv::Vec2f>(y, x);
            const float blue = planes[1].at<cv::Vec2f>(y, x)[0];
            const float weight = weights_(x, y);
            // A picture of one place has nothing around it.
            veil(x, y) = weight < 1e-3f
                             ? foveal(x, y)
                             : glm::max(Rgb(red_green[0], red_green[1], blue), Rgb(0.0f)) / weight;
        }
    return veil;
}

}  // namespace insitu::tonemap
