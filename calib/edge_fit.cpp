#include "calib/edge_fit.h"

#include <algorithm>
#include <cmath>

namespace insitu::edges {

namespace {

/// Step along and across a segment, pixels.
constexpr double kStep = 1.0;
constexpr double kFine = 0.5;
/// Half the width over which an edge changes: blur of lens and reduction.
constexpr double kWindow = 2.0;
/// Neighbours closer than this share the blur of lens and demosaicking: one independent place.
constexpr double kCorrelation = 3.0;
/// Change of grey per pixel, codes, below which there is no edge.
constexpr double kWeakest = 1.5;
/// A fit that looks better than this is luck: the detector's own grid and JPEG's blocks.
constexpr double kFinestSigma = 0.05;
constexpr double kTukey = 4.685;
constexpr double kMadToSigma = 1.4826;

/// Where along a profile across the segment the grey changes fastest.
struct Place {
    double along = 0.0;
    double across = 0.0;
    double slope = 0.0;  ///< signed change of grey per pixel there
};

double greyAt(const Image<float>& grey, glm::dvec2 at)
{
    return sampleBilinear(grey, at.x, at.y);
}

/// Change of grey per pixel across the segment at an offset.
double slopeAt(const Image<float>& grey, glm::dvec2 at, glm::dvec2 normal, double offset)
{
    return 0.5 * (greyAt(grey, at + normal * (offset + 1.0)) -
                  greyAt(grey, at + normal * (offset - 1.0)));
}

/// The middle of the change about its steepest place: unlike the vertex of a parabola, the middle
/// does not mind that values between pixels are interpolated.
Place steepest(const Image<float>& grey, glm::dvec2 at, glm::dvec2 normal, double reach)
{
    const int half = static_cast<int>(std::ceil(reach / kFine));
    Place place;
    for (int i = -half; i <= half; ++i) {
        const double slope = slopeAt(grey, at, normal, i * kFine);
        if (std::abs(slope) <= std::abs(place.slope)) continue;
        place.slope = slope;
        place.across = i * kFine;
    }
    for (int round = 0; round < 3; ++round) {
        double sum = 0.0;
        double moment = 0.0;
        for (double off = -kWindow; off <= kWindow; off += kFine) {
            const double slope = slopeAt(grey, at, normal, place.across + off);
            if (slope * place.slope <= 0.0) continue;
            sum += std::abs(slope);
            moment += std::abs(slope) * off;
        }
        if (sum > 0.0) place.across += moment / sum;
    }
    return place;
}

/// The places along the segment whose grey changes the way most of it does.
std::vector<Place> edgePlaces(const Image<float>& grey,
                              const DetectedSegment& segment,
                              double reach)
{
    const double length = segment.length();
    const glm::dvec2 along = (segment.to_px - segment.from_px) / length;
    const glm::dvec2 normal(-along.y, along.x);
    const int count = std::max(4, static_cast<int>(length / kStep));
    std::vector<Place> places;
    double polarity = 0.0;
    for (int i = 0; i < count; ++i) {
        const double s = (i + 0.5) * length / count;
        Place place = steepest(grey, segment.from_px + along * s, normal, reach);
        place.along = s;
        polarity += place.slope;
        places.push_back(place);
    }
    std::erase_if(places, [&](const Place& place) {
        return place.slope * polarity <= 0.0 || std::abs(place.slope) < kWeakest;
    });
    return places;
}

/// across = middle + slope · (along − center), by least squares with weights.
struct Line {
    double center = 0.0;
    double middle = 0.0;
    double slope = 0.0;

    [[nodiscard]] double at(double along) const { return middle + slope * (along - center); }
};

Line weightedLine(const std::vector<Place>& places, const std::vector<double>& weights)
{
    double sum = 0.0;
    Line line;
    for (std::size_t i = 0; i < places.size(); ++i) {
        sum += weights[i];
        line.center += weights[i] * places[i].along;
        line.middle += weights[i] * places[i].across;
    }
    line.center /= sum;
    line.middle /= sum;
    double spread = 0.0;
    double product = 0.0;
    for (std::size_t i = 0; i < places.size(); ++i) {
        const double off = places[i].along - line.center;
        spread += weights[i] * off * off;
        product += weights[i] * off * places[i].across;
    }
    line.slope = spread > 0.0 ? product / spread : 0.0;
    return line;
}

struct Fit {
    Line line;
    double sigma = 0.0;  ///< of a place about the line
    double share = 0.0;  ///< of the places, that lie on it
};

Fit robustLine(const std::vector<Place>& places)
{
    std::vector<double> weights(places.size(), 1.0);
    Fit fit;
    for (int round = 0; round < 8; ++round) {
        fit.line = weightedLine(places, weights);
        std::vector<double> off;
        for (const Place& place : places)
            off.push_back(std::abs(place.across - fit.line.at(place.along)));
        std::vector<double> sorted = off;
        std::nth_element(sorted.begin(), sorted.begin() + sorted.size() / 2, sorted.end());
        fit.sigma = std::max(kFinestSigma, kMadToSigma * sorted[sorted.size() / 2]);
        double sum = 0.0;
        for (std::size_t i = 0; i < off.size(); ++i) {
            const double u = off[i] / (kTukey * fit.sigma);
            weights[i] = u < 1.0 ? (1.0 - u * u) * (1.0 - u * u) : 0.0;
            sum += u < 1.0 ? 1.0 : 0.0;
        }
        fit.share = sum / static_cast<double>(off.size());
    }
    return fit;
}

/// Whether b goes on where a ends, on the same line.
bool samePiece(const DetectedSegment& a, const DetectedSegment& b)
{
    const double length = a.length();
    const glm::dvec2 along = (a.to_px - a.from_px) / length;
    const auto across = [&](glm::dvec2 p) {
        return std::abs(along.x * (p.y - a.from_px.y) - along.y * (p.x - a.from_px.x));
    };
    const double low = glm::dot(along, b.from_px - a.from_px);
    const double high = glm::dot(along, b.to_px - a.from_px);
    const double gap = std::max(std::min(low, high) - length, -std::max(low, high));
    if (gap > 0.5 * std::min(length, b.length()) || gap < -0.2 * b.length()) return false;
    // How far the line of a is off where b ends, by its own direction's error.
    const double reach = std::max(std::abs(low), std::abs(high)) / length;
    const double allowed = 1.0 + 2.0 * a.sigma_px * reach;
    return std::max(across(b.from_px), across(b.to_px)) < std::min(allowed, 2.5);
}

DetectedSegment joined(const DetectedSegment& a, const DetectedSegment& b)
{
    const glm::dvec2 along = glm::normalize(a.to_px - a.from_px);
    const glm::dvec2 ends[] = {a.from_px, a.to_px, b.from_px, b.to_px};
    const auto by_place = [&](glm::dvec2 p, glm::dvec2 q) {
        return glm::dot(along, p) < glm::dot(along, q);
    };
    return {*std::min_element(ends, ends + 4, by_place),
            *std::max_element(ends, ends + 4, by_place),
            std::max(a.sigma_px, b.sigma_px)};
}

}  // namespace

std::optional<DetectedSegment> fitEdge(const Image<float>& grey,
                                       const DetectedSegment& segment,
                                       double reach)
{
    const double length = segment.length();
    if (!(length > 4.0 * kStep)) return std::nullopt;
    const std::vector<Place> places = edgePlaces(grey, segment, reach);
    const auto expected = static_cast<double>(std::max(4, static_cast<int>(length / kStep)));
    if (places.size() < 4) return std::nullopt;
    const Fit fit = robustLine(places);
    if (fit.share * static_cast<double>(places.size()) < 0.5 * expected) return std::nullopt;

    const glm::dvec2 along = (segment.to_px - segment.from_px) / length;
    const glm::dvec2 normal(-along.y, along.x);
    DetectedSegment fitted;
    fitted.from_px = segment.from_px + normal * fit.line.at(0.0);
    fitted.to_px = segment.to_px + normal * fit.line.at(length);
    // n places have a slope of variance 12 σ²/(n L²), two ends of 2 σ_end²/L².
    const double independent = std::max(3.0, length / kCorrelation);
    fitted.sigma_px = std::max(kFinestSigma, fit.sigma * std::sqrt(6.0 / independent));
    return fitted;
}

std::vector<DetectedSegment> joinPieces(std::vector<DetectedSegment> segments,
                                        const Image<float>& grey)
{
    const auto longer = [](const DetectedSegment& a, const DetectedSegment& b) {
        return a.length() > b.length();
    };
    std::stable_sort(segments.begin(), segments.end(), longer);
    std::vector<bool> gone(segments.size(), false);
    for (std::size_t i = 0; i < segments.size(); ++i) {
        if (gone[i]) continue;
        for (std::size_t j = i + 1; j < segments.size(); ++j) {
            if (gone[j] || !samePiece(segments[i], segments[j])) continue;
            const auto fitted = fitEdge(grey, joined(segments[i], segments[j]), 2.0);
            if (!fitted) continue;
            segments[i] = *fitted;
            gone[j] = true;
            j = i;  // the longer piece reaches others
        }
    }
    std::vector<DetectedSegment> kept;
    for (std::size_t i = 0; i < segments.size(); ++i)
        if (!gone[i]) kept.push_back(segments[i]);
    std::stable_sort(kept.begin(), kept.end(), longer);
    return kept;
}

}  // namespace insitu::edges
