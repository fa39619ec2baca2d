#pragma once

#include "render/fiv/object_light.h"

#include <span>
#include <vector>

namespace insitu {

/// Points all over the objects, both sides of their surface, each standing for an equal area.
struct ObjectSample {
    SurfacePoint point;
    double area = 0.0;
};
[[nodiscard]] std::vector<ObjectSample> sampleObjects(const ObjectScene& objects, int count);

/// How much of each sample is seen from far away, against the directions of the scene's coarse
/// cells: a row of samples a pair, area times cosine times the share that is not hidden. > 0 where
/// the sample faces the pair's direction, < 0 where it faces the opposite one.
[[nodiscard]] std::vector<float> samplesSeen(const FivScene& scene,
                                             std::span<const ObjectSample> samples);
/// Sets what the objects send (FivScene::glow, near) when their samples receive this irradiance.
void setGlow(FivScene& scene,
             std::span<const ObjectSample> samples,
             std::span<const float> seen,
             std::span<const Rgb> irradiance);

}  // namespace insitu
