#include "lighting/light_fit.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <utility>
#include <vector>

namespace insitu {

namespace {

static_assert(kLightBands == 4, "the normal equations are 4x4");
using Bands = glm::dvec4;

constexpr std::size_t kMinCells = 20;
/// Scatter of reflectance over a patterned surface, relative: the scale of the robust loss.
constexpr double kPattern = 0.2;
/// Weight of the prior s = 1 against one square metre of surface. Patterns are correlated over
/// several cells, so that a surface says less than its cells seem to. What is clipped is brighter
/// than its guess by nobody knows how much: there the prior only keeps the equations regular.
const Bands kPrior(0.02, 0.02, 0.02, 1e-4);
const Bands kLowestLog(std::log(0.1), std::log(0.1), std::log(0.1), 0.0);
const Bands kHighestLog(std::log(20.0), std::log(20.0), std::log(20.0), std::log(1e6));
/// A pattern is taken to be correlated over this area, m²: so much counts as one observation.
constexpr double kPatternArea = 0.1;
/// Strengths of clipped lights from which the fit starts: each eight times the one before.
constexpr int kStarts = 6;
constexpr int kIterations = 30;
/// Longest step in log s.
constexpr double kMaxStep = 0.5;

/// One channel of a face's places.
struct Row {
    double weight = 0.0;  ///< area, times the robust weight
    double area = 0.0;
    double radiant = 0.0;  ///< π L
    double known = 0.0;
    Bands guessed{0.0};
};
using Face = std::vector<Row>;

struct NormalEquations {
    glm::dmat4 matrix{0.0};
    Bands right{0.0};
    double loss = 0.0;
};

/// Of one Gauss–Newton step in log s. Each face's log ρ is the weighted mean of its residuals:
/// taking it out of residuals and derivatives alike eliminates it. Robust weights are renewed.
NormalEquations equations(std::vector<Face>& faces, const Bands& log_s)
{
    const Bands s = glm::exp(log_s);
    NormalEquations normal;
    for (int b = 0; b < 4; ++b) {
        normal.matrix[b][b] = kPrior[b];
        normal.right[b] = -kPrior[b] * log_s[b];
        normal.loss += kPrior[b] * log_s[b] * log_s[b];
    }
    for (Face& face : faces) {
        double weights = 0.0;
        double mean = 0.0;
        Bands mean_slope(0.0);
        std::vector<std::pair<double, Bands>> terms;
        for (const Row& row : face) {
            const double irradiance = row.known + glm::dot(s, row.guessed);
            const Bands slope = s * row.guessed / irradiance;
            const double residual = std::log(row.radiant / irradiance);
            weights += row.weight;
            mean += row.weight * residual;
            mean_slope += row.weight * slope;
            terms.emplace_back(residual, slope);
        }
        mean /= weights;
        mean_slope /= weights;
        for (std::size_t i = 0; i < face.size(); ++i) {
            const double residual = terms[i].first - mean;
            const Bands slope = terms[i].second - mean_slope;
            normal.matrix += face[i].weight * glm::outerProduct(slope, slope);
            normal.right += face[i].weight * residual * slope;
            const double scaled = residual * residual / (kPattern * kPattern);
            normal.loss += face[i].area * kPattern * kPattern * std::log1p(scaled);
            // Cauchy weights for the next step.
            face[i].weight = face[i].area / (1.0 + scaled);
        }
    }
    return normal;
}

/// The places of one channel, by face; faces with too few are left out.
std::vector<Face> collectFaces(std::span<const LitCell> cells, int channel)
{
    std::map<std::size_t, Face> by_face;
    for (const LitCell& cell : cells) {
        Row row;
        row.weight = row.area = cell.area;
        row.radiant = std::numbers::pi * cell.radiance[channel];
        row.known = cell.known[channel];
        for (int b = 0; b < 4; ++b)
            row.guessed[b] = cell.guessed[static_cast<std::size_t>(b)][channel];
        const double irradiance = row.known + glm::dot(row.guessed, Bands(1.0));
        if (irradiance > 0.0 && row.radiant > 0.0) by_face[cell.face].push_back(row);
    }
    std::vector<Face> faces;
    for (auto& [face, rows] : by_face)
        if (rows.size() >= kMinCells) faces.push_back(std::move(rows));
    return faces;
}

struct ChannelFit {
    Bands log_s{0.0};
    Bands log_sigma{0.0};
    double loss = 0.0;
};

ChannelFit fitFrom(std::vector<Face> faces, Bands log_s)
{
    ChannelFit fit;
    for (int i = 0; i < kIterations; ++i) {
        const NormalEquations normal = equations(faces, log_s);
        const Bands step = glm::inverse(normal.matrix) * normal.right;
        log_s = glm::clamp(log_s + glm::clamp(step, -kMaxStep, kMaxStep), kLowestLog, kHighestLog);
    }
    const NormalEquations normal = equations(faces, log_s);
    const glm::dmat4 covariance =
        glm::inverse(normal.matrix) * (kPattern * kPattern * kPatternArea);
    fit.log_s = log_s;
    for (int b = 0; b < 4; ++b)
        fit.log_sigma[b] = std::sqrt(std::max(0.0, covariance[b][b]));
    fit.loss = normal.loss;
    return fit;
}

bool hasClippedLight(const std::vector<Face>& faces)
{
    return std::ranges::any_of(faces, [](const Face& face) {
        return std::ranges::any_of(face, [](const Row& row) { return row.guessed.w > 0.0; });
    });
}

}  // namespace

LightFit fitLightBands(std::span<const LitCell> cells)
{
    LightFit result;
    for (int c = 0; c < 3; ++c) {
        const std::vector<Face> faces = collectFaces(cells, c);
        ChannelFit best = fitFrom(faces, Bands(0.0));
        for (int start = 1; start < kStarts && hasClippedLight(faces); ++start) {
            const ChannelFit other = fitFrom(faces, Bands(0, 0, 0, start * std::log(8.0)));
            if (other.loss < best.loss) best = other;
        }
        for (int b = 0; b < 4; ++b) {
            result.factors[static_cast<std::size_t>(b)][c] = std::exp(best.log_s[b]);
            result.log_sigma[static_cast<std::size_t>(b)][c] = best.log_sigma[b];
        }
    }
    return result;
}

}  // namespace insitu
