#pragma once

#include "core/image.h"

#include <glm/glm.hpp>

#include <limits>
#include <optional>

namespace insitu {

/// A direction drawn towards light, with what comes from there.
struct LightSample {
    glm::dvec3 direction{0.0};  ///< unit, from the shaded point
    double distance_m =
        std::numeric_limits<double>::infinity();  ///< to the source; objects nearer block it
    Rgb radiance{0.0f};
    double pdf = 0.0;  ///< per solid angle, > 0
};

/// What arrives along a ray when no object is in its way.
struct IncidentLight {
    Rgb radiance{0.0f};
    double distance_m = std::numeric_limits<double>::infinity();
    double pdf = 0.0;  ///< density with which sample() would have drawn this direction
};

/// Everything that lights the objects: a distant environment, lamps, or the captured room.
///
/// Objects (what the path tracer scatters at) are not part of it: a caller traces its objects up
/// to `distance_m`. All calls are thread-safe and deterministic in their arguments.
class LightSource {
public:
    virtual ~LightSource() = default;

    /// u in [0,1)²; `selector` in [0,1) picks among lights. Nothing when the drawn direction brings
    /// no light (for example hidden from x by the room itself): counts as a sample of value 0.
    [[nodiscard]] virtual std::optional<LightSample> sample(glm::dvec3 x,
                                                            double selector,
                                                            glm::vec2 u) const = 0;
    [[nodiscard]] virtual IncidentLight incident(glm::dvec3 x, glm::dvec3 direction) const = 0;
};

}  // namespace insitu
