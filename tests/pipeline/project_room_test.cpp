#include "core/io/json.h"
#include "pipeline/project.h"
#include "tests/support/errors.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/tolerance.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>

namespace insitu {
namespace {

using testing::AllOf;
using testing::HasSubstr;

/// A project of which only the room varies.
class ProjectRoom : public testing::Test {
protected:
    void SetUp() override
    {
        for (const char* name : {"plate.jpg", "lines.json", "e.exr"})
            write(name, "x");
        write("chair.obj", "v 0 0 0\nv 2 0 0\nv 0 4 0\nv 0 0 6\nf 1 2 3\nf 1 3 4\n");
    }
    void write(const std::string& name, const std::string& text) const
    {
        std::ofstream(folder_ / name) << text;
    }
    [[nodiscard]] RoomDescription read(const std::string& room) const
    {
        write("project.json",
              R"({"format": "insitu-project", "version": 1, "photo": {"image": "plate.jpg"},
                  "camera": {"lines": "lines.json"},
                  "light": {"environment": "e.exr", "center_m": [0, 1, 0]},
                  "objects": [{"model": "chair.obj"}], "room": )" +
                  room + "}");
        return readProject(folder_ / "project.json").room;
    }
    [[nodiscard]] std::string complaint(const std::string& room) const
    {
        return inputErrorOf([&] { (void)read(room); });
    }

    TemporaryFolder folder_;
};

TEST_F(ProjectRoom, PrimitivesStandWhereTheyArePlaced)
{
    const RoomDescription room = read(R"([
        {"type": "primitive", "shape": "cylinder", "parameters": {"height_m": 0.75},
         "position_m": [1, 0.1, -2], "name": "side table"},
        {"type": "primitive", "shape": "wedge", "position_m": [0, 0, 0], "rotation_y_deg": 90,
         "solid": false}])");
    ASSERT_EQ(room.primitives.size(), 2u);
    const RoomPrimitive& table = room.primitives[0];
    EXPECT_EQ(table.name, "side table");
    EXPECT_TRUE(table.solid);
    EXPECT_NEAR(table.faces[1].corners_m[0].y, 0.85, tolerance::kDouble);
    EXPECT_NEAR(glm::distance(table.faces[1].corners_m[5], {1, 0.85, -2}), 0.5, tolerance::kDouble);
    EXPECT_FALSE(room.primitives[1].solid);
    EXPECT_EQ(room.primitives[1].name, "wedge");
    // The back, at z = -0.5, comes to x = -0.5.
    for (const glm::dvec3& corner : room.primitives[1].faces[1].corners_m)
        EXPECT_NEAR(corner.x, -0.5, tolerance::kDouble);
}

TEST_F(ProjectRoom, BoxesMayBeTurned)
{
    const RoomDescription room = read(R"([
        {"type": "box", "min_m": [-4, 0, -3], "max_m": [4, 2.5, 5], "rotation_y_deg": 0},
        {"type": "box", "min_m": [1, 0, 1], "max_m": [3, 1, 2], "rotation_y_deg": 30,
         "solid": true, "name": "desk"}])");
    ASSERT_EQ(room.boxes.size(), 1u);
    ASSERT_EQ(room.primitives.size(), 1u);
    EXPECT_EQ(room.primitives[0].name, "desk");
    glm::dvec3 center(0.0);
    int corners = 0;
    for (const WorldFace& face : room.primitives[0].faces)
        for (const glm::dvec3& corner : face.corners_m) {
            center += corner;
            ++corners;
            EXPECT_NEAR(std::hypot(corner.x - 2.0, corner.z - 1.5), std::sqrt(1.25), 1e-12);
        }
    EXPECT_NEAR(glm::distance(center / double(corners), {2, 0.5, 1.5}), 0.0, 1e-12);
}

TEST_F(ProjectRoom, MayBeAFileOfItsOwn)
{
    std::filesystem::create_directories(folder_ / "rooms");
    write("rooms/shapes.json",
          R"({"format": "insitu-primitives", "version": 1, "primitives": [
              {"name": "tent", "vertices": [{"name": "a", "at": [-1, 0, 0]},
               {"name": "b", "at": [1, 0, 0]}, {"name": "c", "at": [0, 1, 0]}],
               "faces": [{"name": "front", "corners": ["a", "b", "c"]}], "two_sided": true}]})");
    const std::string list = R"([{"type": "floor"}, {"type": "primitive", "shape": "tent",
        "library": "shapes.json", "position_m": [0, 0, -1]}])";
    write("rooms/list.json", list);
    write("rooms/whole.json", R"({"room": )" + list + R"(, "findings": []})");
    for (const char* path : {"\"rooms/list.json\"", "\"rooms/whole.json\""}) {
        const RoomDescription room = read(path);
        EXPECT_EQ(room.floors.size(), 1u);
        ASSERT_EQ(room.primitives.size(), 1u);
        EXPECT_TRUE(room.primitives[0].two_sided);
    }
    EXPECT_THAT(complaint("\"rooms/none.json\""), AllOf(HasSubstr("room"), HasSubstr("no file")));
    write("rooms/bad.json", R"({"rooms": []})");
    EXPECT_THAT(complaint("\"rooms/bad.json\""),
                AllOf(HasSubstr("bad.json"), HasSubstr("did you mean \"room\"?")));
    write("rooms/loop.json", R"({"room": "loop.json"})");
    EXPECT_THAT(complaint("\"rooms/loop.json\""), HasSubstr("room"));
}

TEST_F(ProjectRoom, PrimitivesThatMakeNoSense)
{
    const auto one = [](const std::string& members) {
        return R"([{"type": "primitive", "position_m": [0, 0, 0], )" + members + "}]";
    };
    EXPECT_THAT(complaint(one(R"("shape": "cilinder")")), HasSubstr("did you mean \"cylinder\"?"));
    EXPECT_THAT(complaint(one(R"("shape": "pyramid")")), HasSubstr("known are \"box\""));
    EXPECT_THAT(complaint(one(R"("shape": "box", "parameters": {"widht_m": 1})")),
                HasSubstr("room[0].parameters: unknown key \"widht_m\"; did you mean"));
    EXPECT_THAT(complaint(one(R"("shape": "box", "parameters": {"width_m": -1})")),
                HasSubstr("width_m: is -1; must lie in 0.001 to 1000"));
    EXPECT_THAT(complaint(one(R"("shape": "box", "library": "none.json")")), HasSubstr("library"));
    EXPECT_THAT(complaint(R"([{"type": "primitive", "shape": "box"}])"), HasSubstr("position_m"));
}

}  // namespace
}  // namespace insitu
