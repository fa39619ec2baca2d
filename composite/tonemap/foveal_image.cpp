#include "composite/tonemap/foveal_image.h"

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

/// Kernel cos(angle) / angle² with its middle at (0, 0), cyclic; the place itself is left out.
cv::Mat kernelSpectrum(const cv::Size& size)
{
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
    return kernel;
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

Image<Rgb> veilingLuminance(const Image<Rgb>& foveal)
{
    // Room for the kernel's reach, so that the cyclic sum does not come around.
    const auto padded = [](int pixels) {
        return cv::getOptimalDFTSize(pixels + std::min(pixels, 90));
    };
    const cv::Size size(padded(foveal.width()), padded(foveal.height()));
    // Two real images in each complex one: red and green, blue and the sum of the weights. The
    // latter in the picture's own unit, so that rounding does not carry it over.
    double light = 0.0;
    for (const Rgb& place : foveal.pixels())
        light += static_cast<double>(place.r + place.g + place.b);
    if (light == 0.0) return Image<Rgb>(foveal.width(), foveal.height(), Rgb(0.0f));
    const auto unit = static_cast<float>(light / (3.0 * static_cast<double>(foveal.pixelCount())));
    std::array<cv::Mat, 2> planes;
    const cv::Mat kernel = kernelSpectrum(size);
    parallelFor(0, 2, [&](std::int64_t pair) {
        cv::Mat& plane = planes[static_cast<std::size_t>(pair)];
        plane = cv::Mat::zeros(size, CV_32FC2);
        for (int y = 0; y < foveal.height(); ++y)
            for (int x = 0; x < foveal.width(); ++x) {
                const Rgb& c = foveal(x, y);
                plane.at<cv::Vec2f>(y, x) = pair == 0 ? cv::Vec2f(c.r, c.g) : cv::Vec2f(c.b, unit);
            }
        cv::dft(plane, plane);
        cv::mulSpectrums(plane, kernel, plane, 0);
        cv::dft(plane, plane, cv::DFT_INVERSE | cv::DFT_SCALE);
    });
    Image<Rgb> veil(foveal.width(), foveal.height(), Rgb(0.0f));
    for (int y = 0; y < foveal.height(); ++y)
        for (int x = 0; x < foveal.width(); ++x) {
            const cv::Vec2f red_green = planes[0].at<cv::Vec2f>(y, x);
            const cv::Vec2f blue_weight = planes[1].at<cv::Vec2f>(y, x);
            const float weight = blue_weight[1] / unit;
            // A picture of one place has nothing around it.
            if (weight < 1e-3f)
                veil(x, y) = foveal(x, y);
            else
                veil(x, y) =
                    glm::max(Rgb(red_green[0], red_green[1], blue_weight[0]), Rgb(0.0f)) / weight;
        }
    return veil;
}

}  // namespace insitu::tonemap
