#pragma once

#include "apps/cli/command.h"
#include "capture/hdr_merge.h"
#include "capture/response_recovery.h"

#include <filesystem>
#include <string>
#include <vector>

namespace insitu::cli {

/// What the commands that start from a bracket are told about it.
struct BracketArguments {
    std::vector<std::filesystem::path> images;
    std::vector<std::string> exposures;  ///< "1/60" or "0.5", one an image; empty: from EXIF
    std::filesystem::path response;      ///< a saved curve; empty: recovered from the bracket
    ResponseOptions recovery;
    MergeOptions merge;
};

/// Adds the images, --exposures, --response, --samples, --smoothness, --clip and --black.
void addBracketOptions(CLI::App& command, BracketArguments& arguments);

struct BracketRadiance {
    MergeResult merged;
    ResponseCurve response;
};

/// Reads, recovers (or reads) the response and merges; prints the findings.
[[nodiscard]] BracketRadiance mergeArguments(const BracketArguments& arguments, Context& context);

/// "1/60" or "0.5" -> seconds; InputError when it is neither or not positive.
[[nodiscard]] double secondsFromText(const std::string& text);

}  // namespace insitu::cli
