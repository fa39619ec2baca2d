#pragma once

#include "core/finding.h"
#include "core/photo.h"

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace insitu {

/// One exposure of a bracket.
struct BracketFrame {
    std::string name;  ///< for messages: the file's name
    EncodedImage image;
    double relative_exposure = 0.0;  ///< Exposure::relative(), > 0
    /// Empty: every pixel may be used. Else of the image's size, 1 = this pixel must not be used
    /// (outside the picture after alignment, or something moved there).
    Image<std::uint8_t> excluded = {};
};

/// Exposures of one scene from one place: equal sizes, sorted from longest to shortest exposure.
struct Bracket {
    std::vector<BracketFrame> frames;
    PhotoMetadata metadata;  ///< of the longest exposure: camera, and how codes stand for colour
    /// Frames were cut out of larger pictures one by one, so that they do not lie on each other
    /// before alignBracket() has laid them so.
    bool hand_cut = false;
    Findings findings;
};

/// What pictures of unequal size are.
enum class FrameSizes {
    Equal,   ///< a mistake
    HandCut  ///< one thing, such as a mirror ball, cut by hand out of pictures of equal size
};

/// Reads and checks a bracket. `overrides[i]` replaces what EXIF says about file i, member by
/// member; it is empty or has one entry a file. Their order does not matter. InputError: unequal
/// sizes (hand-cut: by more than a quarter), no exposure known (naming the file and the remedy), no
/// file, RAW beside other files, different colour profiles.
///
/// Hand-cut pictures whose sizes differ come to lie, middle on middle, in the largest width and
/// height among them; what a smaller one lacks repeats its border and is `excluded`.
/// Findings: "bracket-hand-cut" (Info), "bracket-single-exposure", "bracket-duplicate-exposure",
/// "bracket-repeated-picture" (the same codes twice under one exposure; the second is left out),
/// "bracket-mixed-cameras", "bracket-partial-exposure" (f-number or ISO known for some frames
/// only), "bracket-white-balance" (RAW: several; that of the longest exposure counts),
/// photoFindings().
[[nodiscard]] Bracket readBracket(const std::vector<std::filesystem::path>& files,
                                  const std::vector<Exposure>& overrides = {},
                                  FrameSizes sizes = FrameSizes::Equal);

/// The same checks and order for frames that are already in memory.
[[nodiscard]] Bracket makeBracket(std::vector<BracketFrame> frames, PhotoMetadata metadata = {});

}  // namespace insitu
