#pragma once

#include "capture/bracket.h"
#include "capture/response_solve.h"

#include <array>
#include <vector>

namespace insitu::detail {

/// About `count` small flat patches of the bracket, by channel those that are useful in two
/// different exposures or more. For brackets of two frames; see response_solve.h.
[[nodiscard]] std::array<std::vector<PatchObservations>, 3> observePatches(const Bracket& bracket,
                                                                           int count);

}  // namespace insitu::detail
