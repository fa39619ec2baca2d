#include "pipeline/photo_response.h"

#include "core/quantile.h"

#include <Eigen/Dense>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>

namespace insitu {

namespace {

constexpr std::size_t kMinPixels = 300;
constexpr std::size_t kMinFaces = 3;
constexpr double kLowCode = 8.0;
constexpr double kHighCode = 245.0;
constexpr double kSigmas = 3.0;
/// Powers nearer to 1 than this change nothing that is seen.
constexpr double kLeastOff = 0.05;
/// Where photograph and probe disagree by more than this, or by hardly less than before, it is the
/// room or the probe's place that is wrong, and misplaced texture flattens any curve. Chosen on the
/// rooms of docs/validation.md.
constexpr double kLargestSpread = 0.15;
constexpr double kSpreadGain = 0.9;
constexpr int kRounds = 20;
/// Pixels that are fitted, about.
constexpr std::size_t kFitted = 8000;
/// Residuals smaller than this all weigh the same, logarithms.
constexpr double kSmallResidual = 0.01;

struct Sample {
    double x = 0.0;  ///< logarithm of the assumed exposure over that at code 128
    double y = 0.0;  ///< logarithm of the probe's radiance
    int channel = 0;
    std::size_t face = 0;
};

/// Logarithms of each channel's scale, power, bend.
using Parameters = Eigen::Matrix<double, 5, 1>;
constexpr int kPower = 3;
constexpr int kBend = 4;

double predicted(const Parameters& p, const Sample& s)
{
    return p[s.channel] + p[kPower] * s.x + p[kBend] * s.x * s.x;
}

/// Least absolute deviations by weighted least squares; `left_out` face does not count.
Parameters fit(const std::vector<Sample>& samples,
               bool with_bend,
               std::optional<std::size_t> left_out = std::nullopt)
{
    Parameters p = Parameters::Zero();
    p[kPower] = 1.0;
    for (int round = 0; round < kRounds; ++round) {
        Eigen::Matrix<double, 5, 5> normal = Eigen::Matrix<double, 5, 5>::Zero();
        Parameters right = Parameters::Zero();
        for (const Sample& s : samples) {
            if (left_out == s.face) continue;
            Parameters row = Parameters::Zero();
            row[s.channel] = 1.0;
            row[kPower] = s.x;
            if (with_bend) row[kBend] = s.x * s.x;
            const double weight =
                round == 0 ? 1.0 : 1.0 / std::max(std::abs(s.y - predicted(p, s)), kSmallResidual);
            normal += weight * row * row.transpose();
            right += weight * s.y * row;
        }
        // What nothing tells of stays where it is.
        for (int k = 0; k < 5; ++k)
            if (normal(k, k) == 0.0) normal(k, k) = 1.0;
        p = normal.ldlt().solve(right);
    }
    return p;
}

double spreadOf(const std::vector<Sample>& samples, const Parameters& p)
{
    std::vector<double> off;
    for (const Sample& s : samples)
        off.push_back(std::abs(s.y - predicted(p, s)));
    return quantile(off, 0.5);
}

/// The same with the assumed curve: only the scales are free.
double spreadAssumed(const std::vector<Sample>& samples)
{
    std::array<std::vector<double>, 3> ratios;
    for (const Sample& s : samples)
        ratios[static_cast<std::size_t>(s.channel)].push_back(s.y - s.x);
    Parameters p = Parameters::Zero();
    p[kPower] = 1.0;
    for (int c = 0; c < 3; ++c)
        if (auto& list = ratios[static_cast<std::size_t>(c)]; !list.empty())
            p[c] = quantile(list, 0.5);
    return spreadOf(samples, p);
}

/// Standard deviation of a parameter over the faces left out, by the jackknife.
double jackknifeSigma(const std::vector<Parameters>& left_out, int k)
{
    const auto n = static_cast<double>(left_out.size());
    double mean = 0.0;
    for (const Parameters& p : left_out)
        mean += p[k] / n;
    double square = 0.0;
    for (const Parameters& p : left_out)
        square += (p[k] - mean) * (p[k] - mean);
    return std::sqrt(square * (n - 1.0) / n);
}

/// The assumed curve bent; straight in logarithms outside [low, high].
ResponseCurve bent(const ResponseCurve& assumed, double power, double bend, double low, double high)
{
    ResponseCurve curve = assumed;
    curve.source = "estimated from surfaces that the light probe sees";
    for (std::size_t c = 0; c < 3; ++c) {
        const double middle = assumed.exposure[c][128];
        for (std::size_t z = 0; z < 256; ++z) {
            const double exposure = assumed.exposure[c][z];
            if (!(exposure > 0.0)) continue;
            const double x = std::log(exposure / middle);
            const double inside = std::clamp(x, low, high);
            curve.exposure[c][z] = std::exp(power * inside + bend * inside * inside +
                                            (power + 2.0 * bend * inside) * (x - inside));
        }
    }
    return curve;
}

}  // namespace

PhotoResponseEstimate estimatePhotoResponse(const EncodedImage& photo,
                                            const ResponseCurve& assumed,
                                            const std::vector<CommonPixel>& pixels)
{
    PhotoResponseEstimate estimate;
    std::vector<Sample> samples;
    std::map<std::size_t, std::size_t> faces;
    double low = 0.0;
    double high = 0.0;
    const std::size_t step = std::max<std::size_t>(1, pixels.size() / kFitted);
    for (std::size_t i = 0; i < pixels.size(); i += step) {
        const CommonPixel& common = pixels[i];
        const glm::u16vec3 codes = photo.codes(common.pixel.x, common.pixel.y);
        bool any = false;
        for (int c = 0; c < 3; ++c) {
            const double code = codes[c] * 255.0 / photo.max_code;
            const auto channel = static_cast<std::size_t>(c);
            if (code < kLowCode || code > kHighCode || !(common.seen[c] > 0.0f)) continue;
            const double x = std::log(assumed.decode(c, code) / assumed.exposure[channel][128]);
            samples.push_back({x, std::log(double{common.seen[c]}), c, common.face});
            low = std::min(low, x);
            high = std::max(high, x);
            any = true;
        }
        if (!any) continue;
        ++estimate.pixels;
        ++faces[common.face];
    }
    std::erase_if(faces, [](const auto& face) { return face.second < kMinPixels / 10; });
    estimate.curve = assumed;
    if (estimate.pixels < kMinPixels) return estimate;
    estimate.spread_assumed = estimate.spread = spreadAssumed(samples);
    if (faces.size() < kMinFaces) return estimate;

    const auto judge = [&](bool with_bend) {
        const Parameters all = fit(samples, with_bend);
        std::vector<Parameters> left_out;
        for (const auto& [face, count] : faces)
            left_out.push_back(fit(samples, with_bend, face));
        estimate.power = all[kPower];
        estimate.power_sigma = jackknifeSigma(left_out, kPower);
        estimate.bend = all[kBend];
        estimate.bend_sigma = jackknifeSigma(left_out, kBend);
        estimate.spread = spreadOf(samples, all);
        // Rising everywhere, or it is no response.
        return estimate.power + 2.0 * estimate.bend * low > 0.2 &&
               estimate.power + 2.0 * estimate.bend * high > 0.2;
    };
    bool rises = judge(true);
    const bool bends = rises && std::abs(estimate.bend) > kSigmas * estimate.bend_sigma &&
                       std::abs(estimate.bend) * std::max(-low, high) > kLeastOff;
    if (!bends) rises = judge(false);
    const double off = std::abs(estimate.power - 1.0);
    estimate.differs =
        rises && (bends || (off > kLeastOff && off > kSigmas * estimate.power_sigma)) &&
        estimate.spread < kLargestSpread && estimate.spread < kSpreadGain * estimate.spread_assumed;
    if (estimate.differs) estimate.curve = bent(assumed, estimate.power, estimate.bend, low, high);
    return estimate;
}

}  // namespace insitu
