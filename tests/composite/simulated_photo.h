#pragma once

#include "core/photo.h"
#include "core/random.h"
#include "core/response_curve.h"

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <cmath>
#include <functional>

namespace insitu {

/// A camera for tests of what belongs to a photograph: light in, codes out.
struct SimulatedPhoto {
    double read_noise = 0.002;     ///< deviation of a black pixel, of full scale
    double photon_noise = 0.0004;  ///< variance per exposure, of full scale
    bool demosaic = false;         ///< one channel a pixel, the others interpolated
    int jpeg_quality = 0;          ///< 1..100; 0: none

    /// `light` in [0, 1] of full scale, through sRGB.
    [[nodiscard]] EncodedImage take(const Image<Rgb>& light, std::uint64_t shot) const
    {
        const int w = light.width();
        const int h = light.height();
        Image<Rgb> exposure(w, h);
        for (int y = 0; y < h; ++y)
            for (int x = 0; x < w; ++x) {
                RandomStream random(
                    17,
                    static_cast<std::uint64_t>(y) * 100003u + static_cast<std::uint64_t>(x),
                    shot);
                for (int c = 0; c < 3; ++c) {
                    const double e = light(x, y)[c];
                    exposure(x, y)[c] = static_cast<float>(
                        e +
                        std::sqrt(read_noise * read_noise + photon_noise * e) * random.normal());
                }
            }
        if (demosaic) exposure = demosaiced(exposure);
        cv::Mat codes(h, w, CV_8UC3);
        const ResponseCurve response = ResponseCurve::srgb();
        for (int y = 0; y < h; ++y)
            for (int x = 0; x < w; ++x)
                for (int c = 0; c < 3; ++c)
                    codes.at<cv::Vec3b>(y, x)[2 - c] = static_cast<unsigned char>(std::lround(
                        response.encode(c, std::clamp<double>(exposure(x, y)[c], 0.0, 1.0))));
        if (jpeg_quality > 0) {
            std::vector<unsigned char> bytes;
            cv::imencode(".jpg", codes, bytes, {cv::IMWRITE_JPEG_QUALITY, jpeg_quality});
            codes = cv::imdecode(bytes, cv::IMREAD_COLOR);
        }
        EncodedImage photo{Image<glm::u16vec3>(w, h), 255};
        for (int y = 0; y < h; ++y)
            for (int x = 0; x < w; ++x) {
                const cv::Vec3b& v = codes.at<cv::Vec3b>(y, x);
                photo.codes(x, y) = {v[2], v[1], v[0]};
            }
        return photo;
    }

private:
    /// Bilinear interpolation of an RGGB mosaic.
    static Image<Rgb> demosaiced(const Image<Rgb>& full)
    {
        const int w = full.width();
        const int h = full.height();
        const auto channelAt = [](int x, int y) { return y % 2 == 0 ? x % 2 : 1 + x % 2; };
        Image<Rgb> result(w, h);
        for (int y = 0; y < h; ++y)
            for (int x = 0; x < w; ++x) {
                Rgb sum(0.0f);
                Rgb weight(0.0f);
                for (int dy = -1; dy <= 1; ++dy)
                    for (int dx = -1; dx <= 1; ++dx) {
                        const int sx = std::clamp(x + dx, 0, w - 1);
                        const int sy = std::clamp(y + dy, 0, h - 1);
                        const int c = channelAt(sx, sy);
                        const float k = (dx == 0 ? 2.0f : 1.0f) * (dy == 0 ? 2.0f : 1.0f);
                        sum[c] += k * full(sx, sy)[c];
                        weight[c] += k;
                    }
                result(x, y) = sum / weight;
                // What was measured stays as it is.
                const int own = channelAt(x, y);
                result(x, y)[own] = full(x, y)[own];
            }
        return result;
    }
};

/// A picture from a function of the pixel's centre.
[[nodiscard]] inline Image<Rgb> picture(int width,
                                        int height,
                                        const std::function<Rgb(double x, double y)>& at)
{
    Image<Rgb> image(width, height);
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x)
            image(x, y) = at(x + 0.5, y + 0.5);
    return image;
}

}  // namespace insitu
