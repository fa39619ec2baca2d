#pragma once

#include "calib/line_segments.h"

#include <string>

namespace insitu {

/// The segments as a lens without distortion would have shown them: core/camera.h's model with λ
/// `division` about `principal_px`. Points between their ends are dropped, nothing else changes.
/// Throws InputError where the model folds over (1 + λ r²/R² ≤ 0.1) inside the marked points.
[[nodiscard]] LineSet straightened(const LineSet& lines,
                                   glm::dvec2 principal_px,
                                   double division,
                                   const std::string& source);

}  // namespace insitu
