#pragma once

#include "core/mesh.h"
#include "pipeline/simulated_room.h"

#include <glm/glm.hpp>

#include <cstdint>
#include <optional>
#include <span>
#include <utility>

namespace insitu {

/// Collects rectangles and boxes into one Model with materials and textures.
class SurfaceBuilder {
public:
    explicit SurfaceBuilder(std::uint64_t seed) : seed_(seed) {}

    /// corner + u + v, u ⟂ v. Holes are (from, to) in metres along u and v.
    void addRectangle(const SimulatedSurface& surface,
                      glm::dvec3 corner,
                      glm::dvec3 u,
                      glm::dvec3 v,
                      std::span<const std::pair<glm::dvec2, glm::dvec2>> holes = {});
    /// Any two opposite corners.
    void addBox(const SimulatedSurface& surface, glm::dvec3 a, glm::dvec3 b);

    [[nodiscard]] Model take() { return std::move(model_); }

private:
    struct Finish {
        std::uint32_t material = 0;
        glm::dvec2 metres_per_uv{1.0};  ///< along u and v
        double height_m = 1.0;          ///< of the rectangle, along v
    };
    [[nodiscard]] Finish addFinish(const SimulatedSurface& surface, glm::dvec2 size_m);
    void addQuad(const Finish& finish,
                 glm::dvec3 corner,
                 glm::dvec3 u,
                 glm::dvec3 v,
                 glm::dvec2 low,
                 glm::dvec2 high);

    Model model_;
    std::uint64_t seed_;
};

}  // namespace insitu
