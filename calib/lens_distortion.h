#pragma once

#include "calib/line_segments.h"
#include "core/finding.h"

#include <glm/glm.hpp>

#include <string>

namespace insitu {

/// Where a lens without distortion would have shown what is seen at `pixel`.
///
/// One-parameter division model about the picture's middle c, with R half its diagonal:
/// p − c  →  s (p − c) / (1 + λ |p − c|² / R²), where s = 1 + λ ρ²/R² leaves points at the radius
/// ρ = distortion.unchanged_radius_px where they are. λ < 0 is a barrel. Closed form in the
/// direction needed, and as good as two polynomial terms for ordinary lenses.
/// Source: [Fitzgibbon01] section 2.
[[nodiscard]] glm::dvec2 straightened(glm::dvec2 pixel, const LineSet& lines);

/// All points as a lens without distortion would have shown them; the result has no distortion.
/// Throws InputError where the model folds over (1 + λ r²/R² ≤ 0.1) inside the marked points.
[[nodiscard]] LineSet straightened(const LineSet& lines, const std::string& source);

/// "lens-distortion-approximated": pixels that the camera, which has none, is off by at the corners
/// and at the origin. Nothing without distortion.
[[nodiscard]] Findings distortionFindings(const LineSet& lines);

}  // namespace insitu
