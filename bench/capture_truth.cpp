// How well the capture stage does on rooms whose truth is known: prints, for each folder given
// (project.json, truth.json and pano_linear.exr as in the truth rooms), the error of the recovered
// response and of the light probe. Every figure is after one fitted scale per channel.

#include "capture/hdr_merge.h"
#include "capture/light_probe.h"
#include "capture/response_recovery.h"
#include "core/check.h"
#include "core/io/image_io.h"
#include "core/io/json.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <limits>
#include <string>
#include <vector>

namespace {

using namespace insitu;
namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

constexpr int kMapWidth = 768;
/// Texels averaged before radiance is compared: the truth is a path tracer's, with its noise.
constexpr int kBlock = 8;

glm::dvec3 toVec3(const Json& json)
{
    return {json.at(0).get<double>(), json.at(1).get<double>(), json.at(2).get<double>()};
}

/// The room box, and openings in its walls as bounding boxes.
struct Room {
    glm::dvec3 low{0.0};
    glm::dvec3 high{0.0};
    std::vector<std::pair<glm::dvec3, glm::dvec3>> openings;

    [[nodiscard]] double distance(glm::dvec3 origin, glm::dvec3 direction) const
    {
        constexpr double kInfinity = std::numeric_limits<double>::infinity();
        double nearest = kInfinity;
        for (int axis = 0; axis < 3; ++axis) {
            if (direction[axis] == 0.0) continue;
            const double wall = direction[axis] > 0.0 ? high[axis] : low[axis];
            nearest = std::min(nearest, (wall - origin[axis]) / direction[axis]);
        }
        const glm::dvec3 hit = origin + nearest * direction;
        for (const auto& [from, to] : openings) {
            constexpr glm::dvec3 kSlack(0.01);
            if (glm::all(glm::greaterThanEqual(hit, from - kSlack)) &&
                glm::all(glm::lessThanEqual(hit, to + kSlack)))
                return kInfinity;
        }
        return nearest;
    }
};

struct Case {
    std::vector<fs::path> images;
    std::vector<Exposure> exposures;
    MirrorBall ball;
    glm::dvec3 view{0.0};
    Room room;
    ResponseCurve truth;
    Image<Rgb> panorama;
};

/// The table has 256 steps of exposure: its first one spans codes 0 to 10–20, in which the camera
/// goes on as the power law of the next steps (its dark pixels show it), not as a straight line.
ResponseCurve truthCurve(const Json& response)
{
    ResponseCurve curve;
    curve.source = "truth";
    for (std::size_t c = 0; c < 3; ++c) {
        const auto codes = response.at("curve").at(c).get<std::vector<double>>();
        const auto last = static_cast<double>(codes.size() - 1);
        const double gamma = std::log2(codes[2] / codes[1]);
        for (std::size_t z = 0; z < 256; ++z) {
            const double target = static_cast<double>(z) / 255.0;
            if (target < codes[1]) {
                curve.exposure[c][z] = std::pow(target / codes[1], 1.0 / gamma) / last;
                continue;
            }
            const auto above = std::upper_bound(codes.begin() + 1, codes.end() - 1, target);
            const double span = above[0] - above[-1];
            const double t = std::clamp((target - above[-1]) / span, 0.0, 1.0);
            curve.exposure[c][z] = (static_cast<double>(above - codes.begin() - 1) + t) / last;
        }
    }
    return curve;
}

Case readCase(const fs::path& folder)
{
    const Json project = readJson(folder / "project.json");
    const Json truth = readJson(folder / "truth.json");
    const Json& probe = project.at("light").at("probe");
    Case result;
    for (const Json& image : probe.at("images"))
        result.images.push_back(folder / image.get<std::string>());
    for (const Json& seconds : truth.at("exposure_seconds").at("ball")) {
        result.exposures.emplace_back();
        result.exposures.back().seconds = seconds.get<double>();
    }
    const Json& ball = probe.at("ball");
    result.ball.center_px = {ball.at("center_px").at(0).get<double>(),
                             ball.at("center_px").at(1).get<double>()};
    result.ball.radius_px = ball.at("radius_px").get<double>();
    result.ball.radius_m = ball.at("radius_m").get<double>();
    result.ball.reflectance = ball.at("reflectance").get<double>();
    result.ball.center_m = toVec3(probe.at("center_m"));
    result.view = toVec3(probe.at("view").at("position_m"));
    for (const Json& item : project.at("room")) {
        const std::string type = item.at("type").get<std::string>();
        if (type == "box" && !item.value("solid", false)) {
            result.room.low = toVec3(item.at("min_m"));
            result.room.high = toVec3(item.at("max_m"));
        } else if (type == "opening") {
            glm::dvec3 low = toVec3(item.at("corners_m").at(0));
            glm::dvec3 high = low;
            for (const Json& corner : item.at("corners_m")) {
                low = glm::min(low, toVec3(corner));
                high = glm::max(high, toVec3(corner));
            }
            result.room.openings.emplace_back(low, high);
        }
    }
    result.truth = truthCurve(truth.at("response"));
    result.panorama = readRadiance(folder / "pano_linear.exr").pixels;
    return result;
}

/// Error in EV of the curve over codes 8 to 248, after one scale per channel: RMS and largest.
void printResponseError(const ResponseRecovery& recovery, const ResponseCurve& truth)
{
    for (std::size_t c = 0; c < 3; ++c) {
        std::array<double, 256> error{};
        double mean = 0.0;
        double bright_mean = 0.0;
        for (std::size_t z = 8; z <= 248; ++z) {
            error[z] = std::log2(recovery.curve.exposure[c][z] / truth.exposure[c][z]);
            mean += error[z] / 241.0;
            if (z >= 24) bright_mean += error[z] / 225.0;
        }
        double squares = 0.0;
        double dark = 0.0;
        double bright = 0.0;
        double largest = 0.0;
        std::size_t where = 0;
        for (std::size_t z = 8; z <= 248; ++z) {
            const double e = error[z] - mean;
            squares += e * e / 241.0;
            if (z < 24) dark += e * e / 16.0;
            if (z >= 24) bright += (error[z] - bright_mean) * (error[z] - bright_mean) / 225.0;
            if (std::abs(e) > largest) where = z;
            largest = std::max(largest, std::abs(e));
        }
        fmt::print(
            "  response {}: {:.4f} EV RMS (codes 8-23 {:.4f}, 24-248 {:.4f}), largest {:.3f} at "
            "code {}, "
            "residual {:.4f}\n",
            "rgb"[c],
            std::sqrt(squares),
            std::sqrt(dark),
            std::sqrt(bright),
            largest,
            where,
            recovery.residual[c]);
        fmt::print("    EV at code");
        for (const std::size_t z : {8, 12, 16, 20, 24, 32, 48, 64, 96, 160, 200, 224, 240, 248})
            fmt::print(" {}:{:+.3f}", z, error[z] - error[128]);
        fmt::print("\n");
    }
}

Image<glm::dvec3> blockMeans(const Image<Rgb>& map)
{
    Image<glm::dvec3> means(map.width() / kBlock, map.height() / kBlock);
    for (int y = 0; y < means.height(); ++y) {
        for (int x = 0; x < means.width(); ++x) {
            double weight = 0.0;
            for (int j = 0; j < kBlock; ++j) {
                const int row = y * kBlock + j;
                const double w = environmentTexelSolidAngle(map.width(), map.height(), row);
                for (int i = 0; i < kBlock; ++i)
                    means(x, y) += w * glm::dvec3(map(x * kBlock + i, row));
                weight += w * kBlock;
            }
            means(x, y) /= weight;
        }
    }
    return means;
}

struct Pairs {
    std::vector<double> measured;
    std::vector<double> truth;
    std::vector<double> weight;

    /// Errors relative to the truth (to a tenth of its mean where it is darker), after one scale:
    /// the median of truth / measured, which a few displaced lights cannot pull.
    [[nodiscard]] std::vector<double> errors() const
    {
        double mean = 0.0;
        double weights = 0.0;
        std::vector<double> ratios;
        for (std::size_t i = 0; i < truth.size(); ++i) {
            mean += weight[i] * truth[i];
            weights += weight[i];
            ratios.push_back(truth[i] / measured[i]);
        }
        const double least = 0.1 * mean / weights;
        std::ranges::nth_element(ratios, ratios.begin() + ratios.size() / 2);
        const double scale = ratios[ratios.size() / 2];
        std::vector<double> result;
        for (std::size_t i = 0; i < measured.size(); ++i)
            result.push_back((measured[i] * scale - truth[i]) / std::max(truth[i], least));
        return result;
    }
};

void printProbeError(const std::string& title, const EnvironmentMap& map, const Image<Rgb>& truth)
{
    const Image<glm::dvec3> a = blockMeans(map.pixels);
    const Image<glm::dvec3> b = blockMeans(truth);
    const EnvironmentMap true_map{truth};
    std::string radiance;
    std::string light;
    double total = 0.0;
    for (int c = 0; c < 3; ++c) {
        Pairs texels;
        for (int y = 0; y < a.height(); ++y) {
            for (int x = 0; x < a.width(); ++x) {
                texels.measured.push_back(a(x, y)[c]);
                texels.truth.push_back(b(x, y)[c]);
                texels.weight.push_back(environmentTexelSolidAngle(a.width(), a.height(), y));
            }
        }
        const std::vector<double> errors = texels.errors();
        double squares = 0.0;
        double weights = 0.0;
        std::vector<double> sizes;
        for (std::size_t i = 0; i < errors.size(); ++i) {
            squares += texels.weight[i] * errors[i] * errors[i];
            weights += texels.weight[i];
            sizes.push_back(std::abs(errors[i]));
        }
        std::ranges::nth_element(sizes, sizes.begin() + sizes.size() / 2);
        radiance += fmt::format(" {:.2f}/{:.2f}",
                                100.0 * std::sqrt(squares / weights),
                                100.0 * sizes[sizes.size() / 2]);

        Pairs normals;
        for (int axis = 0; axis < 3; ++axis) {
            for (const double sign : {1.0, -1.0}) {
                glm::dvec3 normal(0.0);
                normal[axis] = sign;
                normals.measured.push_back(irradiance(map, normal)[c]);
                normals.truth.push_back(irradiance(true_map, normal)[c]);
                normals.weight.push_back(1.0);
            }
        }
        for (const double e : normals.errors()) {
            light += fmt::format(" {:+.2f}", 100.0 * e);
            total += e * e / 18.0;
        }
        light += c < 2 ? " |" : "";
    }
    fmt::print("  {}: radiance RMS/median %{}; irradiance RMS {:.2f} % (+x -x +y -y +z -z:{})\n",
               title,
               radiance,
               100.0 * std::sqrt(total),
               light);
}

double secondsSince(Clock::time_point start)
{
    return std::chrono::duration<double>(Clock::now() - start).count();
}

void judge(const fs::path& folder)
{
    const Case room = readCase(folder);
    fmt::print("{}\n", folder.filename().string());
    const Bracket bracket = readBracket(room.images, room.exposures);
    auto start = Clock::now();
    const ResponseRecovery recovery = recoverResponse(bracket, {});
    const double response_seconds = secondsSince(start);
    printResponseError(recovery, room.truth);

    start = Clock::now();
    const MergeResult merged = mergeBracket(bracket, recovery.curve, {});
    const double merge_seconds = secondsSince(start);
    const MergeResult ideal = mergeBracket(bracket, room.truth, {});
    const Camera camera = ballCamera(
        room.ball, room.view, merged.radiance.pixels.width(), merged.radiance.pixels.height());
    UnwrapOptions options;
    options.width = kMapWidth;
    const LightProbe far = unwrapMirrorBall(merged.radiance.pixels, room.ball, camera, options);
    options.distance_to_room = [&room](glm::dvec3 origin, glm::dvec3 direction) {
        return room.room.distance(origin, direction);
    };
    start = Clock::now();
    const LightProbe near = unwrapMirrorBall(merged.radiance.pixels, room.ball, camera, options);
    const double unwrap_seconds = secondsSince(start);
    const LightProbe best = unwrapMirrorBall(ideal.radiance.pixels, room.ball, camera, options);
    printProbeError("all at infinity       ", far.environment, room.panorama);
    printProbeError("room box              ", near.environment, room.panorama);
    printProbeError("room box, true response", best.environment, room.panorama);
    fmt::print("  seconds: response {:.2f}, merge {:.2f}, unwrap {:.2f}\n",
               response_seconds,
               merge_seconds,
               unwrap_seconds);
    for (const Findings& findings :
         {bracket.findings, recovery.findings, merged.findings, near.findings})
        for (const Finding& finding : findings)
            fmt::print(
                "  {}: {}: {}\n", severityName(finding.severity), finding.code, finding.message);
}

}  // namespace

int main(int argc, char** argv)
{
    if (argc < 2) {
        fmt::print(stderr, "usage: capture_truth FOLDER...\n");
        return 2;
    }
    try {
        for (int i = 1; i < argc; ++i)
            judge(argv[i]);
    } catch (const std::exception& error) {
        fmt::print(stderr, "{}\n", error.what());
        return 1;
    }
    return 0;
}
