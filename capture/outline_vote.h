#pragma once

#include "capture/outline_picture.h"

#include <glm/glm.hpp>

#include <vector>

namespace insitu::detail {

struct Circle {
    glm::dvec2 center{0.0};
    double radius = 0.0;
};

/// A pixel on an edge of a picture.
struct Edge {
    glm::dvec2 place{0.0};
    glm::dvec2 normal{0.0};  ///< unit, along the gradient
    double weight = 0.0;     ///< (0, 1), small for the many weak ones
};
/// Pixels whose gradient, the strongest of all frames and channels, is the largest along its own
/// direction and stands out of the noise.
[[nodiscard]] std::vector<Edge> thinEdges(const OutlinePicture& picture);

/// Circles that edges vote for, best first, at most `count`, with the centre inside the picture.
/// Each edge votes along its normal, both ways [DudHar72]; cells grow with the radius as the error
/// of the vote does.
[[nodiscard]] std::vector<Circle> voteForCircles(const std::vector<Edge>& edges,
                                                 glm::ivec2 picture_size,
                                                 double smallest_radius,
                                                 std::size_t count);

}  // namespace insitu::detail
