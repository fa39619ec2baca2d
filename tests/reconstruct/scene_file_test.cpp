#include "reconstruct/scene_file.h"

#include "core/io/json.h"
#include "reconstruct/scene_keys.h"
#include "tests/support/errors.h"
#include "tests/support/simulated_scene.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/tolerance.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <functional>
#include <set>

namespace insitu {
namespace {

using namespace simulated_scene;
using testing::AllOf;
using testing::HasSubstr;

class SceneFileTest : public testing::Test {
protected:
    [[nodiscard]] static Json good()
    {
        return Json::parse(R"({ "format": "insitu-scene", "version": 1,
          "primitives": [
            {"name": "lamp", "shape": "cylinder", "stands_on": "table.top", "aligned_with": "table"},
            {"name": "shelf", "shape": "box", "stands_on": "room.floor", "beside": "cupboard.right",
             "flush": "cupboard.front"},
            {"name": "room", "shape": "room-box", "fixed": ["rotation", "depth_m"]},
            {"name": "cupboard", "shape": "box", "stands_on": {"face": "room.floor", "gap_m": 0.1},
             "against": ["room.back", {"face": "left", "target": "room.left", "gap_m": 0.05}],
             "parameters": {"height_m": {"value": 1.9, "sigma": 0.02}}},
            {"name": "table", "shape": "box", "position_m": [1, 0, 1], "rotation_y_deg": 30}],
          "constraints": [
            {"vertex": "table.top_front_left", "at_px": [100, 200], "sigma_px": 2},
            {"edge": ["lamp.bottom_0", "lamp.top_0"], "from_px": [1, 2], "to_px": [30, 4]},
            {"length": ["room.bottom_back_left", "table.top_back_left"], "metres": 2}],
          "room": [{"type": "opening"}] })");
    }
    [[nodiscard]] SceneFile read(const Json& json) const
    {
        std::ofstream(folder_ / "scene.json") << json.dump();
        return readScene(folder_ / "scene.json");
    }
    [[nodiscard]] std::string complaint(const std::function<void(Json&)>& change) const
    {
        Json json = good();
        change(json);
        return inputErrorOf([&] { (void)read(json); });
    }

    TemporaryFolder folder_;
};

TEST_F(SceneFileTest, IsReadWholeWithTargetsFirst)
{
    const SceneFile scene = read(good());
    std::vector<std::string> names;
    for (const ScenePrimitive& primitive : scene.graph.primitives)
        names.push_back(primitive.name);
    EXPECT_THAT(names, testing::ElementsAre("table", "lamp", "room", "cupboard", "shelf"));
    const ScenePrimitive& cupboard = scene.graph.primitives[3];
    EXPECT_EQ(cupboard.support, 2u);
    EXPECT_EQ(cupboard.support_gap_m, 0.1);
    ASSERT_EQ(cupboard.contacts.size(), 2u);
    EXPECT_EQ(cupboard.contacts[0].target, 2u);
    EXPECT_EQ(cupboard.shape.faces[cupboard.contacts[0].face].name, "back");
    EXPECT_EQ(cupboard.contacts[1].gap_m, 0.05);
    EXPECT_EQ(cupboard.parameters[1].value, 1.9);
    EXPECT_EQ(cupboard.parameters[1].sigma, 0.02);
    const ScenePrimitive& shelf = scene.graph.primitives[4];
    EXPECT_EQ(shelf.shape.faces[shelf.contacts[0].face].name, "left");
    EXPECT_TRUE(shelf.contacts[1].flush);
    EXPECT_TRUE(scene.graph.primitives[2].parameters[2].fixed);
    EXPECT_TRUE(scene.graph.primitives[2].rotation_fixed);
    EXPECT_EQ(scene.graph.primitives[1].aligned->target, 0u);
    EXPECT_EQ(scene.graph.vertices[0].vertex.primitive, 0u);
    EXPECT_EQ(scene.graph.vertices[0].sigma_px, 2.0);
    EXPECT_EQ(scene.graph.edges[0].name, "edge lamp.bottom_0 to lamp.top_0");
    EXPECT_EQ(scene.graph.lengths[0].from.primitive, 2u);
}

TEST_F(SceneFileTest, ErrorsNamePlaceCauseAndRemedy)
{
    const auto primitive = [](int i, const char* key, const Json& value) {
        return [=](Json& j) { j["primitives"][i][key] = value; };
    };
    const auto constraint = [](int i, const char* key, const Json& value) {
        return [=](Json& j) { j["constraints"][i][key] = value; };
    };
    EXPECT_THAT(complaint(primitive(0, "stand_on", 1)), HasSubstr("did you mean \"stands_on\"?"));
    EXPECT_THAT(
        complaint(primitive(0, "stands_on", "tabel.top")),
        HasSubstr("primitives[0].stands_on: no primitive \"tabel\"; did you mean \"table\"?"));
    EXPECT_THAT(complaint(primitive(0, "stands_on", "table.tip")), HasSubstr("\"top\""));
    EXPECT_THAT(complaint(primitive(0, "stands_on", "table")), HasSubstr("primitive.face"));
    EXPECT_THAT(complaint(primitive(0, "stands_on", "room.ceiling")), HasSubstr("look up"));
    EXPECT_THAT(complaint(primitive(0, "stands_on", Json{{"gap_m", 1}})), HasSubstr("either"));
    EXPECT_THAT(complaint(primitive(4, "stands_on", "lamp.top")), HasSubstr("itself"));
    EXPECT_THAT(complaint(primitive(0, "model", "x.obj")), HasSubstr("either a shape or a model"));
    EXPECT_THAT(complaint(primitive(0, "name", "a.b")), HasSubstr("no dot"));
    EXPECT_THAT(complaint(primitive(0, "name", "room")), HasSubstr("there twice"));
    EXPECT_THAT(complaint(primitive(2, "fixed", Json::array({"hieght_m"}))),
                HasSubstr("did you mean \"height_m\"?"));
    EXPECT_THAT(complaint(primitive(4, "parameters", Json{{"width_m", -1}})), HasSubstr("0.001"));
    EXPECT_THAT(
        complaint(primitive(
            4, "parameters", Json{{"width_m", {{"value", 1}, {"fixed", true}, {"sigma", 0.1}}}})),
        HasSubstr("either held or known"));
    EXPECT_THAT(complaint(primitive(1, "beside", "room.floor")), HasSubstr("no opposite"));
    EXPECT_THAT(
        complaint(primitive(1, "aligned_with", Json{{"primitive", "room"}, {"turn_deg", 3}})),
        AllOf(HasSubstr("primitives[1]"), HasSubstr("contradict")));
    EXPECT_THAT(complaint(constraint(0, "vertex", "table.top")), HasSubstr("no vertex \"top\""));
    EXPECT_THAT(complaint(constraint(0, "at_px", Json::array({1e300, 0}))), HasSubstr("no place"));
    EXPECT_THAT(complaint(constraint(0, "sigma_px", 0)), HasSubstr("sigma_px"));
    EXPECT_THAT(
        complaint(constraint(1, "edge", Json::array({"lamp.top_0", "table.top_front_left"}))),
        HasSubstr("of one primitive"));
    EXPECT_THAT(complaint(constraint(1, "edge", Json::array({"lamp.top_0", "lamp.top_0"}))),
                HasSubstr("two ends"));
    EXPECT_THAT(complaint(constraint(1, "to_px", Json::array({1, 2}))), HasSubstr("pixel apart"));
    EXPECT_THAT(complaint(constraint(2, "metres", -1)), HasSubstr("metres"));
    EXPECT_THAT(complaint([](Json& j) { j["constraints"].push_back(Json::object()); }),
                HasSubstr("must have \"vertex\", \"edge\" or \"length\""));
    EXPECT_THAT(complaint([](Json& j) { j["constraints"].push_back(j["constraints"][0]); }),
                HasSubstr("twice"));
    EXPECT_THAT(complaint([](Json& j) { j["version"] = 2; }), HasSubstr("version 1"));
    EXPECT_THAT(complaint([](Json& j) { j["library"] = "none.json"; }), HasSubstr("no file"));
    EXPECT_THAT(complaint([](Json& j) { j["primitives"] = Json::array(); }), HasSubstr("empty"));
}

TEST_F(SceneFileTest, ModelsAreScaledAndRoomsWritten)
{
    std::ofstream(folder_ / "block.obj")
        << "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 3 4\n";
    Json json = good();
    json["primitives"].push_back({{"name", "block"},
                                  {"model", "block.obj"},
                                  {"parameters", {{"scale", 0.5}}},
                                  {"position_m", {2, 0, -1}}});
    SceneFile scene = read(json);
    scene.graph.vertices.clear();
    scene.graph.edges.clear();
    scene.graph.lengths.clear();
    SceneSolver solver(scene.graph, camera());
    (void)solver.solve();
    writeReconstruction(folder_ / "room.json", scene, solver.estimate());
    const Json room = readJson(folder_ / "room.json");
    const auto item = [&](const std::string& name) {
        for (const Json& one : room["room"])
            if (one.contains("name") && one["name"] == name) return one;
        ADD_FAILURE() << name;
        return Json();
    };
    EXPECT_EQ(item("room")["type"], "box");
    EXPECT_EQ(item("room")["solid"], false);
    EXPECT_EQ(item("cupboard")["type"], "box");
    EXPECT_NEAR(item("cupboard")["min_m"][2].get<double>(), -2.5, tolerance::kDouble);
    EXPECT_NEAR(item("cupboard")["min_m"][1].get<double>(), 0.1, tolerance::kDouble);
    EXPECT_EQ(item("table")["type"], "primitive");
    EXPECT_NEAR(item("table")["rotation_y_deg"].get<double>(), 30.0, 1e-10);
    EXPECT_EQ(item("lamp")["shape"], "cylinder");
    EXPECT_EQ(item("block")["model"], "block.obj");
    EXPECT_EQ(item("block")["scale"], 0.5);
    EXPECT_EQ(room["room"].back()["type"], "opening");
    // Nothing is marked: the table's width is open, what is fixed is certain.
    for (const Json& one : room["primitives"]) {
        const Json& sizes = one["parameters"];
        if (one["name"] == "table") {
            EXPECT_TRUE(sizes["width_m"]["sigma"].is_null());
        }
        if (one["name"] == "room") {
            EXPECT_EQ(sizes["depth_m"]["sigma"], 0.0);
        }
    }
}

TEST(SceneSchema, NamesTheReadersKeys)
{
    const Json schema =
        readJson(std::filesystem::path(INSITU_SOURCE_DIR) / "docs" / "scene.schema.json");
    const auto expectSame = [](const Json& object, const keys::SceneKeyList& allowed) {
        std::set<std::string> in_schema;
        for (const auto& entry : object.at("properties").items())
            in_schema.insert(entry.key());
        EXPECT_EQ(in_schema, std::set<std::string>(allowed.begin(), allowed.end()));
    };
    expectSame(schema, keys::kScene);
    const Json& d = schema.at("$defs");
    expectSame(d.at("primitive"), keys::kScenePrimitive);
    expectSame(d.at("number"), keys::kSceneNumber);
    expectSame(d.at("stands_on"), keys::kStandsOn);
    expectSame(d.at("contact"), keys::kContact);
    expectSame(d.at("aligned_with"), keys::kAlignedWith);
    expectSame(d.at("vertex"), keys::kVertexConstraint);
    expectSame(d.at("edge"), keys::kEdgeConstraint);
    expectSame(d.at("length"), keys::kLengthConstraint);
}

}  // namespace
}  // namespace insitu
