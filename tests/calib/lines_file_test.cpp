#include "calib/camera_solve.h"
#include "calib/exif_focal.h"
#include "calib/photo_calibration.h"
#include "core/check.h"
#include "tests/calib/synthetic_room.h"
#include "tests/support/tolerance.h"

#include <gmock/gmock.h>

#include <filesystem>
#include <fstream>
#include <string>

namespace insitu {
namespace {

using testing::AllOf;
using testing::HasSubstr;

constexpr const char* kGood = R"({
  "image": {"width": 800, "height": 600},
  "segments": [{"axis": "x", "from_px": [1.5, 2], "to_px": [300, 40], "note": "table"},
               {"axis": "y", "from_px": [10, 20], "to_px": [12, 320]}],
  "origin_px": [420, 455],
  "scale": {"camera_height_m": 1.5, "camera_height_sigma_m": 0.01,
            "lengths": [{"from_px": [1, 500], "to_px": [90, 510], "on": "vertical", "metres": 0.8}]},
  "distortion": {"division": -0.07}
})";

class LinesFile : public testing::Test {
protected:
    std::filesystem::path folder_ = std::filesystem::path(testing::TempDir()) / "insitu_lines";

    void SetUp() override { std::filesystem::create_directories(folder_); }
    void TearDown() override { std::filesystem::remove_all(folder_); }

    std::filesystem::path write(const std::string& text) const
    {
        const auto path = folder_ / "file.json";
        std::ofstream(path) << text;
        return path;
    }
    /// kGood with `from` replaced.
    static std::string changed(const std::string& from, const std::string& to)
    {
        std::string text = kGood;
        const auto at = text.find(from);
        EXPECT_NE(at, std::string::npos) << from;
        return text.replace(at, from.size(), to);
    }
    template <typename Read>
    static std::string complaint(Read&& read)
    {
        try {
            static_cast<void>(read());
        } catch (const InputError& error) {
            return error.what();
        }
        return "";
    }
    std::string complaintAbout(const std::string& text) const
    {
        const auto path = write(text);
        return complaint([&] { return readLineSet(path); });
    }
};

TEST_F(LinesFile, ReadsEveryMember)
{
    const LineSet lines = readLineSet(write(kGood));
    EXPECT_EQ(lines.width, 800);
    EXPECT_EQ(lines.height, 600);
    ASSERT_EQ(lines.segments.size(), 2u);
    EXPECT_EQ(lines.segments[1].axis, RoomAxis::Y);
    EXPECT_EQ(lines.segments[0].from_px, glm::dvec2(1.5, 2.0));
    EXPECT_EQ(lines.segments[0].to_px, glm::dvec2(300.0, 40.0));
    EXPECT_EQ(lines.origin_px, glm::dvec2(420.0, 455.0));
    EXPECT_EQ(lines.camera_height_m, 1.5);
    EXPECT_EQ(lines.camera_height_sigma_m, 0.01);
    ASSERT_EQ(lines.lengths.size(), 1u);
    EXPECT_EQ(lines.lengths[0].on, KnownLength::On::Vertical);
    EXPECT_EQ(lines.lengths[0].metres, 0.8);
    EXPECT_EQ(lines.distortion.division, -0.07);
}

TEST_F(LinesFile, ComplaintsNameFilePlaceAndCause)
{
    EXPECT_THAT(complaintAbout(changed("\"axis\": \"y\"", "\"axis\": \"w\"")),
                AllOf(HasSubstr("file.json"), HasSubstr("segments[1].axis"), HasSubstr("\"w\"")));
    EXPECT_THAT(complaintAbout(changed("\"origin_px\"", "\"orgin_px\"")), HasSubstr("origin_px"));
    EXPECT_THAT(complaintAbout(changed("[12, 320]", "[10, 20]")), HasSubstr("segments[1]"));
    EXPECT_THAT(complaintAbout(changed("[12, 320]", "[]")), HasSubstr("segments[1].to_px"));
    EXPECT_THAT(complaintAbout(changed("\"metres\": 0.8", "\"metres\": -1")), HasSubstr("metres"));
    EXPECT_THAT(complaintAbout(changed("\"vertical\"", "\"wall\"")),
                HasSubstr("scale.lengths[0].on"));
    EXPECT_THAT(complaintAbout(changed("-0.07", "-7")), HasSubstr("distortion.division"));
    EXPECT_THAT(complaintAbout(changed("800", "0")), HasSubstr("image"));
    EXPECT_THAT(complaintAbout(changed("800", "\"wide\"")), HasSubstr("image.width"));
    EXPECT_THAT(complaintAbout("{\"image\": "), HasSubstr("file.json"));
    EXPECT_THAT(complaint([&] { return readLineSet(folder_ / "absent.json"); }),
                HasSubstr("absent.json"));
}

TEST_F(LinesFile, EverythingThatMayBeKnownIsRead)
{
    const LineSet lines = readLineSet(write(R"({
      "image": {"width": 800, "height": 600},
      "segments": [{"axis": "z", "points_px": [[1, 2], [50, 21], [100, 42]]}],
      "origin_px": [420, 455],
      "scale": {"lengths": [{"from_px": [1, 500], "to_px": [90, 510], "on": "floor",
                             "metres": 0.8, "sigma_m": 0.01}]},
      "distortion": {"division": -0.05, "sigma": 0.02},
      "straight_lines": [{"points_px": [[1, 2], [3, 4], [5, 7]], "note": "curtain rail"}],
      "rectangles": [{"corners_px": [[0, 0], [90, 5], [80, 60], [3, 70]], "ratio": 1.5, "on": "floor"},
                     {"corners_px": [[0, 0], [90, 5], [80, 60], [3, 70]]}],
      "right_angles": [{"corner_px": [10, 500], "first_px": [90, 500], "second_px": [20, 560]}],
      "points": [{"at_px": [300, 500], "position_m": [0.5, 0, -1], "sigma_m": 0.02}],
      "principal_point": {"px": [410, 290], "sigma_px": 4},
      "gravity": {"up_in_camera": [0, -0.9, 0.1], "sigma_deg": 2}
    })"));
    EXPECT_EQ(lines.segments[0].to_px, glm::dvec2(100, 42));
    EXPECT_EQ(lines.segments[0].via_px, std::vector<glm::dvec2>({{50, 21}}));
    EXPECT_EQ(lines.lengths[0].sigma_m, 0.01);
    EXPECT_EQ(lines.distortion.sigma, 0.02);
    EXPECT_EQ(lines.straight_lines[0].size(), 3u);
    EXPECT_TRUE(lines.rectangles[0].on_floor);
    EXPECT_EQ(lines.rectangles[0].ratio, 1.5);
    EXPECT_FALSE(lines.rectangles[1].on_floor);
    EXPECT_EQ(lines.rectangles[1].ratio, 0.0);
    EXPECT_EQ(lines.right_angles[0].second_px, glm::dvec2(20, 560));
    EXPECT_EQ(lines.points[0].position_m, glm::dvec3(0.5, 0, -1));
    EXPECT_EQ(lines.principal_point->sigma_px, 4.0);
    EXPECT_NEAR(lines.gravity->sigma_rad, glm::radians(2.0), tolerance::kDouble);
}

TEST_F(LinesFile, WhatMayBeKnownIsChecked)
{
    const auto with = [&](const std::string& more) {
        return complaintAbout(changed("\"origin_px\"", more + ", \"origin_px\""));
    };
    EXPECT_THAT(with(R"("straight_lines": [{"points_px": [[1, 2], [3, 4]]}])"),
                HasSubstr("at least 3 points"));
    EXPECT_THAT(with(R"("rectangles": [{"corners_px": [[0, 0], [80, 60], [90, 5], [3, 70]]}])"),
                HasSubstr("rectangles[0].corners_px"));
    EXPECT_THAT(with(R"("rectangles": [{"corners_px": [[0, 0], [9, 0], [9, 9], [0, 9], [1, 1]]}])"),
                HasSubstr("four corners"));
    EXPECT_THAT(
        with(R"("rectangles": [{"corners_px": [[0, 0], [9, 0], [9, 9], [0, 9]], "on": "wall"}])"),
        HasSubstr("floor"));
    EXPECT_THAT(with(R"("points": [{"at_px": [1e9, 0], "position_m": [0, 0, 0]}])"),
                HasSubstr("points[0].at_px"));
    EXPECT_THAT(with(R"("gravity": {"up_in_camera": [0, 0, 0]})"), HasSubstr("no direction"));
    EXPECT_THAT(complaintAbout(changed("\"from_px\": [1.5, 2]", "\"points_px\": [[1, 2], [3, 4]]")),
                HasSubstr("either"));
}

TEST_F(LinesFile, NoScaleIsAnError)
{
    const std::string text =
        std::string(kGood).substr(0, std::string(kGood).find("\"scale\"")) + "\"scale\": {}}";
    EXPECT_THAT(complaintAbout(text), HasSubstr("no scale"));
}

TEST_F(LinesFile, CameraSurvivesTheRoundTrip)
{
    const synthetic::Room room = synthetic::makeRoom({}, {3, 3, 3}, 3);
    CalibrationOptions options;
    options.exif_focal_px = 905.0;
    CameraEstimate written = calibrateCamera(room.lines, options, "lines");
    written.camera.division = -0.03;
    const auto path = folder_ / "camera.json";
    writeCamera(path, written);
    const CameraEstimate read = readCamera(path);
    EXPECT_EQ(read.camera.width, 1200);
    EXPECT_EQ(read.camera.height, 900);
    EXPECT_EQ(read.camera.focal_px, written.camera.focal_px);
    EXPECT_EQ(read.camera.principal_px, written.camera.principal_px);
    EXPECT_EQ(read.camera.division, -0.03);
    EXPECT_EQ(read.camera.position_m, written.camera.position_m);
    EXPECT_LT(synthetic::rotationError(read.camera, written.camera), tolerance::kDouble);
    EXPECT_DOUBLE_EQ(read.focal_sigma_px, written.focal_sigma_px);
    EXPECT_NEAR(read.rotation_sigma_rad, written.rotation_sigma_rad, tolerance::kDouble);
    EXPECT_EQ(read.position_sigma_m, written.position_sigma_m);
    EXPECT_EQ(read.principal_sigma_px, written.principal_sigma_px);
    EXPECT_EQ(read.covariance, written.covariance);
    EXPECT_LT(glm::length(read.turn_sigma_rad - written.turn_sigma_rad), tolerance::kDouble);
    EXPECT_EQ(read.residual_rms_px, written.residual_rms_px);
    for (std::size_t axis = 0; axis < 3; ++axis)
        EXPECT_EQ(read.vanishing_points_px[axis], written.vanishing_points_px[axis]);
    ASSERT_EQ(read.findings.size(), written.findings.size());
    EXPECT_EQ(read.findings[0].code, written.findings[0].code);
    EXPECT_EQ(read.findings[0].severity, written.findings[0].severity);
}

TEST_F(LinesFile, CamerasOfOtherProgramsAreChecked)
{
    const std::string good = R"({"image": {"width": 640, "height": 480}, "focal_px": [500, 500],
        "position_m": [0, 1.5, 2], "right": [1, 0, 0], "up": [0, 1, 0], "forward": [0, 0, -1]})";
    const Camera camera = readCamera(write(good)).camera;
    EXPECT_EQ(camera.principal_px, glm::dvec2(320.0, 240.0));
    const auto complaintOf = [&](const std::string& from, const std::string& to) {
        std::string text = good;
        const auto path = write(text.replace(text.find(from), from.size(), to));
        return complaint([&] { return readCamera(path); });
    };
    EXPECT_THAT(complaintOf("[0, 0, -1]", "[0, 0, 1]"), HasSubstr("left-handed"));
    EXPECT_THAT(complaintOf("[0, 1, 0]", "[0.1, 1, 0]"), HasSubstr("right angles"));
    EXPECT_THAT(complaintOf("[500, 500]", "[500, -5]"), HasSubstr("focal_px"));
    EXPECT_THAT(complaintOf("\"position_m\"", "\"distortion\": [0.1], \"position_m\""),
                HasSubstr("distortion"));
    EXPECT_THAT(complaintOf("\"position_m\"", "\"distortion\": {\"division\": -3}, \"position_m\""),
                HasSubstr("distortion.division"));
    EXPECT_THAT(complaintOf("\"position_m\"", "\"positon_m\""), HasSubstr("position_m"));
}

TEST(ExifFocal, FullFrameMillimetresBeatTheRoundedEquivalent)
{
    PhotoMetadata metadata;
    metadata.focal_mm = 27.718;
    metadata.focal_35mm = 28.0;
    metadata.focal_px = 28.0 / 36.0 * 800.0;
    const auto focal = focalFromExif(metadata, 800, 600);
    ASSERT_TRUE(focal);
    EXPECT_NEAR(focal->focal_px, 27.718 / 36.0 * 800.0, tolerance::kIterative);
    EXPECT_NEAR(focal->sigma, 0.01, tolerance::kDouble);
}

TEST(ExifFocal, EquivalentOfACropSensorIsRounded)
{
    PhotoMetadata metadata;
    metadata.focal_mm = 19.8;
    metadata.focal_35mm = 29.0;
    metadata.focal_px = 29.0 / 36.0 * 1500.0;
    const auto focal = focalFromExif(metadata, 1500, 1000);
    ASSERT_TRUE(focal);
    // At 3:2 both conventions agree.
    EXPECT_NEAR(focal->focal_px, 29.0 / 36.0 * 1500.0, tolerance::kIterative);
    EXPECT_GT(focal->sigma, 0.02);
    EXPECT_LT(focal->sigma, 0.03);
}

TEST(ExifFocal, FocalPlaneResolutionComesFirst)
{
    PhotoMetadata metadata;
    metadata.focal_mm = 20.0;
    metadata.focal_35mm = 30.0;
    metadata.focal_px = 3300.0;  // not 30/36 of 4000
    const auto focal = focalFromExif(metadata, 4000, 3000);
    ASSERT_TRUE(focal);
    EXPECT_EQ(focal->focal_px, 3300.0);
}

TEST(ExifFocal, NothingKnownIsNothing)
{
    EXPECT_FALSE(focalFromExif({}, 800, 600));
    PhotoMetadata metadata;
    metadata.focal_mm = 5.8;  // without a sensor size
    EXPECT_FALSE(focalFromExif(metadata, 800, 600));
}

TEST(CalibratePhoto, TakesSizeAndFocalLengthFromThePhoto)
{
    const synthetic::Room room = synthetic::makeRoom({0.0, 0.0, 0.0, 900.0, 1.5}, {3, 3, 3}, 5);
    Photo photo;
    photo.image.codes = Image<glm::u16vec3>(1200, 900);
    EXPECT_THROW(static_cast<void>(calibratePhoto(room.lines, photo, {}, "lines")), NoAnswerError);
    photo.metadata.focal_mm = 27.0;
    photo.metadata.focal_35mm = 27.0;
    const CameraEstimate estimate = calibratePhoto(room.lines, photo, {}, "lines");
    EXPECT_NEAR(estimate.camera.focal_px.x, 900.0, tolerance::kIterative * 900.0);
    EXPECT_TRUE(hasFinding(estimate.findings, "focal-from-exif"));
    photo.image.codes = Image<glm::u16vec3>(900, 1200);
    EXPECT_THROW(static_cast<void>(calibratePhoto(room.lines, photo, {}, "lines")), InputError);
}

}  // namespace
}  // namespace insitu
