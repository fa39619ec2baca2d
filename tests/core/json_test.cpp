#include "core/io/json.h"

#include "core/io/file.h"
#include "tests/support/errors.h"
#include "tests/support/temporary_folder.h"

#include <gmock/gmock.h>

namespace insitu {
namespace {

using testing::HasSubstr;

class JsonTest : public testing::Test {
protected:
    std::string errorOf(std::string_view text)
    {
        return inputErrorOf([&] { (void)readJson(folder_.add("a.json", text)); });
    }
    TemporaryFolder folder_;
};

TEST_F(JsonTest, SyntaxErrorsHaveLineAndColumn)
{
    EXPECT_THAT(errorOf("{\n  \"a\": 1,\n  \"b\" 2\n}"), HasSubstr("a.json:3:7: not valid JSON"));
    EXPECT_THAT(errorOf("[1, 2"), HasSubstr("a.json:1:6"));
    EXPECT_THAT(errorOf(""), HasSubstr("a.json:1:1"));
    EXPECT_THAT(errorOf("\n\n\xFF\xFE"), HasSubstr("a.json:3:1"));
    EXPECT_THAT(inputErrorOf([&] { (void)readJson(folder_ / "no.json"); }), HasSubstr("no such"));
}

TEST_F(JsonTest, RefusesWhatOthersLetPass)
{
    EXPECT_THAT(errorOf("{\"a\": 1, \"b\": {\"a\": 2, \"a\": 3}}"),
                HasSubstr("\"a\" is given twice"));
    EXPECT_NO_THROW(
        (void)readJson(folder_.add("b.json", "{\"a\": {\"a\": 1}, \"b\": {\"a\": 1}}")));
    EXPECT_THAT(errorOf("{\"a\": NaN}"), HasSubstr("not valid JSON"));
    EXPECT_THAT(errorOf("{\"a\": 1e999}"), HasSubstr("not valid JSON"));
    EXPECT_THAT(errorOf(std::string(100000, '[')), HasSubstr("nested deeper"));
    std::string nested;
    for (int i = 0; i < 100000; ++i)
        nested += "{\"a\":";
    EXPECT_THAT(errorOf(nested), HasSubstr("nested deeper"));
}

TEST_F(JsonTest, WritesAndReadsBack)
{
    Json json;
    json["z"] = {1, 2.5, "ä"};
    json["a"] = nullptr;
    writeJson(folder_ / "a.json", json);
    EXPECT_EQ(readJson(folder_ / "a.json"), json);
    const std::vector<std::uint8_t> bytes = readFile(folder_ / "a.json");
    EXPECT_EQ(std::string(bytes.begin(), bytes.end()),
              "{\n  \"z\": [\n    1,\n    2.5,\n    \"ä\"\n  ],\n  \"a\": null\n}\n");
    json["a"] = "caf\xE9";  // Latin-1, as a camera may write it
    EXPECT_NO_THROW(writeJson(folder_ / "b.json", json));
    EXPECT_EQ(folder_.size(), 2u);
}

TEST(JsonNode, NamesThePlace)
{
    const Json json = Json::parse(R"({"room": [{"min_m": [1, 2, "x"]}, 5], "n": 1.5})");
    const JsonNode root(json, "p.json");
    const JsonNode minimum = root.at("room").at(std::size_t{0}).at("min_m");
    EXPECT_EQ(minimum.position(), "room[0].min_m");
    EXPECT_EQ(inputErrorOf([&] { (void)minimum.vec3(); }),
              "p.json:room[0].min_m[2]: must be a number, not string");
    EXPECT_EQ(inputErrorOf([&] { (void)minimum.vec2(); }),
              "p.json:room[0].min_m: must have 2 numbers, not 3");
    EXPECT_EQ(inputErrorOf([&] { (void)root.at("objects"); }), "p.json: \"objects\" is missing");
    EXPECT_THAT(inputErrorOf([&] { (void)root.at("room").at(std::size_t{2}); }),
                HasSubstr("p.json:room: has 2 entries"));
    EXPECT_THAT(inputErrorOf([&] { (void)root.at("room").at(std::size_t{1}).at("a"); }),
                HasSubstr("p.json:room[1]: must be an object"));
}

TEST(JsonNode, ConvertsStrictly)
{
    const Json json = Json::parse(R"({"i": 3, "d": 2.5, "b": true, "s": "x", "v": [1, 2, 3],
                                      "minus": -1, "large": 1e12, "zero": 0})");
    const JsonNode root(json, "p.json");
    EXPECT_EQ(root.at("i").integer(), 3);
    EXPECT_EQ(root.at("i").number(), 3.0);
    EXPECT_EQ(root.at("d").positive(), 2.5);
    EXPECT_TRUE(root.at("b").boolean());
    EXPECT_EQ(root.at("s").text(), "x");
    EXPECT_EQ(root.at("v").vec3(), glm::dvec3(1, 2, 3));
    EXPECT_EQ(root.at("v").size(), 3u);
    EXPECT_TRUE(root.has("v"));
    EXPECT_FALSE(root.has("w"));
    EXPECT_FALSE(root.find("w"));
    EXPECT_THAT(inputErrorOf([&] { (void)root.at("d").integer(); }), HasSubstr("whole number"));
    EXPECT_THAT(inputErrorOf([&] { (void)root.at("large").integer(); }), HasSubstr("whole number"));
    EXPECT_THAT(inputErrorOf([&] { (void)root.at("minus").positive(); }), HasSubstr("above 0"));
    EXPECT_THAT(inputErrorOf([&] { (void)root.at("zero").positive(); }), HasSubstr("above 0"));
    EXPECT_THAT(inputErrorOf([&] { (void)root.at("i").boolean(); }), HasSubstr("true or false"));
    EXPECT_THAT(inputErrorOf([&] { (void)root.at("i").text(); }), HasSubstr("must be a text"));
    EXPECT_THAT(inputErrorOf([&] { (void)root.at("b").number(); }), HasSubstr("must be a number"));
    EXPECT_THAT(inputErrorOf([&] { (void)root.at("s").size(); }), HasSubstr("must be a list"));
}

TEST(JsonNode, UnknownKeysGetASuggestion)
{
    const Json json = Json::parse(R"({"postion_m": 1})");
    const JsonNode root(json, "p.json");
    EXPECT_EQ(inputErrorOf([&] {
                  root.expectKeys({"position_m", "scale"});
              }),
              "p.json: unknown key \"postion_m\"; did you mean \"position_m\"?");
    EXPECT_EQ(inputErrorOf([&] {
                  root.expectKeys({"model", "scale"});
              }),
              "p.json: unknown key \"postion_m\"; known are \"model\", \"scale\"");
    EXPECT_NO_THROW(root.expectKeys({"postion_m"}));
}

TEST(DidYouMean, NearestWithinAThird)
{
    EXPECT_EQ(didYouMean("roughnes", {"rough", "roughness"}), "roughness");
    EXPECT_EQ(didYouMean("Scale", {"scale", "scales"}), "scale");
    EXPECT_EQ(didYouMean("rotation", {"rotation_y_deg", "position_m"}), std::nullopt);
    EXPECT_EQ(didYouMean("camera", {"model", "light"}), std::nullopt);
    EXPECT_EQ(didYouMean("x", {"y"}), std::nullopt);
    EXPECT_EQ(didYouMean("abc", {}), std::nullopt);
}

TEST(ResponseJson, RoundTripAndRefusals)
{
    const ResponseCurve curve = ResponseCurve::srgb();
    Json json = toJson(curve);
    const ResponseCurve read = responseFromJson(JsonNode(json, "r.json"));
    EXPECT_EQ(read.exposure, curve.exposure);
    EXPECT_EQ(read.source, "srgb");

    const auto error = [&](const auto& damage) {
        Json damaged = toJson(curve);
        damage(damaged);
        return inputErrorOf([&] { (void)responseFromJson(JsonNode(damaged, "r.json")); });
    };
    EXPECT_EQ(error([](Json& j) { j["exposure"][1][7] = j["exposure"][1][6]; }).substr(0, 22),
              "r.json:exposure[1][7]:");
    EXPECT_THAT(error([](Json& j) { j["exposure"][0][0] = -1.0; }), HasSubstr("not negative"));
    EXPECT_THAT(error([](Json& j) { j["exposure"][2].erase(3); }), HasSubstr("256 numbers"));
    EXPECT_THAT(error([](Json& j) { j["exposure"].erase(0); }), HasSubstr("3 lists"));
    EXPECT_THAT(error([](Json& j) { j["exposures"] = 1; }), HasSubstr("did you mean"));
    EXPECT_THAT(error([](Json& j) { j.erase("exposure"); }), HasSubstr("missing"));
}

}  // namespace
}  // namespace insitu
