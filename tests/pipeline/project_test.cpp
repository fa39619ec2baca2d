#include "pipeline/project.h"

#include "core/check.h"
#include "core/io/json.h"
#include "pipeline/project_keys.h"
#include "tests/support/data.h"
#include "tests/support/errors.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/tolerance.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <functional>
#include <set>
#include <string>

namespace insitu {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::SizeIs;
namespace fs = std::filesystem;

/// A folder with the files that the good project names, removed afterwards.
class ProjectFile : public ::testing::Test {
protected:
    void SetUp() override
    {
        for (const char* name : {"plate.jpg",
                                 "lines.json",
                                 "camera.json",
                                 "ball_1.jpg",
                                 "ball_2.jpg",
                                 "r.json",
                                 "e.exr"})
            write(name, "x");
        write("chair.obj", "v 0 0 0\nv 2 0 0\nv 0 4 0\nv 0 0 6\nf 1 2 3\nf 1 3 4\n");
    }
    void write(const std::string& name, const std::string& text) const
    {
        std::ofstream(folder_ / name) << text;
    }

    [[nodiscard]] static Json good()
    {
        return Json::parse(R"({
          "format": "insitu-project", "version": 1,
          "photo": {"image": "plate.jpg"},
          "camera": {"lines": "lines.json"},
          "light": {"probe": {"kind": "mirror-ball", "images": ["ball_1.jpg", "ball_2.jpg"],
                              "ball": {"center_px": [300, 301], "radius_px": 258.1,
                                       "radius_m": 0.06, "reflectance": 0.9},
                              "center_m": [0, 0.45, 0.1],
                              "view": {"position_m": [-0.4, 0.6, 1.1]}}},
          "room": [{"type": "box", "min_m": [-2.7, 0, -2.1], "max_m": [1.9, 2.6, 3.1]}],
          "objects": [{"model": "chair.obj", "position_m": [0.5, 0, 0], "rotation_y_deg": 90,
                       "scale": 0.01}]})");
    }

    [[nodiscard]] Project read(const Json& json) const
    {
        write("project.json", json.dump());
        return readProject(folder_ / "project.json");
    }

    /// What readProject says about a changed project; fails when it says nothing.
    [[nodiscard]] std::string complaint(const std::function<void(Json&)>& change) const
    {
        Json json = good();
        change(json);
        return inputErrorOf([&] { (void)read(json); });
    }

    TemporaryFolder folder_;
};

TEST_F(ProjectFile, GoodFileIsReadWhole)
{
    const Project project = read(good());
    EXPECT_EQ(project.photo.path, folder_ / "plate.jpg");
    EXPECT_EQ(project.camera_lines, folder_ / "lines.json");
    EXPECT_FALSE(project.camera_file);
    ASSERT_TRUE(project.light.probe);
    const ProjectProbe& probe = *project.light.probe;
    EXPECT_EQ(probe.kind, ProbeKind::MirrorBall);
    ASSERT_THAT(probe.views, SizeIs(1));
    const ProjectView& view = probe.views[0];
    ASSERT_THAT(view.images, SizeIs(2));
    EXPECT_EQ(view.images[1].path, folder_ / "ball_2.jpg");
    EXPECT_EQ(view.ball.center_px, glm::dvec2(300, 301));
    EXPECT_EQ(view.ball.radius_px, 258.1);
    EXPECT_EQ(view.ball.radius_m, 0.06);
    EXPECT_EQ(view.ball.reflectance, 0.9);
    EXPECT_EQ(view.ball.center_m, glm::dvec3(0, 0.45, 0.1));
    EXPECT_FALSE(view.mask);
    EXPECT_EQ(project.light.center_m, glm::dvec3(0, 0.45, 0.1));
    EXPECT_EQ(view.view_position_m, glm::dvec3(-0.4, 0.6, 1.1));
    ASSERT_THAT(project.room.boxes, SizeIs(1));
    EXPECT_FALSE(project.room.boxes[0].solid);
    EXPECT_EQ(project.room.boxes[0].max_m, glm::dvec3(1.9, 2.6, 3.1));
    ASSERT_THAT(project.objects, SizeIs(1));
    EXPECT_EQ(project.objects[0].model, folder_ / "chair.obj");
    EXPECT_EQ(project.objects[0].position_m, glm::dvec3(0.5, 0, 0));
    EXPECT_EQ(project.objects[0].rotation_y_deg, 90.0);
    EXPECT_EQ(project.objects[0].scale, 0.01);
    EXPECT_FALSE(project.objects[0].pivot_bottom_center);
    EXPECT_FALSE(project.objects[0].material);
}

TEST_F(ProjectFile, ABallWithoutOutlineIsLookedFor)
{
    EXPECT_FALSE(read(good()).light.probe->views[0].find_outline);
    Json json = good();
    Json& probe = json["light"]["probe"];
    probe["ball"] = {{"radius_m", 0.06}};
    EXPECT_TRUE(read(json).light.probe->views[0].find_outline);
    // Half an outline is a slip.
    probe["ball"]["radius_px"] = 258.1;
    EXPECT_THAT(inputErrorOf([&] { (void)read(json); }), HasSubstr("center_px"));
    probe["ball"] = {{"radius_m", 0.06}};
    probe["center_m"] = "from-outline";
    probe["view"] = "photo";
    EXPECT_THAT(inputErrorOf([&] { (void)read(json); }), HasSubstr("needs the outline"));
}

TEST_F(ProjectFile, ExposureBesideAnImageOverridesTheOneBesideTheList)
{
    Json json = good();
    json["photo"]["exposure_seconds"] = 0.04;
    json["photo"]["f_number"] = 5.6;
    json["photo"]["iso"] = 1600;
    Json& probe = json["light"]["probe"];
    probe["images"] = Json::parse(R"(["ball_1.jpg", {"image": "ball_2.jpg", "iso": 400}])");
    probe["exposure_seconds"] = {0.5, 0.125};
    probe["f_number"] = 8;
    probe["iso"] = 100;
    const Project project = read(json);
    EXPECT_EQ(project.photo.exposure.seconds, 0.04);
    EXPECT_EQ(project.photo.exposure.f_number, 5.6);
    EXPECT_EQ(project.photo.exposure.iso, 1600.0);
    const auto& images = project.light.probe->views[0].images;
    EXPECT_EQ(images[0].exposure.seconds, 0.5);
    EXPECT_EQ(images[0].exposure.iso, 100.0);
    EXPECT_EQ(images[1].exposure.seconds, 0.125);
    EXPECT_EQ(images[1].exposure.f_number, 8.0);
    EXPECT_EQ(images[1].exposure.iso, 400.0);
}

TEST_F(ProjectFile, OtherFormsOfCameraLightAndRoom)
{
    Json json = good();
    json["camera"] = {{"file", "camera.json"}};
    json["light"]["probe"]["view"] = "photo";
    json["light"]["probe"]["ball"]["crop_origin_px"] = {120, 80};
    json["light"]["probe"]["response"] = "r.json";
    json["room"] = Json::parse(R"([
      {"type": "floor", "height_m": 0.1, "half_size_m": 3},
      {"type": "plane", "corner_m": [0,0,-1], "edge_u_m": [1,0,0], "edge_v_m": [0,1,0]},
      {"type": "plane", "corners_m": [[0,0,0], [2,0,0], [2,3,0], [0,3,0]]},
      {"type": "box", "min_m": [0,0,0], "max_m": [1,1,1], "solid": true, "name": "sofa"},
      {"type": "opening", "corners_m": [[0,0,0], [1,0,0], [1,1,0]]},
      {"type": "mesh", "model": "chair.obj", "position_m": [1,0,0], "scale": 2}])");
    Project project = read(json);
    EXPECT_EQ(project.camera_file, folder_ / "camera.json");
    EXPECT_FALSE(project.camera_lines);
    EXPECT_FALSE(project.light.probe->views[0].view_position_m);
    EXPECT_EQ(project.light.probe->views[0].crop_origin_px, glm::dvec2(120, 80));
    EXPECT_EQ(project.light.probe->response, folder_ / "r.json");
    EXPECT_EQ(project.room.floors.at(0).height_m, 0.1);
    EXPECT_EQ(project.room.floors.at(0).half_size_m, 3.0);
    EXPECT_EQ(project.room.planes.at(0).edge_v_m, glm::dvec3(0, 1, 0));
    EXPECT_EQ(project.room.planes.at(1).edge_u_m, glm::dvec3(2, 0, 0));
    EXPECT_EQ(project.room.planes.at(1).edge_v_m, glm::dvec3(0, 3, 0));
    EXPECT_TRUE(project.room.boxes.at(0).solid);
    EXPECT_EQ(project.room.boxes.at(0).name, "sofa");
    EXPECT_THAT(project.room.openings.at(0).corners_m, SizeIs(3));
    ASSERT_THAT(project.room.meshes, SizeIs(1));
    EXPECT_EQ(project.room.meshes[0].name, "chair");
    const BoundingBox box = boundingBox(project.room.meshes[0].mesh);
    EXPECT_EQ(box.min, glm::dvec3(1, 0, 0));
    EXPECT_EQ(box.max, glm::dvec3(5, 8, 12));

    json["light"] = {{"environment", "e.exr"}, {"center_m", {1, 2, 3}}};
    project = read(json);
    EXPECT_EQ(project.light.environment, folder_ / "e.exr");
    EXPECT_EQ(project.light.center_m, glm::dvec3(1, 2, 3));
    EXPECT_FALSE(project.light.probe);
}

TEST_F(ProjectFile, ProbeMayBeWhereItsOutlineSays)
{
    Json json = good();
    Json& probe = json["light"]["probe"];
    probe["center_m"] = "from-outline";
    EXPECT_THAT(inputErrorOf([&] { (void)read(json); }), HasSubstr("light.probe.center_m"));
    probe["view"] = "photo";
    EXPECT_TRUE(read(json).light.probe->center_from_outline);
    probe["center_m"] = "somewhere";
    EXPECT_THAT(inputErrorOf([&] { (void)read(json); }), HasSubstr("from-outline"));
}

TEST_F(ProjectFile, PlacedModelStandsAndHasTheProjectsMaterial)
{
    Json json = good();
    Json& object = json["objects"][0];
    object["pivot"] = "bottom-center";
    object["material"] =
        Json::parse(R"({"base_color_linear": [0.4, 0.3, 0.2], "roughness": 0.7, "specular": 0})");
    const Project project = read(json);
    const auto [model, placement] = loadObject(project.objects[0]);
    // 2 x 4 x 6 units, centred, scaled by 0.01, turned by 90 degrees: x and z change places.
    const BoundingBox box = boundingBox(placed(model.mesh, placement));
    for (int axis = 0; axis < 3; ++axis) {
        EXPECT_NEAR(box.min[axis], glm::dvec3(0.5 - 0.03, 0.0, -0.01)[axis], tolerance::kFloat);
        EXPECT_NEAR(box.max[axis], glm::dvec3(0.5 + 0.03, 0.04, 0.01)[axis], tolerance::kFloat);
    }
    ASSERT_THAT(model.materials, SizeIs(1));
    EXPECT_EQ(model.materials[0].base_color, glm::vec3(0.4f, 0.3f, 0.2f));
    EXPECT_EQ(model.materials[0].roughness, 0.7f);
    EXPECT_EQ(model.materials[0].specular, 0.0f);
    EXPECT_THAT(model.mesh.material_of, ::testing::Each(0u));
    EXPECT_TRUE(model.textures.empty());
}

TEST_F(ProjectFile, MissingProjectFile)
{
    EXPECT_THROW((void)readProject(folder_ / "none.json"), InputError);
}

TEST_F(ProjectFile, BrokenJsonNamesFileAndPlace)
{
    write("project.json", "{\"format\": \"insitu-project\",\n \"version\": NaN}");
    try {
        (void)readProject(folder_ / "project.json");
        FAIL();
    } catch (const InputError& error) {
        EXPECT_THAT(error.what(), AllOf(HasSubstr("project.json"), HasSubstr("2")));
    }
}

TEST_F(ProjectFile, InfiniteNumber)
{
    write("project.json", R"({"format": "insitu-project", "version": 1e999})");
    EXPECT_THROW((void)readProject(folder_ / "project.json"), InputError);
}

TEST_F(ProjectFile, UnknownKeysGetASuggestion)
{
    EXPECT_THAT(complaint([](Json& j) { j["object"] = 1; }),
                AllOf(HasSubstr("object"), HasSubstr("did you mean"), HasSubstr("objects")));
    EXPECT_THAT(complaint([](Json& j) { j["objects"][0]["positon_m"] = 1; }),
                AllOf(HasSubstr("objects[0]"), HasSubstr("position_m")));
    EXPECT_THAT(complaint([](Json& j) { j["light"]["probe"]["ball"]["radius"] = 1; }),
                AllOf(HasSubstr("light.probe.ball"), HasSubstr("radius_")));
    EXPECT_THAT(complaint([](Json& j) { j["room"][0]["typo"] = 1; }), HasSubstr("room[0]"));
    EXPECT_THAT(complaint([](Json& j) { j["room"][0]["type"] = "boxes"; }),
                AllOf(HasSubstr("room[0].type"), HasSubstr("did you mean \"box\"")));
}

TEST_F(ProjectFile, FormatAndVersion)
{
    EXPECT_THAT(complaint([](Json& j) { j["format"] = "other"; }), HasSubstr("insitu-project"));
    EXPECT_THAT(complaint([](Json& j) { j["version"] = 2; }),
                AllOf(HasSubstr("version"), HasSubstr("reads version 1")));
    EXPECT_THAT(complaint([](Json& j) { j.erase("version"); }), HasSubstr("version"));
}

TEST_F(ProjectFile, WrongTypes)
{
    EXPECT_THAT(complaint([](Json& j) { j["photo"] = 3; }), HasSubstr("photo"));
    EXPECT_THAT(complaint([](Json& j) { j["photo"]["image"] = 3; }), HasSubstr("photo.image"));
    EXPECT_THAT(complaint([](Json& j) { j["objects"] = Json::object(); }), HasSubstr("objects"));
    EXPECT_THAT(complaint([](Json& j) { j["objects"][0]["scale"] = "big"; }),
                HasSubstr("objects[0].scale"));
    EXPECT_THAT(complaint([](Json& j) {
                    j["objects"][0]["position_m"] = {1, 2};
                }),
                HasSubstr("objects[0].position_m"));
    EXPECT_THAT(complaint([](Json& j) {
                    j["room"][0]["min_m"] = {1, "a", 2};
                }),
                HasSubstr("room[0].min_m"));
    EXPECT_THAT(complaint([](Json& j) { j["light"]["probe"]["view"] = 1; }),
                HasSubstr("light.probe.view"));
}

TEST_F(ProjectFile, FilesThatAreNotThere)
{
    EXPECT_THAT(complaint([](Json& j) { j["photo"]["image"] = "no.jpg"; }),
                AllOf(HasSubstr("photo.image"), HasSubstr("no.jpg")));
    EXPECT_THAT(complaint([](Json& j) { j["objects"][0]["model"] = "no.obj"; }),
                AllOf(HasSubstr("objects[0].model"), HasSubstr("no.obj")));
    EXPECT_THAT(complaint([](Json& j) { j["light"]["probe"]["images"][1] = "no.jpg"; }),
                HasSubstr("images[1]"));
    EXPECT_THAT(complaint([](Json& j) { j["camera"]["lines"] = "."; }), HasSubstr("camera.lines"));
}

TEST_F(ProjectFile, CameraAndLightNeedExactlyOneSource)
{
    EXPECT_THAT(complaint([](Json& j) { j["camera"]["file"] = "camera.json"; }),
                AllOf(HasSubstr("camera"), HasSubstr("both")));
    EXPECT_THAT(complaint([](Json& j) { j["camera"] = Json::object(); }), HasSubstr("neither"));
    EXPECT_THAT(complaint([](Json& j) { j["light"]["environment"] = "e.exr"; }),
                AllOf(HasSubstr("light"), HasSubstr("both")));
    EXPECT_THAT(complaint([](Json& j) { j["light"] = Json::object(); }), HasSubstr("neither"));
}

TEST_F(ProjectFile, ProbeThatMakesNoSense)
{
    const auto probe = [](Json& j) -> Json& { return j["light"]["probe"]; };
    EXPECT_THAT(complaint([&](Json& j) { probe(j)["images"] = Json::array(); }),
                AllOf(HasSubstr("images"), HasSubstr("empty")));
    EXPECT_THAT(complaint([&](Json& j) { probe(j)["exposure_seconds"] = {0.5}; }),
                HasSubstr("1 times for 2 images"));
    EXPECT_THAT(complaint([&](Json& j) { probe(j)["exposure_seconds"] = -1; }),
                HasSubstr("exposure_seconds"));
    EXPECT_THAT(complaint([&](Json& j) { probe(j)["ball"]["reflectance"] = 1.2; }),
                HasSubstr("reflectance"));
    EXPECT_THAT(complaint([&](Json& j) { probe(j)["ball"]["radius_px"] = 0; }),
                HasSubstr("radius_px"));
    EXPECT_THAT(complaint([&](Json& j) {
                    probe(j)["view"]["position_m"] = {0, 0.45, 0.12};
                }),
                HasSubstr("inside the ball"));
    EXPECT_THAT(complaint([&](Json& j) {
                    probe(j)["view"]["position_m"] = {0, 2.0, 0.1};
                }),
                HasSubstr("straight"));
    EXPECT_THAT(complaint([&](Json& j) { probe(j)["kind"] = "latlong"; }),
                HasSubstr("mirror ball"));
    EXPECT_THAT(complaint([&](Json& j) { probe(j).erase("view"); }), HasSubstr("view"));
}

/// The good project's probe in two views.
Json twoViews(Json json)
{
    Json& probe = json["light"]["probe"];
    Json view;
    for (const char* key : {"images", "ball", "view"}) {
        view[key] = probe[key];
        probe.erase(key);
    }
    probe["views"] = {view, view};
    Json& second = probe["views"][1];
    second["images"] = {"ball_2.jpg"};
    second["exposure_seconds"] = 0.25;
    second["mask"] = "e.exr";
    second["view"] = {{"position_m", {0, 2.0, 0.1}}, {"up", {0, 0, -2}}};
    return json;
}

TEST_F(ProjectFile, SeveralViewsOfABall)
{
    const Project project = read(twoViews(good()));
    const std::vector<ProjectView>& views = project.light.probe->views;
    ASSERT_THAT(views, SizeIs(2));
    EXPECT_THAT(views[0].images, SizeIs(2));
    EXPECT_EQ(views[0].view_up, glm::dvec3(0, 1, 0));
    EXPECT_FALSE(views[0].mask);
    EXPECT_EQ(views[1].images[0].exposure.seconds, 0.25);
    EXPECT_EQ(views[1].ball.center_m, glm::dvec3(0, 0.45, 0.1));
    EXPECT_EQ(views[1].mask, folder_ / "e.exr");
    EXPECT_EQ(views[1].view_up, glm::dvec3(0, 0, -2));
    for (const char* kind : {"angular", "latlong", "cube-cross"}) {
        Json json = good();
        Json& probe = json["light"]["probe"];
        probe.erase("ball");
        probe.erase("view");
        probe["kind"] = kind;
        EXPECT_NE(read(json).light.probe->kind, ProbeKind::MirrorBall) << kind;
    }
}

TEST_F(ProjectFile, ViewsThatMakeNoSense)
{
    const auto says = [&](const std::function<void(Json&)>& change) {
        return complaint([&](Json& j) {
            j = twoViews(j);
            change(j["light"]["probe"]);
        });
    };
    EXPECT_THAT(says([](Json& probe) { probe["views"] = Json::array(); }), HasSubstr("empty"));
    EXPECT_THAT(says([](Json& probe) { probe["mask"] = "e.exr"; }), HasSubstr("each of"));
    EXPECT_THAT(says([](Json& probe) { probe["kind"] = "angular"; }), HasSubstr("mirror ball"));
    EXPECT_THAT(says([](Json& probe) { probe["views"][1]["mask"] = "no.png"; }),
                HasSubstr("no.png"));
    EXPECT_THAT(says([](Json& probe) { probe["views"][1]["kind"] = "latlong"; }),
                HasSubstr("views[1]"));
    EXPECT_THAT(says([](Json& probe) {
                    probe["views"][1]["view"]["up"] = {0, 0, 0};
                }),
                HasSubstr("no direction"));
    EXPECT_THAT(says([](Json& probe) {
                    probe["views"][1]["view"]["up"] = {0, 1, 0};
                }),
                HasSubstr("along"));
    write("probe.json", good()["light"]["probe"].dump());
    EXPECT_THAT(readProbeFile(folder_ / "probe.json").views, SizeIs(1));
    Json by_photo = good()["light"]["probe"];
    by_photo["view"] = "photo";
    write("probe.json", by_photo.dump());
    EXPECT_THAT(inputErrorOf([&] { (void)readProbeFile(folder_ / "probe.json"); }),
                HasSubstr("photograph"));
}

TEST_F(ProjectFile, RoomThatMakesNoSense)
{
    EXPECT_THAT(complaint([](Json& j) { j["room"] = Json::array(); }), HasSubstr("room"));
    EXPECT_THAT(complaint([](Json& j) {
                    j["room"][0]["min_m"] = {2.0, 0, -2.1};
                }),
                AllOf(HasSubstr("room[0].min_m"), HasSubstr("x")));
    const auto add = [](const char* text) {
        return [text](Json& j) { j["room"].push_back(Json::parse(text)); };
    };
    EXPECT_THAT(complaint(add(R"({"type": "opening", "corners_m": [[0,0,0],[1,0,0]]})")),
                HasSubstr("three"));
    EXPECT_THAT(complaint(add(R"({"type": "opening", "corners_m": [[0,0,0],[1,0,0],[2,0,0]]})")),
                HasSubstr("no area"));
    EXPECT_THAT(complaint(add(R"({"type": "opening",
                                  "corners_m": [[0,0,0],[1,0,0],[1,1,0.5],[0,1,0]]})")),
                HasSubstr("off the plane"));
    EXPECT_THAT(complaint(add(R"({"type": "opening",
                                  "corners_m": [[0,0,0],[4,0,0],[1,1,0],[0,4,0]]})")),
                HasSubstr("not convex"));
    EXPECT_THAT(complaint(add(R"({"type": "plane", "corner_m": [0,0,0], "edge_u_m": [1,0,0],
                                  "edge_v_m": [2,0,0]})")),
                HasSubstr("no area"));
    EXPECT_THAT(complaint(add(R"({"type": "plane",
                                  "corners_m": [[0,0,0],[1,0,0],[2,1,0],[0,1,0]]})")),
                HasSubstr("parallelogram"));
    EXPECT_THAT(complaint(add(R"({"type": "floor", "half_size_m": -1})")),
                HasSubstr("room[1].half_size_m"));
}

TEST_F(ProjectFile, ObjectThatMakesNoSense)
{
    EXPECT_THAT(complaint([](Json& j) { j["objects"] = Json::array(); }),
                AllOf(HasSubstr("objects"), HasSubstr("empty")));
    EXPECT_THAT(complaint([](Json& j) { j["objects"][0]["scale"] = -0.01; }),
                HasSubstr("objects[0].scale"));
    EXPECT_THAT(complaint([](Json& j) {
                    j["objects"][0]["position_m"] = {5, 0, 0};
                }),
                AllOf(HasSubstr("objects[0]"), HasSubstr("outside the room")));
    // A room of 4 x 4 m turned by 45°: its corner is 2.83 m away, its walls 2 m.
    const auto turned = [](double x) {
        return [x](Json& j) {
            j["room"] =
                Json::array({{{"type", "primitive"},
                              {"shape", "room-box"},
                              {"solid", false},
                              {"parameters", {{"width_m", 4}, {"height_m", 2.6}, {"depth_m", 4}}},
                              {"position_m", {0, 0, 0}},
                              {"rotation_y_deg", 45}}});
            j["objects"][0]["position_m"] = {x, 0, 0};
        };
    };
    Json inside = good();
    turned(2.7)(inside);
    EXPECT_NO_THROW((void)read(inside));
    EXPECT_THAT(complaint(turned(2.9)), HasSubstr("outside the room"));
    EXPECT_THAT(complaint([&](Json& j) {
                    turned(0.0)(j);
                    j["objects"][0]["position_m"] = {1.9, 0, 1.9};
                }),
                HasSubstr("outside the room"));
    EXPECT_THAT(complaint([](Json& j) { j["objects"][0]["pivot"] = "center"; }),
                HasSubstr("bottom-center"));
    EXPECT_THAT(complaint([](Json& j) {
                    j["objects"][0]["material"] = {{"base_color_linear", {0.5, 0.5, 2}}};
                }),
                HasSubstr("base_color_linear[2]"));
}

TEST(TruthRooms, AreReadWhole)
{
    INSITU_NEEDS_DATA();
    for (const char* name : {"truth-room-a", "truth-room-b", "truth-room-c"}) {
        const Project project = readProject(dataFolder() / name / "project.json");
        ASSERT_TRUE(project.light.probe) << name;
        EXPECT_THAT(project.light.probe->views[0].images, SizeIs(::testing::Ge(7u))) << name;
        EXPECT_EQ(project.light.probe->views[0].ball.radius_px, 260.8) << name;
        EXPECT_THAT(project.room.boxes, SizeIs(::testing::Ge(3u))) << name;
        EXPECT_THAT(project.room.openings, SizeIs(1)) << name;
        ASSERT_THAT(project.objects, SizeIs(1)) << name;
        EXPECT_TRUE(project.objects[0].pivot_bottom_center) << name;
        ASSERT_TRUE(project.objects[0].material) << name;
        EXPECT_EQ(project.objects[0].material->specular, 0.0f) << name;
    }
}

/// The schema's `properties` of one definition are the keys the parser accepts.
TEST(ProjectSchema, NamesTheParsersKeys)
{
    const Json schema = readJson(fs::path(INSITU_SOURCE_DIR) / "docs" / "project.schema.json");
    const auto expectSame =
        [&](const Json& object, const keys::KeyList& allowed, const std::string& name) {
            std::set<std::string> in_schema;
            for (const auto& item : object.at("properties").items())
                in_schema.insert(item.key());
            EXPECT_EQ(in_schema, std::set<std::string>(allowed.begin(), allowed.end())) << name;
            EXPECT_EQ(object.at("additionalProperties"), false) << name;
        };
    expectSame(schema, keys::kProject, "project");
    const Json& definitions = schema.at("$defs");
    const std::pair<const char*, keys::KeyList> all[] = {
        {"image", keys::kImage},
        {"photo", keys::kPhoto},
        {"foreground", keys::kForeground},
        {"camera", keys::kCamera},
        {"light", keys::kLight},
        {"probe", keys::kProbe},
        {"probe_view", keys::kProbeView},
        {"ball", keys::kBall},
        {"view", keys::kView},
        {"reference_card", keys::kReferenceCard},
        {"reference_ball", keys::kReferenceBall},
        {"reference_illuminance", keys::kReferenceIlluminance},
        {"reference_irradiance", keys::kReferenceIrradiance},
        {"floor", keys::kFloor},
        {"plane", keys::kPlane},
        {"box", keys::kBox},
        {"primitive", keys::kPrimitive},
        {"mesh", keys::kMesh},
        {"opening", keys::kOpening},
        {"object", keys::kObject},
        {"material", keys::kMaterial}};
    for (const auto& [name, allowed] : all)
        expectSame(definitions.at(name), allowed, name);
}

}  // namespace
}  // namespace insitu
