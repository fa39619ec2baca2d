#include "apps/cli/command.h"
#include "calib/camera_formats.h"
#include "calib/line_segments.h"
#include "core/color.h"
#include "core/io/image_io.h"
#include "core/io/json.h"
#include "core/io/model_io.h"
#include "pipeline/project.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <iostream>
#include <limits>

namespace insitu::cli {

namespace {

namespace fs = std::filesystem;

/// What is known about a file, in the order in which it is told; the keys carry their units.
struct Description {
    Json facts;
    Findings findings;
};

template <class Value>
void addIfKnown(Json& facts, const char* key, const std::optional<Value>& value)
{
    if (value) facts[key] = *value;
}

void addText(Json& facts, const char* key, const std::string& text)
{
    if (!text.empty()) facts[key] = text;
}

/// 1 is the largest code. A clipped value has it, or 0, in any channel.
double shareOf(const EncodedImage& image, int code)
{
    std::size_t count = 0;
    for (const glm::u16vec3& pixel : image.codes.pixels())
        count += pixel.r == code || pixel.g == code || pixel.b == code ? 1 : 0;
    return static_cast<double>(count) / static_cast<double>(image.codes.pixelCount());
}

Description describePhoto(const fs::path& path)
{
    const Photo photo = readPhoto(path);
    const PhotoMetadata& metadata = photo.metadata;
    Description description;
    Json& facts = description.facts;
    facts["kind"] = "photograph";
    facts["width"] = photo.image.codes.width();
    facts["height"] = photo.image.codes.height();
    facts["bits"] = photo.image.max_code == 255 ? 8 : 16;
    facts["share_at_largest_code"] = shareOf(photo.image, photo.image.max_code);
    facts["share_at_code_0"] = shareOf(photo.image, 0);
    addText(facts, "make", metadata.make);
    addText(facts, "model", metadata.model);
    addIfKnown(facts, "exposure_seconds", metadata.exposure.seconds);
    addIfKnown(facts, "f_number", metadata.exposure.f_number);
    addIfKnown(facts, "iso", metadata.exposure.iso);
    addIfKnown(facts, "relative_exposure", metadata.exposure.relative());
    addIfKnown(facts, "focal_mm", metadata.focal_mm);
    addIfKnown(facts, "focal_35mm", metadata.focal_35mm);
    addIfKnown(facts, "focal_px", metadata.focal_px);
    facts["orientation_as_stored"] = metadata.orientation;
    facts["color_profile"] = metadata.color.name;
    facts["raw"] = metadata.color.transfer_is_response;
    if (!metadata.exposure.seconds)
        description.findings.push_back(
            {Severity::Info,
             "info-no-exposure",
             "no exposure time in EXIF: in a bracket or a project it has to be given by hand "
             "(exposure_seconds)"});
    append(description.findings, photoFindings(metadata, path.filename().string()));
    return description;
}

void addRadianceFacts(Json& facts, const Image<Rgb>& pixels)
{
    double sum = 0.0;
    float largest = 0.0f;
    float smallest = std::numeric_limits<float>::max();
    std::size_t black = 0;
    for (const Rgb& pixel : pixels.pixels()) {
        const float value = luminance(pixel);
        sum += value;
        largest = std::max(largest, value);
        if (value > 0.0f)
            smallest = std::min(smallest, value);
        else
            ++black;
    }
    const auto count = static_cast<double>(pixels.pixelCount());
    facts["width"] = pixels.width();
    facts["height"] = pixels.height();
    facts["luminance_mean"] = sum / count;
    facts["luminance_max"] = largest;
    if (largest > 0.0f) {
        facts["luminance_min_above_0"] = smallest;
        facts["range_stops"] = std::log2(static_cast<double>(largest) / smallest);
    }
    facts["share_black"] = static_cast<double>(black) / count;
    if (pixels.width() == 2 * pixels.height()) facts["shape"] = "2:1, as an equirectangular map";
}

/// Channels of an EXR beyond plain colour, with their ranges.
void addChannelFacts(Json& facts, const std::vector<ExrChannel>& channels)
{
    for (const ExrChannel& channel : channels) {
        std::size_t not_finite = 0;
        float low = std::numeric_limits<float>::max();
        float high = std::numeric_limits<float>::lowest();
        for (const float value : channel.values.pixels()) {
            if (!std::isfinite(value)) {
                ++not_finite;
                continue;
            }
            low = std::min(low, value);
            high = std::max(high, value);
        }
        Json& entry = facts["channels"][channel.name];
        if (low <= high) entry = {{"min", low}, {"max", high}};
        if (not_finite > 0) entry["not_finite"] = not_finite;
    }
}

Description describeRadiance(const fs::path& path)
{
    Description description;
    description.facts["kind"] = "radiance image";
    if (path.extension() != ".exr" && path.extension() != ".EXR") {
        addRadianceFacts(description.facts, readRadiance(path).pixels);
        return description;
    }
    const std::vector<ExrChannel> channels = readLayeredExr(path);
    const bool colored = std::any_of(channels.begin(), channels.end(), [](const auto& channel) {
        return channel.name == "R" || channel.name == "Y";
    });
    if (colored) {
        addRadianceFacts(description.facts, readRadiance(path).pixels);
    } else {
        description.facts["kind"] = "layers";
        description.facts["width"] = channels.front().values.width();
        description.facts["height"] = channels.front().values.height();
    }
    addChannelFacts(description.facts, channels);
    return description;
}

Json toList(glm::dvec3 v)
{
    return Json::array({v.x, v.y, v.z});
}

Description describeModel(const fs::path& path)
{
    const Model model = readModel(path);
    const BoundingBox box = boundingBox(model.mesh);
    Description description;
    Json& facts = description.facts;
    facts["kind"] = "model";
    facts["triangles"] = model.mesh.triangles.size();
    facts["vertices"] = model.mesh.positions.size();
    facts["shading"] = model.mesh.normals.empty() ? "flat" : "smooth normals";
    facts["texture_coordinates"] = !model.mesh.texcoords.empty();
    facts["min_in_file_units"] = toList(box.min);
    facts["max_in_file_units"] = toList(box.max);
    facts["extent_in_file_units"] = toList(box.max - box.min);
    Json names = Json::array();
    for (const Material& material : model.materials)
        names.push_back(material.name);
    facts["materials"] = names;
    Json textures = Json::array();
    for (const Texture& texture : model.textures)
        textures.push_back(fmt::format("{}x{}", texture.texels.width(), texture.texels.height()));
    facts["textures"] = textures;
    description.findings = model.findings;
    return description;
}

Description describeProject(const fs::path& path)
{
    const Project project = readProject(path);
    Description description;
    Json& facts = description.facts;
    facts["kind"] = "project";
    facts["photo"] = project.photo.path.string();
    if (project.camera_lines) facts["camera_lines"] = project.camera_lines->string();
    if (project.camera_file) facts["camera_file"] = project.camera_file->string();
    if (project.light.environment) facts["environment"] = project.light.environment->string();
    if (project.light.probe) {
        Json images = Json::array();
        for (const ProjectView& view : project.light.probe->views)
            for (const ProjectImage& image : view.images)
                images.push_back(image.path.string());
        facts["probe_views"] = project.light.probe->views.size();
        facts["probe_images"] = images;
    }
    facts["room_boxes"] = project.room.boxes.size();
    facts["room_planes"] = project.room.floors.size() + project.room.planes.size();
    facts["room_openings"] = project.room.openings.size();
    facts["room_meshes"] = project.room.meshes.size();
    for (const ProjectObject& object : project.objects)
        facts["objects"].push_back({{"model", object.model.string()},
                                    {"position_m", toList(object.position_m)},
                                    {"rotation_y_deg", object.rotation_y_deg},
                                    {"scale", object.scale}});
    return description;
}

/// Ours and other programs' (calib/camera_formats.h).
Description describeCamera(const fs::path& path)
{
    const CameraEstimate estimate = readCameraFile(path);
    const Camera& camera = estimate.camera;
    Description description;
    description.findings = estimate.findings;
    Json& facts = description.facts;
    facts["kind"] = "camera";
    facts["width"] = camera.width;
    facts["height"] = camera.height;
    facts["focal_px"] = {camera.focal_px.x, camera.focal_px.y};
    facts["principal_point_px"] = {camera.principal_px.x, camera.principal_px.y};
    if (camera.division != 0.0) facts["division"] = camera.division;
    facts["position_m"] = toList(camera.position_m);
    facts["forward"] = toList(camera.forward);
    // Zero: the format holds none.
    if (estimate.focal_sigma_px > 0.0) facts["focal_px_sigma"] = estimate.focal_sigma_px;
    if (estimate.position_sigma_m != glm::dvec3(0.0))
        facts["position_m_sigma"] = toList(estimate.position_sigma_m);
    return description;
}

/// A model, or a scene of which only the camera is of use here. Its size in pixels is in no glTF.
Description describeGltf(const fs::path& path)
{
    const Json json = readJson(path);
    const JsonNode root(json, path.string());
    const bool camera = root.has("cameras");
    if (camera && !root.has("meshes")) return describeCamera(path);
    Description description = describeModel(path);
    if (camera) description.facts["cameras"] = root.at("cameras").size();
    return description;
}

Description describeJson(const fs::path& path)
{
    const Json json = readJson(path);
    const JsonNode root(json, path.string());
    Description description;
    Json& facts = description.facts;
    if (root.has("format") && !root.has("matrix_world")) return describeProject(path);
    if (root.has("segments")) {
        const LineSet lines = readLineSet(path);
        facts["kind"] = "line segments";
        facts["width"] = lines.width;
        facts["height"] = lines.height;
        for (const LineSegment& segment : lines.segments) {
            Json& count = facts["segments"][axisName(segment.axis)];
            count = count.is_null() ? 1 : count.get<int>() + 1;
        }
        addIfKnown(facts, "camera_height_m", lines.camera_height_m);
        facts["known_lengths"] = lines.lengths.size();
        return description;
    }
    if (root.has("exposure")) {
        const ResponseCurve curve = responseFromJson(root);
        facts["kind"] = "response curve";
        facts["source"] = curve.source;
        for (std::size_t c = 0; c < 3; ++c)
            facts["exposure_at_255"].push_back(curve.exposure[c][255]);
        return description;
    }
    for (const char* key : {"focal_px", "cameraTransform", "matrix_world"})
        if (root.has(key)) return describeCamera(path);
    root.fail("is JSON, but not a project, line segments, a camera or a response curve");
}

Description describe(const fs::path& path)
{
    std::string extension = path.extension().string();
    std::transform(extension.begin(), extension.end(), extension.begin(), [](unsigned char c) {
        return static_cast<char>(std::tolower(c));
    });
    if (extension == ".json") return describeJson(path);
    if (extension == ".fspy" || path.filename() == "cameras.txt") return describeCamera(path);
    if (extension == ".gltf") return describeGltf(path);
    if (isRadianceFile(path)) return describeRadiance(path);
    for (const char* model : {".gltf", ".glb", ".obj", ".fbx", ".dae", ".ply", ".stl", ".3ds"})
        if (extension == model) return describeModel(path);
    return describePhoto(path);
}

void print(const Json& facts)
{
    constexpr std::size_t kColumn = 24;
    for (const auto& fact : facts.items()) {
        const Json& value = fact.value();
        const std::string text = value.is_string() ? value.get<std::string>()
                                 : value.is_number_float()
                                     ? fmt::format("{:.6g}", value.get<double>())
                                     : value.dump();
        std::cout << fmt::format("{:<{}}{}\n", fact.key(), kColumn, text);
    }
}

}  // namespace

void registerInfo(CLI::App& app, Context& context)
{
    struct Arguments {
        fs::path file;
        fs::path json;
    };
    auto arguments = std::make_shared<Arguments>();
    CLI::App* command = app.add_subcommand("info", "What a file holds, as insitu understands it");
    command
        ->add_option("file",
                     arguments->file,
                     "Photograph, radiance image, model, camera (.fspy, COLMAP's cameras.txt, "
                     ".gltf) or JSON file")
        ->required();
    command->add_option("--json", arguments->json, "Write the facts to this file");
    context.addCommonOptions(*command);
    command->footer(
        "Examples:\n"
        "  insitu info IMG_0413.jpg\n"
        "  insitu info room.exr --json room-facts.json\n"
        "  insitu info sofa.glb\n"
        "  insitu info project.json");
    command->callback([arguments, &context] {
        context.start();
        if (!arguments->json.empty()) context.checkOutput(arguments->json);
        const Description description = describe(arguments->file);
        context.print(description.findings);
        print(description.facts);
        if (!arguments->json.empty()) writeJson(arguments->json, description.facts);
    });
}

}  // namespace insitu::cli
