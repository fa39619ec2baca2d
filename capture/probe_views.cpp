#include "capture/probe_views.h"

#include "capture/ball_picture.h"
#include "capture/probe_checks.h"
#include "capture/texel_average.h"
#include "core/check.h"
#include "core/parallel.h"

#include <fmt/format.h>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace insitu {

using std::numbers::pi;

namespace {

using detail::BallPicture;

/// Beside a mask weights rise from 0 to 1 over this share of the ball's radius.
constexpr double kFeatherShare = 0.05;
/// Views are compared where both have this share of their largest weight.
constexpr double kComparedWeight = 0.02;
/// Differences that are reported: of the median, and of half of the directions.
constexpr double kRatioTolerance = 0.10;
constexpr double kSpreadTolerance = 0.25;
/// Two balls farther apart than this share of the radius are not at the same place.
constexpr double kSamePlace = 0.5;

void checkView(const ProbeView& view, const ProbeView& first)
{
    detail::checkRadiance(view.radiance);
    detail::checkBall(view.ball, view.camera.position_m);
    if (!view.mask.empty() && !view.mask.sameSize(view.radiance))
        throw InputError("probe mask",
                         fmt::format("{}x{} pixels for a picture of {}x{}",
                                     view.mask.width(),
                                     view.mask.height(),
                                     view.radiance.width(),
                                     view.radiance.height()));
    INSITU_CHECK(view.clipped.empty() || view.clipped.sameSize(view.radiance),
                 "{}x{}",
                 view.clipped.width(),
                 view.clipped.height());
    if (glm::length(view.ball.center_m - first.ball.center_m) > kSamePlace * first.ball.radius_m)
        throw InputError("light probe",
                         "the views show balls at different places: one environment is what is "
                         "seen from one place");
}

/// 0 on the mask, rising to 1 within `reach` pixels of it; all 1 without one.
Image<float> feathered(const ProbeView& view, double reach)
{
    Image<float> weights(view.radiance.width(), view.radiance.height(), 1.0f);
    if (view.mask.empty() || std::ranges::all_of(view.mask.pixels(), [](auto m) { return m == 0; }))
        return weights;
    cv::Mat free(weights.height(), weights.width(), CV_8U);
    for (int y = 0; y < weights.height(); ++y)
        for (int x = 0; x < weights.width(); ++x)
            free.at<std::uint8_t>(y, x) = view.mask(x, y) == 0;
    cv::Mat distance;
    cv::distanceTransform(free, distance, cv::DIST_L2, cv::DIST_MASK_PRECISE);
    for (int y = 0; y < weights.height(); ++y)
        for (int x = 0; x < weights.width(); ++x)
            weights(x, y) = std::min(distance.at<float>(y, x) / static_cast<float>(reach), 1.0f);
    return weights;
}

/// A view as seen from the ball's centre.
struct ViewMap {
    Image<Rgb> radiance;     ///< weighted mean where the weight is positive
    Image<float> weight;     ///< 0: not seen
    Image<Rgb> rim;          ///< the rim's radiance where the view is blind and not masked
    Image<float> rim_share;  ///< of the texel, 0 to 1
    Image<Rgb> clipped;      ///< part of what is used, `radiance` or `rim`
};

/// Sums over one texel's places.
struct TexelSums {
    glm::dvec3 radiance{0.0};
    double weight = 0.0;
    glm::dvec3 rim{0.0};
    int rim_count = 0;
    glm::dvec3 clipped{0.0};      ///< of `radiance`
    glm::dvec3 rim_clipped{0.0};  ///< of `rim`
};

TexelSums sumTexel(const BallPicture& picture,
                   const Image<float>& free,
                   const ProbeView& view,
                   glm::ivec2 texel,
                   int width,
                   int n)
{
    TexelSums sums;
    const auto clippedAt = [&](glm::dvec2 pixel) {
        return view.clipped.empty() ? glm::dvec3(0.0)
                                    : glm::dvec3(sampleBilinear(view.clipped, pixel.x, pixel.y)) /
                                          view.ball.reflectance;
    };
    detail::forEachPlace(width, texel, n, [&](glm::dvec3 direction) {
        const BallPicture::Sample sample = picture.seen(direction);
        if (sample.outside) return;
        const double open = sampleBilinear(free, sample.pixel.x, sample.pixel.y);
        if (open <= 0.0) return;
        if (sample.blind) {
            sums.rim += glm::dvec3(sample.radiance);
            ++sums.rim_count;
            sums.rim_clipped += clippedAt(sample.pixel);
            return;
        }
        const double resolution = picture.resolution(direction);
        const double weight = open * resolution * resolution;
        sums.radiance += weight * glm::dvec3(sample.radiance);
        sums.weight += weight;
        sums.clipped += weight * clippedAt(sample.pixel);
    });
    return sums;
}

ViewMap unwrapView(const ProbeView& view,
                   const MergeViewsOptions& options,
                   int width,
                   Findings& findings)
{
    UnwrapOptions unwrap;
    unwrap.crop_origin_px = view.crop_origin_px;
    unwrap.distance_to_room = options.distance_to_room;
    const BallPicture picture(view.radiance, view.ball, view.camera, unwrap, findings);
    const Image<float> free = feathered(view, std::max(kFeatherShare * view.ball.radius_px, 1.0));
    const int height = width / 2;
    ViewMap map{Image<Rgb>(width, height),
                Image<float>(width, height),
                Image<Rgb>(width, height),
                Image<float>(width, height),
                Image<Rgb>(width, height)};
    parallelFor(0, height, [&](std::int64_t row) {
        const int y = static_cast<int>(row);
        for (int x = 0; x < width; ++x) {
            const int n = picture.places(detail::middleOfTexel(width, {x, y}), 2.0 * pi / width);
            const TexelSums sums = sumTexel(picture, free, view, {x, y}, width, n);
            if (sums.weight > 0.0) {
                map.radiance(x, y) = Rgb(sums.radiance / sums.weight);
                map.weight(x, y) = static_cast<float>(sums.weight / (n * n));
            }
            if (sums.rim_count > 0) {
                map.rim(x, y) = Rgb(sums.rim / static_cast<double>(sums.rim_count));
                map.rim_share(x, y) =
                    static_cast<float>(sums.rim_count) / static_cast<float>(n * n);
                map.clipped(x, y) = Rgb(sums.rim_clipped / static_cast<double>(sums.rim_count));
            }
            if (sums.weight > 0.0) map.clipped(x, y) = Rgb(sums.clipped / sums.weight);
        }
    });
    return map;
}

double medianOf(std::vector<double>& values)
{
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::ranges::nth_element(values, middle);
    return *middle;
}

struct Agreement {
    glm::dvec3 ratio{1.0};
    double spread = 0.0;  ///< median of |log(this / first / ratio)|, the worst channel
    bool known = false;
};

Agreement compare(const ViewMap& first, const ViewMap& other)
{
    const float first_least =
        static_cast<float>(kComparedWeight) * *std::ranges::max_element(first.weight.pixels());
    const float other_least =
        static_cast<float>(kComparedWeight) * *std::ranges::max_element(other.weight.pixels());
    std::array<std::vector<double>, 3> logs;
    for (std::size_t i = 0; i < first.weight.pixelCount(); ++i) {
        if (first.weight.pixels()[i] <= first_least || other.weight.pixels()[i] <= other_least)
            continue;
        const Rgb a = first.radiance.pixels()[i];
        const Rgb b = other.radiance.pixels()[i];
        for (int c = 0; c < 3; ++c)
            if (a[c] > 0.0f && b[c] > 0.0f)
                logs[static_cast<std::size_t>(c)].push_back(
                    std::log(static_cast<double>(b[c]) / static_cast<double>(a[c])));
    }
    Agreement agreement;
    for (int c = 0; c < 3; ++c) {
        std::vector<double>& list = logs[static_cast<std::size_t>(c)];
        if (list.empty()) continue;
        agreement.known = true;
        const double middle = medianOf(list);
        agreement.ratio[c] = std::exp(middle);
        for (double& value : list)
            value = std::abs(value - middle);
        agreement.spread = std::max(agreement.spread, medianOf(list));
    }
    return agreement;
}

void reportAgreement(std::size_t view, const Agreement& agreement, Findings& findings)
{
    const glm::dvec3 off = glm::abs(glm::log(agreement.ratio));
    const double largest = std::max({off.x, off.y, off.z});
    if (!agreement.known || (largest <= std::log1p(kRatioTolerance) &&
                             agreement.spread <= std::log1p(kSpreadTolerance)))
        return;
    findings.push_back(
        {Severity::Warning,
         "probe-views-disagree",
         fmt::format("view {} of the ball shows {:.2f} {:.2f} {:.2f} times (red, green, blue) the "
                     "first one's radiance, and half of what both see differs by {:.0f} % from "
                     "that: check exposures, response, cameras and the ball's place, or that the "
                     "light did not change",
                     view + 1,
                     agreement.ratio.x,
                     agreement.ratio.y,
                     agreement.ratio.z,
                     100.0 * std::expm1(agreement.spread))});
}

/// Where views show something their weighted mean, else the mean of their rims, else a hole.
void blend(const std::vector<ViewMap>& maps,
           const std::vector<glm::dvec3>& scales,
           LightProbe& probe,
           ProbeMask& holes)
{
    Image<Rgb>& map = probe.environment.pixels;
    double blind = 0.0;
    for (int y = 0; y < map.height(); ++y) {
        const double share = environmentTexelSolidAngle(map.width(), map.height(), y) / (4.0 * pi);
        for (int x = 0; x < map.width(); ++x) {
            glm::dvec3 seen(0.0);
            glm::dvec3 rim(0.0);
            double weight = 0.0;
            double rim_weight = 0.0;
            glm::dvec3 clipped(0.0);
            glm::dvec3 rim_clipped(0.0);
            for (std::size_t i = 0; i < maps.size(); ++i) {
                const double w = maps[i].weight(x, y);
                const double r = maps[i].rim_share(x, y);
                seen += w * scales[i] * glm::dvec3(maps[i].radiance(x, y));
                rim += r * scales[i] * glm::dvec3(maps[i].rim(x, y));
                weight += w;
                rim_weight += r;
                clipped += w * scales[i] * glm::dvec3(maps[i].clipped(x, y));
                rim_clipped += r * scales[i] * glm::dvec3(maps[i].clipped(x, y));
            }
            if (!probe.environment.clipped.empty())
                probe.environment.clipped(x, y) = weight > 0.0       ? Rgb(clipped / weight)
                                                  : rim_weight > 0.0 ? Rgb(rim_clipped / rim_weight)
                                                                     : Rgb(0.0f);
            if (weight > 0.0) {
                map(x, y) = Rgb(seen / weight);
            } else if (rim_weight > 0.0) {
                map(x, y) = Rgb(rim / rim_weight);
                blind += share;
            } else {
                holes(x, y) = 1;
            }
        }
    }
    probe.findings.push_back({Severity::Info,
                              "probe-blind-spot",
                              fmt::format("{:.2f} % of the sphere lies behind the ball or in its "
                                          "rim in every view and was filled from the nearest "
                                          "direction seen",
                                          100.0 * blind)});
}

}  // namespace

MergedProbe mergeProbeViews(const std::vector<ProbeView>& views, const MergeViewsOptions& options)
{
    if (views.empty()) throw InputError("light probe", "no view of the ball was given");
    detail::checkMapWidth(options.width);
    double largest_px = 0.0;
    for (const ProbeView& view : views) {
        checkView(view, views[0]);
        largest_px = std::max(largest_px, view.ball.radius_px);
    }
    const int width =
        options.width > 0 ? options.width : detail::widthForResolution(2.0 / largest_px);
    MergedProbe merged;
    merged.probe.center_m = views[0].ball.center_m;
    std::vector<ViewMap> maps;
    std::vector<glm::dvec3> scales;
    for (const ProbeView& view : views) {
        maps.push_back(unwrapView(view, options, width, merged.probe.findings));
        const Agreement agreement = compare(maps[0], maps.back());
        reportAgreement(maps.size() - 1, agreement, merged.probe.findings);
        merged.exposure_ratios.push_back(agreement.ratio);
        scales.push_back(options.match_exposure ? 1.0 / agreement.ratio : glm::dvec3(1.0));
    }
    merged.probe.environment.pixels = Image<Rgb>(width, width / 2);
    if (std::ranges::any_of(views, [](const ProbeView& view) { return !view.clipped.empty(); }))
        merged.probe.environment.clipped = Image<Rgb>(width, width / 2);
    ProbeMask holes(width, width / 2);
    blend(maps, scales, merged.probe, holes);
    inpaintProbe(merged.probe, holes);
    return merged;
}

}  // namespace insitu
