#pragma once

#include "calib/orientation.h"
#include "core/photo.h"

#include <glm/glm.hpp>

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace insitu::auto_pictures {

/// Pictures of known cameras, for calib_auto: photographs, and views made from them.

/// What is known about a photograph's camera.
struct Known {
    double focal_px = 0.0;         ///< 0: unknown
    std::optional<glm::dvec3> up;  ///< world's up in the camera's frame
};

struct Case {
    std::string name;
    EncodedImage image;
    std::optional<FocalPrior> exif;
    Known known;
    std::uint64_t seed = 0;  ///< of the views that are made from it
};

/// The photographs of `data` (tests/support/data.h), with what is known of their cameras.
[[nodiscard]] std::vector<Case> photographs(const std::filesystem::path& data);

/// What a camera turned by up to 15° (tilted 12°, rolled 8°) and zoomed by up to 1.5 would have
/// taken at the same place, as far as it lies inside the photograph.
[[nodiscard]] std::vector<Case> viewsOf(const Case& base, int count, std::uint64_t seed);

/// Views of an equirectangular environment, 640x427, 40 to 75° high.
[[nodiscard]] std::vector<Case> panoramaViews(const std::filesystem::path& file,
                                              int count,
                                              std::uint64_t seed);

}  // namespace insitu::auto_pictures
