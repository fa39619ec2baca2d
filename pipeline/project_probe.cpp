#include "pipeline/project.h"
#include "pipeline/project_json.h"
#include "pipeline/project_keys.h"

#include <glm/glm.hpp>

#include <algorithm>
#include <cmath>

namespace insitu {

Exposure readExposure(const JsonNode& node)
{
    Exposure exposure;
    if (const auto value = node.find("exposure_seconds")) exposure.seconds = value->positive();
    if (const auto value = node.find("f_number")) exposure.f_number = value->positive();
    if (const auto value = node.find("iso")) exposure.iso = value->positive();
    return exposure;
}

std::vector<ProjectImage> readImages(const JsonNode& node, const std::filesystem::path& folder)
{
    const JsonNode list = node.at("images");
    if (list.size() == 0) list.fail("is empty; name the pictures of the bracket");

    Exposure common;
    if (const auto value = node.find("f_number")) common.f_number = value->positive();
    if (const auto value = node.find("iso")) common.iso = value->positive();
    const auto times = node.find("exposure_seconds");
    const bool one_each = times && times->value().is_array();
    if (one_each && times->size() != list.size())
        times->fail(fmt::format("has {} times for {} images", times->size(), list.size()));

    std::vector<ProjectImage> images;
    for (std::size_t i = 0; i < list.size(); ++i) {
        const JsonNode item = list.at(i);
        ProjectImage image;
        if (item.value().is_object()) {
            image = readImage(item, folder);
        } else {
            image.path = existingFile(item, folder);
        }
        Exposure& own = image.exposure;
        if (times && !own.seconds)
            own.seconds = one_each ? times->at(i).positive() : times->positive();
        if (!own.f_number) own.f_number = common.f_number;
        if (!own.iso) own.iso = common.iso;
        images.push_back(std::move(image));
    }
    return images;
}

namespace {

void readBall(const JsonNode& node, ProjectView& view)
{
    node.expectKeys(keys::kBall);
    view.find_outline = !node.has("center_px") && !node.has("radius_px");
    if (!view.find_outline) {
        view.ball.center_px = node.at("center_px").vec2();
        view.ball.radius_px = node.at("radius_px").positive();
    }
    view.ball.radius_m = node.at("radius_m").positive();
    if (const auto value = node.find("reflectance")) {
        view.ball.reflectance = value->positive();
        (void)readFraction(*value);
    }
    if (const auto value = node.find("crop_origin_px")) view.crop_origin_px = value->vec2();
}

/// The ball's camera; `view.ball` is known already.
void readCamera(const JsonNode& node, bool center_known, ProjectView& view)
{
    if (node.value().is_string()) {
        (void)readChoice(node, {"photo"});
        return;
    }
    if (!node.value().is_object()) node.fail("must be \"photo\" or {\"position_m\": [x, y, z]}");
    node.expectKeys(keys::kView);
    const JsonNode position = node.at("position_m");
    view.view_position_m = position.vec3();
    const glm::dvec3 to_ball = view.ball.center_m - *view.view_position_m;
    const double distance = glm::length(to_ball);
    if (center_known && distance <= view.ball.radius_m)
        position.fail(
            fmt::format("lies {} m from the ball's centre, inside the ball of radius {} m",
                        distance,
                        view.ball.radius_m));
    if (const auto up = node.find("up")) {
        view.view_up = up->vec3();
        if (!(glm::length(view.view_up) > 0.0)) up->fail("is no direction");
    }
    // The ball camera keeps `up` upwards (capture/light_probe.h), so it cannot look along it.
    if (center_known &&
        std::abs(glm::dot(to_ball, view.view_up)) > 0.9999 * distance * glm::length(view.view_up))
        position.fail(node.has("up")
                          ? "lies along \"up\" from the ball: that says nothing about what is "
                            "upwards in the picture"
                          : "the ball's camera would look straight up or down, where Y up is "
                            "undefined; give \"up\", the direction that is upwards in the picture");
}

ProjectView readProbeView(const JsonNode& node,
                          const std::filesystem::path& folder,
                          const ProjectProbe& probe)
{
    ProjectView view;
    if (probe.kind == ProbeKind::MirrorBall) {
        readBall(node.at("ball"), view);
        view.ball.center_m = probe.center_m;
        readCamera(node.at("view"), !probe.center_from_outline, view);
        if (const auto mask = node.find("mask")) view.mask = existingFile(*mask, folder);
    } else {
        for (const char* key : {"ball", "view", "mask"})
            if (node.has(key)) node.at(key).fail("belongs to a mirror ball");
    }
    view.images = readImages(node, folder);
    return view;
}

}  // namespace

ProjectImage readImage(const JsonNode& node, const std::filesystem::path& folder)
{
    node.expectKeys(keys::kImage);
    return {existingFile(node.at("image"), folder), readExposure(node)};
}

ProjectProbe readProbe(const JsonNode& node, const std::filesystem::path& folder)
{
    node.expectKeys(keys::kProbe);
    ProjectProbe probe;
    const std::string kind =
        readChoice(node.at("kind"), {"mirror-ball", "angular", "latlong", "cube-cross"});
    probe.kind = kind == "mirror-ball" ? ProbeKind::MirrorBall
                 : kind == "angular"   ? ProbeKind::Angular
                 : kind == "latlong"   ? ProbeKind::LatLong
                                       : ProbeKind::CubeCross;
    const JsonNode center = node.at("center_m");
    if (center.value().is_string()) {
        (void)readChoice(center, {"from-outline"});
        probe.center_from_outline = true;
    } else {
        probe.center_m = center.vec3();
    }
    if (const auto views = node.find("views")) {
        if (probe.kind != ProbeKind::MirrorBall) views->fail("belongs to a mirror ball");
        for (const std::string_view key : keys::kProbeView)
            if (node.has(key)) node.at(key).fail("belongs into each of \"views\"");
        if (views->size() == 0) views->fail("is empty; describe at least one view of the ball");
        for (std::size_t i = 0; i < views->size(); ++i) {
            views->at(i).expectKeys(keys::kProbeView);
            probe.views.push_back(readProbeView(views->at(i), folder, probe));
        }
    } else {
        probe.views.push_back(readProbeView(node, folder, probe));
    }
    const auto by_photo = [&](const ProjectView& view) {
        return probe.kind == ProbeKind::MirrorBall && !view.view_position_m;
    };
    if (probe.center_from_outline && std::ranges::none_of(probe.views, by_photo))
        center.fail("\"from-outline\" needs a mirror ball with \"view\": \"photo\"");
    if (probe.center_from_outline && std::ranges::none_of(probe.views, [&](const ProjectView& v) {
            return by_photo(v) && !v.find_outline;
        }))
        center.fail("\"from-outline\" needs the outline: give the ball's center_px and radius_px");
    if (const auto response = node.find("response"))
        probe.response = existingFile(*response, folder);
    if (const auto references = node.find("references"))
        probe.references = readReferences(*references, folder);
    for (std::size_t i = 0; i < probe.references.size(); ++i)
        if (probe.kind != ProbeKind::MirrorBall &&
            probe.references[i].kind == ReferenceKind::Ball &&
            probe.references[i].source == ProjectReference::Source::Probe)
            node.at("references")
                .at(i)
                .fail(
                    "is a grey ball in pictures of the whole sphere, whose camera is not known: "
                    "give "
                    "it images of its own, or \"in\": \"photo\"");
    return probe;
}

ProjectProbe readProbeFile(const std::filesystem::path& path)
{
    const Json json = readJson(path);
    const JsonNode root(json, path.string());
    ProjectProbe probe = readProbe(root, std::filesystem::absolute(path).parent_path());
    for (const ProjectView& view : probe.views)
        if (probe.kind == ProbeKind::MirrorBall && !view.view_position_m)
            root.fail("has a view \"photo\", but there is no photograph here: give position_m");
    for (const ProjectReference& reference : probe.references)
        if (reference.source == ProjectReference::Source::Photo)
            root.at("references").fail("has one in the photograph, and there is none here");
    return probe;
}

}  // namespace insitu
