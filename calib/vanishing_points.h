#pragma once

#include "calib/line_segments.h"

#include <glm/glm.hpp>

#include <optional>
#include <span>

namespace insitu {

/// Vanishing points as homogeneous vectors, so that a direction parallel to the picture (its
/// vanishing point at infinity) is as good as any other.
///
/// Common rules: `centred` means pixels relative to the principal point. The sign of a vanishing
/// point is free: a line has no direction.

/// Homogeneous centred vanishing point (x/w, y/w in pixels) of the lines through the segments.
struct VanishingPoint {
    glm::dvec3 centred{0.0, 0.0, 1.0};

    /// Direction in the camera's frame for a focal length in pixels, a unit vector of either sign.
    [[nodiscard]] glm::dvec3 direction(double focal_px) const;
    /// In pixels of the picture; nothing when further out than a million pixels.
    [[nodiscard]] std::optional<glm::dvec2> inPicture(glm::dvec2 principal_px) const;
};

/// Least squares on the Gaussian sphere of a camera with focal length `sphere_focal_px`: the
/// direction most perpendicular to the normals of the planes through the eye and the segments,
/// long segments counting more since the angle of their plane is better known.
/// Nothing with less than two segments or when all lie on one line.
/// Source: [Barnard83] for the sphere, [ColWei90] for the least squares.
[[nodiscard]] std::optional<VanishingPoint> vanishingPoint(std::span<const LineSegment> segments,
                                                           glm::dvec2 principal_px,
                                                           double sphere_focal_px);

/// Focal length in pixels from the vanishing points of two orthogonal directions, from
/// (K⁻¹a)·(K⁻¹b) = 0, i.e. f² = −(a.x b.x + a.y b.y) / (a.w b.w).
/// Nothing when no real focal length fits or when one of them is at infinity.
/// Source: [GibCha03] eq. 1, [CapTor90].
[[nodiscard]] std::optional<double> focalFromOrthogonalPair(const VanishingPoint& a,
                                                            const VanishingPoint& b);

}  // namespace insitu
