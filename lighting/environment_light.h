#pragma once

#include "core/environment_map.h"
#include "lighting/alias_table.h"
#include "lighting/light_source.h"

#include <glm/glm.hpp>

#include <optional>
#include <span>
#include <vector>

namespace insitu {

/// A parallelogram corner + s·edge_u + t·edge_v, s and t in [0, 1]; its normal is along
/// edge_u × edge_v.
struct Quad {
    glm::dvec3 corner{0.0}, edge_u{0.0}, edge_v{0.0};
};

/// A hole through which a closed room sees the environment: a hint where to look for light. It
/// changes how light is drawn, never how much there is. Both sides count.
struct Portal {
    Quad quad;
};

/// A luminous parallelogram of constant radiance. One that is not two-sided shines along its normal
/// and is not there at all when seen from behind.
struct AreaLamp {
    Quad quad;
    Rgb radiance{0.0f};
    bool two_sided = false;
};

/// A distant environment with rectangular lamps in front of it.
///
/// Drawn from a mixture: the environment's texels by power, each portal and each lamp by area. The
/// shares depend on the shaded point, by an estimate of what each brings there, and none that can
/// contribute gets less than a tenth (or 1/2n of n). Inside a texel the density is constant while
/// the radiance is bilinear, so a sample's radiance/pdf varies, but its mean is exact.
class EnvironmentLight : public LightSource {
public:
    /// Map pixels are finite and >= 0 (LogicError otherwise); an empty map is black. Lamps and
    /// portals of no area are an error too.
    explicit EnvironmentLight(EnvironmentMap environment,
                              std::vector<Portal> portals = {},
                              std::vector<AreaLamp> lamps = {});

    [[nodiscard]] std::optional<LightSample> sample(glm::dvec3 x,
                                                    double selector,
                                                    glm::vec2 u) const override;
    [[nodiscard]] IncidentLight incident(glm::dvec3 x, glm::dvec3 direction) const override;

private:
    /// A parallelogram as a place to draw from.
    struct Target {
        Quad quad;
        glm::dvec3 normal{0.0};
        glm::dvec3 across_u{0.0}, across_v{0.0};  ///< s = across_u·(p − corner), t likewise
        double area = 0.0;
        double brightness = 0.0;  ///< luminance of what comes through or from it
        bool two_sided = true;
    };
    struct Crossing {
        double distance_m = 0.0;
        double pdf = 0.0;  ///< of the direction, per solid angle, drawing by area
    };
    [[nodiscard]] static Target makeTarget(const Quad& quad, double brightness, bool two_sided);
    [[nodiscard]] static std::optional<Crossing> cross(const Target& target,
                                                       glm::dvec3 x,
                                                       glm::dvec3 direction);
    /// Estimated light from a target at x, as luminance times solid angle; 0 when it cannot
    /// contribute.
    [[nodiscard]] static double estimate(const Target& target, glm::dvec3 x);

    void buildSky();
    [[nodiscard]] double skyPdf(glm::dvec3 direction) const;
    [[nodiscard]] glm::dvec3 drawSky(double u, double v) const;
    [[nodiscard]] std::optional<glm::dvec3> drawDirection(std::span<const double> shares,
                                                          glm::dvec3 x,
                                                          double selector,
                                                          glm::vec2 u) const;
    /// Shares of the strategies at x: the environment first, then the targets. They sum to 1, or
    /// are all 0 when nothing shines.
    [[nodiscard]] std::span<const double> sharesAt(glm::dvec3 x) const;
    [[nodiscard]] IncidentLight arrive(std::span<const double> shares,
                                       glm::dvec3 x,
                                       glm::dvec3 direction) const;

    EnvironmentMap environment_;
    std::optional<AliasTable> sky_table_;
    std::vector<float> sky_density_;  ///< per texel, of a drawn direction per solid angle
    double sky_brightness_ = 0.0;     ///< mean luminance over the sphere
    std::vector<AreaLamp> lamps_;
    std::vector<Target> targets_;  ///< portals, then lamps
    std::size_t portal_count_ = 0;
};

}  // namespace insitu
