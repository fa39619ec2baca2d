#pragma once

#include "capture/bracket.h"
#include "core/response_curve.h"

namespace insitu {

/// How a bracket is merged into one radiance image.
struct MergeOptions {
    /// Codes above this fraction of full scale count as clipped. Unitless, in (0.5, 1].
    double clip_fraction = 0.98;
    /// Codes below this fraction count as black. Unitless, in [0, 0.5).
    double black_fraction = 0.02;

    [[nodiscard]] Findings validate() const;
};

struct MergeResult {
    RadianceImage radiance;  ///< linearised exposure / relative exposure
    /// Per pixel: 1 where some channel is clipped even in the shortest exposure: a lower bound.
    Image<std::uint8_t> clipped;
    double clipped_fraction = 0.0;
    Findings findings;  ///< "merge-clipped", "merge-all-clipped", "merge-all-black"
};

[[nodiscard]] MergeResult mergeBracket(const Bracket& bracket,
                                       const ResponseCurve& response,
                                       const MergeOptions& options);

}  // namespace insitu
