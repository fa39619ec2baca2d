#include "reconstruct/ray_scene.h"

#include "core/check.h"

#include <embree3/rtcore.h>

#include <algorithm>
#include <cmath>

namespace insitu {

namespace {

/// One Embree device for the process, created on first use and kept until the last scene is gone.
///
/// No limit is set on its threads: Embree would impose it on the whole process (TBB's global
/// control), and setThreadCount() of core/parallel.h governs the build anyway. Trees come out the
/// same for every number of threads, down to which of two coincident triangles is hit.
std::shared_ptr<RTCDeviceTy> sharedDevice()
{
    static const std::shared_ptr<RTCDeviceTy> device = [] {
        RTCDevice made = rtcNewDevice("set_affinity=0");
        INSITU_CHECK(
            made != nullptr, "Embree error {}", static_cast<int>(rtcGetDeviceError(nullptr)));
        return std::shared_ptr<RTCDeviceTy>(made, rtcReleaseDevice);
    }();
    return device;
}

bool isFinite(glm::dvec3 v)
{
    return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

/// Box around all finite vertices; others cannot be hit, Embree leaves their triangles out.
BoundingBox finiteBounds(std::span<const TriangleMesh* const> meshes)
{
    BoundingBox box{glm::dvec3(kInfinity), glm::dvec3(-kInfinity)};
    for (const TriangleMesh* mesh : meshes)
        for (const glm::vec3& position : mesh->positions)
            if (isFinite(position)) {
                box.min = glm::min(box.min, glm::dvec3(position));
                box.max = glm::max(box.max, glm::dvec3(position));
            }
    if (!(box.min.x <= box.max.x)) return {};
    return box;
}

/// The smallest float that is not below the value, so that a limit is never shortened.
float roundUp(double value)
{
    const float nearest = static_cast<float>(value);
    return static_cast<double>(nearest) < value
               ? std::nextafter(nearest, std::numeric_limits<float>::infinity())
               : nearest;
}

}  // namespace

struct RayScene::Impl {
    /// What Embree's callback needs to know about a geometry; its address is the user data.
    struct Geometry {
        const HitFilter* filter = nullptr;
        std::uint32_t mesh = 0;
        const float* vertices = nullptr;  ///< owned by Embree, xyz a vertex, relative to the centre
        const std::uint32_t* indices = nullptr;  ///< owned by Embree, three a triangle
    };

    std::shared_ptr<RTCDeviceTy> device = sharedDevice();
    std::shared_ptr<RTCSceneTy> scene{rtcNewScene(device.get()), rtcReleaseScene};
    glm::dvec3 centre{0.0};
    double radius = 0.0;
    bool empty = true;
    HitFilter filter;
    std::vector<Geometry> geometries;

    void add(const TriangleMesh& mesh, std::uint32_t index, bool filtered);
    [[nodiscard]] glm::dvec3 vertex(const Geometry& geometry, std::uint32_t index) const;
    [[nodiscard]] RTCRay ray(glm::dvec3 origin, glm::dvec3 direction, double max_distance_m) const;

    static void keepOrPass(const RTCFilterFunctionNArguments* arguments);
};

void RayScene::Impl::keepOrPass(const RTCFilterFunctionNArguments* arguments)
{
    const auto* geometry = static_cast<const Geometry*>(arguments->geometryUserPtr);
    for (unsigned int i = 0; i < arguments->N; ++i) {
        if (arguments->valid[i] == 0) continue;
        const std::uint32_t triangle = RTCHitN_primID(arguments->hit, arguments->N, i);
        const glm::vec2 barycentric(RTCHitN_u(arguments->hit, arguments->N, i),
                                    RTCHitN_v(arguments->hit, arguments->N, i));
        if (!(*geometry->filter)(geometry->mesh, triangle, barycentric)) arguments->valid[i] = 0;
    }
}

void RayScene::Impl::add(const TriangleMesh& mesh, std::uint32_t index, bool filtered)
{
    if (mesh.triangles.empty()) return;
    for (const glm::uvec3& t : mesh.triangles)
        INSITU_CHECK(std::max({t.x, t.y, t.z}) < mesh.positions.size(),
                     "mesh {}: triangle ({}, {}, {}) of {} vertices",
                     index,
                     t.x,
                     t.y,
                     t.z,
                     mesh.positions.size());

    RTCGeometry handle = rtcNewGeometry(device.get(), RTC_GEOMETRY_TYPE_TRIANGLE);
    auto* vertices = static_cast<float*>(rtcSetNewGeometryBuffer(handle,
                                                                 RTC_BUFFER_TYPE_VERTEX,
                                                                 0,
                                                                 RTC_FORMAT_FLOAT3,
                                                                 3 * sizeof(float),
                                                                 mesh.positions.size()));
    auto* indices = static_cast<std::uint32_t*>(rtcSetNewGeometryBuffer(handle,
                                                                        RTC_BUFFER_TYPE_INDEX,
                                                                        0,
                                                                        RTC_FORMAT_UINT3,
                                                                        3 * sizeof(std::uint32_t),
                                                                        mesh.triangles.size()));
    INSITU_CHECK(vertices != nullptr && indices != nullptr,
                 "no memory for {} triangles",
                 mesh.triangles.size());
    for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
        const glm::dvec3 relative = glm::dvec3(mesh.positions[i]) - centre;
        for (int axis = 0; axis < 3; ++axis)
            vertices[3 * i + static_cast<std::size_t>(axis)] = static_cast<float>(relative[axis]);
    }
    for (std::size_t i = 0; i < mesh.triangles.size(); ++i)
        for (int corner = 0; corner < 3; ++corner)
            indices[3 * i + static_cast<std::size_t>(corner)] = mesh.triangles[i][corner];

    Geometry& geometry = geometries[index];
    geometry = {&filter, index, vertices, indices};
    if (filtered && filter) {
        rtcSetGeometryUserData(handle, &geometry);
        rtcSetGeometryIntersectFilterFunction(handle, &Impl::keepOrPass);
        rtcSetGeometryOccludedFilterFunction(handle, &Impl::keepOrPass);
    }
    rtcCommitGeometry(handle);
    rtcAttachGeometryByID(scene.get(), handle, index);
    rtcReleaseGeometry(handle);
    empty = false;
}

glm::dvec3 RayScene::Impl::vertex(const Geometry& geometry, std::uint32_t index) const
{
    const float* v = geometry.vertices + 3 * static_cast<std::size_t>(index);
    return {v[0], v[1], v[2]};
}

RTCRay RayScene::Impl::ray(glm::dvec3 origin, glm::dvec3 direction, double max_distance_m) const
{
    RTCRay ray{};
    const glm::vec3 o(origin - centre);
    const glm::vec3 d(direction);
    ray.org_x = o.x;
    ray.org_y = o.y;
    ray.org_z = o.z;
    ray.dir_x = d.x;
    ray.dir_y = d.y;
    ray.dir_z = d.z;
    ray.tnear = 0.0f;
    ray.tfar = roundUp(max_distance_m);
    ray.mask = ~0u;
    return ray;
}

RayScene::RayScene(std::span<const TriangleMesh* const> meshes,
                   std::span<const bool> filtered,
                   HitFilter filter)
    : impl_(std::make_unique<Impl>())
{
    INSITU_CHECK(filtered.empty() || filtered.size() == meshes.size(),
                 "{} flags for {} meshes",
                 filtered.size(),
                 meshes.size());
    const BoundingBox box = finiteBounds(meshes);
    impl_->centre = 0.5 * (box.min + box.max);
    impl_->radius = 0.5 * glm::length(box.max - box.min);
    impl_->filter = std::move(filter);
    impl_->geometries.resize(meshes.size());
    rtcSetSceneFlags(impl_->scene.get(), RTC_SCENE_FLAG_ROBUST);
    rtcSetSceneBuildQuality(impl_->scene.get(), RTC_BUILD_QUALITY_HIGH);
    for (std::size_t i = 0; i < meshes.size(); ++i)
        impl_->add(*meshes[i], static_cast<std::uint32_t>(i), !filtered.empty() && filtered[i]);
    rtcCommitScene(impl_->scene.get());
    const RTCError error = rtcGetDeviceError(impl_->device.get());
    INSITU_CHECK(error == RTC_ERROR_NONE, "Embree error {}", static_cast<int>(error));
}

RayScene::~RayScene() = default;
RayScene::RayScene(RayScene&&) noexcept = default;
RayScene& RayScene::operator=(RayScene&&) noexcept = default;

std::optional<RayHit> RayScene::intersect(glm::dvec3 origin,
                                          glm::dvec3 direction,
                                          double max_distance_m) const
{
    INSITU_DCHECK(isFinite(origin) && isFinite(direction), "ray is not finite");
    if (impl_->empty || !(max_distance_m > 0.0)) return std::nullopt;
    RTCRayHit query{};
    query.ray = impl_->ray(origin, direction, max_distance_m);
    query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    rtcIntersect1(impl_->scene.get(), &context, &query);
    if (query.hit.geomID == RTC_INVALID_GEOMETRY_ID) return std::nullopt;

    // Redo plane and distance in double: the hit point then lies on the stored triangle.
    const Impl::Geometry& geometry = impl_->geometries[query.hit.geomID];
    const std::uint32_t* corner = geometry.indices + 3 * std::size_t{query.hit.primID};
    const glm::dvec3 a = impl_->vertex(geometry, corner[0]);
    const glm::dvec3 area =
        glm::cross(impl_->vertex(geometry, corner[1]) - a, impl_->vertex(geometry, corner[2]) - a);
    const double twice_area = glm::length(area);
    RayHit hit;
    hit.mesh = query.hit.geomID;
    hit.triangle = query.hit.primID;
    hit.barycentric = {query.hit.u, query.hit.v};
    hit.distance_m = query.ray.tfar;
    hit.normal = twice_area > 0.0 ? area / twice_area : -direction;
    const double refined =
        glm::dot(a - (origin - impl_->centre), hit.normal) / glm::dot(direction, hit.normal);
    // A grazing ray's distance is ill-conditioned either way; keep Embree's when they disagree.
    if (std::abs(refined - hit.distance_m) <= 1e-3 * hit.distance_m && refined > 0.0)
        hit.distance_m = refined;
    if (hit.distance_m >= max_distance_m) return std::nullopt;
    return hit;
}

bool RayScene::occluded(glm::dvec3 origin, glm::dvec3 direction, double max_distance_m) const
{
    INSITU_DCHECK(isFinite(origin) && isFinite(direction), "ray is not finite");
    if (impl_->empty || !(max_distance_m > 0.0)) return false;
    RTCRay query = impl_->ray(origin, direction, max_distance_m);
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    rtcOccluded1(impl_->scene.get(), &context, &query);
    return query.tfar < 0.0f;
}

bool RayScene::empty() const
{
    return impl_->empty;
}

glm::dvec3 RayScene::offsetOrigin(glm::dvec3 point,
                                  glm::dvec3 unit_normal,
                                  glm::dvec3 direction) const
{
    // Embree works relative to the centre in float: its errors are a few 2^-24 of the scene's
    // radius and of the ray's own distance from the centre. 64 of them leave a wide margin.
    const double scale = std::max(impl_->radius, glm::length(point - impl_->centre));
    const double side = glm::dot(unit_normal, direction) < 0.0 ? -1.0 : 1.0;
    return point + unit_normal * (side * 64.0 * 0x1p-24 * scale);
}

glm::dvec3 offsetOrigin(glm::dvec3 point, glm::dvec3 unit_normal, glm::dvec3 direction)
{
    // [WacBin19] moves by 256 float steps of each coordinate, or 1/65536 near the origin. Hit
    // distances of RayScene are refined in double, so half of that is enough, on the largest
    // coordinate and never less than for a point one metre from the origin.
    const double magnitude =
        std::max({1.0, std::abs(point.x), std::abs(point.y), std::abs(point.z)});
    const double side = glm::dot(unit_normal, direction) < 0.0 ? -1.0 : 1.0;
    return point + unit_normal * (side * 0x1p-17 * magnitude);
}

}  // namespace insitu
