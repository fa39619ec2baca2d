#include "composite/foreground.h"

#include "composite/box_filter.h"
#include "core/response_curve.h"

#include <algorithm>
#include <cmath>

namespace insitu {

namespace {

/// Lines through each row of pixels on which a polygon's coverage is exact.
constexpr int kSubrows = 8;
/// Variance of codes in [0, 1] that is still one colour: two steps of 8 bit.
constexpr double kOneColor = 6e-5;
/// A refined coverage this near to 0 or 1 is that.
constexpr float kCertain = 0.08f;
/// Radius of the guided filter, pixels.
constexpr int kMatteRadius = 2;
/// Colours must differ by more than this many standard deviations to tell who covers a pixel, and
/// the variance of light that noise leaves at least.
constexpr double kSigmas = 3.0;
constexpr double kLightNoise = 1e-6;
/// A pixel's share in a change of light may be corrected by at most this factor.
constexpr float kMaxFactor = 20.0f;
/// Coverage up to which a pixel tells what is behind the foreground.
constexpr float kFree = 0.02f;
/// Widths of the neighbourhoods in which such pixels are looked for, pixels.
constexpr int kNear[] = {5, 11, 23, 47, 95};

/// Adds the span [from, to) of one subrow to a row of coverages.
void addSpan(Image<float>& coverage, int y, double from, double to)
{
    const double width = coverage.width();
    from = std::clamp(from, 0.0, width);
    to = std::clamp(to, 0.0, width);
    const int last = static_cast<int>(std::ceil(to));
    for (int x = static_cast<int>(from); x < last; ++x) {
        const double inside = std::min<double>(x + 1, to) - std::max<double>(x, from);
        coverage(x, y) += static_cast<float>(inside / kSubrows);
    }
}

/// Area of each pixel inside the polygon.
Image<float> filledPolygon(const std::vector<glm::dvec2>& corners, int width, int height)
{
    Image<float> coverage(width, height);
    std::vector<double> crossings;
    for (int y = 0; y < height; ++y) {
        for (int sub = 0; sub < kSubrows; ++sub) {
            const double line = y + (sub + 0.5) / kSubrows;
            crossings.clear();
            for (std::size_t i = 0; i < corners.size(); ++i) {
                const glm::dvec2 a = corners[i];
                const glm::dvec2 b = corners[(i + 1) % corners.size()];
                if ((a.y <= line) == (b.y <= line)) continue;
                crossings.push_back(a.x + (line - a.y) / (b.y - a.y) * (b.x - a.x));
            }
            std::sort(crossings.begin(), crossings.end());
            for (std::size_t i = 0; i + 1 < crossings.size(); i += 2)
                addSpan(coverage, y, crossings[i], crossings[i + 1]);
        }
    }
    for (float& value : coverage.pixels())
        value = std::clamp(value, 0.0f, 1.0f);
    return coverage;
}

Image<float> gaussianBlurred(const Image<float>& image, double sigma)
{
    const int reach = static_cast<int>(std::ceil(3.0 * sigma));
    std::vector<double> weights;
    double sum = 0.0;
    for (int i = -reach; i <= reach; ++i) {
        weights.push_back(std::exp(-0.5 * i * i / (sigma * sigma)));
        sum += weights.back();
    }
    const auto pass = [&](const Image<float>& from, bool horizontal) {
        Image<float> to(from.width(), from.height());
        parallelFor(0, from.height(), [&](std::int64_t row) {
            const int y = static_cast<int>(row);
            for (int x = 0; x < from.width(); ++x) {
                double value = 0.0;
                for (int i = -reach; i <= reach; ++i) {
                    const int qx = std::clamp(x + (horizontal ? i : 0), 0, from.width() - 1);
                    const int qy = std::clamp(y + (horizontal ? 0 : i), 0, from.height() - 1);
                    value += weights[static_cast<std::size_t>(i + reach)] *
                             static_cast<double>(from(qx, qy));
                }
                to(x, y) = static_cast<float>(std::clamp(value / sum, 0.0, 1.0));
            }
        });
        return to;
    };
    Image<float> result = pass(pass(image, true), false);
    // Rounding must not make a sure pixel unsure.
    for (float& value : result.pixels()) {
        if (value < 1e-5f) value = 0.0f;
        if (value > 1.0f - 1e-5f) value = 1.0f;
    }
    return result;
}

/// Mean colour of marked pixels around, and their mean square deviation.
struct LocalColor {
    Image<glm::dvec4> sum;     ///< colour times mark, mark
    Image<glm::dvec4> square;  ///< colour squared times mark, mark

    LocalColor(const Image<Rgb>& light, const Image<float>& marked, int window)
    {
        sum = square = Image<glm::dvec4>(light.width(), light.height());
        for (std::size_t i = 0; i < light.pixelCount(); ++i) {
            const double m = static_cast<double>(marked.pixels()[i]);
            const glm::dvec3 value(light.pixels()[i]);
            sum.pixels()[i] = m * glm::dvec4(value, 1.0);
            square.pixels()[i] = m * glm::dvec4(value * value, 1.0);
        }
        sum = boxFilter<glm::dvec4>(sum, window);
        square = boxFilter<glm::dvec4>(square, window);
    }
    [[nodiscard]] bool known(std::size_t i) const { return sum.pixels()[i].w > 1e-6; }
    [[nodiscard]] glm::dvec3 mean(std::size_t i) const
    {
        return glm::dvec3(sum.pixels()[i]) / sum.pixels()[i].w;
    }
    [[nodiscard]] glm::dvec3 variance(std::size_t i) const
    {
        const glm::dvec3 m = mean(i);
        return glm::max(glm::dvec3(square.pixels()[i]) / square.pixels()[i].w - m * m,
                        glm::dvec3(0.0));
    }
};

/// Moves the edge to one of the picture's, within `radius` of where it was marked.
///
/// Beyond that distance on both sides it is known what the foreground and the background look
/// like. A pixel of the light L between their mean colours F and B is covered by
/// (L - B) . (F - B) / |F - B|^2, as far as the two differ by more than they vary; elsewhere the
/// mark stands. A guided filter takes the noise out.
Image<float> refined(const Image<float>& coverage, const EncodedImage& photo, int radius)
{
    const int width = coverage.width();
    const int height = coverage.height();
    const Image<float> around = boxFilter<double>(coverage, 2 * radius + 1);
    const ResponseCurve curve = ResponseCurve::srgb();
    Image<Rgb> guide(width, height);
    Image<Rgb> light(width, height);
    Image<float> inner(width, height);
    Image<float> outer(width, height);
    for (std::size_t i = 0; i < guide.pixelCount(); ++i) {
        const glm::u16vec3 code = photo.codes.pixels()[i];
        guide.pixels()[i] = Rgb(code) / static_cast<float>(photo.max_code);
        for (int c = 0; c < 3; ++c)
            light.pixels()[i][c] =
                static_cast<float>(curve.decode(c, code[c] * 255.0 / photo.max_code));
        inner.pixels()[i] = around.pixels()[i] > 1.0f - 1e-5f ? 1.0f : 0.0f;
        outer.pixels()[i] = around.pixels()[i] < 1e-5f ? 1.0f : 0.0f;
    }
    const LocalColor front(light, inner, 4 * radius + 1);
    const LocalColor back(light, outer, 4 * radius + 1);
    Image<float> mixed = coverage;
    for (std::size_t i = 0; i < mixed.pixelCount(); ++i) {
        const bool sure = inner.pixels()[i] > 0.0f || outer.pixels()[i] > 0.0f;
        if (sure || !front.known(i) || !back.known(i)) continue;
        const glm::dvec3 apart = front.mean(i) - back.mean(i);
        const double distance2 = glm::dot(apart, apart);
        const double share = glm::dot(glm::dvec3(light.pixels()[i]) - back.mean(i), apart) /
                             std::max(distance2, 1e-12);
        // Variance along the difference, of the colour that varies more.
        const glm::dvec3 variance = glm::max(front.variance(i), back.variance(i));
        const double spread =
            glm::dot(variance, apart * apart) / std::max(distance2, 1e-12) + kLightNoise;
        const double belief = distance2 / (distance2 + kSigmas * kSigmas * spread);
        mixed.pixels()[i] =
            static_cast<float>(belief * std::clamp(share, 0.0, 1.0) +
                               (1.0 - belief) * static_cast<double>(coverage.pixels()[i]));
    }
    const Image<float> filtered = guidedFilter(guide, mixed, kMatteRadius, kOneColor);
    Image<float> result = coverage;
    for (std::size_t i = 0; i < result.pixelCount(); ++i) {
        if (inner.pixels()[i] > 0.0f || outer.pixels()[i] > 0.0f) continue;
        const float value = (filtered.pixels()[i] - kCertain) / (1.0f - 2.0f * kCertain);
        result.pixels()[i] = std::clamp(value, 0.0f, 1.0f);
    }
    return result;
}

/// What every partly covered pixel would show without the foreground: the mean of free pixels in
/// the smallest neighbourhood that holds some; the photograph itself where there is none.
Image<Rgb> background(const Image<float>& coverage, const Image<Rgb>& radiance)
{
    Image<glm::vec4> weighted(coverage.width(), coverage.height());
    for (std::size_t i = 0; i < weighted.pixelCount(); ++i)
        if (coverage.pixels()[i] <= kFree)
            weighted.pixels()[i] = glm::vec4(radiance.pixels()[i], 1.0f);
    Image<Rgb> result = radiance;
    Image<std::uint8_t> known(coverage.width(), coverage.height());
    for (const int window : kNear) {
        const Image<glm::vec4> mean = boxFilter<glm::dvec4>(weighted, window);
        const float least = 0.5f / static_cast<float>(window);
        for (std::size_t i = 0; i < result.pixelCount(); ++i) {
            const float m = coverage.pixels()[i];
            if (known.pixels()[i] || m <= kFree || mean.pixels()[i].w < least) continue;
            result.pixels()[i] = Rgb(mean.pixels()[i]) / mean.pixels()[i].w;
            known.pixels()[i] = 1;
        }
    }
    return result;
}

/// The pixel is m F + (1 - m) B and F is not negative: no more than this of it can be uncovered,
/// however soft the edge was marked.
float mostUncovered(const Rgb& seen, const Rgb& behind)
{
    float most = 1.0f;
    for (int c = 0; c < 3; ++c)
        if (behind[c] > 0.0f) most = std::min(most, seen[c] / behind[c]);
    return std::max(most, 0.0f);
}

}  // namespace

Findings ForegroundMark::validate() const
{
    Findings findings;
    const auto demand = [&](bool holds, const char* message) {
        if (!holds) findings.push_back({Severity::Error, "option-out-of-range", message});
    };
    demand(!distance_m || *distance_m > 0.0, "distance_m must be > 0");
    demand(feather_px >= 0.0 && feather_px <= 100.0, "feather_px must be in [0, 100]");
    demand(refine_px >= 0 && refine_px <= 200, "refine_px must be in [0, 200]");
    return findings;
}

Image<float> foregroundCoverage(const ForegroundMark& mark, const EncodedImage& photo)
{
    requireValid(mark.validate(), "foreground");
    if (mark.polygon_px.empty() == mark.mask.empty())
        throw InputError("foreground", "give either a polygon or a mask");
    if (mark.mask.empty() && mark.polygon_px.size() < 3)
        throw InputError("foreground", "a polygon needs at least three corners");
    const int width = photo.codes.width();
    const int height = photo.codes.height();
    if (!mark.mask.empty() && !mark.mask.sameSize(photo.codes))
        throw InputError("foreground",
                         fmt::format("the mask is {}x{}, the photograph {}x{}",
                                     mark.mask.width(),
                                     mark.mask.height(),
                                     width,
                                     height));
    Image<float> coverage =
        mark.mask.empty() ? filledPolygon(mark.polygon_px, width, height) : mark.mask;
    if (mark.feather_px > 0.0) coverage = gaussianBlurred(coverage, mark.feather_px);
    // Last: the picture's own edge has its blur already.
    if (mark.refine_px > 0) coverage = refined(coverage, photo, mark.refine_px);
    return coverage;
}

void putBehindForeground(const Image<float>& coverage,
                         std::optional<double> distance_m,
                         const Image<Rgb>& radiance,
                         PhotoLayers& layers)
{
    INSITU_CHECK(coverage.sameSize(layers.object) && radiance.sameSize(layers.object),
                 "foreground {}x{}, layers {}x{}",
                 coverage.width(),
                 coverage.height(),
                 layers.object.width(),
                 layers.object.height());
    const Image<Rgb> behind = background(coverage, radiance);
    parallelFor(0, coverage.height(), [&](std::int64_t row) {
        const int y = static_cast<int>(row);
        for (int x = 0; x < coverage.width(); ++x) {
            const float m = coverage(x, y);
            if (m <= 0.0f) continue;
            const Rgb alpha = layers.coverage(x, y);
            const bool before = distance_m && alpha != Rgb(0.0f) &&
                                static_cast<double>(layers.depth_m(x, y)) < *distance_m;
            const float uncovered = std::min(1.0f - m, mostUncovered(radiance(x, y), behind(x, y)));
            const Rgb without = layers.irradiance_without(x, y);
            const Rgb change = layers.irradiance_with(x, y) - without;
            if (before) {
                // The object stays; what is seen beside it is the foreground, which does not
                // change.
                layers.irradiance_with(x, y) = without + uncovered * change;
                continue;
            }
            // The compositor computes object + (1 - alpha) (photograph + change): its terms here.
            const Rgb new_alpha = uncovered * alpha;
            layers.object(x, y) =
                uncovered * (layers.object(x, y) + alpha * (radiance(x, y) - behind(x, y)));
            // The compositor scales the change by the photograph, which is partly foreground here.
            const Rgb share =
                glm::min(behind(x, y) / glm::max(radiance(x, y), Rgb(1e-12f)), Rgb(kMaxFactor));
            layers.irradiance_with(x, y) =
                without + share * change *
                              (uncovered * (1.0f - alpha) / glm::max(1.0f - new_alpha, Rgb(1e-6f)));
            layers.coverage(x, y) = new_alpha;
            layers.object_variance(x, y) *= uncovered * uncovered;
            if (new_alpha == Rgb(0.0f)) layers.depth_m(x, y) = 0.0f;
        }
    });
}

Image<float> guidedFilter(const Image<Rgb>& guide,
                          const Image<float>& input,
                          int radius_px,
                          double epsilon)
{
    INSITU_CHECK(guide.sameSize(input), "{} and {} wide", guide.width(), input.width());
    const int window = 2 * radius_px + 1;
    const std::size_t count = input.pixelCount();
    // Means of guide and input, of their products, and of the guide's with itself: six numbers.
    Image<glm::dvec4> first(input.width(), input.height());
    Image<glm::dvec3> cross(input.width(), input.height());
    Image<glm::dvec3> square(input.width(), input.height());
    Image<glm::dvec3> mixed(input.width(), input.height());
    for (std::size_t i = 0; i < count; ++i) {
        const glm::dvec3 g(guide.pixels()[i]);
        const double p = static_cast<double>(input.pixels()[i]);
        first.pixels()[i] = glm::dvec4(g, p);
        cross.pixels()[i] = p * g;
        square.pixels()[i] = g * g;
        mixed.pixels()[i] = {g.x * g.y, g.y * g.z, g.z * g.x};
    }
    first = boxFilter<glm::dvec4>(first, window);
    cross = boxFilter<glm::dvec3>(cross, window);
    square = boxFilter<glm::dvec3>(square, window);
    mixed = boxFilter<glm::dvec3>(mixed, window);
    // In each window the input is a . guide + b [HeSunTan13, equations 19 and 20].
    Image<glm::dvec4> linear(input.width(), input.height());
    for (std::size_t i = 0; i < count; ++i) {
        const glm::dvec3 g(first.pixels()[i]);
        const double p = first.pixels()[i].w;
        const glm::dvec3 s = square.pixels()[i] - g * g + glm::dvec3(epsilon);
        const glm::dvec3 m = mixed.pixels()[i] - glm::dvec3(g.x * g.y, g.y * g.z, g.z * g.x);
        const glm::dmat3 covariance(s.x, m.x, m.z, m.x, s.y, m.y, m.z, m.y, s.z);
        const glm::dvec3 a = glm::inverse(covariance) * (cross.pixels()[i] - p * g);
        linear.pixels()[i] = glm::dvec4(a, p - glm::dot(a, g));
    }
    linear = boxFilter<glm::dvec4>(linear, window);
    Image<float> result(input.width(), input.height());
    for (std::size_t i = 0; i < count; ++i) {
        const glm::dvec4 l = linear.pixels()[i];
        result.pixels()[i] =
            static_cast<float>(glm::dot(glm::dvec3(l), glm::dvec3(guide.pixels()[i])) + l.w);
    }
    return result;
}

}  // namespace insitu
