#pragma once

#include "core/finding.h"
#include "core/image.h"

#include <glm/glm.hpp>

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace insitu {

/// An 8-bit RGBA texture. Row 0 on top; texture coordinate (0,0) is the top-left corner (glTF),
/// v grows downwards; importers flip formats that count from the bottom.
struct Texture {
    Image<glm::u8vec4> texels;
    bool srgb = true;  ///< base colour and emissive textures; false for data (metallic-roughness)
    bool clamp_s = false;
    bool clamp_t = false;

    /// Bilinear, wrapped or clamped, decoded to linear per texel before filtering. Alpha is linear.
    [[nodiscard]] glm::vec4 sample(glm::vec2 uv) const;
};

inline constexpr int kNoTexture = -1;

/// glTF 2.0 metallic-roughness parameters; texture members index Model::textures.
struct Material {
    std::string name;
    glm::vec3 base_color{0.8f};  ///< linear, [0, 1]
    float alpha = 1.0f;
    float metallic = 0.0f;
    float roughness = 1.0f;  ///< perceptual, alpha_ggx = roughness²
    float specular = 1.0f;  ///< weight of the dielectric lobe (F0 = 0.04·specular); 0: pure Lambert
    glm::vec3 emissive{0.0f};
    bool alpha_mask = false;  ///< cut out where alpha·texture alpha < alpha_cutoff
    float alpha_cutoff = 0.5f;
    bool double_sided = false;
    int base_color_texture = kNoTexture;
    int metallic_roughness_texture = kNoTexture;  ///< G roughness, B metallic
    int emissive_texture = kNoTexture;
};

/// Triangles. Front = counter-clockwise seen from outside; indices are in range.
///
/// `normals` is empty (flat shading) or one unit vector a vertex; `texcoords` is empty or one a
/// vertex; `material_of` has one entry a triangle.
struct TriangleMesh {
    std::vector<glm::vec3> positions;
    std::vector<glm::vec3> normals;
    std::vector<glm::vec2> texcoords;
    std::vector<glm::uvec3> triangles;
    std::vector<std::uint32_t> material_of;
};

/// Interpolated texture coordinate, (0, 0) for a mesh without. `barycentric`: weights of the second
/// and third corner.
[[nodiscard]] glm::vec2 texcoordAt(const TriangleMesh& mesh,
                                   std::uint32_t triangle,
                                   glm::vec2 barycentric);

/// A piece of furniture as loaded: one mesh (node transforms applied), its materials, textures.
struct Model {
    TriangleMesh mesh;
    std::vector<Material> materials;
    std::vector<Texture> textures;
    Findings findings;
};

struct BoundingBox {
    glm::dvec3 min{0.0};
    glm::dvec3 max{0.0};
};
/// Of all vertices; zeros for a mesh without any.
[[nodiscard]] BoundingBox boundingBox(const TriangleMesh& mesh);

/// A model's largest side, once scaled, lies between these; else its unit was guessed wrong.
inline constexpr double kMinModelExtent_m = 0.001;
inline constexpr double kMaxModelExtent_m = 50.0;
/// Warning "model-extent-implausible" when the box (in metres, after scaling) is beyond those;
/// nothing otherwise. `name` is for the message.
[[nodiscard]] std::optional<Finding> extentFinding(const BoundingBox& box_in_metres,
                                                   const std::string& name);

/// Where a model stands: x_in_world = position + R_y(rotation)·scale·(x_in_model − pivot).
///
/// rotation is counter-clockwise seen from above (right-handed about +Y). scale > 0.
struct Placement {
    glm::dvec3 pivot_in_model{0.0};
    double scale = 1.0;
    double rotation_y_rad = 0.0;
    glm::dvec3 position_m{0.0};

    [[nodiscard]] glm::dvec3 apply(glm::dvec3 x_in_model) const;
    [[nodiscard]] glm::dmat3 worldFromModelRotation() const;
};
/// Bottom centre of the bounding box: centre in x and z, lowest point in y.
[[nodiscard]] glm::dvec3 bottomCenter(const BoundingBox& box);
/// Mesh with every vertex and normal brought into the world.
[[nodiscard]] TriangleMesh placed(const TriangleMesh& mesh, const Placement& placement);
/// `placement` seen from `base`: brings the model to where base.apply() brings it to its place.
/// Lengths are rounded to a micrometre and angles to a nanoradian, so that the same arrangement
/// elsewhere has the same numbers.
[[nodiscard]] Placement relativeTo(const Placement& base, const Placement& placement);

/// A model in its own coordinates, and where it stands.
struct PlacedModel {
    Model model;
    Placement placement{};
};

/// Finds what would hurt a renderer: non-finite vertices, indices out of range, arrays of unequal
/// length, no triangles (InputError naming `path`); drops degenerate triangles and repairs non-unit
/// normals (findings "mesh-degenerate-triangles", "mesh-normals-repaired"); drops vertices that no
/// triangle uses, so that the bounding box is that of what is seen.
void validateMesh(Model& model, const std::string& path);

}  // namespace insitu
