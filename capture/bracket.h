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
    Findings findings;
};

/// Reads and checks a bracket. `overrides[i]` replaces what EXIF says about file i, member by
/// member; it is empty or has one entry a file. Their order does not matter. InputError: unequal
/// sizes, no exposure known (naming the file and the remedy), no file, RAW beside other files,
/// different colour profiles.
/// Findings: "bracket-single-exposure", "bracket-duplicate-exposure", "bracket-repeated-picture"
/// (the same codes twice under one exposure; the second is left out), "bracket-mixed-cameras",
/// "bracket-partial-exposure" (f-number or ISO known for some frames only),
/// "bracket-white-balance" (RAW: several; that of the longest exposure counts), photoFindings().
[[nodiscard]] Bracket readBracket(const std::vector<std::filesystem::path>& files,
                                  const std::vector<Exposure>& overrides = {});

/// The same checks and order for frames that are already in memory.
[[nodiscard]] Bracket makeBracket(std::vector<BracketFrame> frames, PhotoMetadata metadata = {});

}  // namespace insitu
