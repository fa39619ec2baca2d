#pragma once

#include "core/camera.h"
#include "core/environment_map.h"
#include "core/finding.h"
#include "core/progress.h"
#include "lighting/alias_table.h"
#include "lighting/face_grid.h"
#include "lighting/light_fit.h"
#include "lighting/light_reference.h"
#include "lighting/light_source.h"
#include "reconstruct/scene_proxy.h"

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

namespace insitu {

struct RoomLightOptions {
    /// Size of a radiance texel on the room's surfaces, metres, > 0. Grown for very large rooms.
    double texel_m = 0.02;
    /// Size of a reflectance and inter-reflection cell, metres, > 0.
    double cell_m = 0.15;
    /// Rays per cell for its irradiance. Unitless, > 0.
    int rays_per_cell = 256;
    /// Scale light that the probe could not measure (unseen directions through openings, clipped
    /// lights) so that it explains how bright the surfaces are (light_fit.h).
    bool fit_unmeasured = true;
    /// Where the objects stand: light is drawn by what it does there.
    glm::dvec3 reference_point_m{0.0};
    /// What was measured of the light: with fit_unmeasured it solves for lights that are clipped,
    /// before what the surfaces say.
    std::vector<ReferenceGroup> references;
    std::uint64_t seed = 1;

    [[nodiscard]] Findings validate() const;
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
/// opening that the probe did not see through takes the nearest one that it did, scaled so that the
/// light on each surface explains its measured radiance (light_fit.h). Rays that miss the proxy
/// see the probe's environment at infinity. Lights that are clipped in every exposure are scaled in
/// the same way, when a patch of their light tells how strong they are, or by references
/// (light_reference.h), which count far more: what a patch says has errors in common, of the
/// sky that the probe did not see and of surfaces that are not Lambert's.
///
/// A solid box stands for furniture that may have gaps: where the probe, looking at its face
/// towards an opening, saw more light than any surface there could reflect, it saw the opening
/// through a gap, and light passes.
///
/// Findings: "light-unseen-surfaces" (share of the area), "light-opening-extended" (share of the
/// light through openings that is taken from the nearest seen direction), "light-opening-unseen",
/// "light-opening-fitted" (the scale), "light-through-gaps", "light-clipped-solved" (the strength),
/// "light-clipped-unsolved" (the bound), and of references those of light_reference.h.
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

    /// What arrives at a place along a direction that points away from it, and from where.
    struct Arrival {
        Rgb radiance{0.0f};
        double distance_m = kInfinity;
        std::optional<ProxyHit> hit;  ///< nothing: far away
    };
    [[nodiscard]] Arrival arrive(glm::dvec3 x, glm::dvec3 direction) const;
    /// With the density with which draw() draws that direction.
    struct DrawnArrival {
        glm::dvec3 direction{0.0};
        Arrival arrival;
        double pdf = 0.0;
    };
    [[nodiscard]] DrawnArrival arriveWithPdf(glm::dvec3 x, glm::dvec3 direction) const;
    /// The same as sample(), with what was hit.
    [[nodiscard]] std::optional<DrawnArrival> draw(glm::dvec3 x,
                                                   double selector,
                                                   glm::vec2 u) const;

    /// What a ray meets: as SceneProxy::intersect, but gaps in solid boxes are passed.
    [[nodiscard]] std::optional<ProxyHit> intersect(glm::dvec3 x, glm::dvec3 direction) const;

    [[nodiscard]] const SceneProxy& proxy() const { return proxy_; }
    /// Radiance of a surface as the probe saw it; 0 where it did not.
    [[nodiscard]] Rgb probeRadiance(std::size_t face, glm::dvec2 uv) const;
    /// What a surface's irradiance, as computed, is to be multiplied by. Solid boxes are coarser
    /// than the furniture they stand for and hide too much or too little; where they are in the way
    /// the irradiance may be anything between the box as given and no box at all, and the value is
    /// chosen that leaves the surface the reflectance of the rest of its face. 1 elsewhere.
    [[nodiscard]] Rgb irradianceScale(std::size_t face, glm::dvec2 uv) const;
    /// True when the photograph shows, through a solid box, what stands behind it
    /// (see_through.h); false everywhere without a photograph.
    [[nodiscard]] bool seesThrough(int x, int y) const
    {
        return !see_through_.empty() && see_through_(x, y) != 0;
    }
    /// Irradiance and Lambert reflectance of the surfaces, on the cell grid.
    [[nodiscard]] const FaceGrid<Rgb>& cellIrradiance() const { return cell_irradiance_; }
    [[nodiscard]] const FaceGrid<Rgb>& cellReflectance() const { return cell_reflectance_; }
    /// Radiance of the surfaces, on the texel grid; texels in openings are not valid.
    [[nodiscard]] const FaceGrid<Rgb>& surfaceRadiance() const { return radiance_; }
    /// What lies beyond the openings, or everywhere where the proxy is missed.
    [[nodiscard]] const EnvironmentMap& outside() const { return outside_; }
    [[nodiscard]] const Findings& findings() const { return findings_; }

private:
    void findGaps(const EnvironmentMap& probe, glm::dvec3 center);
    void bakeProbe(const EnvironmentMap& probe, glm::dvec3 center, Progress& progress);
    void fillFromPhotograph(const PhotographedRadiance& photograph);
    void lookThroughBoxes(const PhotographedRadiance& photograph);
    void extendBeyondOpenings(const EnvironmentMap& probe, glm::dvec3 center);
    void buildTables(glm::dvec3 reference);
    void gatherCells(const RoomLightOptions& options, Progress& progress);
    void fitUnmeasured(const RoomLightOptions& options, Progress& progress);
    [[nodiscard]] std::vector<LitCell> litCells() const;
    [[nodiscard]] bool scaleOpenings(const LightFit& fit, std::span<const LitCell> cells);
    [[nodiscard]] bool scaleClipped(const LightFit& fit, std::span<const LitCell> cells);
    void scaleClippedBy(glm::dvec3 factor);
    /// Irradiance at the references' places, openings as `fit` scales them.
    [[nodiscard]] std::vector<PredictedIrradiance> predictReferences(
        const RoomLightOptions& options, const LightFit& fit, bool openings) const;
    [[nodiscard]] bool solveByReferences(const RoomLightOptions& options,
                                         const LightFit& fit,
                                         bool openings);
    void scaleDoubtfulIrradiance();
    void fillUnseen();
    void reportCoverage(glm::dvec3 reference);
    [[nodiscard]] Rgb faceRadiance(std::size_t face, glm::dvec2 uv) const;
    /// Part of the radiance that comes from lights clipped in the probe.
    [[nodiscard]] Rgb clippedOf(const Arrival& arrival, glm::dvec3 direction) const;
    [[nodiscard]] Rgb radianceBehind(const ProxyHit& solid, glm::dvec3 direction) const;
    [[nodiscard]] double texelArea(std::size_t face) const;
    [[nodiscard]] double texelPdf(std::size_t face, glm::dvec2 uv) const;
    [[nodiscard]] double outsidePdf(glm::dvec3 direction) const;
    [[nodiscard]] double pdf(const Arrival& arrival, glm::dvec3 direction) const;
    [[nodiscard]] std::uint8_t outsideBand(glm::dvec3 direction) const;
    /// By how much a cell's irradiance would fall or rise were solid boxes not there.
    struct Doubt {
        glm::dvec3 lower{0.0};
        glm::dvec3 higher{0.0};
    };
    using BandIrradiance = std::array<glm::dvec3, kLightBands>;
    /// Mean over the places, of one normal; `cell` numbers the random stream.
    [[nodiscard]] glm::dvec3 irradianceOver(std::span<const glm::dvec3> places,
                                            glm::dvec3 normal,
                                            std::uint64_t cell,
                                            const RoomLightOptions& options,
                                            BandIrradiance* bands,
                                            Doubt* doubt) const;
    void listClipped();
    /// An estimate from one clipped texel, drawn by its power.
    [[nodiscard]] glm::dvec3 clippedIrradianceAt(glm::dvec3 x,
                                                 glm::dvec3 normal,
                                                 double selector,
                                                 glm::vec2 u) const;

    const SceneProxy& proxy_;
    FaceGrid<Rgb> radiance_;               ///< every texel outside openings is valid when built
    std::vector<std::uint8_t> probe_saw_;  ///< per texel of radiance_
    std::vector<std::uint8_t> photo_saw_;
    std::vector<std::uint8_t> gap_;  ///< per texel of radiance_: light passes; empty: nowhere
    FaceGrid<Rgb> clipped_;          ///< part of radiance_ that is only a lower bound
    FaceGrid<Rgb> cell_irradiance_;
    FaceGrid<Rgb> cell_reflectance_;
    EnvironmentMap outside_;  ///< what lies beyond the openings, or everywhere; clipped: as seen
    std::vector<std::uint8_t> outside_seen_;
    /// The LightBand of a far direction that the probe did not see; kMeasured: it did.
    static constexpr std::uint8_t kMeasured = 255;
    std::vector<std::uint8_t> outside_band_;
    std::vector<BandIrradiance> cell_bands_;  ///< part of cell_irradiance_ of each band
    std::vector<Rgb> cell_radiance_;
    std::vector<std::uint8_t> cell_shines_;  ///< holds clipped light: a lamp, not a lit surface
    std::vector<Doubt> cell_doubt_;
    FaceGrid<Rgb> irradiance_scale_;
    Image<std::uint8_t> see_through_;  ///< per pixel of the photograph

    /// A texel of clipped_ or, far away, of outside_.clipped.
    struct ClippedSource {
        std::size_t texel = 0;
        bool far = false;
        double cumulative = 0.0;  ///< of the power of all up to this one
    };
    std::vector<ClippedSource> clipped_sources_;

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
