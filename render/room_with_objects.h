#pragma once

#include "core/progress.h"
#include "lighting/room_light.h"
#include "render/object_scene.h"
#include "render/path_tracer.h"

#include <cstdint>

namespace insitu {

/// Light that goes from the objects to each other and the room and back.
struct InterreflectionOptions {
    /// false: of the objects only what they emit lights anything, and the room does not answer.
    bool enabled = true;
    /// Times the light travels object -> room -> room. 0: the room does not answer. >= 0.
    int rounds = 2;
    /// Samples per cell and round, > 0.
    int samples_per_cell = 192;
    std::uint64_t seed = 1;
    PathOptions path;
};

/// The two irradiances of a real surface point from one set of random numbers.
struct ReceiverSample {
    glm::dvec3 without{0.0};
    glm::dvec3 with{0.0};
};

/// The captured room after the objects were put into it: a surface's radiance changes by its
/// reflectance times the change of its irradiance,
///   ΔL = ρ/π ∫ [L_with(ω) − L_without(ω)] cos dω,
/// which is zero but for directions that an object hides and for surfaces that changed themselves.
/// The change is tabulated on the room's cells; as a light source it lights the objects.
class RoomWithObjects : public LightSource {
public:
    RoomWithObjects(const RoomLight& room,
                    const ObjectScene& objects,
                    const InterreflectionOptions& options,
                    Progress& progress);

    [[nodiscard]] std::optional<LightSample> sample(glm::dvec3 x,
                                                    double selector,
                                                    glm::vec2 u) const override;
    [[nodiscard]] IncidentLight incident(glm::dvec3 x, glm::dvec3 direction) const override;

    /// One sample of a receiver's irradiance without and with the objects (their mean over samples
    /// is the estimate). Cosine, light and object-cone sampling joined by the balance heuristic.
    [[nodiscard]] ReceiverSample sampleReceiver(glm::dvec3 x,
                                                glm::dvec3 normal,
                                                const PathOptions& path,
                                                RandomStream& random) const;
    /// One sample of the radiance of an object's point towards `wo` (unit), as the camera sees it.
    [[nodiscard]] Rgb sampleObject(const SurfacePoint& point,
                                   glm::dvec3 wo,
                                   PathOptions path,
                                   RandomStream& random) const;

    [[nodiscard]] const RoomLight& room() const { return room_; }
    [[nodiscard]] const ObjectScene& objects() const { return objects_; }

private:
    struct Sphere {
        glm::dvec3 center{0.0};
        double radius = 0.0;
    };
    struct Cones;
    [[nodiscard]] Cones conesFrom(glm::dvec3 x) const;
    [[nodiscard]] Rgb change(const RoomLight::Arrival& arrival) const;
    void addDirection(glm::dvec3 x,
                      glm::dvec3 normal,
                      const RoomLight::DrawnArrival& drawn,
                      const Cones& cones,
                      const PathOptions& path,
                      RandomStream& random,
                      ReceiverSample& sum) const;

    const RoomLight& room_;
    const ObjectScene& objects_;
    bool interreflection_ = true;
    std::vector<Sphere> spheres_;
    FaceGrid<Rgb> change_;  ///< ΔL of the cells
};

}  // namespace insitu
