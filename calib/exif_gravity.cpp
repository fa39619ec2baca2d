#include "calib/exif_gravity.h"

#include "core/io/exif_acceleration.h"

#include <array>
#include <cmath>

namespace insitu {

namespace {

constexpr double kMoving = 0.05;  ///< in g
constexpr double kSigma = 0.02;   ///< radians

/// A direction of the stored picture in the upright one. Orientations as in EXIF 2.32, tag 0x0112.
glm::dvec3 upright(glm::dvec3 stored, int orientation)
{
    const auto [x, y, z] = std::array{stored.x, stored.y, stored.z};
    switch (orientation) {
        case 2:
            return {-x, y, z};
        case 3:
            return {-x, -y, z};
        case 4:
            return {x, -y, z};
        case 5:
            return {y, x, z};
        case 6:
            return {-y, x, z};
        case 7:
            return {-y, -x, z};
        case 8:
            return {y, -x, z};
        default:
            return stored;
    }
}

}  // namespace

std::optional<Gravity> gravityFromExif(const PhotoMetadata& metadata)
{
    const auto acceleration = accelerationFromExif(metadata.exif);
    if (!acceleration || std::abs(glm::length(*acceleration) - 1.0) > kMoving) return std::nullopt;
    return Gravity{upright(glm::normalize(*acceleration), metadata.orientation), kSigma};
}

}  // namespace insitu
