#include "core/color.h"
#include "core/io/image_io.h"
#include "core/io/json.h"
#include "tests/capture/synthetic_ball.h"
#include "tests/capture/synthetic_bracket.h"
#include "tests/cli/run_program.h"
#include "tests/support/temporary_folder.h"

#include <gmock/gmock.h>

#include <fstream>
#include <numbers>

namespace insitu {
namespace {

using std::numbers::pi;
using testing::HasSubstr;
using testing::Not;

const glm::dvec3 kToLamp = glm::normalize(glm::dvec3(-0.5, 0.7, 0.6));
constexpr double kLampAngle = 4.0 * pi / 180.0;
constexpr double kLamp = 1500.0;
constexpr double kReflectance = 0.18;

/// Light from all sides, more from above, and a lamp of 8 degrees. Blue is `blue` of the rest.
struct LampSky {
    double blue = 0.8;

    [[nodiscard]] glm::dvec3 tint() const { return {1.0, 0.9, blue}; }
    [[nodiscard]] Rgb radiance(glm::dvec3 d) const
    {
        const double lamp = glm::dot(d, kToLamp) > std::cos(kLampAngle) ? kLamp : 0.0;
        return Rgb(tint() * (1.0 + 0.3 * d.y + lamp));
    }
    /// Closed form: π + 2π/3 · 0.3 n.y, and π sin² of the lamp's angle times its cosine.
    [[nodiscard]] glm::dvec3 irradiance(glm::dvec3 normal) const
    {
        const double cosine = std::max(0.0, glm::dot(normal, kToLamp));
        const double lamp = kLamp * pi * std::pow(std::sin(kLampAngle), 2.0) * cosine;
        return tint() * (pi + 0.2 * pi * normal.y + lamp);
    }
};

/// A bracket that clips the lamp by far, of a picture with a mirror ball, a grey ball and a card.
class ProbeWithReferences : public testing::Test {
protected:
    static constexpr double kDistance = 1.5;

    void write(const LampSky& sky)
    {
        MirrorBall mirror;
        mirror.center_px = {140, 140};
        mirror.radius_px = 110;
        mirror.radius_m = 0.06;
        const Camera camera = ballCamera(mirror, {0, 0, kDistance}, 440, 280);
        Image<Rgb> picture = renderBall(
            mirror,
            camera,
            [&](glm::dvec3, glm::dvec3 d) { return sky.radiance(d); },
            {},
            {},
            Rgb(0.2f));
        // The grey ball, where its middle is seen at (350, 80), with a radius of about 55 px.
        const glm::dvec3 middle =
            camera.position_m + kDistance * camera.rayDirection({350.0, 80.0});
        const double radius = 0.03;
        for (int y = 0; y < 280; ++y)
            for (int x = 260; x < 440; ++x) {
                const glm::dvec3 d = camera.rayDirection({x + 0.5, y + 0.5});
                const glm::dvec3 from = camera.position_m - middle;
                const double b = glm::dot(d, from);
                const double q = b * b - glm::dot(from, from) + radius * radius;
                if (q > 0.0)
                    picture(x, y) = Rgb(kReflectance / pi *
                                        sky.irradiance((from + (-b - std::sqrt(q)) * d) / radius));
                if (x >= 300 && x < 400 && y >= 180 && y < 260)
                    picture(x, y) = Rgb(kReflectance / pi * sky.irradiance({0, 0, 1}));
            }
        const Bracket bracket = photograph(picture, seconds_, shoulderCamera(0.6, 2e-5, 1e-7));
        for (std::size_t k = 0; k < seconds_.size(); ++k)
            writeEncoded(folder_ / fmt::format("{}.png", k), bracket.frames[k].image);
    }
    [[nodiscard]] nlohmann::ordered_json probe() const
    {
        return {{"kind", "mirror-ball"},
                {"images", {"0.png", "1.png", "2.png", "3.png", "4.png", "5.png"}},
                {"exposure_seconds", seconds_},
                {"ball", {{"center_px", {140, 140}}, {"radius_px", 110}, {"radius_m", 0.06}}},
                {"center_m", {0, 0, 0}},
                {"view", {{"position_m", {0, 0, kDistance}}}}};
    }
    ProgramRun run(const nlohmann::ordered_json& references) const
    {
        nlohmann::ordered_json file = probe();
        if (!references.empty()) file["references"] = references;
        std::ofstream(folder_ / "probe.json") << file.dump();
        return runProgram({"probe", name("probe.json"), "-o", name("env.exr"), "--force"});
    }
    /// Irradiance of a surface that faces the lamp over that of one that looks the other way,
    /// relative to the truth; the bracket's unit falls out.
    [[nodiscard]] glm::dvec3 contrast(const LampSky& sky) const
    {
        const EnvironmentMap map{readRadiance(name("env.exr")).pixels};
        const auto ratio = [](glm::dvec3 towards, glm::dvec3 away) { return towards / away; };
        return ratio(irradiance(map, kToLamp), irradiance(map, -kToLamp)) /
               ratio(sky.irradiance(kToLamp), sky.irradiance(-kToLamp));
    }
    [[nodiscard]] std::string name(const std::string& file) const
    {
        return (folder_ / file).string();
    }

    TemporaryFolder folder_;
    std::vector<double> seconds_ = {2.0, 0.5, 0.125, 1.0 / 32, 1.0 / 128, 1.0 / 512};
    const nlohmann::ordered_json card_ = {{"type", "card"},
                                          {"area_px", {310, 190, 80, 60}},
                                          {"reflectance", kReflectance},
                                          {"normal", {0, 0, 1}}};
};

TEST_F(ProbeWithReferences, TheClippedLampIsFoundWithinFivePercent)
{
    const LampSky sky;
    write(sky);
    const ProgramRun alone = run({});
    ASSERT_EQ(alone.exit_code, 0) << alone.messages;
    EXPECT_THAT(alone.messages, HasSubstr("light-clipped-unsolved"));
    EXPECT_LT(contrast(sky).g, 0.7);

    const auto lux = [&](glm::dvec3 normal) {
        const glm::dvec3 e = 123.0 * sky.irradiance(normal);
        return nlohmann::ordered_json{{"type", "illuminance"},
                                      {"lux", 0.2126 * e.r + 0.7152 * e.g + 0.0722 * e.b},
                                      {"normal", {normal.x, normal.y, normal.z}}};
    };
    const std::vector<nlohmann::ordered_json> all = {
        nlohmann::ordered_json::array({card_}),
        nlohmann::ordered_json::array({{{"type", "ball"},
                                        {"center_px", {350, 80}},
                                        {"radius_px", 55},
                                        {"reflectance", kReflectance}}}),
        nlohmann::ordered_json::array(
            {{{"type", "ball"}, {"center_px", {350, 80}}, {"radius_px", 55}}}),
        nlohmann::ordered_json::array({lux(kToLamp), lux({0, -1, 0})})};
    for (const nlohmann::ordered_json& references : all) {
        const ProgramRun solved = run(references);
        ASSERT_EQ(solved.exit_code, 0) << solved.messages;
        EXPECT_THAT(solved.messages, HasSubstr("light-clipped-solved"));
        EXPECT_THAT(solved.messages, Not(HasSubstr("light-reference-disagrees")));
        // A light meter says nothing of colour.
        if (references[0]["type"] == "illuminance")
            EXPECT_NEAR(luminance(Rgb(contrast(sky))), 1.0, 0.05);
        else
            for (int c = 0; c < 3; ++c)
                EXPECT_NEAR(contrast(sky)[c], 1.0, 0.05) << references.dump() << " channel " << c;
    }
}

TEST_F(ProbeWithReferences, FlagsSayTheSameAsTheFile)
{
    const LampSky sky;
    write(sky);
    std::vector<std::string> command = {"probe"};
    for (std::size_t k = 0; k < seconds_.size(); ++k)
        command.push_back(name(fmt::format("{}.png", k)));
    for (const char* word : {"--exposures",
                             "2,0.5,0.125,0.03125,0.0078125,0.001953125",
                             "--center",
                             "140,140",
                             "--radius",
                             "110",
                             "--radius-m",
                             "0.06",
                             "--view-position",
                             "0,0,1.5",
                             "-o"})
        command.push_back(word);
    command.push_back(name("env.exr"));
    std::vector<std::string> with_card = command;
    for (const char* word : {"--card", "310,190,80,60", "--card-normal", "0,0,1"})
        with_card.push_back(word);
    const ProgramRun solved = runProgram(with_card);
    ASSERT_EQ(solved.exit_code, 0) << solved.messages;
    EXPECT_THAT(solved.messages, HasSubstr("light-clipped-solved"));
    for (int c = 0; c < 3; ++c)
        EXPECT_NEAR(contrast(sky)[c], 1.0, 0.05);

    const auto refused = [&](std::vector<std::string> more, const std::string& cause) {
        std::vector<std::string> all = command;
        all.back() = name("none.exr");
        all.insert(all.end(), more.begin(), more.end());
        const ProgramRun wrong = runProgram(all);
        EXPECT_EQ(wrong.exit_code, 1) << wrong.messages;
        EXPECT_THAT(wrong.messages, HasSubstr(cause));
        EXPECT_FALSE(std::filesystem::exists(name("none.exr")));
    };
    refused({"--lux", "500,0,1,0"}, "a single reading");
    refused({"--lux", "500,0,1", "--lux", "3,0,1,0"}, "has 3 numbers");
    refused({"--lux", "bright,0,1,0", "--lux", "3,0,1,0"}, "is no number");
    refused({"--lux", "-5,0,1,0", "--lux", "3,0,1,0"}, "must be above 0");
    refused({"--lux", "5,0,0,0", "--lux", "3,0,1,0"}, "must be a direction");
    refused({"--card", "310,190,0,60"}, "width and a height");
    refused({"--card", "430,190,80,60"}, "is not in it");
    refused({"--grey-ball", "350,80,2"}, "at least 4 pixels");
    refused({"--grey-ball", "430,80,55"}, "not wholly in it");
    refused({"--irradiance", "1,2,0,0,1,0"}, "each channel");
}

// A tungsten lamp: its light has hardly any blue, and the card's blue is a few codes.
TEST_F(ProbeWithReferences, ATungstenLampWithAlmostNoBlue)
{
    const LampSky sky{.blue = 0.02};
    write(sky);
    const ProgramRun solved = run(nlohmann::ordered_json::array({card_}));
    ASSERT_EQ(solved.exit_code, 0) << solved.messages;
    EXPECT_THAT(solved.messages, HasSubstr("light-clipped-solved"));
    EXPECT_NEAR(contrast(sky).r, 1.0, 0.05);
    EXPECT_NEAR(contrast(sky).g, 1.0, 0.05);
    EXPECT_NEAR(contrast(sky).b, 1.0, 0.05);
}

TEST_F(ProbeWithReferences, AClippedCardIsRefused)
{
    write(LampSky{});
    // The lamp's own reflection.
    nlohmann::ordered_json lamp = card_;
    lamp["area_px"] = {109, 97, 3, 3};
    const ProgramRun wrong = run(nlohmann::ordered_json::array({lamp}));
    EXPECT_EQ(wrong.exit_code, 1);
    EXPECT_THAT(wrong.messages, HasSubstr("grey card clipped in every exposure"));
    EXPECT_FALSE(std::filesystem::exists(name("env.exr")));
}

TEST_F(ProbeWithReferences, EntriesWithoutMeaningAreRefused)
{
    write(LampSky{});
    const auto refused = [&](const nlohmann::ordered_json& entry, const std::string& cause) {
        const ProgramRun wrong = run(nlohmann::ordered_json::array({entry}));
        EXPECT_EQ(wrong.exit_code, 1) << entry.dump();
        EXPECT_THAT(wrong.messages, HasSubstr("references[0]"));
        EXPECT_THAT(wrong.messages, HasSubstr(cause));
    };
    const auto card = [&](const std::string& key, const nlohmann::ordered_json& value) {
        nlohmann::ordered_json changed = card_;
        changed[key] = value;
        return changed;
    };
    refused({{"type", "lamp"}}, "card");
    refused(card("reflectance", 0.0), "above 0 and at most 1");
    refused(card("reflectance", 18), "above 0 and at most 1");
    refused(card("area_px", {1, 2, 3}), "[left, top, width, height]");
    refused(card("normal", {0, 0, 0}), "is no direction");
    refused(card("sigma_percent", 80), "between 0.1 and 50");
    refused(card("reflectence", 0.2), "reflectence");
    refused(card("in", "ball"), "photo");
    refused(card("iso", 100), "images of its own");
    refused({{"type", "irradiance"}, {"value", {1, -1, 1}}}, "must be above 0");
    const ProgramRun lone =
        run(nlohmann::ordered_json::array({{{"type", "illuminance"}, {"lux", 300}}}));
    EXPECT_EQ(lone.exit_code, 1);
    EXPECT_THAT(lone.messages, HasSubstr("a single reading in lux"));
    const ProgramRun photo = run(nlohmann::ordered_json::array({card("in", "photo")}));
    EXPECT_EQ(photo.exit_code, 1);
    EXPECT_THAT(photo.messages, HasSubstr("there is none here"));
}

}  // namespace
}  // namespace insitu
