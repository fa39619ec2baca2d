#include "pipeline/project.h"
#include "pipeline/project_json.h"
#include "pipeline/project_keys.h"

#include <glm/glm.hpp>

#include <algorithm>

namespace insitu {

namespace {

/// One number for all channels, or one each.
glm::dvec3 readColor(const JsonNode& node)
{
    return node.value().is_array() ? node.vec3() : glm::dvec3(node.number());
}

glm::dvec3 readReflectance(const JsonNode& node)
{
    const glm::dvec3 value = readColor(node);
    for (int c = 0; c < 3; ++c)
        if (!(value[c] > 0.0 && value[c] <= 1.0))
            node.fail(
                "must be above 0 and at most 1: the share of light that it reflects (0.18 "
                "of the usual grey card)");
    return value;
}

/// Where its pictures come from: the probe's, the photograph, or its own.
void readSource(const JsonNode& node,
                const std::filesystem::path& folder,
                ProjectReference& reference)
{
    const auto in = node.find("in");
    if (node.has("images")) {
        if (in) in->fail("and images: give one, whose pictures show it, or its own");
        reference.source = ProjectReference::Source::Own;
        reference.images = readImages(node, folder);
        return;
    }
    for (const char* key : {"exposure_seconds", "f_number", "iso"})
        if (node.has(key)) node.at(key).fail("belongs to images of its own");
    if (in && readChoice(*in, {"probe", "photo"}) == "photo")
        reference.source = ProjectReference::Source::Photo;
}

void readCard(const JsonNode& node,
              const std::filesystem::path& folder,
              ProjectReference& reference)
{
    reference.kind = ReferenceKind::Card;
    readSource(node, folder, reference);
    const JsonNode area = node.at("area_px");
    if (area.size() != 4) area.fail("must be [left, top, width, height] in pixels");
    reference.area_from_px = {area.at(0).number(), area.at(1).number()};
    reference.area_size_px = {area.at(2).positive(), area.at(3).positive()};
    reference.reflectance = readReflectance(node.at("reflectance"));
}

void readGreyBall(const JsonNode& node,
                  const std::filesystem::path& folder,
                  ProjectReference& reference)
{
    reference.kind = ReferenceKind::Ball;
    readSource(node, folder, reference);
    reference.center_px = node.at("center_px").vec2();
    reference.radius_px = node.at("radius_px").positive();
    if (reference.radius_px < 4.0) node.at("radius_px").fail("must be at least 4 pixels");
    const auto reflectance = node.find("reflectance");
    reference.reflectance_known = reflectance.has_value();
    if (reflectance) reference.reflectance = readReflectance(*reflectance);
    const bool own = reference.source == ProjectReference::Source::Own;
    for (const char* key : {"view", "radius_m"})
        if (node.has(key) && !own) node.at(key).fail("belongs to images of its own");
    if (!own) return;
    reference.radius_m = node.at("radius_m").positive();
    const JsonNode view = node.at("view");
    view.expectKeys(keys::kView);
    reference.view_position_m = view.at("position_m").vec3();
    if (const auto up = view.find("up")) reference.view_up = up->vec3();
}

ProjectReference readReference(const JsonNode& node, const std::filesystem::path& folder)
{
    ProjectReference reference;
    const std::string type =
        readChoice(node.at("type"), {"card", "ball", "illuminance", "irradiance"});
    if (type == "card") {
        node.expectKeys(keys::kReferenceCard);
        readCard(node, folder, reference);
    } else if (type == "ball") {
        node.expectKeys(keys::kReferenceBall);
        readGreyBall(node, folder, reference);
    } else if (type == "illuminance") {
        node.expectKeys(keys::kReferenceIlluminance);
        reference.kind = ReferenceKind::Illuminance;
        reference.irradiance = glm::dvec3(node.at("lux").positive());
        reference.sigma = 0.05;
    } else {
        node.expectKeys(keys::kReferenceIrradiance);
        reference.kind = ReferenceKind::Irradiance;
        reference.irradiance = readColor(node.at("value"));
        for (int c = 0; c < 3; ++c)
            if (!(reference.irradiance[c] > 0.0)) node.at("value").fail("must be above 0");
    }
    if (const auto position = node.find("position_m")) reference.position_m = position->vec3();
    if (const auto normal = node.find("normal")) {
        const double length = glm::length(normal->vec3());
        if (!(length > 1e-6)) normal->fail("is no direction: what the surface faces");
        reference.normal = normal->vec3() / length;
    }
    if (const auto sigma = node.find("sigma_percent")) {
        reference.sigma = 0.01 * sigma->positive();
        if (reference.sigma < 1e-3 || reference.sigma > 0.5)
            sigma->fail("must be between 0.1 and 50: the measurement's standard deviation");
    }
    return reference;
}

}  // namespace

std::vector<ProjectReference> readReferences(const JsonNode& list,
                                             const std::filesystem::path& folder)
{
    std::vector<ProjectReference> references;
    for (std::size_t i = 0; i < list.size(); ++i)
        references.push_back(readReference(list.at(i), folder));
    const auto readings =
        std::ranges::count(references, ReferenceKind::Illuminance, &ProjectReference::kind);
    if (readings == 1)
        list.fail(
            "has a single reading in lux, whose unit is not the camera's: give at least two "
            "(one that faces the lamp, one in its shade), which compare with each other");
    return references;
}

}  // namespace insitu
