#pragma once

#include "core/image.h"

#include <glm/glm.hpp>

#include <span>
#include <vector>

namespace insitu {

class ObjectScene;
struct ObjectSample;

/// What the objects' surfaces send, between samples all over them.
class SentLight {
public:
    SentLight() = default;
    SentLight(const ObjectScene& objects, std::span<const ObjectSample> samples);

    /// Share of the even light of its surface that reaches a sample past the objects.
    [[nodiscard]] float open(std::size_t sample) const { return open_[sample]; }
    /// Sets the samples' radiance.
    void update(std::span<const Rgb> sent);
    /// Mean radiance of the surface at a place, of the samples near it that face the same way; 0
    /// before update().
    [[nodiscard]] Rgb at(glm::dvec3 place, glm::dvec3 unit_normal) const;

private:
    struct Sample {
        glm::vec3 position{0.0f}, normal{0.0f};
        Rgb sent{0.0f};
    };
    std::vector<Sample> samples_;
    std::vector<float> open_;
    float spacing2_ = 0.0f;  ///< square of the distance between samples
};

}  // namespace insitu
