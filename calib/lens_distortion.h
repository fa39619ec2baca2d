#pragma once

#include "calib/line_segments.h"

#include <string>

namespace insitu {

/// All points as a lens without distortion would have shown them (core/camera.h, about the
/// picture's middle); the result has no distortion.
/// Throws InputError where the model folds over (1 + λ r²/R² ≤ 0.1) inside the marked points.
[[nodiscard]] LineSet straightened(const LineSet& lines, const std::string& source);

}  // namespace insitu
