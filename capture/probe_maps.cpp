#include "capture/light_probe.h"
#include "capture/probe_checks.h"
#include "capture/texel_average.h"
#include "core/check.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace insitu {

using std::numbers::pi;

namespace {

/// Sub-samples per texel and axis for a source with texels of `source_radians`.
int placesFor(double texel_radians, double source_radians)
{
    return std::clamp(static_cast<int>(std::ceil(2.0 * texel_radians / source_radians)), 2, 16);
}

}  // namespace

LightProbe probeFromLatLong(const Image<Rgb>& radiance, int width)
{
    detail::checkRadiance(radiance);
    detail::checkMapWidth(width);
    if (radiance.width() != 2 * radiance.height())
        throw InputError("light probe",
                         fmt::format("{}x{} pixels: an equirectangular picture is twice as wide as "
                                     "high",
                                     radiance.width(),
                                     radiance.height()));
    LightProbe probe;
    EnvironmentMap source{radiance};
    if (width == 0 || width == radiance.width()) {
        probe.environment = std::move(source);
        return probe;
    }
    const int places = placesFor(2.0 * pi / width, 2.0 * pi / radiance.width());
    probe.environment.pixels = detail::averageOverTexels(
        width,
        [&](glm::dvec3) { return places; },
        [&](glm::dvec3 direction) { return lookUp(source, direction); });
    return probe;
}

LightProbe probeFromAngularMap(const Image<Rgb>& radiance, int width)
{
    detail::checkRadiance(radiance);
    detail::checkMapWidth(width);
    if (radiance.width() != radiance.height())
        throw InputError(
            "light probe",
            fmt::format(
                "{}x{} pixels: an angular map is square", radiance.width(), radiance.height()));
    const double half = 0.5 * radiance.width();
    const double source_radians = pi / half;
    const int map_width = width > 0 ? width : detail::widthForResolution(source_radians);
    const int places = placesFor(2.0 * pi / map_width, source_radians);
    LightProbe probe;
    probe.environment.pixels = detail::averageOverTexels(
        map_width,
        [&](glm::dvec3) { return places; },
        [&](glm::dvec3 d) {
            const double across = std::hypot(d.x, d.y);
            const double angle = std::atan2(across, -d.z);
            // One pixel inside the disc: its edge is mixed with what is outside.
            const double r = std::min(angle / pi * half, half - 1.0);
            const double scale = across > 1e-12 ? r / across : 0.0;
            return sampleBilinear(radiance, half + scale * d.x, half - scale * d.y);
        });
    return probe;
}

}  // namespace insitu
