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

/// Sets what the objects send (FivScene::sent) when their samples receive this irradiance.
void setSent(FivScene& scene,
             std::span<const ObjectSample> samples,
             std::span<const Rgb> irradiance);

}  // namespace insitu
