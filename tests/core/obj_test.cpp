#include "core/io/model_io.h"
#include "tests/support/data.h"
#include "tests/support/errors.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/tolerance.h"

#include <assimp/Importer.hpp>
#include <assimp/postprocess.h>
#include <assimp/scene.h>
#include <gmock/gmock.h>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include <cmath>
#include <map>
#include <numbers>
#include <tuple>

namespace insitu {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

Model readText(const std::string& text)
{
    const TemporaryFolder folder;
    return readModel(folder.add("m.obj", text));
}

std::string errorOf(const std::string& text)
{
    return inputErrorOf([&] { static_cast<void>(readText(text)); });
}

void expectNear(glm::dvec3 actual, glm::dvec3 expected, double tolerance = tolerance::kFloat)
{
    for (int i = 0; i < 3; ++i)
        EXPECT_NEAR(actual[i], expected[i], tolerance) << "component " << i;
}

glm::dvec3 areaVector(const TriangleMesh& mesh, const glm::uvec3& t)
{
    const glm::dvec3 a(mesh.positions[t.x]);
    return 0.5 *
           glm::cross(glm::dvec3(mesh.positions[t.y]) - a, glm::dvec3(mesh.positions[t.z]) - a);
}

const std::string kTriangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
// Two unit squares that meet in the edge 1-2 at a right angle: facing z and facing x.
const std::string kFold = "v 0 0 0\nv 0 1 0\nv -1 1 0\nv -1 0 0\nv 0 1 1\nv 0 0 1\n";

TEST(Obj, WithoutSmoothingIsFlat)
{
    for (const char* s : {"", "s off\n", "s 0\n"}) {
        const Model model = readText(kFold + s + "f 1 2 3 4\nf 1 2 5 6\n");
        EXPECT_THAT(model.mesh.normals, IsEmpty());
        EXPECT_THAT(model.mesh.triangles, SizeIs(4));
        EXPECT_THAT(model.mesh.positions, SizeIs(6));
        EXPECT_THAT(model.mesh.texcoords, IsEmpty());
    }
}

// Six corners: the two on the fold (shared) have both faces' normals, equally weighted.
TEST(Obj, SmoothsOverSharedVertices)
{
    const Model model = readText(kFold + "s 1\nf 1 2 3 4\nf 1 2 5 6\n");
    ASSERT_THAT(model.mesh.normals, SizeIs(6));
    for (std::size_t i = 0; i < 6; ++i) {
        const glm::vec3 p = model.mesh.positions[i];
        const double half = std::sqrt(0.5);
        if (p.x == 0 && p.z == 0)
            expectNear(model.mesh.normals[i], {half, 0, half});
        else
            expectNear(model.mesh.normals[i], p.x < 0 ? glm::dvec3(0, 0, 1) : glm::dvec3(1, 0, 0));
    }
}

TEST(Obj, DoesNotSmoothOverGroupsObjectsOrFlatFaces)
{
    for (const char* between : {"s 2\n", "o other\n", "s off\n"}) {
        const Model model = readText(kFold + "o one\ns 1\nf 1 2 3 4\n" + between + "f 1 2 5 6\n");
        for (std::size_t t = 0; t < 4; ++t)
            for (int i = 0; i < 3; ++i)
                expectNear(model.mesh.normals[model.mesh.triangles[t][i]],
                           t < 2 ? glm::dvec3(0, 0, 1) : glm::dvec3(1, 0, 0));
    }
    // A group goes on after another one came between, and `g` does not end it.
    const Model model = readText(kFold + "s 1\nf 1 2 3 4\ns 2\ng side\ns 1\nf 1 2 5 6\n");
    EXPECT_THAT(model.mesh.positions, SizeIs(6));
}

TEST(Obj, StatedNormalsWin)
{
    const Model model = readText(kTriangle + "vn 0 0.6 0.8\ns 1\nf 1//1 2//1 3//1\n");
    ASSERT_THAT(model.mesh.normals, SizeIs(3));
    for (const glm::vec3& normal : model.mesh.normals)
        expectNear(normal, {0, 0.6, 0.8});
}

TEST(Obj, BentFlatFacesAreShadedByTheirTriangles)
{
    // Half of the model is smooth, so that normals are stored at all.
    const Model model = readText(
        "v 0 0 0\nv 1 0 0\nv 1 1 1\nv 0 1 0\nf 1 2 3 4\n"
        "v 9 0 0\nv 9 1 0\nv 9 0 1\ns 1\nf 5 6 7\n");
    for (std::size_t t = 0; t < 2; ++t) {
        const glm::dvec3 normal = glm::normalize(areaVector(model.mesh, model.mesh.triangles[t]));
        for (int i = 0; i < 3; ++i)
            expectNear(model.mesh.normals[model.mesh.triangles[t][i]], normal);
    }
}

// A unit sphere of quadrilaterals: within the facet angle the normals are the radii.
TEST(Obj, ASphereIsRound)
{
    constexpr int kRows = 24;
    constexpr int kColumns = 48;
    std::string text = "s 1\n";
    for (int r = 1; r < kRows; ++r)
        for (int c = 0; c < kColumns; ++c) {
            const double theta = std::numbers::pi * r / kRows;
            const double phi = 2 * std::numbers::pi * c / kColumns;
            text += fmt::format("v {} {} {}\n",
                                std::sin(theta) * std::cos(phi),
                                std::cos(theta),
                                std::sin(theta) * std::sin(phi));
        }
    for (int r = 0; r + 2 < kRows; ++r)
        for (int c = 0; c < kColumns; ++c) {
            const int next = (c + 1) % kColumns;
            text += fmt::format("f {} {} {} {}\n",
                                r * kColumns + c + 1,
                                r * kColumns + next + 1,
                                (r + 1) * kColumns + next + 1,
                                (r + 1) * kColumns + c + 1);
        }
    const Model model = readText(text);
    for (std::size_t i = 0; i < model.mesh.normals.size(); ++i) {
        const glm::vec3 p = model.mesh.positions[i];
        if (std::abs(p.y) > 0.97f) continue;  // next to the open poles rings are one-sided
        EXPECT_GT(glm::dot(model.mesh.normals[i], p), 1.0 - 2e-5) << "vertex " << i;
    }
}

TEST(Obj, ReadsWhateverWritersWrite)
{
    const Model model = readText(
        "\xEF\xBB\xBFv  0\t0 0 1.0 # trailing\r\nv 1e0 +0 -0.0\r\nv 0 1 0\r\n"
        "vt 0.25\r\nvt 0.5 0.25\r\nvt .5 1 0\r\n"
        "g a b\r\nl 1 2\r\nf -3/-3 \\\r\n -2/2 3/3\r\n");
    ASSERT_THAT(model.mesh.triangles, SizeIs(1));
    const glm::uvec3 t = model.mesh.triangles[0];
    EXPECT_EQ(model.mesh.positions[t.x], glm::vec3(0, 0, 0));
    EXPECT_EQ(model.mesh.positions[t.y], glm::vec3(1, 0, 0));
    // OBJ counts v from the bottom, we from the top.
    EXPECT_EQ(model.mesh.texcoords[t.x], glm::vec2(0.25, 1));
    EXPECT_EQ(model.mesh.texcoords[t.y], glm::vec2(0.5, 0.75));
    EXPECT_EQ(model.mesh.texcoords[t.z], glm::vec2(0.5, 0));
    EXPECT_TRUE(hasFinding(model.findings, "model-primitives-skipped"));
}

TEST(Obj, SplitsVerticesAtTextureSeamsButNotTheirNormals)
{
    const Model model =
        readText(kFold + "vt 0 0\nvt 1 1\ns 1\nf 1/1 2/1 3/1 4/1\nf 1/2 2/2 5/2 6/2\n");
    EXPECT_THAT(model.mesh.positions, SizeIs(8));
    int on_fold = 0;
    for (std::size_t i = 0; i < 8; ++i) {
        const glm::vec3 p = model.mesh.positions[i];
        if (p.x != 0 || p.z != 0) continue;
        ++on_fold;
        expectNear(model.mesh.normals[i], {std::sqrt(0.5), 0, std::sqrt(0.5)});
    }
    EXPECT_EQ(on_fold, 4);
}

TEST(Obj, NamesTheLineOfAnError)
{
    EXPECT_THAT(errorOf(kTriangle + "f 1 2 4\n"), AllOf(HasSubstr("line 4"), HasSubstr("4 of 3")));
    EXPECT_THAT(errorOf(kTriangle + "f 1 2 0\n"), HasSubstr("line 4"));
    EXPECT_THAT(errorOf(kTriangle + "f 1 2 -4\n"), HasSubstr("before the first"));
    EXPECT_THAT(errorOf(kTriangle + "f 1/1 2/1 3/1\n"), HasSubstr("texture coordinate 1 of 0"));
    EXPECT_THAT(errorOf(kTriangle + "f 1//1 2//1 3//1\n"), HasSubstr("normal 1 of 0"));
    EXPECT_THAT(errorOf(kTriangle + "f 1 2 3x\n"), HasSubstr("'3x'"));
    EXPECT_THAT(errorOf(kTriangle + "f 1/1/1/1 2 3\n"), HasSubstr("no corner"));
    EXPECT_THAT(errorOf("v 0 0\n"), HasSubstr("line 1"));
    EXPECT_THAT(errorOf("v 0 0 zero\n"), HasSubstr("'zero' is no number"));
    EXPECT_THAT(errorOf("v 0 0 1e39\n"), HasSubstr("too large"));
    EXPECT_THAT(errorOf("v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"), HasSubstr("not finite"));
    EXPECT_THAT(errorOf("v 0 0 0\n"), HasSubstr("no triangles"));
    EXPECT_THAT(errorOf(""), HasSubstr("no triangles"));
    EXPECT_THAT(errorOf(kTriangle + "s two\nf 1 2 3\n"), HasSubstr("smoothing group"));
}

TEST(Obj, NotesWhatItLeavesOut)
{
    const Model model =
        readText("v 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 0 1 0 0 0 1\nf 1 2\nusemtl paint\nf 1 2 3\n");
    EXPECT_TRUE(hasFinding(model.findings, "model-faces-skipped"));
    EXPECT_TRUE(hasFinding(model.findings, "model-vertex-colors-ignored"));
    EXPECT_TRUE(hasFinding(model.findings, "model-material-missing"));
}

class ObjMaterials : public ::testing::Test {
protected:
    Model read(const std::string& mtl, const std::string& name = "paint")
    {
        folder_.add("m.mtl", "newmtl paint\n" + mtl);
        return readModel(
            folder_.add("m.obj", "mtllib m.mtl\n" + kTriangle + "usemtl " + name + "\nf 1 2 3\n"));
    }
    std::string errorOf(const std::string& mtl)
    {
        return inputErrorOf([&] { static_cast<void>(read(mtl)); });
    }
    TemporaryFolder folder_;
};

TEST_F(ObjMaterials, FollowTheStatedRules)
{
    const Model model = read("Kd 0.1 0.2 0.3\nKs 0.1 0.2 0.3\nNs 250\nKe 1 2 3\nd 0.75\nillum 2\n");
    ASSERT_THAT(model.materials, SizeIs(1));
    const Material& material = model.materials[0];
    EXPECT_EQ(material.name, "paint");
    expectNear(material.base_color, {0.1, 0.2, 0.3});
    EXPECT_NEAR(material.specular, 0.4, tolerance::kFloat);
    EXPECT_NEAR(material.roughness, 0.5, tolerance::kFloat);
    expectNear(material.emissive, {1, 2, 3});
    EXPECT_NEAR(material.alpha, 0.75, tolerance::kFloat);
    EXPECT_TRUE(material.alpha_mask);
    EXPECT_TRUE(hasFinding(model.findings, "model-blend-as-mask"));
}

TEST_F(ObjMaterials, WithoutHighlightAreLambert)
{
    EXPECT_EQ(read("Kd 1 1 1\n").materials[0].specular, 0.0f);
    EXPECT_EQ(read("Kd 1 1 1\nKs 1 1 1\nillum 1\n").materials[0].specular, 0.0f);
    EXPECT_EQ(read("Ks 1 1 1\n").materials[0].specular, 1.0f);
    EXPECT_EQ(read("Kd 1 1 1\n").materials[0].roughness, 1.0f);
    EXPECT_EQ(read("Ns 5000\n").materials[0].roughness, 0.0f);
}

TEST_F(ObjMaterials, PbrStatementsWin)
{
    const Material material = read("Ns 250\nPr 0.2\nPm 1\nd 1\nTr 1\n").materials[0];
    EXPECT_NEAR(material.roughness, 0.2, tolerance::kFloat);
    EXPECT_EQ(material.metallic, 1.0f);
    EXPECT_FALSE(material.alpha_mask) << "d wins over Tr";
}

TEST_F(ObjMaterials, ReadTheirTexture)
{
    cv::Mat pixels(2, 1, CV_8UC3, cv::Scalar(0, 0, 255));  // BGR: red
    pixels.at<cv::Vec3b>(1, 0) = {255, 0, 0};              // blue below
    fs::create_directory(folder_ / "my textures");
    ASSERT_TRUE(cv::imwrite((folder_ / "my textures/red blue.png").string(), pixels));
    const Model model =
        read("Kd 0.1 0.2 0.3\nmap_Kd -s 1 1 1 -clamp on my textures\\red blue.png\n");
    ASSERT_THAT(model.textures, SizeIs(1));
    EXPECT_EQ(model.materials[0].base_color_texture, 0);
    EXPECT_EQ(model.materials[0].base_color, glm::vec3(1)) << "the texture stands for Kd";
    EXPECT_EQ(model.textures[0].texels(0, 0), glm::u8vec4(255, 0, 0, 255));
    EXPECT_EQ(model.textures[0].texels(0, 1), glm::u8vec4(0, 0, 255, 255));
    EXPECT_TRUE(model.textures[0].srgb);
    EXPECT_TRUE(model.textures[0].clamp_s && model.textures[0].clamp_t);
}

TEST_F(ObjMaterials, MissingOrBrokenTexturesLeaveThePlainColour)
{
    folder_.add("broken.png", "not a picture");
    for (const auto& [name, code] : {std::pair("none.png", "model-texture-missing"),
                                     std::pair("broken.png", "model-texture-unreadable")}) {
        const Model model = read("Kd 0.1 0.2 0.3\nmap_Kd " + std::string(name) + "\n");
        EXPECT_TRUE(hasFinding(model.findings, code)) << name;
        EXPECT_EQ(model.materials[0].base_color_texture, kNoTexture);
        expectNear(model.materials[0].base_color, {0.1, 0.2, 0.3});
    }
    EXPECT_TRUE(hasFinding(read("bump b.png\n").findings, "model-map-ignored"));
    EXPECT_TRUE(hasFinding(read("", "other").findings, "model-material-missing"));
}

TEST_F(ObjMaterials, NeverLeaveTheFolder)
{
    for (const char* name : {"../secret.png",
                             "/etc/passwd",
                             "..\\..\\secret.png",
                             "C:\\secret.png",
                             "a/../../secret.png",
                             "http://host/a.png",
                             "file:///etc/passwd"})
        EXPECT_THAT(errorOf("map_Kd " + std::string(name) + "\n"), HasSubstr("own folder")) << name;
    fs::create_symlink("/etc", folder_ / "link");
    EXPECT_THAT(errorOf("map_Kd link/passwd\n"), HasSubstr("through a link"));
    folder_.add("m.obj", "mtllib ../m.mtl\n" + kTriangle + "f 1 2 3\n");
    EXPECT_THAT(inputErrorOf([&] { static_cast<void>(readModel(folder_ / "m.obj")); }),
                HasSubstr("own folder"));
}

TEST_F(ObjMaterials, NameTheLineOfAnError)
{
    EXPECT_THAT(errorOf("Kd red\n"), AllOf(HasSubstr("m.mtl"), HasSubstr("line 2")));
    EXPECT_THAT(errorOf("Ns\n"), HasSubstr("line 2"));
    EXPECT_THAT(errorOf("d nan\n"), HasSubstr("not finite"));
}

/// What assimp, an independent reader, finds in a file, whatever the order.
struct Totals {
    double area = 0.0;
    double volume = 0.0;
    glm::dvec3 centroid{0.0};
};

void addTriangle(Totals& totals, glm::dvec3 a, glm::dvec3 b, glm::dvec3 c)
{
    const double area = 0.5 * glm::length(glm::cross(b - a, c - a));
    totals.area += area;
    totals.centroid += area * (a + b + c) / 3.0;
    totals.volume += glm::dot(a, glm::cross(b, c)) / 6.0;
}

Totals totalsByAssimp(const fs::path& path)
{
    Assimp::Importer importer;
    const aiScene* scene = importer.ReadFile(path.string(), aiProcess_Triangulate);
    Totals totals;
    if (!scene) return totals;
    for (unsigned m = 0; m < scene->mNumMeshes; ++m) {
        const aiMesh& mesh = *scene->mMeshes[m];
        for (unsigned f = 0; f < mesh.mNumFaces; ++f) {
            if (mesh.mFaces[f].mNumIndices != 3) continue;
            glm::dvec3 corner[3];
            for (int i = 0; i < 3; ++i) {
                const aiVector3D& p = mesh.mVertices[mesh.mFaces[f].mIndices[i]];
                corner[i] = {p.x, p.y, p.z};
            }
            addTriangle(totals, corner[0], corner[1], corner[2]);
        }
    }
    return totals;
}

TEST(ObjSamples, AgreeWithAssimpInAreaVolumeAndCentroid)
{
    INSITU_NEEDS_DATA();
    for (const char* name : {"shippable/furniture/oakChair/oakChair.obj",
                             "shippable/furniture/sofa2/sofa2.obj",
                             "shippable/furniture/lamp2/lamp2.obj",
                             "furniture/classic/spot.obj"}) {
        const fs::path path = dataFolder() / name;
        const TriangleMesh mesh = readModel(path).mesh;
        Totals ours;
        for (const glm::uvec3& t : mesh.triangles)
            addTriangle(ours, mesh.positions[t.x], mesh.positions[t.y], mesh.positions[t.z]);
        const Totals theirs = totalsByAssimp(path);
        // Bent polygons may be cut in several ways, which changes up to 2e-3 of the area.
        EXPECT_NEAR(ours.area / theirs.area, 1.0, 2e-3) << name;
        EXPECT_NEAR(ours.volume, theirs.volume, 1e-3 * std::pow(theirs.area, 1.5)) << name;
        expectNear(ours.centroid / ours.area,
                   theirs.centroid / theirs.area,
                   1e-3 * std::sqrt(theirs.area));
    }
}

// The chair's faces all lie in smoothing groups: every normal is close to those of its triangles,
// and hardly any triangle is flat.
TEST(ObjSamples, TheChairIsSmooth)
{
    INSITU_NEEDS_DATA();
    const Model model = readModel(dataFolder() / "shippable/furniture/oakChair/oakChair.obj");
    const TriangleMesh& mesh = model.mesh;
    EXPECT_THAT(mesh.triangles, SizeIs(31786));
    EXPECT_THAT(model.textures, SizeIs(1));
    ASSERT_EQ(mesh.normals.size(), mesh.positions.size());
    std::map<std::tuple<float, float, float>, int> seams;
    std::size_t facing = 0;
    std::size_t flat = 0;
    for (const glm::uvec3& t : mesh.triangles) {
        const glm::dvec3 n = glm::normalize(areaVector(mesh, t));
        double least = 1.0;
        for (int i = 0; i < 3; ++i)
            least = std::min(least, glm::dot(n, glm::dvec3(mesh.normals[t[i]])));
        facing += least > 0.0;
        flat += least > 1.0 - 1e-9;
    }
    EXPECT_GT(static_cast<double>(facing), 0.999 * static_cast<double>(mesh.triangles.size()));
    EXPECT_LT(static_cast<double>(flat), 0.2 * static_cast<double>(mesh.triangles.size()));
}

}  // namespace
}  // namespace insitu
