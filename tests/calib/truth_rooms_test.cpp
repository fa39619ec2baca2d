#include "calib/camera_solve.h"
#include "calib/photo_calibration.h"
#include "core/io/image_io.h"
#include "core/io/json.h"
#include "tests/calib/synthetic_room.h"
#include "tests/support/data.h"

#include <gmock/gmock.h>

#include <fstream>
#include <sstream>

namespace insitu {
namespace {

struct Expected {
    std::string room;
    double focal_share;  ///< with EXIF; the lines hold 0.8 px noise, bench/calib_truth the spread
    double rotation_deg;
    double position_m;
};

class TruthRoom : public testing::TestWithParam<Expected> {};

/// Four times what the noise of the lines predicts on average (bench/calib_truth).
INSTANTIATE_TEST_SUITE_P(Rooms,
                         TruthRoom,
                         testing::Values(Expected{"truth-room-a", 0.015, 1.1, 0.09},
                                         Expected{"truth-room-b", 0.015, 0.8, 0.08},
                                         Expected{"truth-room-c", 0.015, 0.9, 0.07}));

TEST_P(TruthRoom, CameraIsFound)
{
    INSITU_NEEDS_DATA();
    const auto folder = dataFolder() / GetParam().room;
    const Json json = readJson(folder / "truth.json");
    const JsonNode truth(json, "truth.json");
    const JsonNode node = truth.at("camera");
    Camera expected;
    expected.right = node.at("right_in_world").vec3();
    expected.up = node.at("up_in_world").vec3();
    expected.forward = node.at("forward_in_world").vec3();
    expected.position_m =
        node.at("position_in_world_m").vec3() - truth.at("object").at("position_in_world_m").vec3();
    const double focal = node.at("fx_px").number();

    const LineSet lines = readLineSet(folder / "lines.json");
    const Photo plate = readPhoto(folder / "plate.jpg");
    const CameraEstimate found = calibratePhoto(lines, plate, {}, "lines.json");
    EXPECT_NEAR(found.camera.focal_px.x / focal, 1.0, GetParam().focal_share);
    EXPECT_LT(glm::degrees(synthetic::rotationError(found.camera, expected)),
              GetParam().rotation_deg);
    EXPECT_LT(glm::length(found.camera.position_m - expected.position_m), GetParam().position_m);
    // What is claimed about the error holds.
    EXPECT_LT(std::abs(found.camera.focal_px.x - focal), 4.0 * found.focal_sigma_px);
    EXPECT_LT(synthetic::rotationError(found.camera, expected), 4.0 * found.rotation_sigma_rad);
    EXPECT_FALSE(hasFinding(found.findings, "focal-disagrees-with-exif"));
    EXPECT_FALSE(hasFinding(found.findings, "segments-inconsistent"));
}

/// Segments of the York Urban database whose line passes near a vanishing point of its truth.
LineSet labelledLines(const std::filesystem::path& file, const JsonNode& points, double focal_px)
{
    LineSet lines;
    lines.width = 640;
    lines.height = 480;
    lines.origin_px = {320, 470};
    lines.camera_height_m = 1.6;
    std::ifstream stream(file);
    std::string header;
    std::getline(stream, header);
    for (std::string row; std::getline(stream, row);) {
        std::istringstream cells(row);
        double v[12];
        for (double& value : v)
            cells >> value;
        const glm::dvec2 from(v[6], v[7]);
        const glm::dvec2 to(v[9], v[10]);
        if (!cells || glm::length(to - from) < 60.0) continue;
        for (std::size_t axis = 0; axis < 3; ++axis) {
            const glm::dvec3 d = points.at(axis).vec3();
            const glm::dvec2 middle = 0.5 * (from + to) - glm::dvec2(307.551, 251.454);
            const glm::dvec2 toward = focal_px * glm::dvec2(d) - middle * d.z;
            const glm::dvec2 along = glm::normalize(to - from);
            const double sine =
                std::abs(toward.x * along.y - toward.y * along.x) / glm::length(toward);
            // The truth's order is: a horizontal direction, the vertical, the other horizontal.
            if (sine < glm::radians(1.0) * 1.0)
                lines.segments.push_back({static_cast<RoomAxis>(axis), from, to});
        }
    }
    return lines;
}

/// Both pictures of the database that are here; their labelled segments bend a little with the
/// lens.
class YorkUrban : public testing::TestWithParam<std::string> {};
INSTANTIATE_TEST_SUITE_P(Pictures, YorkUrban, testing::Values("P1020171", "P1020816"));

TEST_P(YorkUrban, FocalLengthWithinTwoPercent)
{
    INSITU_NEEDS_DATA();
    const auto folder = dataFolder() / "rooms" / "yud";
    const Json json = readJson(folder / "ground_truth.json");
    const JsonNode truth(json, "ground_truth.json");
    const double focal = truth.at("focal_px").number();
    const JsonNode points = truth.at("images").at(GetParam() + ".jpg").at("vp_camera");
    const LineSet lines = labelledLines(folder / (GetParam() + ".lines.txt"), points, focal);
    ASSERT_GT(lines.segments.size(), 30u);
    const CameraEstimate found = calibrateCamera(lines, {}, GetParam() + ".lines.txt");
    RecordProperty("focal_px", std::to_string(found.camera.focal_px.x));
    EXPECT_NEAR(found.camera.focal_px.x / focal, 1.0, 0.02)
        << found.focal_sigma_px << " " << found.camera.division;
    EXPECT_LT(std::abs(found.camera.focal_px.x - focal), 4.0 * found.focal_sigma_px);
    // The truth's principal point is (307.6, 251.5), 17 px off the middle.
    EXPECT_LT(std::abs(found.camera.principal_px.x - 307.551), 4.0 * found.principal_sigma_px.x);
    EXPECT_LT(std::abs(found.camera.principal_px.y - 251.454), 4.0 * found.principal_sigma_px.y);
    // Vanishing point of the upright direction, as an angle to the truth in the camera's frame,
    // beside the 1.4° that an offset principal point turns everything by.
    const glm::dvec3 up = points.at(std::size_t{1}).vec3();
    const glm::dvec3 found_up(found.camera.right.y, -found.camera.up.y, found.camera.forward.y);
    EXPECT_LT(glm::degrees(std::acos(std::abs(glm::dot(up, found_up)))), 2.5);
}

}  // namespace
}  // namespace insitu
