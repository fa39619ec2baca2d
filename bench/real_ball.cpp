// A mirror ball that was really there: the composite with the ball's model inserted against the
// photograph with the ball.
//
//   real_ball PROJECT PHOTOGRAPH [--samples N] [--ignore X0 Y0 X1 Y1...]
//
// PROJECT inserts the ball into the empty photograph and says where the ball is in the pictures;
// PHOTOGRAPH has the same exposure as the empty one. Both are linearised by the response that the
// probe's bracket gives. Reflections: within 0.92 of the ball's outline, after one scale a channel;
// where the inserted ball would have to move and grow to lie on the photographed one. Shadow:
// ratios to the empty photograph, blurred, over the pixels that the composite darkens by more
// than 1.5 %, without the ball and without rectangles that --ignore names (what carries the ball).
#include "composite/differential.h"
#include "core/check.h"
#include "core/io/image_io.h"
#include "pipeline/insert.h"

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <vector>

namespace insitu {
namespace {

using Plane = cv::Mat_<float>;
using Planes = std::array<Plane, 3>;
using Mask = cv::Mat_<std::uint8_t>;

struct Arguments {
    int samples = 32;
    std::vector<int> ignore;  ///< rectangles: x0, y0, x1, y1, pixels
    std::filesystem::path project, photograph;
};

Planes planesOf(const Image<Rgb>& image, double blur_px)
{
    Planes planes;
    for (int c = 0; c < 3; ++c) {
        Plane& plane = planes[static_cast<std::size_t>(c)];
        plane = Plane(image.height(), image.width());
        for (int y = 0; y < image.height(); ++y)
            for (int x = 0; x < image.width(); ++x)
                plane(y, x) = image(x, y)[c];
        if (blur_px > 0.0) cv::GaussianBlur(plane, plane, {0, 0}, blur_px);
    }
    return planes;
}

/// Moments of two planes over a mask.
struct Comparison {
    double scale = 1.0;       ///< of the first, least squares
    double difference = 0.0;  ///< mean |scale a - b| / mean b
    double correlation = 0.0;
    double residual = 0.0;  ///< sum of squares
};

Comparison compare(const Plane& a, const Plane& b, const Mask& mask)
{
    double n = 0.0, sa = 0.0, sb = 0.0, saa = 0.0, sbb = 0.0, sab = 0.0;
    for (int y = 0; y < mask.rows; ++y)
        for (int x = 0; x < mask.cols; ++x) {
            if (mask(y, x) == 0) continue;
            const double va = a(y, x);
            const double vb = b(y, x);
            n += 1.0;
            sa += va;
            sb += vb;
            saa += va * va;
            sbb += vb * vb;
            sab += va * vb;
        }
    Comparison result;
    result.scale = sab / saa;
    result.correlation = (sab - sa * sb / n) / std::sqrt((saa - sa * sa / n) * (sbb - sb * sb / n));
    result.residual = sbb - sab * sab / saa;
    double off = 0.0;
    for (int y = 0; y < mask.rows; ++y)
        for (int x = 0; x < mask.cols; ++x)
            if (mask(y, x) != 0)
                off += std::abs(result.scale * static_cast<double>(a(y, x)) -
                                static_cast<double>(b(y, x)));
    result.difference = off / sb;
    return result;
}

Mask discMask(cv::Size size, glm::dvec2 center, double radius)
{
    Mask mask(size, std::uint8_t{0});
    for (int y = 0; y < size.height; ++y)
        for (int x = 0; x < size.width; ++x)
            if (glm::length(glm::dvec2(x + 0.5, y + 0.5) - center) < radius) mask(y, x) = 255;
    return mask;
}

/// Moved by `shift` and grown by `factor` about the ball's centre.
Plane moved(const Plane& plane, glm::dvec2 center, glm::dvec3 shift_and_factor)
{
    const double f = shift_and_factor.z;
    const glm::dvec2 middle = center - 0.5;
    const cv::Matx23d to(f,
                         0.0,
                         middle.x + shift_and_factor.x - f * middle.x,
                         0.0,
                         f,
                         middle.y + shift_and_factor.y - f * middle.y);
    Plane result;
    cv::warpAffine(plane, result, to, plane.size(), cv::INTER_CUBIC, cv::BORDER_REPLICATE);
    return result;
}

/// Shift (pixels) and growth that lay the inserted ball best onto the photographed one: downhill
/// over all neighbours of a step that is halved.
glm::dvec3 registerBall(const Plane& inserted,
                        const Plane& real,
                        const Mask& mask,
                        glm::dvec2 center)
{
    const auto cost = [&](glm::dvec3 at) {
        return compare(moved(inserted, center, at), real, mask).residual;
    };
    glm::dvec3 best(0.0, 0.0, 1.0);
    double least = cost(best);
    for (double step = 0.8; step > 0.02;) {
        const glm::dvec3 from = best;
        for (int i = 0; i < 27; ++i) {
            const glm::dvec3 next =
                from + step * glm::dvec3(i % 3 - 1, i / 3 % 3 - 1, 0.01 * (i / 9 - 1));
            const double value = cost(next);
            if (value >= least) continue;
            least = value;
            best = next;
        }
        if (best == from) step *= 0.5;
    }
    return best;
}

void printReflections(const Image<Rgb>& inserted, const Image<Rgb>& real, const MirrorBall& ball)
{
    const Mask mask =
        discMask({inserted.width(), inserted.height()}, ball.center_px, 0.92 * ball.radius_px);
    for (const double blur : {0.0, 2.0}) {
        const Planes a = planesOf(inserted, blur);
        const Planes b = planesOf(real, blur);
        for (std::size_t c = 0; c < 3; ++c) {
            const Comparison result = compare(a[c], b[c], mask);
            fmt::print(
                "reflections, blur {:.0f} px, {}: scale {:.3f}, difference {:.3f}, "
                "correlation {:.3f}\n",
                blur,
                "rgb"[c],
                result.scale,
                result.difference,
                result.correlation);
        }
    }
    const glm::dvec3 place =
        registerBall(planesOf(inserted, 1.0)[1], planesOf(real, 1.0)[1], mask, ball.center_px);
    fmt::print(
        "the photographed ball lies {:+.2f} {:+.2f} px beside the inserted one and is "
        "{:+.2f} % larger\n",
        place.x,
        place.y,
        100.0 * (place.z - 1.0));
}

void printShadow(const Image<Rgb>& inserted,
                 const Image<Rgb>& real,
                 const Image<Rgb>& empty,
                 const MirrorBall& ball,
                 const Arguments& arguments)
{
    constexpr double kBlur = 6.0;
    constexpr float kDarkened = 0.985f;
    const Planes a = planesOf(inserted, kBlur);
    const Planes b = planesOf(real, kBlur);
    const Planes e = planesOf(empty, kBlur);
    const cv::Size size(empty.width(), empty.height());
    Mask outside;
    cv::bitwise_not(discMask(size, ball.center_px, ball.radius_px + 3.0 * kBlur), outside);
    for (std::size_t i = 0; i + 3 < arguments.ignore.size(); i += 4)
        cv::rectangle(outside,
                      {arguments.ignore[i], arguments.ignore[i + 1]},
                      {arguments.ignore[i + 2], arguments.ignore[i + 3]},
                      cv::Scalar(0),
                      cv::FILLED);
    std::vector<cv::Point> places;
    for (int y = 0; y < size.height; ++y)
        for (int x = 0; x < size.width; ++x)
            if (outside(y, x) != 0 && a[1](y, x) < kDarkened * e[1](y, x))
                places.emplace_back(x, y);
    fmt::print("shadow: {} pixels\n", places.size());
    if (places.empty()) return;
    for (std::size_t c = 0; c < 3; ++c) {
        std::vector<double> ours, theirs;
        double off = 0.0, none = 0.0;
        for (const cv::Point p : places) {
            ours.push_back(a[c](p) / e[c](p));
            theirs.push_back(b[c](p) / e[c](p));
            off += std::abs(ours.back() - theirs.back());
            none += std::abs(1.0 - theirs.back());
        }
        const auto mean = [](const std::vector<double>& v) {
            double sum = 0.0;
            for (const double x : v)
                sum += x;
            return sum / static_cast<double>(v.size());
        };
        const auto darkest = [](std::vector<double> v) {
            std::ranges::sort(v);
            return v[v.size() / 40];
        };
        fmt::print(
            "shadow, {}: mean {:.3f} photographed, {:.3f} inserted; darkest 2.5 % {:.3f}, "
            "{:.3f}; mean difference {:.3f}, without a shadow {:.3f}\n",
            "rgb"[c],
            mean(theirs),
            mean(ours),
            darkest(theirs),
            darkest(ours),
            off / static_cast<double>(places.size()),
            none / static_cast<double>(places.size()));
    }
}

void run(const Arguments& arguments)
{
    const Project project = readProject(arguments.project);
    InsertOptions options;
    options.render.max_samples = options.render.min_samples = arguments.samples;
    Progress progress;
    const InsertResult result = insertObjects(project, options, progress);
    const Photo real = readPhoto(arguments.photograph);
    if (!real.image.codes.sameSize(result.photo.image.codes))
        throw InputError(arguments.photograph.string(), "has another size than the photograph");
    const auto linear = [&](const EncodedImage& image) {
        return photographedRadiance(image, result.photo_response, result.photo_relative_exposure);
    };
    const MirrorBall& ball = project.light.probe->views.at(0).ball;
    printReflections(linear(result.composite.image), linear(real.image), ball);
    printShadow(linear(result.composite.image),
                linear(real.image),
                linear(result.photo.image),
                ball,
                arguments);
}

}  // namespace
}  // namespace insitu

int main(int argc, char** argv)
{
    CLI::App app("The composite with a mirror ball against the photograph of the real one");
    insitu::Arguments arguments;
    app.add_option("--samples", arguments.samples)->check(CLI::PositiveNumber);
    app.add_option("--ignore", arguments.ignore, "Rectangles X0 Y0 X1 Y1, pixels");
    app.add_option("project", arguments.project)->required();
    app.add_option("photograph", arguments.photograph)->required();
    CLI11_PARSE(app, argc, argv);
    try {
        insitu::run(arguments);
    } catch (const std::exception& error) {
        fmt::print(stderr, "{}\n", error.what());
        return 1;
    }
    return 0;
}
