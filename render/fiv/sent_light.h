#pragma once

#include "core/color.h"
#include "core/instruction_set.h"

#include <glm/glm.hpp>

#include <array>
#include <cstddef>
#include <span>
#include <vector>

namespace insitu {

class ObjectScene;
struct ObjectSample;

/// What the objects' surfaces send, between samples all over them. 0 before update(). Every
/// instruction set gives the same bytes.
class SentLight {
public:
    SentLight() = default;
    SentLight(const ObjectScene& objects, std::span<const ObjectSample> samples);

    /// Share of the even light of its surface that reaches a sample past the objects.
    [[nodiscard]] float open(std::size_t sample) const { return open_[sample]; }
    /// Sets the samples' radiance.
    void update(std::span<const Rgb> sent);

    /// Radiance of the surface at a place on the objects: mean of the samples near it that face the
    /// same way.
    [[nodiscard]] Rgb at(glm::dvec3 place,
                         glm::dvec3 unit_normal,
                         InstructionSet isa = bestInstructionSet()) const;
    /// What a place of the room sees of the objects: mean of the samples that face it and lie above
    /// its horizon, each as its form factor, less the deeper it lies in a hollow; 0 where there is
    /// none. What samples hide each other from the place is not looked at.
    [[nodiscard]] Rgb seenFrom(glm::dvec3 place,
                               glm::dvec3 unit_normal,
                               InstructionSet isa = bestInstructionSet()) const;

private:
    static constexpr std::size_t kLanes = 16;
    using Lanes = std::array<float, kLanes>;
    /// As many samples as are worked on at a time; unused ones have no normal and weigh nothing.
    struct Bundle {
        Lanes x{}, y{}, z{}, normal_x{}, normal_y{}, normal_z{}, open_area{}, red{}, green{},
            blue{};
    };
    /// Weight, red, green and blue.
    using Sums = std::array<Lanes, 4>;
    /// How a mean weighs samples.
    enum class Weighing { Alike, FormFactor };
    template <Weighing kWeighing>
    void sum(glm::vec3 x, glm::vec3 n, Sums& sums) const;
    template <Weighing kWeighing>
    void sumAvx2(glm::vec3 x, glm::vec3 n, Sums& sums) const;
    template <Weighing kWeighing>
    void sumAvx512(glm::vec3 x, glm::vec3 n, Sums& sums) const;
    template <Weighing kWeighing>
    [[nodiscard]] Rgb mean(InstructionSet isa, glm::dvec3 place, glm::dvec3 unit_normal) const;

    std::vector<Bundle> bundles_;
    std::vector<float> open_;
    float spacing2_ = 0.0f;  ///< square of the distance between samples
};

}  // namespace insitu
