#include "calib/vanishing_points.h"

#include <Eigen/Eigenvalues>

#include <cmath>

namespace insitu {

namespace {

/// Vanishing points further out are parallel lines as far as a picture can tell.
constexpr double kInfinityPx = 1e6;
/// Second smallest over largest eigenvalue below which all planes through the segments coincide.
constexpr double kOneLine = 1e-12;

}  // namespace

glm::dvec3 VanishingPoint::direction(double focal_px) const
{
    return glm::normalize(glm::dvec3(centred.x, centred.y, centred.z * focal_px));
}

std::optional<glm::dvec2> VanishingPoint::inPicture(glm::dvec2 principal_px) const
{
    const glm::dvec2 finite(centred.x, centred.y);
    if (glm::length(finite) > kInfinityPx * std::abs(centred.z)) return std::nullopt;
    return finite / centred.z + principal_px;
}

std::optional<VanishingPoint> vanishingPoint(std::span<const LineSegment> segments,
                                             glm::dvec2 principal_px,
                                             double sphere_focal_px)
{
    if (segments.size() < 2) return std::nullopt;
    Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
    for (const LineSegment& segment : segments) {
        const glm::dvec2 from = (segment.from_px - principal_px) / sphere_focal_px;
        const glm::dvec2 to = (segment.to_px - principal_px) / sphere_focal_px;
        // |normal| is about the segment's length: the weight that its accuracy deserves.
        const glm::dvec3 n = glm::cross(glm::dvec3(from, 1.0), glm::dvec3(to, 1.0));
        const Eigen::Vector3d normal(n.x, n.y, n.z);
        scatter += normal * normal.transpose();
    }
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(scatter);
    if (solver.eigenvalues()(1) < kOneLine * solver.eigenvalues()(2)) return std::nullopt;
    const Eigen::Vector3d v = solver.eigenvectors().col(0);
    return VanishingPoint{glm::dvec3(v.x(), v.y(), v.z() / sphere_focal_px)};
}

std::optional<double> focalFromOrthogonalPair(const VanishingPoint& a, const VanishingPoint& b)
{
    const double numerator = a.centred.x * b.centred.x + a.centred.y * b.centred.y;
    const double denominator = a.centred.z * b.centred.z;
    const double squared = -numerator / denominator;
    if (!std::isfinite(squared) || squared <= 0.0) return std::nullopt;
    return std::sqrt(squared);
}

}  // namespace insitu
