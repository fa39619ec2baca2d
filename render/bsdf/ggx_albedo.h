#pragma once

namespace insitu::ggx {

/// What the GGX lobe reflects of the light from one direction, ∫ f cos dω, split by Schlick's
/// Fresnel term F = f0·(1 − (1 − c)^5) + f90·(1 − c)^5: the albedo is f0·at_f0 + f90·at_f90.
struct Albedo {
    double at_f0 = 0.0;
    double at_f90 = 0.0;

    [[nodiscard]] double of(double f0, double f90) const { return f0 * at_f0 + f90 * at_f90; }
};

/// Perceptual roughness in [0, 1], cosine in [0, 1] (clamped). From a table that is computed on
/// first use (some 60 ms) and interpolated; within 4e-3 for cosines above 0.02.
[[nodiscard]] Albedo directionalAlbedo(double roughness, double cosine);
/// Mean over the hemisphere, ∫ 2c·albedo(c) dc: what is reflected of uniform light.
[[nodiscard]] Albedo meanAlbedo(double roughness);

/// alpha of a perceptual roughness, glTF 2.0 B.2.3, kept above 1e-4.
[[nodiscard]] double alphaFromRoughness(double roughness);

}  // namespace insitu::ggx
