#include "reconstruct/primitive.h"

#include "core/io/file.h"
#include "core/random.h"
#include "reconstruct/primitive_library.h"
#include "reconstruct/scene_proxy.h"
#include "tests/support/errors.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/tolerance.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <numbers>
#include <stdexcept>

namespace insitu {
namespace {

using std::numbers::pi;
using testing::HasSubstr;

const std::vector<std::string> kNames = {"width_m", "height_m"};

TEST(LinearExpression, ReadsWhatIsLinear)
{
    const struct {
        const char* text;
        double constant, width, height;
    } expected[] = {{"2", 2, 0, 0},
                    {"width_m", 0, 1, 0},
                    {"-width_m/2", 0, -0.5, 0},
                    {"0.5*(width_m + 2*height_m) - .25", -0.25, 0.5, 1},
                    {" 3 * ( 1 - - 1 ) ", 6, 0, 0},
                    {"height_m * (2 / 4) - (width_m - 1e-1)", 0.1, -1, 0.5},
                    {"2*3*width_m/4/3", 0, 0.5, 0}};
    for (const auto& e : expected) {
        const LinearExpression read = parseLinearExpression(e.text, kNames);
        EXPECT_NEAR(read.constant, e.constant, tolerance::kDouble) << e.text;
        EXPECT_NEAR(read.coefficients[0], e.width, tolerance::kDouble) << e.text;
        EXPECT_NEAR(read.coefficients[1], e.height, tolerance::kDouble) << e.text;
        const double values[] = {3.0, 7.0};
        EXPECT_NEAR(read.value(values), e.constant + 3 * e.width + 7 * e.height, 1e-11) << e.text;
    }
}

TEST(LinearExpression, RefusesAllElseAndSaysWhere)
{
    const struct {
        std::string text;
        const char* cause;
    } cases[] = {{"", "is missing"},
                 {"width_m*height_m", "linear"},
                 {"1/width_m", "only numbers may divide"},
                 {"1/(2-2)", "division by 0"},
                 {"width", "did you mean \"width_m\"?"},
                 {"(1", "a ) is missing"},
                 {"1)", "character 2: ')' is not expected"},
                 {"system(1)", "no parameter"},
                 {"1e999", "cannot be read"},
                 {"1e300*1e300", "too large"},
                 {"2 3", "not expected"},
                 {std::string(100, '('), "too many brackets"},
                 {std::string(100, '-') + "1", "too many brackets"},
                 {std::string(600, '1'), "at most 512"},
                 {"1 \x01", "not expected"}};
    for (const auto& c : cases) {
        try {
            (void)parseLinearExpression(c.text, kNames);
            ADD_FAILURE() << c.text << " was read";
        } catch (const std::invalid_argument& error) {
            EXPECT_THAT(error.what(), HasSubstr(c.cause)) << c.text;
        }
    }
}

/// Volume that faces seen from outside enclose: a third of Σ area · (normal · point).
double volume(const std::vector<WorldFace>& faces)
{
    double sum = 0.0;
    for (const WorldFace& face : faces)
        for (std::size_t i = 1; i + 1 < face.corners_m.size(); ++i)
            sum +=
                glm::dot(face.corners_m[0], glm::cross(face.corners_m[i], face.corners_m[i + 1])) /
                6.0;
    return sum;
}

TEST(Primitive, BuiltInSolidsAreClosedAndSeenFromOutside)
{
    const double area24 = 0.5 * 24 * std::sin(2 * pi / 24);
    const struct {
        const char* name;
        std::vector<double> parameters;
        double volume;
    } expected[] = {{"box", {0.8, 1.5, 0.4}, 0.8 * 1.5 * 0.4},
                    {"room-box", {4, 2.5, 5}, -4 * 2.5 * 5},
                    {"wedge", {0.8, 1.5, 0.4}, 0.5 * 0.8 * 1.5 * 0.4},
                    {"cylinder", {0.3, 0.7}, area24 * 0.3 * 0.3 * 0.7}};
    for (const auto& e : expected) {
        const PrimitiveShape& shape = builtinPrimitives().at(e.name);
        EXPECT_EQ(shape.solid, e.volume > 0.0) << e.name;
        EXPECT_FALSE(shape.two_sided) << e.name;
        // Closed: the volume does not depend on where the origin lies, nor on how it is turned.
        for (const glm::dvec3 at : {glm::dvec3(0.0), glm::dvec3(3, -2, 5)})
            EXPECT_NEAR(volume(placedFaces(shape, e.parameters, at, 0.7)), e.volume, 1e-10)
                << e.name;
    }
}

TEST(Primitive, IsTurnedCounterClockwiseSeenFromAbove)
{
    const PrimitiveShape& box = builtinPrimitives().at("box");
    const std::vector<double> size = {2.0, 1.0, 0.5};
    const auto faces = placedFaces(box, size, {10, 1, 20}, pi / 2);
    // +z turned by 90 degrees looks along +x.
    for (const glm::dvec3& corner : faces[*box.findFace("front")].corners_m)
        EXPECT_NEAR(corner.x, 10.25, tolerance::kDouble * 20);
    EXPECT_NEAR(faces[*box.findFace("right")].corners_m[0].z, 19.0, tolerance::kDouble * 20);
}

TEST(Primitive, KnowsWhichFacesKeepTheirPlane)
{
    const PrimitiveShape& wedge = builtinPrimitives().at("wedge");
    EXPECT_FALSE(axisPlane(wedge, *wedge.findFace("slope")).has_value());
    const auto back = axisPlane(wedge, *wedge.findFace("back"));
    ASSERT_TRUE(back);
    EXPECT_EQ(back->axis, 2);
    EXPECT_EQ(back->sign, -1);
    EXPECT_EQ(back->offset.value(std::vector<double>{1.0, 1.0, 3.0}), -1.5);
    const PrimitiveShape& room = builtinPrimitives().at("room-box");
    EXPECT_EQ(axisPlane(room, *room.findFace("left"))->sign, 1);
    EXPECT_EQ(axisPlane(room, *room.findFace("ceiling"))->sign, -1);
}

class PrimitiveFile : public testing::Test {
protected:
    std::filesystem::path write(const std::string& shape)
    {
        const auto path = folder_ / "shapes.json";
        writeTextFile(
            path,
            R"({"format": "insitu-primitives", "version": 1, "primitives": [)" + shape + "]}");
        return path;
    }
    std::string errorOf(const std::string& shape)
    {
        const auto path = write(shape);
        PrimitiveLibrary library;
        return inputErrorOf([&] { addPrimitives(library, path); });
    }
    TemporaryFolder folder_;
};

constexpr const char* kTriangle = R"({"name": "gable",
    "parameters": [{"name": "width_m", "default": 2, "min": 0.1, "max": 20}],
    "vertices": [{"name": "a", "at": ["-width_m/2", 0, 0]}, {"name": "b", "at": ["width_m/2", 0, 0]},
                 {"name": "c", "at": [0, "width_m/2", 0]}],
    "faces": [{"name": "front", "corners": ["a", "b", "c"]}]})";

std::string with(const std::string& from, const std::string& to)
{
    std::string text = kTriangle;
    const std::size_t at = text.find(from);
    EXPECT_NE(at, std::string::npos) << from;
    return text.replace(at, from.size(), to);
}

TEST_F(PrimitiveFile, AddsAShape)
{
    PrimitiveLibrary library = builtinPrimitives();
    addPrimitives(library, write(kTriangle));
    ASSERT_TRUE(library.contains("gable"));
    const PrimitiveShape& gable = library.at("gable");
    EXPECT_EQ(gable.vertex(1, std::vector<double>{3.0}), glm::dvec3(1.5, 0, 0));
    EXPECT_TRUE(gable.solid);
    EXPECT_EQ(library.size(), builtinPrimitives().size() + 1);
}

TEST_F(PrimitiveFile, TheBuiltInOnesAreOfTheSameForm)
{
    const auto path = folder_ / "builtin.json";
    writeTextFile(path, builtinPrimitivesText());
    PrimitiveLibrary library;
    addPrimitives(library, path);
    EXPECT_EQ(library.size(), 6u);
}

TEST_F(PrimitiveFile, ErrorsNameTheirPlace)
{
    EXPECT_THAT(errorOf(with("\"faces\"", "\"face\"")), HasSubstr("did you mean \"faces\"?"));
    EXPECT_THAT(errorOf(with("\"b\", \"c\"]", "\"b\", \"d\"]")),
                HasSubstr("primitives[0].faces[0].corners[2]: no vertex \"d\""));
    EXPECT_THAT(errorOf(with("\"b\", \"c\"]", "\"b\", \"b\"]")), HasSubstr("twice"));
    EXPECT_THAT(errorOf(with("\"a\", \"b\", \"c\"", "\"a\", \"b\"")), HasSubstr("three corners"));
    EXPECT_THAT(errorOf(with("\"width_m/2\", 0]", "\"height_m\", 0]")), HasSubstr("no parameter"));
    EXPECT_THAT(errorOf(with("[0, \"width_m/2\", 0]", "[0, 0, 0]")), HasSubstr("has no area"));
    EXPECT_THAT(errorOf(with("\"default\": 2", "\"default\": 200")), HasSubstr("0.1 to 20"));
    EXPECT_THAT(errorOf(with("\"max\": 20", "\"max\": 0")), HasSubstr("is not below max"));
    EXPECT_THAT(errorOf(with("\"gable\"", "\"ga ble\"")), HasSubstr("is no name"));
    EXPECT_THAT(errorOf(with("\"name\": \"b\"", "\"name\": \"a\"")), HasSubstr("there twice"));
    EXPECT_THAT(errorOf(with("[0, \"width_m/2\", 0]", "[0, 0]")), HasSubstr("3 coordinates"));
    // A quad bent out of its plane once its parameters are not equal.
    EXPECT_THAT(errorOf(R"({"name": "bent", "parameters": [{"name": "a", "default": 1},
        {"name": "b", "default": 1}], "vertices": [{"name": "p", "at": [0, 0, 0]},
        {"name": "q", "at": [1, 0, 0]}, {"name": "r", "at": [1, 1, "a - b"]},
        {"name": "s", "at": [0, 1, 0]}],
        "faces": [{"name": "f", "corners": ["p", "q", "r", "s"]}]})"),
                HasSubstr("is not flat"));
    std::string many = "{\"name\": \"m\", \"vertices\": [";
    for (int i = 0; i < 5000; ++i)
        many += fmt::format("{}{{\"name\": \"v{}\", \"at\": [0, 0, 0]}}", i ? "," : "", i);
    EXPECT_THAT(errorOf(many + "], \"faces\": []}"), HasSubstr("at most 4096"));
}

TEST_F(PrimitiveFile, DamagedTextIsAnErrorAndNothingElse)
{
    RandomStream random(11, 0, 0);
    int refused = 0;
    for (int i = 0; i < 100; ++i) {
        std::string text = kTriangle;
        for (int k = 0; k < 3; ++k)
            text[random.below(static_cast<std::uint32_t>(text.size()))] =
                static_cast<char>(32 + random.below(95));
        PrimitiveLibrary library;
        try {
            addPrimitives(library, write(text));
        } catch (const InputError&) {
            ++refused;
        }
    }
    EXPECT_GT(refused, 60);
}

RoomDescription roomWith(const char* shape, const std::vector<double>& size, double turn)
{
    RoomDescription room;
    room.boxes.push_back({{-3, 0, -3}, {3, 2.5, 3}, false, ""});
    const PrimitiveShape& s = builtinPrimitives().at(shape);
    room.primitives.push_back(
        {placedFaces(s, size, {0, 0, -1}, turn), s.two_sided, s.solid, "thing"});
    return room;
}

TEST(Primitive, BecomesFacesOfTheProxy)
{
    // A box of 1 x 1 x 1 m, turned by 45 degrees: its edge is nearer than its faces were.
    const SceneProxy proxy(roomWith("box", {1, 1, 1}, pi / 4));
    const auto edge = proxy.intersect({1e-3, 0.5, 2}, {0, 0, -1});
    ASSERT_TRUE(edge);
    EXPECT_NEAR(edge->distance_m, 3.0 - std::sqrt(0.5) + 1e-3, 1e-9);
    EXPECT_TRUE(proxy.faces()[edge->face].solid);
    EXPECT_EQ(proxy.faces()[edge->face].box, 1);
    EXPECT_NEAR(edge->normal.x, std::sqrt(0.5), tolerance::kDouble);
    // It stands on the floor: its bottom receives nothing and is left out.
    for (const ProxyFace& face : proxy.faces())
        EXPECT_NE(face.name, "thing bottom");
    EXPECT_EQ(proxy.faces().size(), 6u + 5u);
    EXPECT_FALSE(proxy.mutuallyVisible({0, 0.5, 2}, {0, 0.5, -2.9}));
    EXPECT_TRUE(proxy.mutuallyVisible({0, 1.5, 2}, {0, 1.5, -2.9}));
}

TEST(Primitive, WedgeAndCylinderAreMetWhereTheyAre)
{
    const SceneProxy wedge(roomWith("wedge", {1, 1, 1}, 0.0));
    // From above, at its middle, the slope is half as high.
    EXPECT_NEAR(wedge.intersect({0, 2, -1}, {0, -1, 0})->distance_m, 1.5, 1e-9);
    const SceneProxy cylinder(roomWith("cylinder", {0.5, 1}, 0.0));
    const auto side = cylinder.intersect({0, 0.5, 2}, {0, 0, -1});
    // A corner of the 24 lies in front.
    EXPECT_NEAR(side->distance_m, 2.5, 1e-6);
    EXPECT_NEAR(cylinder.intersect({0.1, 2, -1.2}, {0, -1, 0})->distance_m, 1.0, 1e-9);
    double top = 0.0;
    for (std::size_t f = 0; f < cylinder.faces().size(); ++f)
        if (cylinder.faces()[f].name == "thing top") top += cylinder.area(f);
    EXPECT_NEAR(top, 0.5 * 24 * std::sin(2 * pi / 24) * 0.25, 1e-12);
}

TEST(Primitive, OfAMeshScales)
{
    TriangleMesh mesh;
    mesh.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
    mesh.triangles = {{0, 1, 2}, {0, 0, 1}};
    mesh.material_of = {0, 0};
    const PrimitiveShape shape = shapeFromMesh(mesh, "m");
    ASSERT_EQ(shape.faces.size(), 1u);  // the line is left out
    const auto faces = placedFaces(shape, std::vector<double>{2.5}, {0, 0, 0}, 0.0);
    EXPECT_EQ(faces[0].corners_m[1], glm::dvec3(2.5, 0, 0));
    EXPECT_TRUE(shape.two_sided);
}

}  // namespace
}  // namespace insitu
