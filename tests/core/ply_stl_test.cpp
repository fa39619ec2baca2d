#include "core/io/model_io.h"
#include "tests/support/errors.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/tolerance.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <cstring>

namespace insitu {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

Model readBytes(const char* name, const std::string& bytes)
{
    const TemporaryFolder folder;
    return readModel(folder.add(name, bytes));
}

std::string errorOf(const char* name, const std::string& bytes)
{
    return inputErrorOf([&] { static_cast<void>(readBytes(name, bytes)); });
}

template <class Number>
std::string bytesOf(Number number, bool big_endian = false)
{
    std::string bytes(sizeof number, '\0');
    std::memcpy(bytes.data(), &number, sizeof number);
    if (big_endian) std::reverse(bytes.begin(), bytes.end());
    return bytes;
}

std::string header(const std::string& format, const std::string& vertex = "", int vertices = 4)
{
    return "ply\nformat " + format + " 1.0\ncomment made by hand\nelement vertex " +
           std::to_string(vertices) + "\nproperty double x\nproperty float y\nproperty short z\n" +
           vertex +
           "element face 2\nproperty list uchar uint vertex_indices\nproperty uchar flags\n"
           "end_header\n";
}

const std::string kTextBody = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3 9\n3 0 1 2 9\n";

std::string binaryBody(bool big)
{
    std::string body;
    for (const auto& [x, y] : {std::pair(0, 0), {1, 0}, {1, 1}, {0, 1}})
        body += bytesOf(static_cast<double>(x), big) + bytesOf(static_cast<float>(y), big) +
                bytesOf(std::int16_t{0}, big);
    body += bytesOf(std::uint8_t{4});
    for (const std::uint32_t i : {0, 1, 2, 3})
        body += bytesOf(i, big);
    body += bytesOf(std::uint8_t{9}) + bytesOf(std::uint8_t{3});
    for (const std::uint32_t i : {0, 1, 2})
        body += bytesOf(i, big);
    return body + bytesOf(std::uint8_t{9});
}

TEST(Ply, AllThreeFormatsMeanTheSame)
{
    for (const Model& model :
         {readBytes("m.ply", header("ascii") + kTextBody),
          readBytes("m.ply", header("binary_little_endian") + binaryBody(false)),
          readBytes("m.ply", header("binary_big_endian") + binaryBody(true))}) {
        EXPECT_THAT(
            model.mesh.positions,
            ElementsAre(
                glm::vec3(0, 0, 0), glm::vec3(1, 0, 0), glm::vec3(1, 1, 0), glm::vec3(0, 1, 0)));
        EXPECT_THAT(model.mesh.triangles,
                    ElementsAre(glm::uvec3(0, 1, 2), glm::uvec3(0, 2, 3), glm::uvec3(0, 1, 2)));
        EXPECT_THAT(model.mesh.normals, IsEmpty());
        EXPECT_THAT(model.findings, IsEmpty());
    }
}

TEST(Ply, ReadsNormalsAndTextureCoordinates)
{
    const Model model =
        readBytes("m.ply",
                  "ply\nformat ascii 1.0\nelement vertex 3\nproperty float nx\nproperty float ny\n"
                  "property float nz\nproperty float x\nproperty float y\nproperty float z\n"
                  "property float s\nproperty float t\nproperty uchar red\nelement edge 1\n"
                  "property list uchar float weights\nelement face 1\n"
                  "property list uchar int vertex_index\nend_header\n"
                  "0 0.6 0.8 0 0 0 0.25 0.25 7\n0 0.6 0.8 1 0 0 0 1 7\n0 0.6 0.8 0 1 0 0 0 7\n"
                  "2 1.5 2.5\n3 0 1 2\n");
    EXPECT_THAT(model.mesh.normals, SizeIs(3));
    EXPECT_NEAR(model.mesh.normals[0].z, 0.8, tolerance::kFloat);
    EXPECT_EQ(model.mesh.texcoords[0], glm::vec2(0.25f, 0.75f)) << "v from the top";
    EXPECT_TRUE(hasFinding(model.findings, "model-vertex-colors-ignored"));
}

TEST(Ply, ErrorsAreNamed)
{
    EXPECT_THAT(errorOf("m.ply", "plx\n"), HasSubstr("no PLY"));
    EXPECT_THAT(errorOf("m.ply", "ply\nformat ascii 1.0\n"), HasSubstr("does not end"));
    EXPECT_THAT(errorOf("m.ply", "ply\nformat ascii 2.0\n"), HasSubstr("line 2"));
    EXPECT_THAT(errorOf("m.ply", "ply\nformat ebcdic 1.0\n"), HasSubstr("ebcdic"));
    EXPECT_THAT(errorOf("m.ply", "ply\nend_header\n"), HasSubstr("format"));
    EXPECT_THAT(errorOf("m.ply", header("ascii", "property half w\n")), HasSubstr("'half'"));
    EXPECT_THAT(errorOf("m.ply", header("ascii")), HasSubstr("ends early"));
    EXPECT_THAT(errorOf("m.ply", header("ascii", "", 2'000'000'000) + kTextBody),
                HasSubstr("more than 20000000"));
    EXPECT_THAT(errorOf("m.ply", header("ascii") + "0 0 zero"), HasSubstr("'zero'"));
    EXPECT_THAT(
        errorOf("m.ply", header("ascii") + "0 0 0 1 0 0 1 1 0 0 1 0\n4 0 1 2 4 9\n3 0 1 2 9\n"),
        HasSubstr("vertex 4 of 4"));
    EXPECT_THAT(errorOf("m.ply", header("ascii") + "0 0 0 1 0 0 1 1 0 0 1 0\n-1 0 9\n"),
                HasSubstr("whole number"));
    EXPECT_THAT(
        errorOf("m.ply", "ply\nformat ascii 1.0\nelement nothing 99999999999\nend_header\n"),
        HasSubstr("no properties"));
    EXPECT_THAT(
        errorOf("m.ply", "ply\nformat ascii 1.0\nelement vertex 1\nproperty int x\nend_header\n1"),
        HasSubstr("x, y and z"));
}

std::string binaryStl(const std::string& title, std::uint32_t declared, int triangles)
{
    std::string bytes = title;
    bytes.resize(80, ' ');
    bytes += bytesOf(declared);
    for (int i = 0; i < triangles; ++i) {
        for (const float value : {0.f, 0.f, 0.f, 0.f, 0.f, 0.f, 1.f, 0.f, 0.f, 0.f, 1.f, 0.f})
            bytes += bytesOf(value);
        bytes += std::string(2, '\0');
    }
    return bytes;
}

const std::string kTextStl =
    "solid chair\n facet normal 0 0 1\n  outer loop\n   vertex 0 0 0\n   vertex 1e0 0 0\n"
    "   vertex 0 1 0\n  endloop\n endfacet\nendsolid chair\n";

TEST(Stl, TextAndBinaryMeanTheSame)
{
    for (const Model& model : {readBytes("m.stl", kTextStl),
                               readBytes("M.STL", binaryStl("made by hand", 1, 1)),
                               readBytes("m.stl", binaryStl("solid, yet binary", 1, 1))}) {
        EXPECT_THAT(model.mesh.positions,
                    ElementsAre(glm::vec3(0, 0, 0), glm::vec3(1, 0, 0), glm::vec3(0, 1, 0)));
        EXPECT_THAT(model.mesh.triangles, ElementsAre(glm::uvec3(0, 1, 2)));
        EXPECT_THAT(model.mesh.normals, IsEmpty());
    }
}

TEST(Stl, ErrorsAreNamed)
{
    EXPECT_THAT(errorOf("m.stl", binaryStl("cut off", 2, 1)), HasSubstr("cut off"));
    EXPECT_THAT(errorOf("m.stl", binaryStl("empty", 0, 0)), HasSubstr("no triangles"));
    EXPECT_THAT(errorOf("m.stl", "solid\n"), HasSubstr("no triangles"));
    EXPECT_THAT(errorOf("m.stl", "solid\nvertex 0 0\n"), HasSubstr("line 2"));
    EXPECT_THAT(errorOf("m.stl", "solid\nvertex 0 0 0\nendfacet\n"), HasSubstr("three vertices"));
    EXPECT_THAT(errorOf("m.stl", "solid\nvertex 0 0 0\n"), HasSubstr("inside a facet"));
    EXPECT_THAT(errorOf("m.stl", "what"), HasSubstr("neither"));
}

}  // namespace
}  // namespace insitu
