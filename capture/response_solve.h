#pragma once

#include <array>
#include <utility>
#include <vector>

namespace insitu::detail {

/// One patch in one frame and one channel.
struct PatchObservation {
    double log_exposure = 0.0;  ///< ln of the frame's relative exposure
    double mean_code = 0.0;     ///< of 255
    double code_variance = 0.0;
    bool clean = false;  ///< no pixel near the ends of the codes, see usefulMeanCode
    /// Share of the patch's pixels at each table entry, ascending; the shares sum to 1.
    std::vector<std::pair<int, double>> histogram;
};

/// One patch in one channel: two or more observations at different exposures.
using PatchObservations = std::vector<PatchObservation>;

/// ln(exposure) by code.
using LogCurve = std::array<double, 256>;

struct ResponseSolution {
    LogCurve log_curve{};
    double residual = 0.0;  ///< weighted RMS of ln exposure, see ResponseRecovery
};

/// Solves one channel; `smoothness` as in ResponseOptions. See response_solve.cpp.
[[nodiscard]] ResponseSolution solveResponse(const std::vector<PatchObservations>& patches,
                                             double smoothness);

}  // namespace insitu::detail
