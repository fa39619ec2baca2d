#include "core/io/image_io.h"
#include "core/io/json.h"
#include "tests/capture/synthetic_ball.h"
#include "tests/cli/run_program.h"
#include "tests/support/temporary_folder.h"

#include <gmock/gmock.h>

#include <cmath>
#include <fstream>

namespace insitu {
namespace {

using testing::HasSubstr;

/// A far room by direction: walls that get lighter upwards, a lamp.
Rgb farRoom(glm::dvec3 /*origin*/, glm::dvec3 d)
{
    if (glm::dot(d, glm::normalize(glm::dvec3(0.4, 0.8, -0.3))) > 0.97) return Rgb(20.0f);
    return Rgb(glm::dvec3(0.6 + 0.3 * d.x, 0.7 + 0.4 * d.y, 0.5 - 0.3 * d.z));
}

/// Two pictures of one ball with a black photographer in each, masks of them, and the file that
/// describes them. The second camera is rolled.
class TwoViews : public testing::Test {
protected:
    static constexpr int kSide = 220;
    static constexpr double kPerson = 0.25;  // radians

    void SetUp() override
    {
        ball_.center_m = {0.1, 0.9, -0.2};
        ball_.radius_m = 0.06;
        ball_.radius_px = 100.0;
        ball_.center_px = glm::dvec2(0.5 * kSide);
        writeView("front", {-0.2, 1.1, 1.0}, {0.0, 1.0, 0.0});
        writeView("side", {-1.3, 1.1, -0.5}, {0.2, 1.0, 0.4});
        nlohmann::ordered_json probe = {{"kind", "mirror-ball"},
                                        {"center_m", {0.1, 0.9, -0.2}},
                                        {"views", {view("front", {-0.2, 1.1, 1.0})}}};
        probe["views"].push_back(view("side", {-1.3, 1.1, -0.5}));
        probe["views"][1]["view"]["up"] = {0.2, 1.0, 0.4};
        std::ofstream(folder_ / "probe.json") << probe.dump();
    }
    void writeView(const std::string& name, glm::dvec3 position, glm::dvec3 up) const
    {
        const Camera camera = ballCamera(ball_, position, kSide, kSide, up);
        const glm::dvec3 person = glm::normalize(position - ball_.center_m);
        writeRadiance(
            file(name + ".exr"), renderBall(ball_, camera, [&](glm::dvec3 o, glm::dvec3 d) {
                return glm::dot(d, person) > std::cos(kPerson) ? Rgb(0.0f) : farRoom(o, d);
            }));
        EncodedImage mask;
        mask.codes = Image<glm::u16vec3>(kSide, kSide);
        for (int y = 0; y < kSide; ++y)
            for (int x = 0; x < kSide; ++x)
                if (glm::length(glm::dvec2(x + 0.5, y + 0.5) - ball_.center_px) <
                    (std::sin(0.5 * kPerson) + 0.03) * ball_.radius_px)
                    mask.codes(x, y) = glm::u16vec3(255);
        writeEncoded(file(name + "_mask.png"), mask);
    }
    [[nodiscard]] static nlohmann::ordered_json view(const std::string& name,
                                                     std::array<double, 3> position)
    {
        return {
            {"images", nlohmann::ordered_json::array({name + ".exr"})},
            {"mask", name + "_mask.png"},
            {"ball",
             {{"center_px", {0.5 * kSide, 0.5 * kSide}}, {"radius_px", 100.0}, {"radius_m", 0.06}}},
            {"view", {{"position_m", position}}}};
    }
    [[nodiscard]] std::string file(const std::string& name) const
    {
        return (folder_ / name).string();
    }

    TemporaryFolder folder_;
    MirrorBall ball_;
};

TEST_F(TwoViews, ShowTheRoomWithoutThePhotographer)
{
    const ProgramRun run =
        runProgram({"probe", file("probe.json"), "-o", file("env.exr"), "--width", "256"});
    ASSERT_EQ(run.exit_code, 0) << run.messages;
    EXPECT_THAT(run.messages, testing::Not(HasSubstr("probe-views-disagree")));
    EXPECT_THAT(run.messages, testing::Not(HasSubstr("probe-inpainted")));
    const EnvironmentMap found{readRadiance(file("env.exr")).pixels};
    const EnvironmentMap truth = panorama(farRoom, ball_.center_m, 256);
    for (int axis = 0; axis < 3; ++axis) {
        for (const double sign : {1.0, -1.0}) {
            glm::dvec3 normal(0.0);
            normal[axis] = sign;
            const glm::dvec3 ratio = irradiance(found, normal) / irradiance(truth, normal);
            for (int c = 0; c < 3; ++c)
                EXPECT_NEAR(ratio[c], 1.0, 0.01);  // the aim of the stage
        }
    }
}

TEST_F(TwoViews, OneMaskedOnTheCommandLineIsPaintedIn)
{
    const std::vector<std::string> command = {"probe",
                                              file("side.exr"),
                                              "-o",
                                              file("one.exr"),
                                              "--center",
                                              "110,110",
                                              "--radius",
                                              "100",
                                              "--radius-m",
                                              "0.06",
                                              "--position",
                                              "0.1,0.9,-0.2",
                                              "--view-position",
                                              "-1.3,1.1,-0.5",
                                              "--up",
                                              "0.2,1,0.4",
                                              "--mask"};
    std::vector<std::string> good = command;
    good.push_back(file("side_mask.png"));
    const ProgramRun run = runProgram(good);
    ASSERT_EQ(run.exit_code, 0) << run.messages;
    EXPECT_THAT(run.messages, HasSubstr("probe-inpainted"));
    const EnvironmentMap found{readRadiance(file("one.exr")).pixels};
    const glm::dvec3 person = glm::normalize(glm::dvec3(-1.3, 1.1, -0.5) - ball_.center_m);
    EXPECT_NEAR(lookUp(found, person).r, farRoom({}, person).r, 0.05);  // black without the mask
    const glm::dvec3 above(0.0, 1.0, 0.0);  // where the rolled camera's up matters
    EXPECT_NEAR(lookUp(found, above).g, farRoom({}, above).g, 0.01);

    EncodedImage small;
    small.codes = Image<glm::u16vec3>(20, 10);
    writeEncoded(file("small.png"), small);
    std::vector<std::string> bad = command;
    bad.push_back(file("small.png"));
    bad.emplace_back("--force");
    const ProgramRun refused = runProgram(bad);
    EXPECT_EQ(refused.exit_code, 1);
    EXPECT_THAT(refused.messages, HasSubstr("as large as"));
}

}  // namespace
}  // namespace insitu
