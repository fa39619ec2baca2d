#pragma once

#include "lighting/hidden_light.h"
#include "lighting/shell_lookup.h"

#include <glm/glm.hpp>

#include <array>
#include <cstddef>
#include <span>
#include <vector>

namespace insitu {

/// Where a field of irradiance vectors around an object is sampled: directions on concentric
/// spheres whose radii grow by a constant factor. Source: [Michael10] 3.3.2.
struct ShellFieldOptions {
    int azimuths = 128;  ///< about +Y, [4, 4096]
    int polars = 65;     ///< from pole to pole, [3, 2048]
    int shells = 30;     ///< [2, 256]
    /// Radii of the first and the last shell, in radii of the bounding sphere, 0 < first < last.
    /// From about 0.35 on the field reaches under and between the parts of the object.
    double first_radii = 0.35;
    double last_radii = 8.0;

    [[nodiscard]] Findings validate() const;
};

/// Irradiance vectors of what an object hides, at positions around it; in between, trilinear in
/// azimuth, polar angle and the logarithm of the distance.
///
/// Inside the first shell the values of the first shell hold, beyond the last one they fall with
/// the square of the distance.
class ShellField {
public:
    ShellField() = default;
    /// InputError for bad options.
    ShellField(const ObjectLight& object, const ShellFieldOptions& options);

    /// FIV of the hidden light at a local place.
    [[nodiscard]] IrradianceVector at(glm::vec3 x_local) const;
    /// N·FIV of the hidden light of many places, >= 0, with the thesis's shadow cases by the plane
    /// through each place: an object wholly behind it hides nothing, one that the plane cuts counts
    /// by the share (d + R) / 2R in front. R is the half extent of the object's box along the
    /// normal, where the thesis has the sphere's radius: what stands on a floor is not cut by it.
    /// Source: [Michael10] 3.3.3.1.
    void hiddenIrradiance(std::span<const glm::vec3> places_local,
                          std::span<const glm::vec3> unit_normals,
                          std::span<Rgb> hidden) const;

    [[nodiscard]] const ShellFieldOptions& options() const { return options_; }
    [[nodiscard]] std::size_t memoryBytes() const { return nodes_.size() * sizeof(nodes_[0]); }

private:
    ShellFieldOptions options_;
    glm::vec3 half_extent_{1.0f};
    fiv::ShellGrid grid_;
    std::vector<fiv::ShellNode> nodes_;
};

/// A plane whose points receive light: floor, wall or table top, in the object's own axes.
struct ReceiverPlane {
    glm::dvec3 corner{0.0};               ///< in the model's units, as its mesh
    glm::dvec3 edge_u{0.0}, edge_v{0.0};  ///< across each other, length > 0
    /// Unit; the side that receives.
    [[nodiscard]] glm::dvec3 normal() const;
};

/// How finely a plane's field is sampled.
struct PlaneFieldOptions {
    /// Tiles along each edge, [1, 256].
    int tiles = 24;
    /// Tiles get samples until bilinear interpolation is off by no more than this, as a share of
    /// the plane's irradiance without the object. > 0.
    double max_error = 0.01;
    /// Most halvings of a tile, [1, 8].
    int max_level = 6;
    /// As in hiddenShares(): 0 for planes that the object stands on or before, 1 for its own
    /// surfaces, which must not hide themselves. [0, 4].
    float bias_texels = 0.0f;

    [[nodiscard]] Findings validate() const;
};

/// Irradiance that an object hides from a plane, its horizon clipped exactly; tiles hold as many
/// samples as their error asks for, most of them where shadows touch the object.
class PlaneField {
public:
    PlaneField() = default;
    /// InputError for bad options or a plane without area.
    PlaneField(const ObjectLight& object,
               const ReceiverPlane& plane,
               const PlaneFieldOptions& options);

    /// Of the point corner + u·edge_u + v·edge_v, u and v in [0, 1]; clamped outside.
    [[nodiscard]] Rgb at(glm::dvec2 uv) const;

    [[nodiscard]] std::size_t samples() const { return samples_.size(); }
    [[nodiscard]] std::size_t memoryBytes() const
    {
        return samples_.size() * sizeof(Rgb) + tiles_.size() * sizeof(Tile);
    }
    /// Largest error that a test sample showed before its tile was refined the last time, as a
    /// share of the plane's irradiance: what is left is smaller, unless max_level stopped it.
    [[nodiscard]] double largestError() const { return largest_error_; }

private:
    /// (2^level + 1)² samples from `first` on, row by row.
    struct Tile {
        std::uint32_t first = 0;
        std::uint32_t level = 0;
    };
    int tiles_a_side_ = 0;
    std::vector<Tile> tiles_;
    std::vector<Rgb> samples_;
    double largest_error_ = 0.0;
};

}  // namespace insitu
