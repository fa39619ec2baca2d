#pragma once

#include "capture/response_groups.h"
#include "capture/response_solve.h"

#include <array>
#include <optional>
#include <vector>

namespace insitu::detail {

/// ln decoders of the three channels; nothing where a method finds no increasing curve.
using Decoders = std::optional<std::array<LogCurve, 3>>;

/// Polynomial of the code, its order chosen by the data [MitNay99]; see response_mitsunaga.cpp.
[[nodiscard]] Decoders fitPolynomials(const std::array<PixelGroups, 3>& groups,
                                      const std::vector<double>& log_exposures);

/// Alternating estimates of radiance and curve, pixel by pixel [Robertson03]; see
/// response_robertson.cpp.
[[nodiscard]] Decoders iterateTables(const BracketPixels& pixels,
                                     const std::vector<double>& log_exposures);

/// Takes back the usable pixels of small blocks whose frames disagree under the curves: something
/// moved there. Returns the share of blocks. See response_moved.cpp.
double dropMovedBlocks(BracketPixels& pixels,
                       const std::array<LogCurve, 3>& decoders,
                       const std::vector<double>& log_exposures);

}  // namespace insitu::detail
