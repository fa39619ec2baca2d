#include "pipeline/reference_capture.h"

#include "core/check.h"
#include "core/color.h"
#include "core/quantile.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>

namespace insitu {

using std::numbers::pi;

namespace {

/// Share of a ball's radius that is used: nearer to the rim its shading changes within a pixel.
constexpr double kUsedRadius = 0.9;
/// Patches across a ball: a normal turns by 0.15 between them, so that a patch's mean differs from
/// the light at its mean normal by a thousandth.
constexpr int kBallPatches = 12;
/// Variation over a card, half its interdecile range, that is told.
constexpr double kUneven = 0.15;
/// Codes of a photograph above this share of full scale are clipped.
constexpr double kClipFraction = 0.98;
/// Share of a card that may be clipped.
constexpr double kClippedShare = 0.01;

[[noreturn]] void refuse(const ReferencePicture& picture, const std::string& cause)
{
    throw InputError(picture.name, cause);
}

bool isClipped(const ReferencePicture& picture, int x, int y)
{
    return !picture.clipped.empty() && picture.clipped(x, y) != Rgb(0.0f);
}

ReferenceGroup measureCard(const ProjectReference& reference,
                           const ReferencePicture& picture,
                           Findings& findings)
{
    const glm::ivec2 from(glm::round(reference.area_from_px - picture.crop_origin_px));
    const glm::ivec2 size(glm::round(reference.area_size_px));
    const Image<Rgb>& radiance = picture.radiance;
    if (from.x < 0 || from.y < 0 || from.x + size.x > radiance.width() ||
        from.y + size.y > radiance.height() || size.x < 1 || size.y < 1)
        refuse(picture,
               fmt::format("is {}x{} pixels, and the grey card's area ({}, {}), {} x {} pixels, "
                           "is not in it: give x, y of its top left pixel, width and height",
                           radiance.width(),
                           radiance.height(),
                           from.x,
                           from.y,
                           size.x,
                           size.y));
    std::array<std::vector<double>, 3> values;
    std::vector<double> brightness;
    std::size_t clipped = 0;
    for (int y = from.y; y < from.y + size.y; ++y)
        for (int x = from.x; x < from.x + size.x; ++x) {
            if (isClipped(picture, x, y)) ++clipped;
            for (int c = 0; c < 3; ++c)
                values[static_cast<std::size_t>(c)].push_back(radiance(x, y)[c]);
            brightness.push_back(luminance(radiance(x, y)));
        }
    const double all = static_cast<double>(brightness.size());
    if (static_cast<double>(clipped) > kClippedShare * all)
        refuse(picture,
               fmt::format("shows {:.0f} % of the grey card clipped in every exposure: it cannot "
                           "tell how bright it is; add a shorter exposure, or turn it away from "
                           "the light",
                           100.0 * static_cast<double>(clipped) / all));
    const double middle = quantile(brightness, 0.5);
    if (!(middle > 0.0)) refuse(picture, "shows the grey card black: add a longer exposure");
    const double spread = 0.5 * (quantile(brightness, 0.9) - quantile(brightness, 0.1)) / middle;
    if (spread > kUneven)
        findings.push_back({Severity::Warning,
                            "light-reference-uneven",
                            fmt::format("{}: the grey card's area varies by {:.0f} %: is there a "
                                        "shadow on it, or something else within the area?",
                                        picture.name,
                                        100.0 * spread)});
    LightReference place;
    place.normal = reference.normal;
    for (int c = 0; c < 3; ++c)
        place.irradiance[c] = std::max(
            0.0,
            pi * quantile(values[static_cast<std::size_t>(c)], 0.5) / reference.reflectance[c]);
    place.log_sigma = reference.sigma;
    return {.name = "the grey card", .places = {place}};
}

/// The sphere's normal at a pixel, its outline given; nothing outside.
class BallNormals {
public:
    BallNormals(const Camera& camera, glm::dvec2 center_px, double radius_px) : camera_(camera)
    {
        axis_ = camera.rayDirection(center_px);
        // The outline's mean radius, by four of its points.
        double cosine = 0.0;
        for (const glm::dvec2& way :
             {glm::dvec2(1, 0), glm::dvec2(-1, 0), glm::dvec2(0, 1), glm::dvec2(0, -1)})
            cosine += 0.25 * glm::dot(axis_, camera.rayDirection(center_px + radius_px * way));
        distance_ = 1.0 / std::sqrt(std::max(1.0 - cosine * cosine, 1e-12));
    }

    [[nodiscard]] std::optional<glm::dvec3> at(glm::dvec2 pixel) const
    {
        // |t d − D a| = 1, the nearer of both.
        const glm::dvec3 ray = camera_.rayDirection(pixel);
        const double along = distance_ * glm::dot(ray, axis_);
        const double inside = along * along - distance_ * distance_ + 1.0;
        if (!(inside >= 0.0)) return std::nullopt;
        return glm::normalize((along - std::sqrt(inside)) * ray - distance_ * axis_);
    }

private:
    const Camera& camera_;
    glm::dvec3 axis_{0.0};
    double distance_ = 0.0;  ///< of the centre, in radii
};

ReferenceGroup measureBall(const ProjectReference& reference, const ReferencePicture& picture)
{
    INSITU_CHECK(picture.camera != nullptr, "{}: a grey ball without a camera", picture.name);
    const glm::dvec2 center = reference.center_px - picture.crop_origin_px;
    const double radius = reference.radius_px;
    const Image<Rgb>& radiance = picture.radiance;
    if (center.x < radius || center.y < radius || center.x + radius > radiance.width() ||
        center.y + radius > radiance.height())
        refuse(picture,
               fmt::format("is {}x{} pixels, and the grey ball at ({:.1f}, {:.1f}) with radius "
                           "{:.1f} px is not wholly in it",
                           radiance.width(),
                           radiance.height(),
                           center.x,
                           center.y,
                           radius));
    struct Patch {
        glm::dvec3 radiance{0.0};
        glm::dvec3 normal{0.0};
        int count = 0;
        bool clipped = false;
    };
    std::map<int, Patch> patches;
    const BallNormals normals(*picture.camera, reference.center_px, radius);
    for (int y = static_cast<int>(center.y - radius); y < center.y + radius; ++y)
        for (int x = static_cast<int>(center.x - radius); x < center.x + radius; ++x) {
            const glm::dvec2 pixel(x + 0.5, y + 0.5);
            const glm::dvec2 off = (pixel - center) / (kUsedRadius * radius);
            if (x < 0 || y < 0 || x >= radiance.width() || y >= radiance.height() ||
                glm::dot(off, off) > 1.0)
                continue;
            const auto normal = normals.at(pixel + picture.crop_origin_px);
            if (!normal) continue;
            const glm::ivec2 at(glm::clamp(
                0.5 * (off + 1.0) * static_cast<double>(kBallPatches), 0.0, kBallPatches - 1.0));
            Patch& patch = patches[at.y * kBallPatches + at.x];
            patch.radiance += glm::dvec3(radiance(x, y));
            patch.normal += *normal;
            ++patch.count;
            patch.clipped = patch.clipped || isClipped(picture, x, y);
        }
    ReferenceGroup group{.name = "the grey ball", .places = {}};
    for (const auto& [number, patch] : patches) {
        const glm::dvec3 mean = patch.radiance / static_cast<double>(patch.count);
        if (patch.clipped || !(mean.x > 0.0 || mean.y > 0.0 || mean.z > 0.0)) continue;
        LightReference place;
        place.normal = glm::normalize(patch.normal);
        place.irradiance = glm::max(pi * mean / reference.reflectance, 0.0);
        place.log_sigma = reference.sigma;
        group.places.push_back(place);
    }
    if (group.places.empty())
        refuse(picture,
               "shows the grey ball clipped in every exposure, or black: it cannot tell how "
               "bright it is; add shorter or longer exposures");
    group.common_log_sigma = reference.sigma;
    group.scale_free = !reference.reflectance_known;
    return group;
}

}  // namespace

ReferenceGroup measureReference(const ProjectReference& reference,
                                const ReferencePicture& picture,
                                glm::dvec3 probe_center_m,
                                Findings& findings)
{
    ReferenceGroup group = reference.kind == ReferenceKind::Card
                               ? measureCard(reference, picture, findings)
                               : measureBall(reference, picture);
    for (LightReference& place : group.places)
        place.position_m = reference.position_m.value_or(probe_center_m);
    return group;
}

std::vector<ReferenceGroup> photographedReferences(const ProjectProbe& probe,
                                                   const EncodedImage& photo,
                                                   const Image<Rgb>& radiance,
                                                   const Camera& camera,
                                                   const std::string& name,
                                                   Findings& findings)
{
    std::vector<ReferenceGroup> groups;
    Image<Rgb> clipped;
    for (const ProjectReference& reference : probe.references) {
        if (reference.source != ProjectReference::Source::Photo) continue;
        if (clipped.empty()) {
            clipped = Image<Rgb>(radiance.width(), radiance.height(), Rgb(0.0f));
            for (std::size_t i = 0; i < clipped.pixelCount(); ++i) {
                const glm::u16vec3 code = photo.codes.pixels()[i];
                if (std::max({code.r, code.g, code.b}) >= kClipFraction * photo.max_code)
                    clipped.pixels()[i] = radiance.pixels()[i];
            }
        }
        groups.push_back(measureReference(
            reference, {radiance, clipped, {}, &camera, name}, probe.center_m, findings));
    }
    return groups;
}

std::vector<ReferenceGroup> givenReferences(const std::vector<ProjectReference>& references,
                                            glm::dvec3 probe_center_m)
{
    std::vector<ReferenceGroup> groups;
    ReferenceGroup meter{.name = "the light meter", .places = {}, .scale_free = true};
    meter.luminance_only = true;
    for (const ProjectReference& reference : references) {
        const LightReference place{reference.position_m.value_or(probe_center_m),
                                   reference.normal,
                                   reference.irradiance,
                                   reference.sigma};
        if (reference.kind == ReferenceKind::Irradiance)
            groups.push_back({.name = "the given irradiance", .places = {place}});
        else if (reference.kind == ReferenceKind::Illuminance)
            meter.places.push_back(place);
    }
    if (!meter.places.empty()) groups.push_back(std::move(meter));
    return groups;
}

}  // namespace insitu
