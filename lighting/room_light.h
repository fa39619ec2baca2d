#pragma once

#include "core/camera.h"
#include "core/environment_map.h"
#include "core/finding.h"
#include "core/progress.h"
#include "lighting/alias_table.h"
#include "lighting/face_grid.h"
#include "lighting/light_source.h"
#include "reconstruct/scene_proxy.h"

#include <cstdint>
#include <optional>

namespace insitu {

struct RoomLightOptions {
    /// Size of a radiance texel on the room's surfaces, metres, > 0. Grown for very large rooms.
    double texel_m = 0.02;
    /// Size of a reflectance and inter-reflection cell, metres, > 0.
    double cell_m = 0.15;
    /// Rays per cell for its irradiance. Unitless, > 0.
    int rays_per_cell = 256;
    /// Where the objects stand: light is drawn by what it does there.
    glm::dvec3 reference_point_m{0.0};
    std::uint64_t seed = 1;
};

/// The photograph as a second witness of the room's radiance, for what the probe did not see.
struct PhotographedRadiance {
    Camera camera;
    Image<Rgb> radiance;  ///< same unit as the probe
};

/// The captured light, brought to its place in the room: radiance on the proxy's surfaces, and far
/// away beyond its openings.
///
/// Each surface texel that the probe saw has the radiance the probe measured in its direction. One
/// it did not see takes the photograph's, or, unseen by both, gathers light with its face's mean
/// reflectance ([GibCha03] 4.2; 0.5 where nothing of the face was seen). A direction through an
/// opening that the probe did not see through takes the nearest one that it did. Rays that miss the
/// proxy see the probe's environment at infinity.
///
/// Findings: "light-unseen-surfaces" (share of the area), "light-opening-extended" (share of the
/// light through openings that is taken from the nearest seen direction), "light-opening-unseen".
class RoomLight : public LightSource {
public:
    RoomLight(const SceneProxy& proxy,
              const EnvironmentMap& probe,
              glm::dvec3 probe_center_m,
              const std::optional<PhotographedRadiance>& photograph,
              const RoomLightOptions& options,
              Progress& progress);

    [[nodiscard]] std::optional<LightSample> sample(glm::dvec3 x,
                                                    double selector,
                                                    glm::vec2 u) const override;
    [[nodiscard]] IncidentLight incident(glm::dvec3 x, glm::dvec3 direction) const override;

    /// The same as incident(), with what was hit (nothing: far away).
    struct Arrival {
        IncidentLight light;
        std::optional<ProxyHit> hit;
    };
    [[nodiscard]] Arrival arrive(glm::dvec3 x, glm::dvec3 direction) const;
    /// The same as sample(), with what was hit.
    struct DrawnArrival {
        glm::dvec3 direction{0.0};
        Arrival arrival;
    };
    [[nodiscard]] std::optional<DrawnArrival> draw(glm::dvec3 x,
                                                   double selector,
                                                   glm::vec2 u) const;

    [[nodiscard]] const SceneProxy& proxy() const { return proxy_; }
    /// Radiance of a surface as the probe saw it; 0 where it did not.
    [[nodiscard]] Rgb probeRadiance(std::size_t face, glm::dvec2 uv) const;
    /// Irradiance and Lambert reflectance of the surfaces, on the cell grid.
    [[nodiscard]] const FaceGrid<Rgb>& cellIrradiance() const { return cell_irradiance_; }
    [[nodiscard]] const FaceGrid<Rgb>& cellReflectance() const { return cell_reflectance_; }
    [[nodiscard]] const Findings& findings() const { return findings_; }

private:
    void bakeProbe(const EnvironmentMap& probe, glm::dvec3 center, Progress& progress);
    void fillFromPhotograph(const PhotographedRadiance& photograph);
    void extendBeyondOpenings(const EnvironmentMap& probe, glm::dvec3 center);
    void buildTables(glm::dvec3 reference);
    void gatherCells(const RoomLightOptions& options, Progress& progress);
    void fillUnseen();
    void reportCoverage();
    [[nodiscard]] Rgb faceRadiance(std::size_t face, glm::dvec2 uv) const;
    [[nodiscard]] double texelArea(std::size_t face) const;
    [[nodiscard]] double texelPdf(std::size_t face, glm::dvec2 uv) const;
    [[nodiscard]] double outsidePdf(glm::dvec3 direction) const;
    [[nodiscard]] glm::dvec3 cellIrradianceAt(glm::dvec3 x,
                                              glm::dvec3 normal,
                                              std::uint64_t cell,
                                              const RoomLightOptions& options) const;

    const SceneProxy& proxy_;
    FaceGrid<Rgb> radiance_;               ///< every texel outside openings is valid when built
    std::vector<std::uint8_t> probe_saw_;  ///< per texel of radiance_
    std::vector<std::uint8_t> photo_saw_;
    FaceGrid<Rgb> cell_irradiance_;
    FaceGrid<Rgb> cell_reflectance_;
    EnvironmentMap outside_;  ///< what lies beyond the openings, or everywhere
    std::vector<std::uint8_t> outside_seen_;
    bool outside_is_everywhere_ = false;  ///< no openings: rays that miss see the probe itself

    /// The three ways to draw light: a texel by its power, a point in an opening, a far direction.
    std::optional<AliasTable> texel_table_;
    std::optional<AliasTable> outside_table_;
    std::vector<std::array<glm::dvec3, 3>> portal_triangles_;
    std::vector<double> portal_cumulative_area_;
    double texel_share_ = 1.0;
    double portal_share_ = 0.0;
    double outside_share_ = 0.0;
    Findings findings_;
};

}  // namespace insitu
