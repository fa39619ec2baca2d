#include "core/check.h"
#include "core/parallel.h"
#include "lighting/fiv_field.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace insitu {

using std::numbers::pi;

namespace {

/// Samples of a shell that are summed together: a patch, so that they see the same directions.
constexpr int kPatchAzimuths = 8;
constexpr int kPatchPolars = 4;
/// Places that one task looks up.
constexpr std::size_t kPlacesAtATime = 4096;

using Vector4 = float __attribute__((vector_size(16)));

Vector4 load(const std::array<float, 4>& from)
{
    return Vector4{from[0], from[1], from[2], from[3]};
}

/// atan2 in units of a full turn, [0, 1), off by 2e-7: a polynomial on the octant next to +x.
/// Source: [AbrSte64] 4.4.49, eight terms.
float turnOf(float x, float z)
{
    const float ax = std::abs(x);
    const float az = std::abs(z);
    const float most = std::max(ax, az);
    const float t = most > 0.0f ? std::min(ax, az) / most : 0.0f;
    const float s = t * t;
    float angle = -0.0161657367f + s * 0.0028662257f;
    angle = 0.0429096138f + s * angle;
    angle = -0.0752896400f + s * angle;
    angle = 0.1065626393f + s * angle;
    angle = -0.1420889944f + s * angle;
    angle = 0.1999355085f + s * angle;
    angle = -0.3333314528f + s * angle;
    angle = (1.0f + s * angle) * t * static_cast<float>(0.5 / pi);
    angle = az > ax ? 0.25f - angle : angle;
    angle = x < 0.0f ? 0.5f - angle : angle;
    angle = z < 0.0f ? 1.0f - angle : angle;
    return angle;
}

glm::vec3 samplePlace(const ShellFieldOptions& o, int azimuth, int polar, int shell)
{
    const double phi = 2.0 * pi * azimuth / o.azimuths;
    const double theta = pi * polar / (o.polars - 1);
    const double rho =
        o.first_radii * std::pow(o.last_radii / o.first_radii, shell / (o.shells - 1.0));
    return glm::vec3(rho * std::sin(theta) * std::cos(phi),
                     rho * std::cos(theta),
                     rho * std::sin(theta) * std::sin(phi));
}

}  // namespace

Findings ShellFieldOptions::validate() const
{
    Findings problems;
    const auto require = [&](bool holds, const std::string& message) {
        if (!holds) problems.push_back({Severity::Error, "shell-field-options", message});
    };
    require(azimuths >= 4 && azimuths <= 4096,
            fmt::format("azimuths is {}, not in [4, 4096]", azimuths));
    require(polars >= 3 && polars <= 2048, fmt::format("polars is {}, not in [3, 2048]", polars));
    require(shells >= 2 && shells <= 256, fmt::format("shells is {}, not in [2, 256]", shells));
    require(first_radii > 0.0 && first_radii < last_radii && last_radii < 1e6,
            fmt::format("radii from {} to {}: not 0 < first < last", first_radii, last_radii));
    return problems;
}

ShellField::ShellField(const ObjectLight& object, const ShellFieldOptions& options)
    : options_(options), half_extent_(object.local().half_extent)
{
    requireValid(options.validate(), "shell field options");
    std::vector<glm::vec3> places;
    std::vector<std::uint32_t> node_of;
    const int across = options.azimuths;
    for (int shell = 0; shell < options.shells; ++shell)
        for (int row = 0; row < options.polars; row += kPatchPolars)
            for (int column = 0; column < across; column += kPatchAzimuths)
                for (int j = row; j < std::min(row + kPatchPolars, options.polars); ++j)
                    for (int i = column; i < std::min(column + kPatchAzimuths, across); ++i) {
                        places.push_back(samplePlace(options, i, j, shell));
                        node_of.push_back(
                            static_cast<std::uint32_t>((shell * options.polars + j) * across + i));
                    }
    std::vector<IrradianceVector> hidden(places.size());
    hiddenVectors(object, places, hidden);
    nodes_.resize(places.size());
    for (std::size_t i = 0; i < places.size(); ++i)
        for (int axis = 0; axis < 3; ++axis)
            nodes_[node_of[i]].axis[axis] = {hidden[i].channels[0][axis],
                                             hidden[i].channels[1][axis],
                                             hidden[i].channels[2][axis],
                                             0.0f};
}

ShellField::Corners ShellField::cornersOf(glm::vec3 x) const
{
    const ShellFieldOptions& o = options_;
    const float distance = glm::length(x);
    const float across = std::sqrt(x.x * x.x + x.z * x.z);
    const auto first = static_cast<float>(o.first_radii);
    const auto last = static_cast<float>(o.last_radii);
    const float azimuth = turnOf(x.x, x.z) * static_cast<float>(o.azimuths);
    const float polar = 2.0f * turnOf(x.y, across) * static_cast<float>(o.polars - 1);
    const float shell = std::log2(std::clamp(distance, first, last) / first) /
                        std::log2(last / first) * static_cast<float>(o.shells - 1);

    const int i = std::min(static_cast<int>(azimuth), o.azimuths - 1);
    const int j = std::clamp(static_cast<int>(polar), 0, o.polars - 2);
    const int k = std::clamp(static_cast<int>(shell), 0, o.shells - 2);
    const float ti = azimuth - static_cast<float>(i);
    const float tj = polar - static_cast<float>(j);
    const float tk = shell - static_cast<float>(k);
    // The object's solid angle falls with the square of its distance.
    const float fall = distance > last ? (last / distance) * (last / distance) : 1.0f;
    Corners corners;
    for (int corner = 0; corner < 8; ++corner) {
        const int a = corner & 1;
        const int b = (corner >> 1) & 1;
        const int c = corner >> 2;
        const int column = i + a < o.azimuths ? i + a : 0;
        const auto slot = static_cast<std::size_t>(corner);
        corners.nodes[slot] =
            static_cast<std::uint32_t>(((k + c) * o.polars + j + b) * o.azimuths + column);
        corners.weights[slot] =
            fall * (a ? ti : 1.0f - ti) * (b ? tj : 1.0f - tj) * (c ? tk : 1.0f - tk);
    }
    return corners;
}

IrradianceVector ShellField::at(glm::vec3 x) const
{
    const Corners corners = cornersOf(x);
    IrradianceVector found;
    for (std::size_t corner = 0; corner < 8; ++corner)
        for (std::size_t c = 0; c < 3; ++c)
            for (int axis = 0; axis < 3; ++axis)
                found.channels[c][axis] +=
                    corners.weights[corner] * nodes_[corners.nodes[corner]].axis[axis][c];
    return found;
}

void ShellField::hiddenIrradiance(std::span<const glm::vec3> places,
                                  std::span<const glm::vec3> normals,
                                  std::span<Rgb> hidden) const
{
    INSITU_CHECK(places.size() == hidden.size() && places.size() == normals.size(),
                 "{} and {} for {}",
                 hidden.size(),
                 normals.size(),
                 places.size());
    const std::size_t tasks = (places.size() + kPlacesAtATime - 1) / kPlacesAtATime;
    parallelFor(0, static_cast<std::int64_t>(tasks), [&](std::int64_t task) {
        const std::size_t begin = static_cast<std::size_t>(task) * kPlacesAtATime;
        const std::size_t end = std::min(begin + kPlacesAtATime, places.size());
        for (std::size_t i = begin; i < end; ++i) {
            const glm::vec3 n = normals[i];
            // Height of the object's centre over the place's plane, in its half extents along the
            // normal: d / R of the thesis.
            const float height = -glm::dot(places[i], n) / glm::dot(half_extent_, glm::abs(n));
            if (height <= -1.0f) {
                hidden[i] = Rgb(0.0f);
                continue;
            }
            const Corners corners = cornersOf(places[i]);
            Vector4 sum{};
            for (std::size_t corner = 0; corner < 8; ++corner) {
                const Node& node = nodes_[corners.nodes[corner]];
                sum +=
                    corners.weights[corner] * (load(node.axis[0]) * n.x + load(node.axis[1]) * n.y +
                                               load(node.axis[2]) * n.z);
            }
            const float share = std::min(0.5f * (height + 1.0f), 1.0f);
            hidden[i] = Rgb(std::max(0.0f, share * sum[0]),
                            std::max(0.0f, share * sum[1]),
                            std::max(0.0f, share * sum[2]));
        }
    });
}

}  // namespace insitu
