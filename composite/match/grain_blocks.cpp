#include "composite/match/grain_blocks.h"

#include "core/parallel.h"

#include <Eigen/Eigenvalues>

#include <cmath>
#include <complex>
#include <numbers>

namespace insitu {

namespace {

constexpr int kPixels = kGrainBlock * kGrainBlock;
constexpr double kCentre = 0.5 * (kGrainBlock - 1);
/// Σ (x − centre)² over a block.
constexpr double kMoment = kPixels * (kGrainBlock * kGrainBlock - 1) / 12.0;

using Residuals = std::array<std::array<double, kPixels>, 3>;

/// Codes of a block, 8-bit steps, less the plane through them.
Residuals residuals(const EncodedImage& photo, int x0, int y0, glm::dvec3& level)
{
    Residuals result;
    const double step = 255.0 / photo.max_code;
    for (int c = 0; c < 3; ++c) {
        auto& r = result[static_cast<std::size_t>(c)];
        double mean = 0.0;
        double along_x = 0.0;
        double along_y = 0.0;
        for (int i = 0; i < kPixels; ++i) {
            const int x = i % kGrainBlock;
            const int y = i / kGrainBlock;
            const double z = step * photo.codes(x0 + x, y0 + y)[c];
            r[static_cast<std::size_t>(i)] = z;
            mean += z / kPixels;
            along_x += z * (x - kCentre) / kMoment;
            along_y += z * (y - kCentre) / kMoment;
        }
        for (int i = 0; i < kPixels; ++i)
            r[static_cast<std::size_t>(i)] -= mean + along_x * (i % kGrainBlock - kCentre) +
                                              along_y * (i / kGrainBlock - kCentre);
        level[c] = mean;
    }
    return result;
}

bool wellExposed(const EncodedImage& photo, int x0, int y0)
{
    const int low = photo.max_code / 128;
    const int high = photo.max_code - low;
    for (int y = y0; y < y0 + kGrainBlock; ++y)
        for (int x = x0; x < x0 + kGrainBlock; ++x)
            for (int c = 0; c < 3; ++c)
                if (photo.codes(x, y)[c] < low || photo.codes(x, y)[c] > high) return false;
    return true;
}

int lagIndex(int dx, int dy)
{
    return (dy + GrainCorrelation::kReach) * GrainCorrelation::kSide + dx +
           GrainCorrelation::kReach;
}

using Lags = std::array<double, GrainCorrelation::kSide * GrainCorrelation::kSide>;

/// What residuals about a plane show, on average over a block, of noise with covariances `lags`:
/// those of (I − Q Qᵀ) T (I − Q Qᵀ), T(i, j) = lags(x_j − x_i), Q the orthonormal planes.
Lags seenThroughPlane(const Lags& lags)
{
    constexpr int kReach = GrainCorrelation::kReach;
    Eigen::Matrix<double, kPixels, 3> q;
    for (int i = 0; i < kPixels; ++i)
        q.row(i) << 1.0 / std::sqrt(double(kPixels)),
            (i % kGrainBlock - kCentre) / std::sqrt(kMoment),
            (i / kGrainBlock - kCentre) / std::sqrt(kMoment);
    const auto forLags = [&](auto&& visit) {
        for (int y = 0; y < kGrainBlock; ++y)
            for (int x = 0; x < kGrainBlock; ++x)
                for (int dy = std::max(-kReach, -y); dy <= std::min(kReach, kGrainBlock - 1 - y);
                     ++dy)
                    for (int dx = std::max(-kReach, -x);
                         dx <= std::min(kReach, kGrainBlock - 1 - x);
                         ++dx)
                        visit(y * kGrainBlock + x,
                              (y + dy) * kGrainBlock + x + dx,
                              static_cast<std::size_t>(lagIndex(dx, dy)));
    };
    Eigen::Matrix<double, kPixels, 3> tq = Eigen::Matrix<double, kPixels, 3>::Zero();
    Eigen::Matrix<double, kPixels, 3> ttq = tq;  // Tᵀ Q
    forLags([&](int i, int j, std::size_t lag) {
        tq.row(i) += lags[lag] * q.row(j);
        ttq.row(j) += lags[lag] * q.row(i);
    });
    const Eigen::Matrix3d inner = q.transpose() * tq;
    Lags sum{};
    Lags count{};
    forLags([&](int i, int j, std::size_t lag) {
        sum[lag] += lags[lag] - q.row(i).dot(ttq.row(j)) - tq.row(i).dot(q.row(j)) +
                    (q.row(i) * inner).dot(q.row(j));
        count[lag] += 1.0;
    });
    for (std::size_t k = 0; k < sum.size(); ++k)
        sum[k] /= count[k];
    return sum;
}

/// Undoes the plane in every covariance, and says what it left of the variances.
void undoPlane(GrainCorrelation& correlation)
{
    constexpr int kRounds = 6;
    const std::size_t middle = static_cast<std::size_t>(lagIndex(0, 0));
    for (int c = 0; c < 3; ++c)
        for (int d = 0; d < 3; ++d) {
            Lags seen;
            for (std::size_t k = 0; k < seen.size(); ++k)
                seen[k] = correlation.covariance[k][d][c];
            Lags lags = seen;
            for (int round = 0; round < kRounds; ++round) {
                const Lags expected = seenThroughPlane(lags);
                for (std::size_t k = 0; k < seen.size(); ++k)
                    lags[k] += seen[k] - expected[k];
            }
            for (std::size_t k = 0; k < seen.size(); ++k)
                correlation.covariance[k][d][c] = lags[k];
        }
    glm::dvec3 grown;
    for (int c = 0; c < 3; ++c)
        grown[c] = std::clamp(correlation.covariance[middle][c][c], 1.0, 3.0);
    for (glm::dmat3& covariance : correlation.covariance)
        for (int d = 0; d < 3; ++d)
            for (int c = 0; c < 3; ++c)
                covariance[d][c] /= std::sqrt(grown[c] * grown[d]);
    // Per degree of freedom, the blocks' variances count n − 3.
    correlation.left_by_plane = kPixels / (kPixels - 3.0) / grown;
}

}  // namespace

std::vector<GrainBlock> grainBlocks(const EncodedImage& photo)
{
    const int columns = photo.codes.width() / kGrainBlock;
    const int rows = photo.codes.height() / kGrainBlock;
    std::vector<std::vector<GrainBlock>> by_row(static_cast<std::size_t>(rows));
    parallelFor(0, rows, [&](std::int64_t row) {
        for (int i = 0; i < columns; ++i) {
            GrainBlock block{i * kGrainBlock, static_cast<int>(row) * kGrainBlock};
            if (!wellExposed(photo, block.x, block.y)) continue;
            const Residuals left = residuals(photo, block.x, block.y, block.level);
            for (int c = 0; c < 3; ++c)
                for (const double r : left[static_cast<std::size_t>(c)])
                    block.variance[c] += r * r / (kPixels - 3.0);
            by_row[static_cast<std::size_t>(row)].push_back(block);
        }
    });
    std::vector<GrainBlock> blocks;
    for (const auto& line : by_row)
        blocks.insert(blocks.end(), line.begin(), line.end());
    return blocks;
}

GrainCorrelation grainCorrelation(const EncodedImage& photo,
                                  const std::vector<GrainBlock>& flat,
                                  const GrainModel& measured,
                                  double rounding)
{
    constexpr int kReach = GrainCorrelation::kReach;
    // A photograph's few thousand first flat blocks say as much as all.
    constexpr std::size_t kEnough = 4000;
    const std::size_t stride = std::max<std::size_t>(1, flat.size() / kEnough);
    GrainCorrelation sum;
    glm::dvec3 rounding_share(0.0);
    double blocks = 0.0;
    for (std::size_t b = 0; b < flat.size(); b += stride) {
        glm::dvec3 level;
        Residuals noise = residuals(photo, flat[b].x, flat[b].y, level);
        for (int c = 0; c < 3; ++c) {
            const double sigma = measured.sigmaAt(c, level[c]);
            for (double& r : noise[static_cast<std::size_t>(c)])
                r /= sigma;
            rounding_share[c] += rounding / (sigma * sigma);
        }
        blocks += 1.0;
        for (int dy = 0; dy <= kReach; ++dy)
            for (int dx = -kReach; dx <= kReach; ++dx) {
                if (dy == 0 && dx < 0) continue;
                glm::dmat3 pairs(0.0);
                for (int y = 0; y < kGrainBlock - dy; ++y)
                    for (int x = std::max(0, -dx); x < kGrainBlock - std::max(0, dx); ++x) {
                        const auto here = static_cast<std::size_t>(y * kGrainBlock + x);
                        const auto there =
                            static_cast<std::size_t>((y + dy) * kGrainBlock + x + dx);
                        for (int d = 0; d < 3; ++d)
                            for (int c = 0; c < 3; ++c)
                                pairs[d][c] += noise[static_cast<std::size_t>(c)][here] *
                                               noise[static_cast<std::size_t>(d)][there];
                    }
                const double count = (kGrainBlock - dy) * (kGrainBlock - std::abs(dx));
                sum.covariance[static_cast<std::size_t>(lagIndex(dx, dy))] += pairs / count;
            }
    }
    GrainCorrelation result;
    glm::dvec3 scale;
    const auto middle = static_cast<std::size_t>(lagIndex(0, 0));
    for (int c = 0; c < 3; ++c)
        scale[c] =
            1.0 / std::sqrt(std::max(
                      sum.covariance[middle][c][c] / blocks - rounding_share[c] / blocks, 1e-3));
    for (int dy = -kReach; dy <= kReach; ++dy)
        for (int dx = -kReach; dx <= kReach; ++dx) {
            const bool seen = dy > 0 || (dy == 0 && dx >= 0);
            const int sy = seen ? dy : -dy;
            const int sx = seen ? dx : -dx;
            glm::dmat3 c = sum.covariance[static_cast<std::size_t>(lagIndex(sx, sy))] / blocks;
            if (!seen) c = glm::transpose(c);
            for (int i = 0; i < 3; ++i)
                for (int k = 0; k < 3; ++k)
                    c[i][k] *= scale[i] * scale[k];
            result.covariance[static_cast<std::size_t>(lagIndex(dx, dy))] = c;
        }
    for (int c = 0; c < 3; ++c)
        result.covariance[middle][c][c] = 1.0;
    undoPlane(result);
    return result;
}

void setKernel(const GrainCorrelation& correlation, GrainModel& model)
{
    constexpr int kReach = GrainCorrelation::kReach;
    constexpr int kGrid = 16;
    constexpr int kRadius = 6;
    constexpr int kSide = 2 * kRadius + 1;
    using Matrix = Eigen::Matrix3cd;
    const auto wave = [](int a, int b) {
        return std::polar(1.0, 2.0 * std::numbers::pi * a * b / kGrid);
    };
    // Square root of the spectrum, frequency by frequency.
    std::vector<Matrix> root(kGrid * kGrid);
    for (int v = 0; v < kGrid; ++v)
        for (int u = 0; u < kGrid; ++u) {
            Matrix spectrum = Matrix::Zero();
            for (int dy = -kReach; dy <= kReach; ++dy)
                for (int dx = -kReach; dx <= kReach; ++dx) {
                    const glm::dmat3& c =
                        correlation.covariance[static_cast<std::size_t>(lagIndex(dx, dy))];
                    const std::complex<double> phase = wave(-u, dx) * wave(-v, dy);
                    for (int i = 0; i < 3; ++i)
                        for (int k = 0; k < 3; ++k)
                            spectrum(i, k) += phase * c[k][i];
                }
            spectrum = (0.5 * (spectrum + spectrum.adjoint())).eval();
            const Eigen::SelfAdjointEigenSolver<Matrix> solver(spectrum);
            const Eigen::Vector3d clamped = solver.eigenvalues().cwiseMax(0.0).cwiseSqrt();
            root[static_cast<std::size_t>(v * kGrid + u)] =
                solver.eigenvectors() * clamped.cast<std::complex<double>>().asDiagonal() *
                solver.eigenvectors().adjoint();
        }
    model.radius = kRadius;
    model.kernel.assign(kSide * kSide, glm::mat3(0.0f));
    glm::dvec3 variance(0.0);
    for (int y = -kRadius; y <= kRadius; ++y)
        for (int x = -kRadius; x <= kRadius; ++x) {
            Matrix tap = Matrix::Zero();
            for (int v = 0; v < kGrid; ++v)
                for (int u = 0; u < kGrid; ++u)
                    tap += root[static_cast<std::size_t>(v * kGrid + u)] * wave(u, x) * wave(v, y) /
                           static_cast<double>(kGrid * kGrid);
            glm::mat3& kept =
                model.kernel[static_cast<std::size_t>((y + kRadius) * kSide + x + kRadius)];
            for (int i = 0; i < 3; ++i)
                for (int k = 0; k < 3; ++k) {
                    kept[k][i] = static_cast<float>(tap(i, k).real());
                    variance[i] += tap(i, k).real() * tap(i, k).real();
                }
        }
    for (glm::mat3& tap : model.kernel)
        for (int i = 0; i < 3; ++i)
            for (int k = 0; k < 3; ++k)
                tap[k][i] /= static_cast<float>(std::sqrt(std::max(variance[i], 1e-12)));
}

}  // namespace insitu
