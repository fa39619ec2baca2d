#include "capture/hdr_merge.h"
#include "capture/light_probe.h"
#include "capture/response_recovery.h"
#include "core/io/image_io.h"
#include "core/io/json.h"
#include "tests/capture/synthetic_bracket.h"
#include "tests/support/data.h"

#include <gmock/gmock.h>

namespace insitu {
namespace {

/// The ball of a truth room (rendered by another program) and what its maker knows.
struct TruthRoom {
    std::filesystem::path folder;
    Bracket bracket;
    MirrorBall ball;
    glm::dvec3 view{0.0};
    glm::dvec3 low{0.0};
    glm::dvec3 high{0.0};
    ResponseCurve curve;
};

TruthRoom readTruthRoom(const std::string& name)
{
    TruthRoom room;
    room.folder = dataFolder() / name;
    const Json project = readJson(room.folder / "project.json");
    const Json& probe = project.at("light").at("probe");
    std::vector<std::filesystem::path> images;
    for (const Json& image : probe.at("images"))
        images.push_back(room.folder / image.get<std::string>());
    room.bracket = readBracket(images);
    const auto vec3 = [](const Json& json) { return JsonNode(json, "project.json").vec3(); };
    room.ball.center_px = JsonNode(probe.at("ball").at("center_px"), "project.json").vec2();
    room.ball.radius_px = probe.at("ball").at("radius_px").get<double>();
    room.ball.radius_m = probe.at("ball").at("radius_m").get<double>();
    room.ball.center_m = vec3(probe.at("center_m"));
    room.view = vec3(probe.at("view").at("position_m"));
    room.low = vec3(project.at("room").at(0).at("min_m"));
    room.high = vec3(project.at("room").at(0).at("max_m"));

    const Json truth = readJson(room.folder / "truth.json");
    const Json& curve = truth.at("response").at("curve");
    for (std::size_t c = 0; c < 3; ++c) {
        const auto codes = curve.at(c).get<std::vector<double>>();
        for (std::size_t z = 0; z < 256; ++z) {
            const auto above = std::upper_bound(
                codes.begin() + 1, codes.end() - 1, static_cast<double>(z) / 255.0);
            const double t = (static_cast<double>(z) / 255.0 - above[-1]) / (above[0] - above[-1]);
            room.curve.exposure[c][z] = static_cast<double>(above - codes.begin() - 1) + t;
        }
    }
    return room;
}

double distanceToWalls(const TruthRoom& room, glm::dvec3 origin, glm::dvec3 direction)
{
    double nearest = std::numeric_limits<double>::infinity();
    for (int axis = 0; axis < 3; ++axis) {
        const double wall = direction[axis] > 0.0 ? room.high[axis] : room.low[axis];
        if (direction[axis] != 0.0)
            nearest = std::min(nearest, (wall - origin[axis]) / direction[axis]);
    }
    return nearest;
}

class TruthRooms : public testing::TestWithParam<const char*> {};

// JPEG, 4:2:0, sensor noise, 2 EV steps. Figures: docs/validation.md.
TEST_P(TruthRooms, ResponseIsRecovered)
{
    INSITU_NEEDS_DATA();
    const TruthRoom room = readTruthRoom(GetParam());
    const ResponseRecovery recovery = recoverResponse(room.bracket, {});
    for (std::size_t c = 0; c < 3; ++c)
        EXPECT_LT(curveErrorEv(recovery.curve, room.curve, c, 24, 220), 0.015) << c;
}

// Rooms a and b: the map gives the irradiance of the truth panorama, after one scale per channel
// (that of the mean over the six axes), and is better with the walls than without.
TEST_P(TruthRooms, ProbeGivesTheLightAtTheBall)
{
    INSITU_NEEDS_DATA();
    const TruthRoom room = readTruthRoom(GetParam());
    if (std::string(GetParam()).back() == 'c') GTEST_SKIP() << "a sun of eleven pixels";
    const EnvironmentMap truth{readRadiance(room.folder / "pano_linear.exr").pixels};
    const ResponseCurve curve = recoverResponse(room.bracket, {}).curve;
    const Image<Rgb> radiance = mergeBracket(room.bracket, curve, {}).radiance.pixels;
    const Camera camera = ballCamera(room.ball, room.view, radiance.width(), radiance.height());
    UnwrapOptions options;
    options.width = 512;
    options.distance_to_room = [&](glm::dvec3 origin, glm::dvec3 direction) {
        return distanceToWalls(room, origin, direction);
    };
    const LightProbe probe = unwrapMirrorBall(radiance, room.ball, camera, options);
    std::vector<glm::dvec3> ratios;
    glm::dvec3 mean(0.0);
    for (int axis = 0; axis < 3; ++axis) {
        for (const double sign : {1.0, -1.0}) {
            glm::dvec3 normal(0.0);
            normal[axis] = sign;
            ratios.push_back(irradiance(probe.environment, normal) / irradiance(truth, normal));
            mean += ratios.back() / 6.0;
        }
    }
    for (const glm::dvec3 ratio : ratios)
        for (int c = 0; c < 3; ++c)
            EXPECT_NEAR(ratio[c] / mean[c], 1.0, 0.03);  // largest seen: 2.4 %, the blind spot
}

INSTANTIATE_TEST_SUITE_P(Rooms,
                         TruthRooms,
                         testing::Values("truth-room-a", "truth-room-b", "truth-room-c"));

}  // namespace
}  // namespace insitu
