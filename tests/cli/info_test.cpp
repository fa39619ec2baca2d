#include "core/io/exif.h"
#include "core/io/image_io.h"
#include "core/io/json.h"
#include "tests/cli/run_program.h"

#include <gmock/gmock.h>

namespace insitu {
namespace {

using testing::HasSubstr;

class InfoTest : public testing::Test {
protected:
    /// The facts of a file that `info` understands.
    Json factsOf(const std::filesystem::path& path)
    {
        const std::string facts = (folder_ / "facts.json").string();
        const ProgramRun run =
            runProgram({"info", path.string(), "--json", facts, "--force", "--color", "never"});
        EXPECT_EQ(run.exit_code, 0) << run.messages;
        messages_ = run.messages;
        output_ = run.output;
        return readJson(facts);
    }
    TemporaryFolder folder_;
    std::string messages_;
    std::string output_;
};

TEST_F(InfoTest, Photograph)
{
    EncodedImage image{Image<glm::u16vec3>(10, 4, glm::u16vec3(128)), 255};
    for (int x = 0; x < 10; ++x)
        image.codes(x, 0) = glm::u16vec3(255, 3, 4);
    PhotoMetadata metadata;
    metadata.exposure = {0.5, 2.0, 200.0};
    metadata.make = "Acme";
    writeEncoded(folder_ / "a.png", image, makeExif(metadata));
    const Json facts = factsOf(folder_ / "a.png");
    EXPECT_EQ(facts["kind"], "photograph");
    EXPECT_EQ(facts["width"], 10);
    EXPECT_EQ(facts["height"], 4);
    EXPECT_EQ(facts["bits"], 8);
    EXPECT_EQ(facts["share_at_largest_code"], 0.25);
    EXPECT_EQ(facts["share_at_code_0"], 0.0);
    EXPECT_EQ(facts["exposure_seconds"], 0.5);
    EXPECT_EQ(facts["relative_exposure"], 0.25);  // 0.5 s · 2 / 2²
    EXPECT_EQ(facts["make"], "Acme");
    EXPECT_FALSE(facts.contains("focal_mm"));
    EXPECT_EQ(messages_, "");
    EXPECT_THAT(output_, HasSubstr("exposure_seconds        0.5\n"));

    writeEncoded(folder_ / "b.png", image);
    (void)factsOf(folder_ / "b.png");
    EXPECT_THAT(messages_, HasSubstr("info-no-exposure"));
}

TEST_F(InfoTest, RadianceAndLayers)
{
    Image<Rgb> image(4, 2, Rgb(1.0f));
    image(0, 0) = Rgb(0.0f);
    image(1, 0) = Rgb(8.0f);
    writeRadiance(folder_ / "a.exr", image);
    const Json facts = factsOf(folder_ / "a.exr");
    EXPECT_EQ(facts["kind"], "radiance image");
    EXPECT_NEAR(facts["luminance_max"].get<double>(), 8.0, 1e-5);
    EXPECT_NEAR(facts["range_stops"].get<double>(), 3.0, 1e-5);
    EXPECT_EQ(facts["share_black"], 0.125);
    EXPECT_THAT(facts["shape"], HasSubstr("2:1"));

    writeLayeredExr(folder_ / "b.exr", {{"depth.Z", Image<float>(3, 3, 2.5f)}});
    const Json layers = factsOf(folder_ / "b.exr");
    EXPECT_EQ(layers["kind"], "layers");
    EXPECT_EQ(layers["channels"]["depth.Z"]["max"], 2.5);
}

TEST_F(InfoTest, Model)
{
    const auto path = folder_.add("a.obj", "v 0 0 0\nv 2 0 0\nv 0 3 0\nf 1 2 3\n");
    const Json facts = factsOf(path);
    EXPECT_EQ(facts["kind"], "model");
    EXPECT_EQ(facts["triangles"], 1);
    EXPECT_EQ(facts["extent_in_file_units"], Json::array({2.0, 3.0, 0.0}));
}

TEST_F(InfoTest, JsonFiles)
{
    writeJson(folder_ / "r.json", toJson(ResponseCurve::srgb()));
    const Json facts = factsOf(folder_ / "r.json");
    EXPECT_EQ(facts["kind"], "response curve");
    EXPECT_EQ(facts["source"], "srgb");
    const auto lines = folder_.add("l.json", R"({"image": {"width": 800, "height": 600},
        "segments": [{"axis": "x", "from_px": [1, 2], "to_px": [300, 4]},
                     {"axis": "x", "from_px": [1, 90], "to_px": [300, 80]},
                     {"axis": "y", "from_px": [9, 2], "to_px": [9, 400]}],
        "origin_px": [420, 455], "scale": {"camera_height_m": 1.5}})");
    const Json segments = factsOf(lines);
    EXPECT_EQ(segments["segments"]["x"], 2);
    EXPECT_EQ(segments["segments"]["y"], 1);
    EXPECT_EQ(segments["camera_height_m"], 1.5);
    const auto camera = folder_.add("c.json", R"({"image": {"width": 800, "height": 600},
        "focal_px": [700, 700], "position_m": [1, 2, 3], "right": [1, 0, 0], "up": [0, 1, 0],
        "forward": [0, 0, -1]})");
    EXPECT_EQ(factsOf(camera)["kind"], "camera");
    EXPECT_EQ(factsOf(camera)["position_m"], Json::array({1.0, 2.0, 3.0}));
}

TEST_F(InfoTest, CamerasOfOtherPrograms)
{
    const auto ours = folder_.add("c.json", R"({"image": {"width": 800, "height": 600},
        "focal_px": [700, 700], "principal_point_px": [400, 300], "position_m": [1, 2, 3],
        "right": [1, 0, 0], "up": [0, 1, 0], "forward": [0, 0, -1]})");
    const auto picture = folder_ / "p.png";
    writeEncoded(picture, {Image<glm::u16vec3>(800, 600, glm::u16vec3(9)), 255});
    for (const char* name : {"a.fspy", "a.fspy.json", "a.blender.json", "a.gltf", "cameras.txt"}) {
        const auto file = folder_ / name;
        const ProgramRun run = runProgram({"calibrate",
                                           picture.string(),
                                           "--from",
                                           ours.string(),
                                           "-o",
                                           file.string(),
                                           "--force"});
        ASSERT_EQ(run.exit_code, 0) << name << run.messages;
        const Json facts = factsOf(file);
        EXPECT_EQ(facts["kind"], "camera") << name;
        EXPECT_EQ(facts["width"], 800) << name;
        EXPECT_NEAR(facts["focal_px"][0].get<double>(), 700.0, 1e-6) << name;
        for (int k = 0; k < 3; ++k)
            EXPECT_NEAR(facts["position_m"][static_cast<std::size_t>(k)].get<double>(), k + 1, 1e-6)
                << name;
        EXPECT_FALSE(facts.contains("focal_px_sigma")) << name;
    }
    const ProgramRun broken =
        runProgram({"info", folder_.add("b.fspy", "fspy, but no more").string()});
    EXPECT_EQ(broken.exit_code, 1);
    EXPECT_THAT(broken.messages, HasSubstr("b.fspy"));
}

TEST_F(InfoTest, WhatItDoesNotKnowIsAFailureWithACause)
{
    const auto failure = [&](const std::filesystem::path& path) {
        const ProgramRun run = runProgram({"info", path.string()});
        EXPECT_EQ(run.exit_code, 1);
        EXPECT_EQ(run.output, "");
        return run.messages;
    };
    EXPECT_THAT(failure(folder_ / "no.png"), HasSubstr("no such file"));
    EXPECT_THAT(failure(folder_.add("a.txt", "hello")), HasSubstr("not a JPEG, PNG or TIFF"));
    EXPECT_THAT(failure(folder_.add("a.json", "{}")), HasSubstr("is JSON, but not"));
    EXPECT_THAT(failure(folder_.add("b.json", "{")), HasSubstr("b.json:1:2"));
}

}  // namespace
}  // namespace insitu
