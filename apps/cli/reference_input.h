#pragma once

#include "apps/cli/command.h"
#include "pipeline/project.h"

#include <array>
#include <optional>
#include <string>
#include <vector>

namespace insitu::cli {

/// What `insitu probe` is told of the light, to solve for lamps that are clipped.
struct ReferenceArguments {
    std::optional<std::array<double, 4>> card_px;
    double card_reflectance = 0.18;
    std::array<double, 3> card_normal = {0.0, 1.0, 0.0};
    std::optional<std::array<double, 3>> grey_ball_px;
    std::optional<double> grey_ball_reflectance;
    std::vector<std::string> lux;         ///< "E,x,y,z"
    std::vector<std::string> irradiance;  ///< "R,G,B,x,y,z"
    std::optional<double> sigma_percent;
};

/// Adds --card, --card-reflectance, --card-normal, --grey-ball, --grey-ball-reflectance, --lux,
/// --irradiance and --reference-sigma.
void addReferenceOptions(CLI::App& command, ReferenceArguments& arguments);

/// As entries of a probe's `references`; InputError for values without meaning.
[[nodiscard]] std::vector<ProjectReference> referencesOf(const ReferenceArguments& arguments);

}  // namespace insitu::cli
