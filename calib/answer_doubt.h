#pragma once

#include "calib/manhattan_search.h"

/// Internal to calib/: how far an answer can be trusted. Not installed.
namespace insitu::manhattan {

struct Doubt {
    double focal = 0.0;     ///< σ of ln f
    double rotation = 0.0;  ///< radians
};

/// Scatter of the frame when the segments are drawn anew with repetition, which shows what hangs
/// on a few of them, together with what the principal point's error does.
///
/// principal_sigma   of each coordinate, share of the long side
/// Source: [EfrTib93] chapter 6 for the bootstrap; fixed seed, deterministic.
[[nodiscard]] Doubt doubtOf(const Task& task, const Frame& frame, double principal_sigma);

}  // namespace insitu::manhattan
