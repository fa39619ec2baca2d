#pragma once

#include "capture/radiance_capture.h"

#include <filesystem>

namespace insitu {

/// Writes what was found on the way from a bracket to radiance (docs/file_format.md, "capture
/// report"): exposures, response, weights, noise, deviations, clipping, findings.
void writeCaptureReport(const std::filesystem::path& path, const CapturedRadiance& captured);

/// Draws the same as SVG: response, weight of each exposure, standard deviation of merged pixels,
/// clipping, and a table of the exposures (given, measured, used).
void writeCapturePlot(const std::filesystem::path& path, const CapturedRadiance& captured);

}  // namespace insitu
