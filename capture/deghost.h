#pragma once

#include "capture/bracket.h"
#include "core/response_curve.h"

#include <cstdint>
#include <vector>

namespace insitu {

/// How pixels are found at which something moved between the exposures.
struct DeghostOptions {
    /// A pixel disagrees when it is off by this many standard deviations of the bracket's own
    /// noise, which is measured. Unitless, > 0.
    double sigmas = 2.5;
    /// Differences of radiance below this are not looked for: response curves and exposure times
    /// are not better. Fraction, in (0, 1).
    double tolerance = 0.08;
    /// A region with fewer pixels is noise. >= 1.
    int min_region_px = 24;
    /// What is found grows by this: outlines are blurred. Pixels, >= 0.
    int grow_px = 3;

    [[nodiscard]] Findings validate() const;
};

struct MovedPixels {
    /// One a frame, of its size: 1 = must not be used here. It does not hold what the frame
    /// excluded already.
    std::vector<Image<std::uint8_t>> masks;
    double moved_fraction = 0.0;  ///< of the pixels, those masked in some frame
    Findings findings;            ///< "bracket-ghosts-removed" (Info: share, frames)
};

/// Finds what moved in an aligned bracket, so that every place of the merged image shows one
/// moment and moving people leave no half-transparent ghosts.
///
/// Frames are compared with the best exposed one, where that is clipped or black with the nearest
/// in exposure that is not. They disagree when a frame's code differs from the one that the other's
/// radiance would give, beyond noise, tolerance and a pixel of misplacement, or when a bound is
/// broken (a clipped code is a lower bound of the radiance, a black one an upper bound). Where a
/// connected region disagrees, the frame that most others agree with is believed instead of the
/// best exposed one: it shows the room rather than who walked through it.
///
/// The bracket needs at least two frames of one size; with fewer the masks are empty of ones. The
/// answer does not depend on the number of threads. InputError: options that make no sense.
[[nodiscard]] MovedPixels findMovedPixels(const Bracket& bracket,
                                          const ResponseCurve& response,
                                          const DeghostOptions& options = {});

/// Adds the masks to those of the bracket's frames.
void exclude(Bracket& bracket, const MovedPixels& moved);

}  // namespace insitu
