#include "core/io/model_io.h"
#include "tests/core/gltf_builder.h"
#include "tests/support/data.h"
#include "tests/support/errors.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/tolerance.h"

#include <gmock/gmock.h>

#include <cmath>

namespace insitu {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;
using Json = GltfBuilder::Json;

Model readGlb(const GltfBuilder& builder)
{
    const TemporaryFolder folder;
    return readModel(folder.add("m.glb", builder.glb()));
}

std::string errorOf(const GltfBuilder& builder)
{
    return inputErrorOf([&] { static_cast<void>(readGlb(builder)); });
}

void expectNear(glm::dvec3 actual, glm::dvec3 expected)
{
    for (int i = 0; i < 3; ++i)
        EXPECT_NEAR(actual[i], expected[i], tolerance::kFloat) << "component " << i;
}

glm::dvec3 faceNormal(const TriangleMesh& mesh, std::size_t triangle)
{
    const glm::uvec3 t = mesh.triangles[triangle];
    const glm::dvec3 a(mesh.positions[t.x]);
    return glm::normalize(
        glm::cross(glm::dvec3(mesh.positions[t.y]) - a, glm::dvec3(mesh.positions[t.z]) - a));
}

TEST(Gltf, ReadsATriangle)
{
    const Model model = readGlb(triangleGltf());
    EXPECT_THAT(model.mesh.positions,
                ElementsAre(glm::vec3(0, 0, 0), glm::vec3(1, 0, 0), glm::vec3(0, 1, 0)));
    EXPECT_THAT(model.mesh.triangles, ElementsAre(glm::uvec3(0, 1, 2)));
    EXPECT_THAT(model.mesh.normals, IsEmpty()) << "without normals: flat";
    EXPECT_THAT(model.mesh.texcoords, IsEmpty());
    EXPECT_THAT(model.materials, SizeIs(1));
    EXPECT_THAT(model.findings, IsEmpty());
}

TEST(Gltf, IndicesOfAllTypesMeanTheSame)
{
    const auto read = [](auto sample, int type) {
        using Index = decltype(sample);
        GltfBuilder builder;
        const int positions = builder.addPositions({{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}});
        const int normals = builder.addPositions(std::vector<glm::vec3>(4, {0, 0, 1}));
        const int indices =
            builder.addAccessor(std::vector<Index>{0, 1, 2, 0, 2, 3}, type, "SCALAR");
        builder.addNode({{"mesh",
                          builder.addMesh({{"POSITION", positions}, {"NORMAL", normals}},
                                          {{"indices", indices}})}});
        return readGlb(builder).mesh.triangles;
    };
    const auto expected = ElementsAre(glm::uvec3(0, 1, 2), glm::uvec3(0, 2, 3));
    EXPECT_THAT(read(std::uint8_t{}, GltfBuilder::kUnsignedByte), expected);
    EXPECT_THAT(read(std::uint16_t{}, GltfBuilder::kUnsignedShort), expected);
    EXPECT_THAT(read(std::uint32_t{}, GltfBuilder::kUnsignedInt), expected);
}

// A strip's zigzag and a fan's rim, both facing +z everywhere.
TEST(Gltf, StripsAndFansKeepTheirFront)
{
    for (const int mode : {5, 6}) {
        GltfBuilder builder;
        const std::vector<glm::vec3> strip = {
            {0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}, {0, 2, 0}};
        const std::vector<glm::vec3> fan = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {-1, 1, 0}};
        const int positions = builder.addPositions(mode == 5 ? strip : fan);
        builder.addNode({{"mesh", builder.addMesh({{"POSITION", positions}}, {{"mode", mode}})}});
        const TriangleMesh mesh = readGlb(builder).mesh;
        ASSERT_THAT(mesh.triangles, SizeIs(3)) << mode;
        for (std::size_t t = 0; t < 3; ++t)
            expectNear(faceNormal(mesh, t), {0, 0, 1});
    }
}

TEST(Gltf, SkipsPointsAndLines)
{
    GltfBuilder builder = triangleGltf();
    for (const int mode : {0, 1, 3})
        builder.addNode(
            {{"mesh", builder.addMesh({{"POSITION", 0}, {"COLOR_0", 0}}, {{"mode", mode}})}});
    const Model model = readGlb(builder);
    EXPECT_THAT(model.mesh.triangles, SizeIs(1));
    EXPECT_TRUE(hasFinding(model.findings, "model-primitives-skipped"));
}

TEST(Gltf, NodeTransformsMultiplyFromTheRoot)
{
    GltfBuilder builder = triangleGltf();
    const double half = std::sqrt(0.5);
    // x_in_model = T(10,0,0) · [R_z(90°)·S(2,3,4)] · x; a quaternion is x, y, z, w.
    builder.json["nodes"][0]["rotation"] = {0, 0, half, half};
    builder.json["nodes"][0]["scale"] = {2, 3, 4};
    builder.addNode(
        {{"children", {0}}, {"matrix", {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 10, 0, 0, 1}}});
    const TriangleMesh mesh = readGlb(builder).mesh;
    expectNear(mesh.positions[0], {10, 0, 0});
    expectNear(mesh.positions[1], {10, 2, 0});
    expectNear(mesh.positions[2], {7, 0, 0});
}

// A mirrored or unevenly scaled plane: the stated normal must stay perpendicular to it and on
// the side of its front.
TEST(Gltf, NormalsFollowAnyScale)
{
    for (const glm::dvec3 scale : {glm::dvec3(1), {-1, 1, 1}, {2, 5, 0.1}, {-3, -2, -1}}) {
        GltfBuilder builder;
        const int positions = builder.addPositions({{0, 0, 0}, {1, 0, 1}, {0, 1, 0}});
        const float h = std::sqrt(0.5f);
        const int normals = builder.addPositions(std::vector<glm::vec3>(3, {-h, 0, h}));
        builder.addNode({{"mesh", builder.addMesh({{"POSITION", positions}, {"NORMAL", normals}})},
                         {"scale", {scale.x, scale.y, scale.z}}});
        const Model model = readGlb(builder);
        expectNear(model.mesh.normals[0], faceNormal(model.mesh, 0));
        EXPECT_THAT(model.findings, IsEmpty());
    }
}

TEST(Gltf, OnlyTheDefaultSceneIsThere)
{
    GltfBuilder builder = triangleGltf();
    builder.addNode({{"mesh", 0}, {"translation", {5, 0, 0}}});
    builder.json["scenes"] = {{{"nodes", {0}}}, {{"nodes", {1}}}};
    EXPECT_EQ(readGlb(builder).mesh.positions[0].x, 0.0f);
    builder.json["scene"] = 1;
    EXPECT_EQ(readGlb(builder).mesh.positions[0].x, 5.0f);
    builder.json["scene"] = 2;
    EXPECT_THAT(errorOf(builder), HasSubstr("scene 2"));
}

TEST(Gltf, MixesPartsWithAndWithoutNormals)
{
    GltfBuilder builder = triangleGltf();
    const int normals = builder.addPositions(std::vector<glm::vec3>(3, {0, 0.6f, 0.8f}));
    builder.addNode({{"mesh", builder.addMesh({{"POSITION", 0}, {"NORMAL", normals}})}});
    const TriangleMesh mesh = readGlb(builder).mesh;
    ASSERT_THAT(mesh.normals, SizeIs(6));
    expectNear(mesh.normals[0], {0, 0, 1});
    expectNear(mesh.normals[3], {0, 0.6, 0.8});
}

TEST(Gltf, SparseAccessorsReplaceElements)
{
    GltfBuilder builder = triangleGltf();
    const std::vector<std::uint8_t> which = {2};
    const std::vector<glm::vec3> values = {{0, 7, 0}};
    const int indices = builder.addView(which.data(), which.size());
    const int replacements = builder.addView(values.data(), sizeof(glm::vec3));
    builder.json["accessors"][0]["sparse"] = {
        {"count", 1},
        {"indices", {{"bufferView", indices}, {"componentType", 5121}}},
        {"values", {{"bufferView", replacements}}}};
    EXPECT_EQ(readGlb(builder).mesh.positions[2], glm::vec3(0, 7, 0));
    EXPECT_EQ(readGlb(builder).mesh.positions[1], glm::vec3(1, 0, 0));
    // Without a view the rest is zero: a single point, hence no triangle left.
    builder.json["accessors"][0].erase("bufferView");
    EXPECT_THAT(errorOf(builder), HasSubstr("points or lines"));
}

TEST(Gltf, InterleavedAttributesAreStrided)
{
    GltfBuilder builder;
    const std::vector<float> data = {0, 0, 0, 0.1f, 0.2f, 1, 0, 0, 0.3f, 0.4f, 0, 1, 0, 0.5f, 0.6f};
    const int view = builder.addView(data.data(), data.size() * sizeof(float));
    builder.json["bufferViews"][0]["byteStride"] = 20;
    const int positions = builder.push(
        "accessors",
        {{"bufferView", view}, {"componentType", 5126}, {"count", 3}, {"type", "VEC3"}});
    const int texcoords = builder.push("accessors",
                                       {{"bufferView", view},
                                        {"byteOffset", 12},
                                        {"componentType", 5126},
                                        {"count", 3},
                                        {"type", "VEC2"}});
    builder.addNode(
        {{"mesh", builder.addMesh({{"POSITION", positions}, {"TEXCOORD_0", texcoords}})}});
    const TriangleMesh mesh = readGlb(builder).mesh;
    EXPECT_EQ(mesh.positions[2], glm::vec3(0, 1, 0));
    EXPECT_THAT(mesh.texcoords,
                ElementsAre(glm::vec2(0.1f, 0.2f), glm::vec2(0.3f, 0.4f), glm::vec2(0.5f, 0.6f)));
}

TEST(Gltf, NormalisesIntegerTextureCoordinates)
{
    GltfBuilder builder = triangleGltf();
    const int bytes = builder.addAccessor(
        std::vector<glm::u8vec2>{{0, 255}, {51, 0}, {0, 0}}, GltfBuilder::kUnsignedByte, "VEC2");
    builder.json["accessors"][static_cast<std::size_t>(bytes)]["normalized"] = true;
    builder.json["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"] = bytes;
    EXPECT_EQ(readGlb(builder).mesh.texcoords[0], glm::vec2(0, 1));
    EXPECT_NEAR(readGlb(builder).mesh.texcoords[1].x, 0.2, tolerance::kFloat);
}

TEST(Gltf, ExternalBuffersLieInTheFolder)
{
    const GltfBuilder builder = triangleGltf();
    const TemporaryFolder folder;
    folder.add("my+data 1.bin", builder.binary + "padding");
    const auto read = [&](const std::string& uri) {
        Json json = builder.json;
        json["buffers"] = {{{"uri", uri}, {"byteLength", builder.binary.size()}}};
        return readModel(folder.add("m.gltf", json.dump()));
    };
    EXPECT_THAT(read("my+data%201.bin").mesh.triangles, SizeIs(1));
    for (const char* uri : {"../m.bin",
                            "%2e%2e/m.bin",
                            "/etc/passwd",
                            "file:///etc/passwd",
                            "http://host/m.bin",
                            "a/..%5c..%5cm.bin"})
        EXPECT_THAT(inputErrorOf([&] { static_cast<void>(read(uri)); }), HasSubstr("own folder"))
            << uri;
    EXPECT_THAT(inputErrorOf([&] { static_cast<void>(read("none.bin")); }),
                HasSubstr("no such file"));
    folder.add("short.bin", "abc");
    EXPECT_THAT(inputErrorOf([&] { static_cast<void>(read("short.bin")); }),
                HasSubstr("has 3 bytes"));
}

TEST(Gltf, DataUrisHoldBuffers)
{
    GltfBuilder builder = triangleGltf();
    // Three little-endian floats 0 are 12 zero bytes, "AAAA" four times; 1.0f is 00 00 80 3f.
    builder.json["buffers"] = {{{"uri",
                                 "data:application/octet-stream;base64,"
                                 "AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA"},
                                {"byteLength", 36}}};
    builder.binary.clear();
    const TemporaryFolder folder;
    const Model model = readModel(folder.add("m.gltf", builder.json.dump()));
    EXPECT_EQ(model.mesh.positions[2], glm::vec3(0, 1, 0));
}

TEST(Gltf, RefusesRequiredExtensionsByName)
{
    GltfBuilder builder = triangleGltf();
    for (const char* name : {"KHR_draco_mesh_compression",
                             "KHR_mesh_quantization",
                             "KHR_texture_transform",
                             "ACME_unknown"}) {
        builder.json["extensionsRequired"] = {name};
        EXPECT_THAT(errorOf(builder), AllOf(HasSubstr(name), HasSubstr("m.glb"))) << name;
    }
    builder.json["extensionsRequired"] = {"KHR_materials_specular"};
    EXPECT_THAT(readGlb(builder).mesh.triangles, SizeIs(1));
    builder.json.erase("extensionsRequired");
    builder.json["extensionsUsed"] = {"ACME_unknown", "KHR_materials_specular"};
    const Model model = readGlb(builder);
    ASSERT_THAT(model.findings, SizeIs(1));
    EXPECT_EQ(model.findings[0].code, "model-extension-ignored");
    EXPECT_THAT(model.findings[0].message,
                AllOf(HasSubstr("ACME_unknown"), testing::Not(HasSubstr("specular"))));
}

TEST(Gltf, ChecksWhatItIsTold)
{
    const auto errorAfter = [](auto spoil) {
        GltfBuilder builder = triangleGltf();
        const int indices = builder.addAccessor(
            std::vector<std::uint16_t>{0, 1, 2}, GltfBuilder::kUnsignedShort, "SCALAR");
        builder.json["meshes"][0]["primitives"][0]["indices"] = indices;
        spoil(builder.json);
        return errorOf(builder);
    };
    const auto accessor = [](const char* key, const Json& value) {
        return [=](Json& j) { j["accessors"][0][key] = value; };
    };
    const auto view = [](const char* key, const Json& value) {
        return [=](Json& j) { j["bufferViews"][0][key] = value; };
    };
    EXPECT_THAT(errorAfter([](Json& j) { j["asset"]["version"] = "1.0"; }), HasSubstr("2.0"));
    EXPECT_THAT(errorAfter([](Json& j) { j.erase("asset"); }), HasSubstr("no glTF"));
    EXPECT_THAT(errorAfter([](Json& j) { j.erase("nodes"); }), HasSubstr("no triangles"));
    EXPECT_THAT(errorAfter(accessor("count", 4)), HasSubstr("outside its buffer view"));
    EXPECT_THAT(errorAfter(accessor("count", 1ull << 60)), HasSubstr("elements"));
    EXPECT_THAT(errorAfter(accessor("byteOffset", 4)), HasSubstr("outside its buffer view"));
    EXPECT_THAT(errorAfter(accessor("bufferView", 9)), HasSubstr("buffer view 9"));
    EXPECT_THAT(errorAfter(accessor("type", "VEC2")), HasSubstr("three floats"));
    EXPECT_THAT(errorAfter(accessor("componentType", 5122)), HasSubstr("quantised"));
    EXPECT_THAT(errorAfter(view("byteLength", 1000)), HasSubstr("outside the buffer"));
    EXPECT_THAT(errorAfter(view("byteOffset", 1000)), HasSubstr("outside the buffer"));
    EXPECT_THAT(errorAfter(view("byteStride", 200)), HasSubstr("outside its buffer view"));
    EXPECT_THAT(errorAfter(view("buffer", 1)), HasSubstr("buffer 1"));
    EXPECT_THAT(errorAfter([](Json& j) { j["accessors"][0]["count"] = 2; }), HasSubstr("vertex 2"));
    EXPECT_THAT(errorAfter([](Json& j) { j["nodes"][0]["mesh"] = 7; }), HasSubstr("mesh 7"));
    EXPECT_THAT(errorAfter([](Json& j) { j["nodes"][0]["children"] = {4}; }), HasSubstr("node 4"));
    EXPECT_THAT(errorAfter([](Json& j) { j["meshes"][0]["primitives"][0]["material"] = 3; }),
                HasSubstr("material 3"));
    EXPECT_THAT(
        errorAfter([](Json& j) {
            j["images"] = {{{"bufferView", 2}, {"mimeType", "image/png"}}};
            j["bufferViews"].push_back({{"buffer", 0}, {"byteOffset", 40}, {"byteLength", 100}});
        }),
        HasSubstr("outside its buffer"));
}

TEST(Gltf, RefusesCyclesAndSharedChildren)
{
    GltfBuilder builder = triangleGltf();
    builder.json["nodes"][0]["children"] = {1};
    builder.addNode({{"children", {0}}});
    builder.json["scenes"] = {{{"nodes", {0}}}};
    EXPECT_THAT(errorOf(builder), HasSubstr("ancestor"));
    // Without scenes, a ring has no root at all.
    builder.json.erase("scenes");
    EXPECT_THAT(errorOf(builder), HasSubstr("no triangles"));
}

TEST(Gltf, DeepTreesDoNotRecurse)
{
    GltfBuilder builder = triangleGltf();
    constexpr int kDepth = 20'000;
    for (int i = 0; i < kDepth; ++i)
        builder.json["nodes"].push_back({{"children", {i}}, {"translation", {0, 0, 1}}});
    EXPECT_EQ(readGlb(builder).mesh.positions[0].z, static_cast<float>(kDepth));
}

// Instances of one mesh are legal and small in the file, but not for nothing in memory.
TEST(Gltf, BoundsInstancedMemory)
{
    GltfBuilder builder;
    const int positions = builder.addPositions(std::vector<glm::vec3>(300'000, glm::vec3(0.5f)));
    const int mesh = builder.addMesh({{"POSITION", positions}});
    for (int i = 0; i < 1000; ++i)
        builder.addNode({{"mesh", mesh}});
    EXPECT_THAT(errorOf(builder), HasSubstr("more than"));
}

TEST(GltfSamples, HaveTheTrianglesAndSizesOfTheirIndex)
{
    INSITU_NEEDS_DATA();
    struct Sample {
        const char* file;
        std::size_t triangles;
        glm::dvec3 extent_m;
        std::size_t textures;
    };
    for (const Sample& sample :
         {Sample{"polyhaven/sofa_03_1k.gltf", 8004, {2.73, 1.12, 0.93}, 4},
          Sample{"polyhaven/wooden_table_02_1k.gltf", 196, {1.13, 0.80, 0.71}, 2},
          Sample{"polyhaven/wooden_bookshelf_worn_1k.gltf", 10106, {1.37, 2.06, 0.58}, 2},
          Sample{"polyhaven/painted_wooden_cabinet_02_1k.gltf", 966, {1.00, 2.57, 0.72}, 2},
          Sample{"WickerChair/WickerChair.glb", 18320, {1.35, 1.89, 1.03}, 2}}) {
        const Model model = readModel(dataFolder() / "furniture" / sample.file);
        EXPECT_THAT(model.mesh.triangles, SizeIs(sample.triangles)) << sample.file;
        EXPECT_THAT(model.textures, SizeIs(sample.textures)) << sample.file;
        const BoundingBox box = boundingBox(model.mesh);
        for (int i = 0; i < 3; ++i)
            EXPECT_NEAR((box.max - box.min)[i], sample.extent_m[i], 0.0051)  // two digits stated
                << sample.file;
        EXPECT_NEAR(box.min.y, 0.0, 0.002) << sample.file;
        EXPECT_FALSE(extentFinding(box, sample.file));
    }
}

TEST(GltfSamples, DracoIsRefusedByName)
{
    INSITU_NEEDS_DATA();
    EXPECT_THAT(
        inputErrorOf([] {
            static_cast<void>(readModel(dataFolder() / "furniture/playcanvas/chess-board.glb"));
        }),
        HasSubstr("KHR_draco_mesh_compression"));
}

}  // namespace
}  // namespace insitu
