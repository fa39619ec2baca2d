#include "apps/cli/reference_input.h"

#include "core/check.h"

#include <fmt/format.h>

#include <cmath>
#include <sstream>

namespace insitu::cli {

namespace {

/// "1,2.5,3" -> numbers, as many as `count`.
std::vector<double> numbersOf(const std::string& flag, const std::string& text, std::size_t count)
{
    std::vector<double> numbers;
    std::istringstream stream(text);
    for (std::string part; std::getline(stream, part, ',');) {
        std::size_t used = 0;
        double value = NAN;
        try {
            value = std::stod(part, &used);
        } catch (const std::exception&) {
            used = 0;
        }
        if (used == 0 || used != part.size() || !std::isfinite(value))
            throw InputError(flag, fmt::format("'{}' in '{}' is no number", part, text));
        numbers.push_back(value);
    }
    if (numbers.size() != count)
        throw InputError(
            flag,
            fmt::format(
                "'{}' has {} numbers separated by commas, not {}", text, numbers.size(), count));
    return numbers;
}

glm::dvec3 directionOf(const std::string& flag, double x, double y, double z)
{
    const glm::dvec3 direction(x, y, z);
    const double length = glm::length(direction);
    if (!(std::isfinite(length) && length > 1e-6))
        throw InputError(flag, "what the surface faces must be a direction, x,y,z");
    return direction / length;
}

}  // namespace

void addReferenceOptions(CLI::App& command, ReferenceArguments& arguments)
{
    command
        .add_option("--card",
                    arguments.card_px,
                    "Grey card in the pictures: left,top,width,height in pixels. It, a grey ball "
                    "or readings of a meter tell how strong lamps are that are clipped")
        ->delimiter(',');
    command.add_option("--card-reflectance", arguments.card_reflectance, "Its diffuse reflectance")
        ->check(CLI::Range(0.01, 1.0))
        ->capture_default_str();
    command
        .add_option(
            "--card-normal", arguments.card_normal, "What it faces, x,y,z in the room's axes")
        ->delimiter(',')
        ->capture_default_str();
    command
        .add_option("--grey-ball",
                    arguments.grey_ball_px,
                    "Diffuse ball in the pictures: x,y of its centre and radius in pixels")
        ->delimiter(',');
    command
        .add_option("--grey-ball-reflectance",
                    arguments.grey_ball_reflectance,
                    "Its reflectance (default: unknown, its shading tells)")
        ->check(CLI::Range(0.01, 1.0));
    command
        .add_option("--lux",
                    arguments.lux,
                    "Reading of a light meter at the probe: E,x,y,z with what it faced; at least "
                    "two, as their unit is not the camera's")
        ->allow_extra_args(false);
    command
        .add_option("--irradiance",
                    arguments.irradiance,
                    "Irradiance in the pictures' unit of radiance: R,G,B,x,y,z with what the "
                    "surface faces")
        ->allow_extra_args(false);
    command
        .add_option("--reference-sigma",
                    arguments.sigma_percent,
                    "Relative standard deviation of each of them, % (default: 3, of lux 5)")
        ->check(CLI::Range(0.1, 50.0));
}

std::vector<ProjectReference> referencesOf(const ReferenceArguments& arguments)
{
    std::vector<ProjectReference> references;
    if (const auto& card = arguments.card_px) {
        ProjectReference reference;
        reference.area_from_px = {(*card)[0], (*card)[1]};
        reference.area_size_px = {(*card)[2], (*card)[3]};
        if (!((*card)[2] > 0.0 && (*card)[3] > 0.0))
            throw InputError("--card", "must have a width and a height above 0");
        reference.reflectance = glm::dvec3(arguments.card_reflectance);
        const auto& normal = arguments.card_normal;
        reference.normal = directionOf("--card-normal", normal[0], normal[1], normal[2]);
        references.push_back(reference);
    }
    if (const auto& ball = arguments.grey_ball_px) {
        ProjectReference reference;
        reference.kind = ReferenceKind::Ball;
        reference.center_px = {(*ball)[0], (*ball)[1]};
        reference.radius_px = (*ball)[2];
        if (!(reference.radius_px >= 4.0))
            throw InputError("--grey-ball", "must have a radius of at least 4 pixels");
        reference.reflectance_known = arguments.grey_ball_reflectance.has_value();
        reference.reflectance = glm::dvec3(arguments.grey_ball_reflectance.value_or(1.0));
        references.push_back(reference);
    }
    for (const std::string& text : arguments.lux) {
        const std::vector<double> v = numbersOf("--lux", text, 4);
        if (!(v[0] > 0.0)) throw InputError("--lux", "must be above 0");
        ProjectReference reference;
        reference.kind = ReferenceKind::Illuminance;
        reference.irradiance = glm::dvec3(v[0]);
        reference.normal = directionOf("--lux", v[1], v[2], v[3]);
        reference.sigma = 0.05;
        references.push_back(reference);
    }
    if (arguments.lux.size() == 1)
        throw InputError("--lux",
                         "a single reading says nothing, as its unit is not the camera's: give "
                         "at least two (one that faces the lamp, one in its shade), which compare "
                         "with each other");
    for (const std::string& text : arguments.irradiance) {
        const std::vector<double> v = numbersOf("--irradiance", text, 6);
        if (!(v[0] > 0.0 && v[1] > 0.0 && v[2] > 0.0))
            throw InputError("--irradiance", "must be above 0 in each channel");
        ProjectReference reference;
        reference.kind = ReferenceKind::Irradiance;
        reference.irradiance = {v[0], v[1], v[2]};
        reference.normal = directionOf("--irradiance", v[3], v[4], v[5]);
        references.push_back(reference);
    }
    if (arguments.sigma_percent)
        for (ProjectReference& reference : references)
            reference.sigma = 0.01 * *arguments.sigma_percent;
    return references;
}

}  // namespace insitu::cli
