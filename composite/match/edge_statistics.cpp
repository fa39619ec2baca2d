#include "composite/match/edge_profile.h"
#include "core/quantile.h"

#include <algorithm>
#include <cmath>

namespace insitu {

namespace {

constexpr int kMinEdges = 20;
/// Variance of a pixel's box across an edge of any direction, pixels squared.
constexpr double kBoxVariance = 1.0 / 12.0;

/// Huber's weights for residuals of one deviation.
double huber(double residual)
{
    constexpr double kBend = 1.345;
    return std::abs(residual) <= kBend ? 1.0 : kBend / std::abs(residual);
}

}  // namespace

BlurEstimate estimateBlur(const std::vector<EdgeProfile>& edges)
{
    BlurEstimate estimate;
    estimate.edges = static_cast<int>(edges.size());
    if (estimate.edges < kMinEdges) {
        estimate.findings.push_back(
            {Severity::Info,
             "blur-unknown",
             fmt::format("only {} clear edges in the photograph ({} are needed to see its "
                         "sharpness): the objects are left as sharp as their pixels",
                         estimate.edges,
                         kMinEdges)});
        return estimate;
    }
    std::vector<double> spreads;
    for (const EdgeProfile& edge : edges)
        spreads.push_back(edge.spread.g);
    std::sort(spreads.begin(), spreads.end());
    // The shortest interval with half of the sharper half is where they crowd.
    const std::size_t sharper = std::max<std::size_t>(spreads.size() / 2, kMinEdges / 2);
    const std::size_t half = std::max<std::size_t>(sharper / 2, 2);
    std::size_t best = 0;
    for (std::size_t i = 0; i + half <= sharper; ++i)
        if (spreads[i + half - 1] / spreads[i] < spreads[best + half - 1] / spreads[best]) best = i;
    std::vector<double> crowd(spreads.begin() + static_cast<std::ptrdiff_t>(best),
                              spreads.begin() + static_cast<std::ptrdiff_t>(best + half));
    // Half of a crowd spans 0.67 of its deviation to both sides.
    const double deviation = (crowd.back() - crowd.front()) / (2.0 * 0.6745);
    const double spread = quantile(crowd, 0.5);
    estimate.sigma_px = std::sqrt(std::max(0.0, spread * spread - kBoxVariance));
    estimate.sigma_of_sigma_px = 1.2533 * deviation / std::sqrt(static_cast<double>(half)) *
                                 spread / std::max(estimate.sigma_px, 0.1);
    return estimate;
}

ChromaticAberration estimateChromaticAberration(const std::vector<EdgeProfile>& edges,
                                                glm::dvec2 centre_px)
{
    ChromaticAberration estimate;
    if (edges.size() < static_cast<std::size_t>(kMinEdges)) return estimate;
    for (const int c : {0, 2}) {
        double k = 0.0;
        double scale = 0.0;
        double information = 0.0;
        for (int iteration = 0; iteration < 20; ++iteration) {
            std::vector<double> size;
            for (const EdgeProfile& edge : edges)
                size.push_back(std::abs(edge.offset[c] - edge.offset.g -
                                        k * glm::dot(edge.normal, edge.at - centre_px)));
            scale = std::max(1.4826 * quantile(size, 0.5), 1e-6);
            double cross = 0.0;
            information = 0.0;
            for (const EdgeProfile& edge : edges) {
                const double lever = glm::dot(edge.normal, edge.at - centre_px);
                const double shift = edge.offset[c] - edge.offset.g;
                const double w = huber((shift - k * lever) / scale);
                cross += w * lever * shift;
                information += w * lever * lever;
            }
            if (information <= 0.0) break;
            k = cross / information;
        }
        if (information <= 0.0) continue;
        estimate.magnification[c] = k;
        // Huber's weights lose a twentieth of the information.
        estimate.magnification_sigma[c] = scale / std::sqrt(0.95 * information);
        const double corner_px = std::abs(k) * glm::length(centre_px);
        estimate.significant =
            estimate.significant ||
            (std::abs(k) > 3.0 * estimate.magnification_sigma[c] && corner_px > 0.05);
    }
    return estimate;
}

}  // namespace insitu
