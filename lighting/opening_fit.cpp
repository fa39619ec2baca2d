#include "lighting/opening_fit.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <utility>
#include <vector>

namespace insitu {

namespace {

constexpr std::size_t kMinCells = 20;
/// Scatter of reflectance over a patterned surface, relative: the scale of the robust weights.
constexpr double kPattern = 0.2;
/// Weight of the prior s = 1 against one square metre of surface. Patterns are correlated over
/// several cells, so that a surface says less than its cells seem to.
constexpr double kPrior = 0.02;
constexpr int kIterations = 20;
/// Longest step in log s.
constexpr double kMaxStep = 0.5;
constexpr double kMinFactor = 0.1;
constexpr double kMaxFactor = 20.0;

/// One channel of a face's places.
struct Row {
    double weight = 0.0;  ///< area, times the robust weight
    double area = 0.0;
    double radiant = 0.0;  ///< π L
    double known = 0.0;
    glm::dvec3 guessed{0.0};  ///< per band
};
using Face = std::vector<Row>;

/// One Gauss–Newton step in log s. Each face's log ρ is the weighted mean of its residuals: taking
/// it out of residuals and derivatives alike eliminates it.
glm::dvec3 step(std::vector<Face>& faces, const glm::dvec3& log_s)
{
    const glm::dvec3 s = glm::exp(log_s);
    glm::dmat3 matrix(kPrior);
    glm::dvec3 right = -kPrior * log_s;
    for (Face& face : faces) {
        double weights = 0.0;
        double mean = 0.0;
        glm::dvec3 mean_slope(0.0);
        std::vector<std::pair<double, glm::dvec3>> terms;
        for (const Row& row : face) {
            const double irradiance = row.known + glm::dot(s, row.guessed);
            const glm::dvec3 slope = s * row.guessed / irradiance;
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
            const glm::dvec3 slope = terms[i].second - mean_slope;
            matrix += face[i].weight * glm::outerProduct(slope, slope);
            right += face[i].weight * residual * slope;
            // Cauchy weights for the next step.
            face[i].weight = face[i].area / (1.0 + residual * residual / (kPattern * kPattern));
        }
    }
    return glm::clamp(glm::inverse(matrix) * right, -kMaxStep, kMaxStep);
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
        for (std::size_t b = 0; b < kOpeningBands; ++b)
            row.guessed[static_cast<int>(b)] = cell.guessed[b][channel];
        const double irradiance = row.known + row.guessed.x + row.guessed.y + row.guessed.z;
        if (irradiance > 0.0 && row.radiant > 0.0) by_face[cell.face].push_back(row);
    }
    std::vector<Face> faces;
    for (auto& [face, rows] : by_face)
        if (rows.size() >= kMinCells) faces.push_back(std::move(rows));
    return faces;
}

}  // namespace

std::array<glm::dvec3, kOpeningBands> fitOpeningBands(std::span<const LitCell> cells)
{
    static_assert(kOpeningBands == 3, "the normal equations are 3x3");
    std::array<glm::dvec3, kOpeningBands> factors;
    factors.fill(glm::dvec3(1.0));
    for (int c = 0; c < 3; ++c) {
        std::vector<Face> faces = collectFaces(cells, c);
        glm::dvec3 log_s(0.0);
        for (int i = 0; i < kIterations; ++i)
            log_s =
                glm::clamp(log_s + step(faces, log_s), std::log(kMinFactor), std::log(kMaxFactor));
        for (int b = 0; b < 3; ++b)
            factors[static_cast<std::size_t>(b)][c] = std::exp(log_s[b]);
    }
    return factors;
}

}  // namespace insitu
