#include "core/check.h"
#include "core/io/model_io.h"
#include "tests/core/gltf_builder.h"
#include "tests/support/data.h"
#include "tests/support/errors.h"
#include "tests/support/temporary_folder.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <cstdlib>
#include <random>
#include <set>

namespace insitu {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

/// Reads the file; whatever it holds, the answer is a valid model or an InputError.
void expectModelOrInputError(const fs::path& path)
{
    try {
        const Model model = readModel(path);
        for (const glm::uvec3& t : model.mesh.triangles)
            for (int i = 0; i < 3; ++i)
                ASSERT_LT(t[i], model.mesh.positions.size()) << path;
        for (const std::uint32_t material : model.mesh.material_of)
            ASSERT_LT(material, model.materials.size()) << path;
    } catch (const InputError&) {
    } catch (const std::exception& error) {
        FAIL() << path << ": not an InputError: " << error.what();
    }
}

TEST(HostileModels, FilesMadeToBreakReaders)
{
    INSITU_NEEDS_DATA();
    const fs::path folder = dataFolder() / ".." / "hostile";
    ASSERT_TRUE(fs::exists(folder)) << "the hostile files lie beside the captures: " << folder;
    const std::set<std::string> extensions = {
        ".obj", ".gltf", ".glb", ".ply", ".stl", ".dae", ".fbx"};
    for (const auto& entry : fs::recursive_directory_iterator(folder))
        if (entry.is_regular_file() && extensions.contains(entry.path().extension().string()))
            expectModelOrInputError(entry.path());
}

TEST(HostileModels, UnknownFormatsAreNamed)
{
    const TemporaryFolder folder;
    EXPECT_THAT(inputErrorOf([&] { static_cast<void>(readModel(folder.add("m.xyz", "x"))); }),
                HasSubstr(".xyz"));
    EXPECT_THAT(inputErrorOf([&] { static_cast<void>(readModel(folder / "none.obj")); }),
                HasSubstr("no such file"));
    fs::create_directory(folder / "folder.glb");
    EXPECT_THAT(inputErrorOf([&] { static_cast<void>(readModel(folder / "folder.glb")); }),
                HasSubstr("not a file"));
    for (const char* name : {"m.obj", "m.gltf", "m.glb", "m.ply", "m.stl", "m.fbx"})
        EXPECT_THAT(inputErrorOf([&] { static_cast<void>(readModel(folder.add(name, ""))); }),
                    HasSubstr(name));
}

TEST(HostileModels, DeeplyNestedJsonIsRefused)
{
    const TemporaryFolder folder;
    const std::string open(2'000'000, '[');
    for (const std::string& text : {open,
                                    R"({"asset":{"version":"2.0"},"extras":)" + open,
                                    "{\"a\":" + open + std::string(2'000'000, ']') + "}"})
        EXPECT_THAT(inputErrorOf([&] { static_cast<void>(readModel(folder.add("m.gltf", text))); }),
                    HasSubstr("nested too deeply"));
}

TEST(HostileModels, CountlessJsonValuesAreRefused)
{
    const TemporaryFolder folder;
    std::string text = R"({"asset":{"version":"2.0"},"nodes":[{})";
    for (int i = 0; i < 1'100'000; ++i)
        text += ",{}";
    EXPECT_THAT(
        inputErrorOf([&] { static_cast<void>(readModel(folder.add("m.gltf", text + "]}"))); }),
        HasSubstr("JSON values"));
}

/// A small text or binary with some bytes replaced, removed, repeated or cut off.
std::string mutated(std::string bytes, std::mt19937& random)
{
    const int changes = 1 + static_cast<int>(random() % 4);
    for (int i = 0; i < changes && !bytes.empty(); ++i) {
        const std::size_t at = random() % bytes.size();
        const std::size_t length = 1 + random() % std::min<std::size_t>(8, bytes.size() - at);
        static constexpr std::string_view kTelling = "0123456789-/.e{}[]\",:\n \\\xFF\x7F\x80";
        switch (random() % 6) {
            case 0:
                bytes[at] = static_cast<char>(random() & 0xFF);
                break;
            case 1:
            case 2:
                bytes[at] = kTelling[random() % kTelling.size()];
                break;
            case 3:
                bytes.erase(at, length);
                break;
            case 4:
                bytes.insert(at, bytes.substr(at, length));
                break;
            default:
                if (random() % 4 == 0) bytes.resize(at);
                break;
        }
    }
    return bytes;
}

/// Runs of each fuzz test: few in everyday testing, INSITU_FUZZ_RUNS says otherwise.
int fuzzRuns()
{
    const char* runs = std::getenv("INSITU_FUZZ_RUNS");
    return runs ? std::max(1, std::atoi(runs)) : 300;
}

void fuzz(const std::string& seed_bytes, const char* name)
{
    const int runs = fuzzRuns();
    const TemporaryFolder folder;
    expectModelOrInputError(folder.add(name, seed_bytes));
    for (int run = 0; run < runs && !::testing::Test::HasFatalFailure(); ++run) {
        std::mt19937 random(static_cast<unsigned>(run));
        SCOPED_TRACE(run);
        fs::remove(folder / name);  // rewriting a file in place waits for the disk
        expectModelOrInputError(folder.add(name, mutated(seed_bytes, random)));
    }
}

std::string sampleObj()
{
    return "mtllib m.mtl\no a\nv 0 0 0\nv 1 0 0\nv 1 1 0.1\nv 0 1 0\nv 0.5 2 0\nvt 0 0\nvt 1 1\n"
           "vn 0 0 1\nusemtl a\ns 1\nf 1/1 2/2 3/1 4/2\ns off\nf 1 2 3 5 4\no b\ns 2\n"
           "f -1//1 -2//1 -3//1\n";
}

std::string sampleGlb()
{
    GltfBuilder builder = triangleGltf();
    const int normals = builder.addPositions(std::vector<glm::vec3>(3, {0, 0, 1}));
    const int indices = builder.addAccessor(
        std::vector<std::uint16_t>{0, 1, 2}, GltfBuilder::kUnsignedShort, "SCALAR");
    auto& primitive = builder.json["meshes"][0]["primitives"][0];
    primitive["attributes"]["NORMAL"] = normals;
    primitive["indices"] = indices;
    primitive["material"] = 0;
    builder.push(
        "materials",
        {{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}}}, {"alphaMode", "BLEND"}});
    builder.push("textures", {{"source", 0}, {"sampler", 0}});
    builder.push("samplers", {{"wrapS", 33071}});
    builder.push("images", {{"bufferView", 0}, {"mimeType", "image/png"}});
    builder.addNode({{"children", {0}}, {"scale", {1, 2, -3}}});
    builder.json["scenes"] = {{{"nodes", {1}}}};
    builder.json["extensionsUsed"] = {"KHR_materials_specular"};
    return builder.glb();
}

TEST(HostileModels, MutatedObj)
{
    fuzz(sampleObj(), "m.obj");
}

TEST(HostileModels, MutatedMtl)
{
    const TemporaryFolder folder;
    const fs::path obj = folder.add("m.obj", sampleObj());
    const std::string mtl =
        "newmtl a\nKd 0.1 0.2 0.3\nKs 1 1 1\nNs 30\nd 0.5\nmap_Kd -s 1 1 1 t.png\n";
    for (int run = 0; run < fuzzRuns() && !HasFatalFailure(); ++run) {
        std::mt19937 random(static_cast<unsigned>(run));
        fs::remove(folder / "m.mtl");
        folder.add("m.mtl", mutated(mtl, random));
        expectModelOrInputError(obj);
    }
}

TEST(HostileModels, MutatedGlb)
{
    fuzz(sampleGlb(), "m.glb");
}

// The JSON alone, where most of the structure is, with its buffer in a data URI.
TEST(HostileModels, MutatedGltf)
{
    GltfBuilder builder = triangleGltf();
    builder.json["buffers"] = {{{"uri",
                                 "data:application/octet-stream;base64,"
                                 "AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA"},
                                {"byteLength", 36}}};
    builder.json["accessors"][0]["sparse"] = {
        {"count", 1},
        {"indices", {{"bufferView", 0}, {"componentType", 5121}}},
        {"values", {{"bufferView", 0}}}};
    fuzz(builder.json.dump(), "m.gltf");
}

std::string samplePly()
{
    return "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
           "property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
           "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
}

std::string sampleStl()
{
    std::string bytes(80, ' ');
    bytes += GltfBuilder::word(1);
    const float values[12] = {0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0};
    bytes.append(reinterpret_cast<const char*>(values), sizeof values);
    return bytes + std::string(2, '\0');
}

TEST(HostileModels, MutatedPly)
{
    fuzz(samplePly(), "m.ply");
}

TEST(HostileModels, MutatedStl)
{
    fuzz(sampleStl(), "m.stl");
}

}  // namespace
}  // namespace insitu
