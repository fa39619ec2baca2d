#pragma once

#include "pipeline/insert.h"

#include <filesystem>

namespace insitu {

/// What an insertion found and measured, as JSON (docs/file_format.md, "report"): findings with
/// codes, camera with sigmas, light, render and composite figures, seconds per stage, settings.
void writeReport(const std::filesystem::path& path,
                 const Project& project,
                 const InsertOptions& options,
                 const InsertResult& result,
                 const std::filesystem::path& picture);

/// The layers of a result as one EXR: object.*, irradiance.with.*, irradiance.without.*, alpha.A,
/// depth.Z, variance.object.Y, variance.ratio.Y, influence.Y.
void writeLayers(const std::filesystem::path& path, const InsertResult& result);

}  // namespace insitu
