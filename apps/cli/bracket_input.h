#pragma once

#include "apps/cli/command.h"
#include "capture/radiance_capture.h"

#include <filesystem>
#include <string>
#include <vector>

namespace insitu::cli {

/// What the commands that start from a bracket are told about it.
struct BracketArguments {
    std::vector<std::filesystem::path> images;
    std::vector<std::string> exposures;  ///< "1/60" or "0.5", one an image; empty: from EXIF
    std::filesystem::path response;      ///< a saved curve; empty: recovered from the bracket
    CaptureOptions capture;
};

/// Adds the images and how they are brought to radiance: --exposures, --response, --align,
/// --deghost, --samples, --smoothness, --clip and --black.
void addBracketOptions(CLI::App& command, BracketArguments& arguments);

/// Reads the bracket and the response, if one is given, and merges; prints the findings.
[[nodiscard]] CapturedRadiance mergeArguments(const BracketArguments& arguments,
                                              Context& context,
                                              FrameSizes sizes = FrameSizes::Equal);

/// "1/60" or "0.5" -> seconds; InputError when it is neither or not positive.
[[nodiscard]] double secondsFromText(const std::string& text);

}  // namespace insitu::cli
