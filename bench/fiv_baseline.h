#pragma once

#include "lighting/cell_light.h"
#include "lighting/silhouettes.h"
#include "reconstruct/ray_scene.h"

#include <glm/glm.hpp>

#include <span>
#include <vector>

namespace insitu::baseline {

/// The thesis's method as it stands, for comparison: [Michael10] chapter 3. Distant light of
/// 6 x n x n texels, each a direction; occluders that move but do not turn; everything by rays.

/// Light of each texel of the cube, by 2·pair + side of DirectionCells.
struct TexelLight {
    DirectionCells cells;
    std::vector<Rgb> radiance;

    /// FIV of the whole environment, equation 10.
    [[nodiscard]] IrradianceVector total() const;
    [[nodiscard]] glm::dvec3 direction(std::size_t texel) const;
    /// The same light as sums over directions understand it.
    [[nodiscard]] CellLight asCellLight() const;
};
/// Mean radiance of the environment in each texel.
[[nodiscard]] TexelLight texelLight(const EnvironmentMap& environment, int face_size);

/// Irradiance without occluders for each of 6·n² normals (equation 6), looked up bilinearly.
class IrradianceCube {
public:
    IrradianceCube(const TexelLight& light, int face_size);
    [[nodiscard]] Rgb at(glm::dvec3 unit_normal) const;

private:
    int size_ = 0;
    std::vector<Rgb> texels_;  ///< face, row, column; faces +x −x +y −y +z −z
};

struct TableSize {
    int azimuths = 128, polars = 65, shells = 30;
    double first_radii = 1.05, last_radii = 8.0;
};

/// FIVs of the occluded environment at (θ, φ, ρ) around an occluder.
class Table {
public:
    /// `stride` > 1 computes only every stride-th position, to measure the speed.
    Table(const RayScene& rays,
          const LocalFrame& local,
          const TexelLight& light,
          const TableSize& size,
          int stride = 1);

    /// Trilinear; of samples inside the object (everything hidden) when others are there, nothing.
    [[nodiscard]] IrradianceVector at(glm::vec3 x_local) const;
    [[nodiscard]] std::size_t rays() const { return rays_; }
    /// Three colours of three floats a position.
    [[nodiscard]] std::size_t memoryBytes() const { return vectors_.size() * 36; }

private:
    TableSize size_;
    std::vector<IrradianceVector> vectors_;
    std::vector<std::uint8_t> inside_;
    std::size_t rays_ = 0;
};

/// An occluder on stage.
struct Occluder {
    const Table* table = nullptr;
    glm::dvec3 center{0.0};
    double radius = 1.0;
};
struct Corrections {
    bool partial = true;   ///< (d + R) / 2R of occluders that the receiver's plane cuts
    bool multiple = true;  ///< equations 14 and 15
};

/// Irradiance at a place in the shadow of occluders: equation 12, cases A, B and C.
[[nodiscard]] Rgb shadowed(const IrradianceCube& cube,
                           std::span<const Occluder> occluders,
                           glm::dvec3 x,
                           glm::dvec3 unit_normal,
                           const Corrections& corrections = {});
/// Irradiance at a place on the object itself: N·(FIV(env) − FIV(occluded)), equation 13.
[[nodiscard]] Rgb selfShadowed(const TexelLight& light,
                               const Occluder& self,
                               glm::dvec3 x,
                               glm::dvec3 unit_normal);

/// Brute force: every texel above the horizon, hidden or not. Equation 6.
[[nodiscard]] Rgb bruteForce(std::span<const RayScene* const> scenes,
                             const TexelLight& light,
                             glm::dvec3 x,
                             glm::dvec3 unit_normal);

/// Area of the overlap of two discs of these radii whose centres are `distance` apart.
[[nodiscard]] double discOverlap(double radius_a, double radius_b, double distance);

}  // namespace insitu::baseline
