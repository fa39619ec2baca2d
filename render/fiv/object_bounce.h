#pragma once

#include "core/image.h"

#include <glm/glm.hpp>

#include <cstdint>
#include <span>
#include <vector>

namespace insitu {

class ObjectScene;
struct ObjectSample;

/// What objects show themselves and each other: at points all over them, the mean radiance of the
/// surfaces that hide the light from there, by rays that are traced once.
class ObjectBounce {
public:
    ObjectBounce() = default;
    /// A fan of rays from every sample, cosine-weighted; what one meets has the radiance of the
    /// nearest sample that faces the same way.
    ObjectBounce(const ObjectScene& objects, std::span<const ObjectSample> samples);

    /// Share of a sample's rays that meet nothing.
    [[nodiscard]] float open(std::size_t sample) const { return open_[sample]; }
    /// Sets what the samples send.
    void update(std::span<const Rgb> sent);
    /// Mean radiance of what hides light from a place on an object, between the samples near it
    /// that face the same way; 0 before update().
    [[nodiscard]] Rgb at(glm::dvec3 place, glm::dvec3 unit_normal) const;

private:
    struct Seeing {
        glm::vec3 position{0.0f}, normal{0.0f};
        float share = 0.0f;              ///< of its rays that meet something
        Rgb radiance{0.0f};              ///< mean of what they meet
        std::vector<std::uint32_t> met;  ///< samples, one a ray
    };
    std::vector<Seeing> seeing_;
    std::vector<float> open_;
    float spacing2_ = 0.0f;  ///< square of the distance between samples
};

}  // namespace insitu
