#pragma once

#include "capture/bracket.h"

#include <glm/glm.hpp>

#include <optional>
#include <vector>

namespace insitu {

/// What may move between two frames of a bracket, from the simplest to the richest.
enum class AlignmentModel {
    Translation,  ///< 2 parameters
    Euclidean,    ///< 3: and rotation in the picture plane
    Homography    ///< 8: a camera that turns any way (and a plane seen by one that moves)
};

/// How the frames of a hand-held bracket are laid onto each other.
struct AlignmentOptions {
    /// The richest model allowed; a simpler one is taken where the data tells no more.
    AlignmentModel model = AlignmentModel::Homography;
    /// Largest translation between two frames that is looked for, as a share of the picture's long
    /// side. Unitless, in (0, 0.5].
    double max_shift_fraction = 0.12;
    /// A frame that moves by less than this anywhere counts as not moved at all, as does one that
    /// moves by less than twice its uncertainty: resampling would cost more sharpness than it
    /// gains. Pixels of the full picture, >= 0.
    double min_shift_px = 0.2;
    /// The frame whose place and field of view the others take; absent = the best exposed one.
    std::optional<int> reference;

    [[nodiscard]] Findings validate() const;
};

/// Where every frame of a bracket lies.
struct Alignment {
    int reference = 0;  ///< index of the frame that stays as it is
    /// One a frame: x_in_frame ~ frame_from_reference * (x_in_reference, 1), homogeneous, pixels,
    /// (0, 0) being the corner of the top-left pixel. Exactly the identity for a frame that did not
    /// move or whose place is unknown.
    std::vector<glm::dmat3> frame_from_reference;
    /// One a frame: how far its farthest corner moved, pixels, as measured: also for a frame that
    /// counts as not moved; 0 for one whose place is unknown.
    std::vector<double> shift_px;
    /// One a frame: standard deviation of that, pixels.
    std::vector<double> sigma_px;
    /// "bracket-aligned" (Info: the shifts), "bracket-static" (Info: nothing moved),
    /// "bracket-alignment-failed" (a frame that tells nothing, too dark or bright or blurred, and
    /// stays as it was: Warning when others moved, else Info), "bracket-not-alignable" (Warning: no
    /// two frames show enough in common).
    Findings findings;

    /// Nothing has to be resampled.
    [[nodiscard]] bool isIdentity() const;
};

/// Estimates how the frames lie. No response curve is needed: frames are compared after their codes
/// were matched by rank ([GroNay03]), each with its neighbour in exposure, and registered from
/// coarse to fine by inverse compositional Gauss-Newton with robust weights ([BakMat04], section
/// 3.2), which moving people do not pull. Uncertainties are those of blocks of the picture against
/// each other ([LiaZeg86]), so that correlated noise does not make them too small.
///
/// InputError: options that make no sense, a reference
/// that does not exist. A repeated texture is ambiguous: the smallest fitting shift is taken.
[[nodiscard]] Alignment alignBracket(const Bracket& bracket, const AlignmentOptions& options = {});

/// The bracket with every frame in the reference's place, cubic in codes ([Keys81]).
///
/// A code whose surroundings are clipped in its channel comes out clipped (max_code): a value
/// between a clipped and another code would look like a measurement. What lies outside a frame's
/// picture, or touches a pixel that it excludes, gets max_code and is marked in
/// `BracketFrame::excluded`. Frames whose transform is the identity are handed through unchanged.
[[nodiscard]] Bracket applyAlignment(Bracket bracket, const Alignment& alignment);

}  // namespace insitu
