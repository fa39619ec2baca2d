#include "render/room_with_objects.h"

#include "core/parallel.h"
#include "lighting/sampling.h"

#include <array>
#include <cmath>
#include <numbers>

namespace insitu {

using std::numbers::pi;

namespace {
/// More objects than this share the cones of the first ones' neighbours: sampled by the cosine.
constexpr std::size_t kMaxCones = 8;
}  // namespace

/// Cones from a point around the objects' bounding spheres, one of which is drawn uniformly.
struct RoomWithObjects::Cones {
    struct Cone {
        glm::dvec3 axis{0.0};
        double cos_half_angle = 0.0;
    };
    std::array<Cone, kMaxCones> cones;
    std::size_t count = 0;

    [[nodiscard]] double pdf(glm::dvec3 direction) const
    {
        double sum = 0.0;
        for (std::size_t i = 0; i < count; ++i)
            if (glm::dot(direction, cones[i].axis) >= cones[i].cos_half_angle)
                sum += 1.0 / (2.0 * pi * (1.0 - cones[i].cos_half_angle));
        return count > 0 ? sum / static_cast<double>(count) : 0.0;
    }
};

RoomWithObjects::RoomWithObjects(const RoomLight& room,
                                 const ObjectScene& objects,
                                 const InterreflectionOptions& options,
                                 Progress& progress)
    : room_(room),
      objects_(objects),
      interreflection_(options.enabled),
      change_(room.cellIrradiance())
{
    for (const BoundingBox& box : objects.bounds())
        spheres_.push_back({0.5 * (box.min + box.max), 0.5 * glm::length(box.max - box.min)});
    for (std::size_t i = 0; i < change_.size(); ++i)
        change_[i] = Rgb(0.0f);

    const int rounds = options.enabled ? options.rounds : 0;
    for (int round = 0; round < rounds; ++round) {
        FaceGrid<Rgb> next = change_;
        parallelFor(0, static_cast<std::int64_t>(change_.size()), [&](std::int64_t number) {
            const std::size_t cell = static_cast<std::size_t>(number);
            if (!change_.valid(cell)) return;
            const auto texel = change_.texel(cell);
            const glm::dvec3 normal = room.proxy().faces()[texel.face].normal;
            glm::dvec3 sum(0.0);
            for (int s = 0; s < options.samples_per_cell; ++s) {
                RandomStream random(options.seed + static_cast<std::uint64_t>(round) + 1,
                                    cell,
                                    static_cast<std::uint64_t>(s));
                const glm::dvec2 inside(random.uniform(), random.uniform());
                const glm::dvec3 x = room.proxy().pointOn(texel.face, change_.uv(texel, inside));
                const ReceiverSample drawn = sampleReceiver(x, normal, options.path, random);
                sum += drawn.with - drawn.without;
            }
            next[cell] = room.cellReflectance()[cell] *
                         Rgb(sum / (static_cast<double>(options.samples_per_cell) * pi));
        });
        change_ = std::move(next);
        progress.report("inter-reflection", (round + 1.0) / rounds);
        progress.checkpoint();
    }
}

Rgb RoomWithObjects::change(const RoomLight::Arrival& arrival) const
{
    if (!arrival.hit || arrival.hit->opening) return Rgb(0.0f);
    return change_.lookUp(arrival.hit->face, arrival.hit->uv, Rgb(0.0f));
}

std::optional<LightSample> RoomWithObjects::sample(glm::dvec3 x, double selector, glm::vec2 u) const
{
    const auto drawn = room_.draw(x, selector, u);
    if (!drawn) return std::nullopt;
    const RoomLight::Arrival& arrival = drawn->arrival;
    return LightSample{drawn->direction,
                       arrival.distance_m,
                       glm::max(arrival.radiance + change(arrival), Rgb(0.0f)),
                       drawn->pdf};
}

IncidentLight RoomWithObjects::incident(glm::dvec3 x, glm::dvec3 direction) const
{
    const RoomLight::DrawnArrival drawn = room_.arriveWithPdf(x, direction);
    return {glm::max(drawn.arrival.radiance + change(drawn.arrival), Rgb(0.0f)),
            drawn.arrival.distance_m,
            drawn.pdf};
}

RoomWithObjects::Cones RoomWithObjects::conesFrom(glm::dvec3 x) const
{
    Cones cones;
    for (const Sphere& sphere : spheres_) {
        const glm::dvec3 way = sphere.center - x;
        const double distance = glm::length(way);
        if (distance <= sphere.radius * 1.01 || cones.count == kMaxCones) continue;
        const double sine = sphere.radius / distance;
        cones.cones[cones.count++] = {way / distance, std::sqrt(1.0 - sine * sine)};
    }
    return cones;
}

void RoomWithObjects::addDirection(glm::dvec3 x,
                                   glm::dvec3 normal,
                                   const RoomLight::DrawnArrival& drawn,
                                   const Cones& cones,
                                   const PathOptions& path,
                                   RandomStream& random,
                                   ReceiverSample& sum) const
{
    const auto& [direction, arrival, light_pdf] = drawn;
    const double cosine = glm::dot(direction, normal);
    if (cosine <= 0.0) return;
    // Balance heuristic over the three strategies, one draw each.
    const double weight = cosine / (cosine / pi + light_pdf + cones.pdf(direction));
    const glm::dvec3 without(arrival.radiance);
    sum.without += weight * without;

    const glm::dvec3 origin = offsetOrigin(x, normal, direction);
    const auto point = objects_.intersect(origin, direction, arrival.distance_m);
    glm::dvec3 with = without;
    if (!point)
        with += glm::dvec3(change(arrival));
    else if (interreflection_)
        with = glm::dvec3(tracePath(objects_, *this, *point, -direction, path, random));
    else
        with = glm::dvec3(point->material.emissive);
    sum.with += weight * with;
}

ReceiverSample RoomWithObjects::sampleReceiver(glm::dvec3 x,
                                               glm::dvec3 normal,
                                               const PathOptions& path,
                                               RandomStream& random) const
{
    ReceiverSample sum;
    const Cones cones = conesFrom(x);

    const glm::dvec3 by_cosine = frameFromNormal(normal) * cosineHemisphere(random.uniform2());
    addDirection(x, normal, room_.arriveWithPdf(x, by_cosine), cones, path, random, sum);

    const double selector = random.uniformDouble();
    if (const auto drawn = room_.draw(x, selector, random.uniform2()))
        addDirection(x, normal, *drawn, cones, path, random, sum);

    if (cones.count > 0) {
        const Cones::Cone& cone =
            cones.cones[random.below(static_cast<std::uint32_t>(cones.count))];
        const glm::dvec3 by_cone =
            frameFromNormal(cone.axis) * uniformCone(random.uniform2(), cone.cos_half_angle);
        if (glm::dot(by_cone, normal) > 0.0)
            addDirection(x, normal, room_.arriveWithPdf(x, by_cone), cones, path, random, sum);
    }
    return sum;
}

Rgb RoomWithObjects::sampleObject(const SurfacePoint& point,
                                  glm::dvec3 wo,
                                  PathOptions path,
                                  RandomStream& random) const
{
    if (!interreflection_) path.max_bounces = 1;
    return tracePath(objects_, *this, point, wo, path, random);
}

}  // namespace insitu
