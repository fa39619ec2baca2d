#include "render/object_scene.h"

#include "core/check.h"
#include "render/cut_outs.h"

#include <algorithm>
#include <cmath>

namespace insitu {

namespace {

/// Least cosine between a glossy shading normal and the direction to the viewer.
constexpr double kLeastCosine = 1e-3;

template <class Value>
Value interpolate(const std::vector<Value>& values, const glm::uvec3& corner, glm::vec2 b)
{
    return values[corner.x] * (1.0f - b.x - b.y) + values[corner.y] * b.x + values[corner.z] * b.y;
}

void checkModel(const Model& model)
{
    const TriangleMesh& mesh = model.mesh;
    INSITU_CHECK(mesh.material_of.size() == mesh.triangles.size(),
                 "{} material indices for {} triangles",
                 mesh.material_of.size(),
                 mesh.triangles.size());
    INSITU_CHECK(mesh.normals.empty() || mesh.normals.size() == mesh.positions.size(),
                 "{} normals for {} vertices",
                 mesh.normals.size(),
                 mesh.positions.size());
    INSITU_CHECK(mesh.texcoords.empty() || mesh.texcoords.size() == mesh.positions.size(),
                 "{} texture coordinates for {} vertices",
                 mesh.texcoords.size(),
                 mesh.positions.size());
    for (const std::uint32_t material : mesh.material_of)
        INSITU_CHECK(material < model.materials.size(),
                     "material {} of {}",
                     material,
                     model.materials.size());
    const int textures = static_cast<int>(model.textures.size());
    for (const Material& material : model.materials)
        for (const int texture : {material.base_color_texture,
                                  material.metallic_roughness_texture,
                                  material.emissive_texture})
            INSITU_CHECK(texture >= kNoTexture && texture < textures &&
                             (texture == kNoTexture ||
                              !model.textures[static_cast<std::size_t>(texture)].texels.empty()),
                         "texture {} of {}",
                         texture,
                         textures);
}

glm::vec4 lookUpTexture(const Model& model, int texture, glm::vec2 uv)
{
    return model.textures[static_cast<std::size_t>(texture)].sample(uv);
}

SurfaceMaterial materialAt(const Model& model, const Material& material, glm::vec2 uv)
{
    SurfaceMaterial at{.base_color = material.base_color,
                       .metallic = material.metallic,
                       .roughness = material.roughness,
                       .specular = material.specular,
                       .emissive = material.emissive};
    if (material.base_color_texture != kNoTexture)
        at.base_color *= glm::vec3(lookUpTexture(model, material.base_color_texture, uv));
    if (material.metallic_roughness_texture != kNoTexture) {
        const glm::vec4 texel = lookUpTexture(model, material.metallic_roughness_texture, uv);
        at.roughness *= texel.g;
        at.metallic *= texel.b;
    }
    if (material.emissive_texture != kNoTexture)
        at.emissive *= glm::vec3(lookUpTexture(model, material.emissive_texture, uv));
    return at;
}

}  // namespace

struct ObjectScene::Impl {
    std::vector<Object> objects;
    std::vector<TriangleMesh> meshes;  ///< in the world
    std::vector<BoundingBox> bounds;
    std::unique_ptr<RayScene> rays;

    /// The interpolated normal, or the geometric one of a flat or broken mesh.
    [[nodiscard]] glm::dvec3 shadingNormal(const RayHit& hit,
                                           glm::dvec3 geometric,
                                           glm::dvec3 wo,
                                           bool glossy) const;
};

glm::dvec3 ObjectScene::Impl::shadingNormal(const RayHit& hit,
                                            glm::dvec3 geometric,
                                            glm::dvec3 wo,
                                            bool glossy) const
{
    const TriangleMesh& mesh = meshes[hit.mesh];
    if (mesh.normals.empty()) return geometric;
    glm::dvec3 normal(interpolate(mesh.normals, mesh.triangles[hit.triangle], hit.barycentric));
    const double length = glm::length(normal);
    if (!(length > 1e-6) || !std::isfinite(length)) return geometric;
    normal /= length;
    if (glm::dot(normal, geometric) < 0.0) normal = -normal;
    const double cosine = glm::dot(normal, wo);
    if (glossy && cosine < kLeastCosine)
        normal = glm::normalize(normal + (kLeastCosine - cosine) * wo);
    return normal;
}

ObjectScene::ObjectScene(std::vector<Object> objects) : impl_(std::make_unique<Impl>())
{
    impl_->objects = std::move(objects);
    const std::size_t count = impl_->objects.size();
    for (const Object& object : impl_->objects) {
        checkModel(object.model);
        impl_->meshes.push_back(placed(object.model.mesh, object.placement));
    }
    std::vector<const TriangleMesh*> meshes;
    const auto cut_out = std::make_unique<bool[]>(count);
    for (std::size_t i = 0; i < count; ++i) {
        meshes.push_back(&impl_->meshes[i]);
        impl_->bounds.push_back(boundingBox(impl_->meshes[i]));
        cut_out[i] = hasCutOuts(impl_->objects[i].model);
    }
    impl_->rays = std::make_unique<RayScene>(
        meshes,
        std::span<const bool>(cut_out.get(), count),
        [scene = impl_.get()](std::uint32_t object, std::uint32_t triangle, glm::vec2 barycentric) {
            return isThere(scene->objects[object].model, triangle, barycentric);
        });
}

ObjectScene::~ObjectScene() = default;
ObjectScene::ObjectScene(ObjectScene&&) noexcept = default;

bool ObjectScene::empty() const
{
    return impl_->rays->empty();
}

const std::vector<ObjectScene::Object>& ObjectScene::objects() const
{
    return impl_->objects;
}

const std::vector<TriangleMesh>& ObjectScene::meshes() const
{
    return impl_->meshes;
}

const std::vector<BoundingBox>& ObjectScene::bounds() const
{
    return impl_->bounds;
}

std::optional<SurfacePoint> ObjectScene::intersect(glm::dvec3 origin,
                                                   glm::dvec3 direction,
                                                   double max_distance_m) const
{
    const std::optional<RayHit> hit = impl_->rays->intersect(origin, direction, max_distance_m);
    if (!hit) return std::nullopt;
    const Model& model = impl_->objects[hit->mesh].model;
    const Material& material = model.materials[model.mesh.material_of[hit->triangle]];
    SurfacePoint point;
    point.distance_m = hit->distance_m;
    point.position = origin + hit->distance_m * direction;
    point.geometric_normal = glm::dot(hit->normal, direction) > 0.0 ? -hit->normal : hit->normal;
    point.material =
        materialAt(model, material, texcoordAt(model.mesh, hit->triangle, hit->barycentric));
    point.shading_normal =
        impl_->shadingNormal(*hit, point.geometric_normal, -direction, isGlossy(point.material));
    point.object = hit->mesh;
    return point;
}

bool ObjectScene::occluded(glm::dvec3 origin, glm::dvec3 direction, double max_distance_m) const
{
    return impl_->rays->occluded(origin, direction, max_distance_m);
}

glm::dvec3 ObjectScene::leave(const SurfacePoint& point, glm::dvec3 direction) const
{
    return impl_->rays->offsetOrigin(point.position, point.geometric_normal, direction);
}

}  // namespace insitu
