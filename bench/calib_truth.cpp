// How far the calibration is from the truth in rooms with a known camera (truth.json).
//
//   calib_truth ROOM_FOLDER...
//
// Two lines a room and mode: "file" is the one noisy set of lines.json, "mean" the root mean square
// over many fresh draws of the same noise on the true edges. Modes: lines alone, and with the focal
// length of the plate's EXIF.
#include "calib/camera_solve.h"
#include "calib/exif_focal.h"
#include "core/io/image_io.h"
#include "core/io/json.h"
#include "core/random.h"

#include <fmt/format.h>
#include <glm/gtc/constants.hpp>

#include <cmath>
#include <cstdio>

namespace insitu {
namespace {

constexpr int kDraws = 200;

struct Truth {
    Camera camera;
    LineSet lines;  ///< with exact segments
    double noise_px = 0.0;
};

struct Errors {
    double focal = 0.0;     ///< share
    double rotation = 0.0;  ///< degrees
    double position = 0.0;  ///< cm
    double floor = 0.0;     ///< cm, rms of four floor points half a metre from the origin
    double pixels = 0.0;    ///< px, a point 1 m above the origin
};

Truth readTruth(const std::filesystem::path& folder)
{
    const Json json = readJson(folder / "truth.json");
    const JsonNode root(json, (folder / "truth.json").string());
    Truth truth;
    truth.lines = readLineSet(folder / "lines.json");
    const JsonNode camera = root.at("camera");
    truth.camera.width = truth.lines.width;
    truth.camera.height = truth.lines.height;
    truth.camera.focal_px = {camera.at("fx_px").number(), camera.at("fy_px").number()};
    truth.camera.principal_px = {camera.at("cx_px").number(), camera.at("cy_px").number()};
    truth.camera.position_m = camera.at("position_in_world_m").vec3() -
                              root.at("object").at("position_in_world_m").vec3();
    truth.camera.right = glm::normalize(camera.at("right_in_world").vec3());
    truth.camera.up = glm::normalize(camera.at("up_in_world").vec3());
    truth.camera.forward = glm::normalize(camera.at("forward_in_world").vec3());
    const JsonNode edges = root.at("true_edges");
    for (std::size_t i = 0; i < edges.size(); ++i) {
        truth.lines.segments.at(i).from_px = edges.at(i).at("from_px").vec2();
        truth.lines.segments.at(i).to_px = edges.at(i).at("to_px").vec2();
    }
    truth.noise_px = root.at("line_noise_px").number();
    return truth;
}

glm::dvec3 floorPoint(const Camera& camera, glm::dvec2 pixel)
{
    const glm::dvec3 ray = camera.rayDirection(pixel);
    return camera.position_m - ray * (camera.position_m.y / ray.y);
}

Errors compare(const Camera& camera, const Camera& truth)
{
    Errors errors;
    errors.focal = camera.focal_px.x / truth.focal_px.x - 1.0;
    const glm::dmat3 a(camera.right, camera.up, camera.forward);
    const glm::dmat3 b(truth.right, truth.up, truth.forward);
    const glm::dmat3 turn = glm::transpose(a) * b;
    // |skew part| = sin(angle), exact for small angles where the trace is not.
    const glm::dvec3 skew(
        turn[1][2] - turn[2][1], turn[2][0] - turn[0][2], turn[0][1] - turn[1][0]);
    errors.rotation = glm::degrees(std::asin(std::min(1.0, 0.5 * glm::length(skew))));
    errors.position = 100.0 * glm::length(camera.position_m - truth.position_m);
    double sum = 0.0;
    for (const glm::dvec3 point : {glm::dvec3(0.5, 0, 0),
                                   glm::dvec3(-0.5, 0, 0),
                                   glm::dvec3(0, 0, 0.5),
                                   glm::dvec3(0, 0, -0.5)}) {
        const glm::dvec3 seen = floorPoint(camera, *truth.project(point));
        sum += glm::dot(seen - point, seen - point) / 4.0;
    }
    errors.floor = 100.0 * std::sqrt(sum);
    const glm::dvec3 above(0.0, 1.0, 0.0);
    errors.pixels = glm::length(*camera.project(above) - *truth.project(above));
    return errors;
}

Errors meanOverDraws(const Truth& truth, const CalibrationOptions& options)
{
    Errors sum;
    for (int draw = 0; draw < kDraws; ++draw) {
        RandomStream random(1, 0, static_cast<std::uint64_t>(draw));
        LineSet lines = truth.lines;
        for (LineSegment& segment : lines.segments)
            for (glm::dvec2* end : {&segment.from_px, &segment.to_px}) {
                end->x += truth.noise_px * random.normal();
                end->y += truth.noise_px * random.normal();
            }
        const Errors one = compare(calibrateCamera(lines, options, "draw").camera, truth.camera);
        sum.focal += one.focal * one.focal / kDraws;
        sum.rotation += one.rotation * one.rotation / kDraws;
        sum.position += one.position * one.position / kDraws;
        sum.floor += one.floor * one.floor / kDraws;
        sum.pixels += one.pixels * one.pixels / kDraws;
    }
    return {std::sqrt(sum.focal),
            std::sqrt(sum.rotation),
            std::sqrt(sum.position),
            std::sqrt(sum.floor),
            std::sqrt(sum.pixels)};
}

void print(const std::string& room, const char* mode, const char* what, const Errors& errors)
{
    fmt::print("{:<14} {:<8} {:<5} {:>8.3f} {:>9.4f} {:>9.2f} {:>8.2f} {:>8.2f}\n",
               room,
               mode,
               what,
               100.0 * errors.focal,
               errors.rotation,
               errors.position,
               errors.floor,
               errors.pixels);
}

void measure(const std::filesystem::path& folder)
{
    const std::string room = folder.filename().string();
    const Truth truth = readTruth(folder);
    const LineSet lines = readLineSet(folder / "lines.json");
    const Photo plate = readPhoto(folder / "plate.jpg");
    const auto exif =
        focalFromExif(plate.metadata, plate.image.codes.width(), plate.image.codes.height());
    CalibrationOptions options;
    options.segment_sigma_px = truth.noise_px;
    for (const bool with_exif : {false, true}) {
        if (with_exif && !exif) continue;
        if (with_exif) {
            options.exif_focal_px = exif->focal_px;
            options.exif_focal_sigma = exif->sigma;
        }
        const CameraEstimate estimate =
            calibrateCamera(lines, options, (folder / "lines.json").string());
        const char* mode = with_exif ? "exif" : "lines";
        print(room, mode, "file", compare(estimate.camera, truth.camera));
        print(room, mode, "mean", meanOverDraws(truth, options));
        print(room,
              mode,
              "sigma",
              {estimate.focal_sigma_px / estimate.camera.focal_px.x,
               glm::degrees(estimate.rotation_sigma_rad),
               100.0 * glm::length(estimate.position_sigma_m),
               0.0,
               0.0});
        for (const Finding& finding : estimate.findings)
            if (finding.severity != Severity::Info)
                fmt::print("  {}: {}\n", finding.code, finding.message);
    }
    if (exif)
        fmt::print("{:<14} EXIF focal length {:.2f} px ± {:.2f} % (truth {:.2f}, off {:+.3f} %)\n",
                   room,
                   exif->focal_px,
                   100.0 * exif->sigma,
                   truth.camera.focal_px.x,
                   100.0 * (exif->focal_px / truth.camera.focal_px.x - 1.0));
}

}  // namespace
}  // namespace insitu

int main(int argc, char** argv)
{
    if (argc < 2) {
        fmt::print(stderr, "usage: calib_truth ROOM_FOLDER...\n");
        return 2;
    }
    try {
        fmt::print("{:<14} {:<8} {:<5} {:>8} {:>9} {:>9} {:>8} {:>8}\n",
                   "room",
                   "focal by",
                   "",
                   "focal %",
                   "rot deg",
                   "place cm",
                   "floor cm",
                   "1 m up px");
        for (int i = 1; i < argc; ++i) {
            std::filesystem::path folder = argv[i];
            if (!folder.has_filename()) folder = folder.parent_path();
            insitu::measure(folder);
        }
    } catch (const std::exception& error) {
        fmt::print(stderr, "{}\n", error.what());
        return 1;
    }
    return 0;
}
