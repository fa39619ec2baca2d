#pragma once

#include "capture/radiance_capture.h"

#include <filesystem>

namespace insitu {

/// Writes what was found on the way from a bracket to radiance (docs/file_format.md, "capture
/// report"): exposures, response, noise, clipping, findings.
void writeCaptureReport(const std::filesystem::path& path, const CapturedRadiance& captured);

/// Draws the response as SVG: code over the binary logarithm of the exposure, a line a channel.
void writeResponsePlot(const std::filesystem::path& path, const ResponseCurve& response);

}  // namespace insitu
