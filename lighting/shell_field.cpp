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
                        node_of.push_back(static_cast<std::uint32_t>(
                            (shell * options.polars + j) * (across + 1) + i));
                    }
    std::vector<IrradianceVector> hidden(places.size());
    hiddenVectors(object, places, hidden);
    grid_ = {options.azimuths,
             options.polars,
             options.shells,
             static_cast<float>(options.first_radii),
             static_cast<float>(options.last_radii),
             static_cast<float>((options.shells - 1) /
                                std::log2(options.last_radii / options.first_radii))};
    // One more, since a look-up reads beyond the node it means.
    nodes_.assign(
        static_cast<std::size_t>(grid_.sphere()) * static_cast<std::size_t>(grid_.shells) + 1, {});
    for (std::size_t i = 0; i < places.size(); ++i)
        for (int axis = 0; axis < 3; ++axis)
            nodes_[node_of[i]].axis[axis] = {hidden[i].channels[0][axis],
                                             hidden[i].channels[1][axis],
                                             hidden[i].channels[2][axis],
                                             0.0f};
    for (std::size_t row = 0; row + 1 < nodes_.size(); row += static_cast<std::size_t>(grid_.row()))
        nodes_[row + static_cast<std::size_t>(across)] = nodes_[row];
}

IrradianceVector ShellField::at(glm::vec3 x) const
{
    const fiv::ShellCorners corners = fiv::shellCorners(grid_, x);
    IrradianceVector found;
    for (std::size_t corner = 0; corner < 8; ++corner) {
        const std::size_t node = static_cast<std::size_t>(corners.node) + (corner & 1u) +
                                 (corner >> 1 & 1u) * static_cast<std::size_t>(grid_.row()) +
                                 (corner >> 2) * static_cast<std::size_t>(grid_.sphere());
        for (std::size_t c = 0; c < 3; ++c)
            for (int axis = 0; axis < 3; ++axis)
                found.channels[c][axis] += corners.weights[corner] * nodes_[node].axis[axis][c];
    }
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
        const std::size_t count = std::min(kPlacesAtATime, places.size() - begin);
        fiv::lookUpShells(bestInstructionSet(),
                          grid_,
                          nodes_,
                          half_extent_,
                          places.subspan(begin, count),
                          normals.subspan(begin, count),
                          hidden.subspan(begin, count));
    });
}

}  // namespace insitu
