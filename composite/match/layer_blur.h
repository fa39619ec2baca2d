#pragma once

#include "composite/photo_layers.h"
#include "core/image.h"

#include <array>

namespace insitu {

/// Weights of a blur at whole pixels 0, 1, … reach; their two-sided sum is 1. Of exact variance up
/// to 0.7 pixels (three taps), a sampled Gaussian above.
struct BlurTaps {
    static constexpr int kMaxReach = 48;
    std::array<float, kMaxReach + 1> weight{};
    int reach = 0;

    explicit BlurTaps(double sigma_px);
};

/// Blurs that differ from pixel to pixel: of objects spread from where they come from, those of
/// receivers gathered.
struct LayerBlur {
    Image<float> object_sigma_px;    ///< of the object at the pixel
    Image<float> receiver_sigma_px;  ///< of the surface behind it
    float max_sigma_px = 0.0f;
};

void blurLayers(const LayerBlur& blur, PhotoLayers& layers);

}  // namespace insitu
