#include "core/color.h"
#include "core/parallel.h"
#include "lighting/room_light.h"
#include "lighting/see_through.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace insitu {

namespace {

/// Points per texel side at which the probe is looked up.
constexpr int kBakeGrid = 2;

/// Times brighter than a white surface could be: then it is no surface.
constexpr float kGapBrightness = 1.5f;

/// Where an unseen direction lies from the nearest seen one: above, below or beside it.
std::uint8_t bandOf(glm::vec3 direction, glm::vec3 nearest)
{
    const float higher = std::asin(std::clamp(direction.y, -1.0f, 1.0f)) -
                         std::asin(std::clamp(nearest.y, -1.0f, 1.0f));
    const float apart = std::acos(std::clamp(glm::dot(direction, nearest), -1.0f, 1.0f));
    if (std::abs(higher) < 0.7f * apart) return kBesideBand;
    return higher > 0.0f ? kAboveBand : kBelowBand;
}

}  // namespace

void RoomLight::findGaps(const EnvironmentMap& probe, glm::dvec3 center)
{
    if (proxy_.openings().empty()) return;
    std::vector<std::uint8_t> gaps(radiance_.size(), 0);
    std::size_t count = 0;
    for (std::size_t face = 0; face < radiance_.faceCount(); ++face) {
        if (!proxy_.faces()[face].solid) continue;
        // A white surface at the probe's place, facing as this one, would be this bright.
        const glm::dvec3 normal = proxy_.faces()[face].normal;
        const float limit =
            luminance(Rgb(irradiance(probe, normal))) / std::numbers::pi_v<float> * kGapBrightness;
        for (const std::size_t i : radiance_.texelsOf(face)) {
            const glm::dvec3 point = proxy_.pointOn(face, radiance_.centerUv(i));
            const glm::dvec3 direction = glm::normalize(point - center);
            if (glm::dot(direction, normal) >= 0.0 || !proxy_.mutuallyVisible(center, point) ||
                luminance(lookUp(probe, direction)) <= limit)
                continue;
            // Leave this box and whatever solid stands behind it: is there an opening?
            const auto beyond = intersectBehindBoxes(proxy_, point, direction);
            if (!beyond || !beyond->opening) continue;
            gaps[i] = 1;
            ++count;
        }
    }
    if (count == 0) return;
    gap_ = std::move(gaps);
    findings_.push_back(
        {Severity::Info,
         "light-through-gaps",
         "the probe saw the light of an opening through solid boxes, brighter than they could "
         "reflect: there the boxes let light pass"});
}

void RoomLight::bakeProbe(const EnvironmentMap& probe, glm::dvec3 center, Progress& progress)
{
    // Average the probe over the points of each texel that it saw and that are no opening.
    for (std::size_t face = 0; face < radiance_.faceCount(); ++face) {
        progress.checkpoint();
        const int columns = radiance_.columns(face);
        parallelFor(0, radiance_.rows(face), [&](std::int64_t row) {
            for (int column = 0; column < columns; ++column) {
                const typename FaceGrid<Rgb>::Texel texel{face, column, static_cast<int>(row)};
                const std::size_t index =
                    radiance_.firstOf(face) + static_cast<std::size_t>(row * columns + column);
                Rgb sum(0.0f);
                int seen = 0;
                int solid = 0;
                Rgb clipped(0.0f);
                for (int k = 0; k < kBakeGrid * kBakeGrid; ++k) {
                    const glm::dvec2 inside((k % kBakeGrid + 0.5) / kBakeGrid,
                                            (k / kBakeGrid + 0.5) / kBakeGrid);
                    const glm::dvec2 uv = radiance_.uv(texel, inside);
                    if (proxy_.faces()[face].triangle && uv.x + uv.y > 1.0) continue;
                    const glm::dvec3 point = proxy_.pointOn(face, uv);
                    if (proxy_.insideOpening(face, point) || (!gap_.empty() && gap_[index]))
                        continue;
                    ++solid;
                    const glm::dvec3 way = point - center;
                    const bool facing = proxy_.faces()[face].two_sided ||
                                        glm::dot(way, proxy_.faces()[face].normal) < 0.0;
                    if (!facing || !proxy_.mutuallyVisible(center, point)) continue;
                    sum += lookUp(probe, glm::normalize(way));
                    clipped += lookUpClipped(probe, glm::normalize(way));
                    ++seen;
                }
                radiance_.setValid(index, solid > 0);
                clipped_.setValid(index, solid > 0);
                if (seen == 0) continue;
                radiance_[index] = sum / static_cast<float>(seen);
                probe_saw_[index] = 1;
                clipped_[index] = clipped / static_cast<float>(seen);
            }
        });
    }
}

void RoomLight::fillFromPhotograph(const PhotographedRadiance& photograph)
{
    const Camera& camera = photograph.camera;
    parallelFor(0, static_cast<std::int64_t>(radiance_.faceCount()), [&](std::int64_t f) {
        const std::size_t face = static_cast<std::size_t>(f);
        for (const std::size_t i : radiance_.texelsOf(face)) {
            if (probe_saw_[i] || !radiance_.valid(i)) continue;
            const glm::dvec3 point = proxy_.pointOn(face, radiance_.centerUv(i));
            const auto pixel = camera.project(point);
            if (!pixel || pixel->x < 0 || pixel->y < 0 || pixel->x >= camera.width ||
                pixel->y >= camera.height || !proxy_.mutuallyVisible(camera.position_m, point))
                continue;
            radiance_[i] = sampleBilinear(photograph.radiance, pixel->x, pixel->y);
            photo_saw_[i] = 1;
        }
    });
}

void RoomLight::lookThroughBoxes(const PhotographedRadiance& photograph)
{
    std::vector<std::uint8_t> known(radiance_.size());
    for (std::size_t i = 0; i < known.size(); ++i)
        known[i] = probe_saw_[i] || photo_saw_[i];
    see_through_ = findSeeThrough(photograph.camera, photograph.radiance, proxy_, radiance_, known);
}

void RoomLight::extendBeyondOpenings(const EnvironmentMap& probe, glm::dvec3 center)
{
    const int width = probe.pixels.width();
    const int height = probe.pixels.height();
    outside_ = probe;
    outside_seen_.assign(probe.pixels.pixelCount(), 0);
    outside_band_.assign(probe.pixels.pixelCount(), kMeasured);

    // A texel is seen when the ways through its centre and corners all leave the room.
    const auto leaves = [&](double x, double y) {
        const auto hit = intersect(center, environmentDirectionFromUv({x / width, y / height}));
        return !hit || hit->opening;
    };
    parallelFor(0, height, [&](std::int64_t y) {
        for (int x = 0; x < width; ++x) {
            const double row = static_cast<double>(y);
            const bool seen = leaves(x + 0.5, row + 0.5) && leaves(x, row) && leaves(x + 1, row) &&
                              leaves(x, row + 1) && leaves(x + 1, row + 1);
            const std::size_t i = static_cast<std::size_t>(y * width + x);
            outside_seen_[i] = seen;
            if (!seen && !outside_.clipped.empty()) outside_.clipped.pixels()[i] = Rgb(0.0f);
        }
    });

    // Texels on the rim of what is seen are the nearest ones to all that is not.
    struct RimTexel {
        glm::vec3 direction;
        Rgb radiance;
    };
    std::vector<RimTexel> rim;
    const auto seenAt = [&](int x, int y) {
        return outside_seen_[static_cast<std::size_t>(y * width + (x + width) % width)] != 0;
    };
    const auto directionOf = [&](int x, int y) {
        return environmentDirectionFromUv({(x + 0.5) / width, (y + 0.5) / height});
    };
    bool all_seen = true;
    for (int y = 0; y < height; ++y) {
        for (int x = 0; x < width; ++x) {
            all_seen = all_seen && seenAt(x, y);
            if (!seenAt(x, y)) continue;
            const bool inner = y > 0 && y + 1 < height && seenAt(x - 1, y) && seenAt(x + 1, y) &&
                               seenAt(x, y - 1) && seenAt(x, y + 1);
            if (!inner) rim.push_back({glm::vec3(directionOf(x, y)), probe.pixels(x, y)});
        }
    }
    if (all_seen) return;
    if (rim.empty()) {
        if (!proxy_.openings().empty())
            findings_.push_back({Severity::Warning,
                                 "light-opening-unseen",
                                 "the probe sees nothing through the openings; what lies beyond "
                                 "them is taken from the probe's own directions"});
        return;
    }
    parallelFor(0, height, [&](std::int64_t row) {
        const int y = static_cast<int>(row);
        for (int x = 0; x < width; ++x) {
            if (seenAt(x, y)) continue;
            const glm::vec3 direction(directionOf(x, y));
            const RimTexel* nearest = &rim.front();
            float best = -2.0f;
            for (const RimTexel& texel : rim) {
                const float closeness = glm::dot(direction, texel.direction);
                if (closeness > best) {
                    best = closeness;
                    nearest = &texel;
                }
            }
            outside_.pixels(x, y) = nearest->radiance;
            outside_band_[static_cast<std::size_t>(y * width + x)] =
                bandOf(direction, nearest->direction);
        }
    });
}

}  // namespace insitu
