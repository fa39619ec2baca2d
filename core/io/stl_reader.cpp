#include "core/io/stl_reader.h"

#include "core/check.h"
#include "core/io/byte_view.h"
#include "core/io/file.h"
#include "core/io/model_resources.h"
#include "core/io/obj_parser.h"

#include <bit>
#include <string_view>

namespace insitu {

namespace {

// Layout of a binary file: 80 bytes of anything, the number of triangles, then for each a normal,
// three corners (floats, little-endian) and two more bytes.
constexpr std::size_t kHeaderBytes = 84;
constexpr std::size_t kTriangleBytes = 50;

void readBinary(const ByteView& view, std::vector<glm::vec3>& corners)
{
    const std::size_t triangles = view.u32(80);
    checkElementCount(3 * triangles, view.path());
    for (std::size_t t = 0; t < triangles; ++t) {
        std::size_t at = kHeaderBytes + t * kTriangleBytes + 12;
        for (int corner = 0; corner < 3; ++corner) {
            glm::vec3 position;
            for (int c = 0; c < 3; ++c, at += 4)
                position[c] = std::bit_cast<float>(view.u32(at));
            corners.push_back(position);
        }
    }
}

void readText(std::string_view text, const std::string& path, std::vector<glm::vec3>& corners)
{
    ObjLines lines(text);
    const auto fail = [&](const char* cause) {
        throw InputError(path, fmt::format("line {}", lines.number()), cause);
    };
    std::size_t begin = 0;
    while (lines.next()) {
        const auto& words = lines.words();
        if (words[0] == "vertex") {
            if (words.size() < 4) fail("a vertex needs three numbers");
            glm::vec3 position;
            for (int c = 0; c < 3; ++c)
                position[c] =
                    objNumber(words[static_cast<std::size_t>(c) + 1], path, lines.number());
            corners.push_back(position);
            checkElementCount(corners.size(), path);
        } else if (words[0] == "endfacet") {
            if (corners.size() - begin != 3) fail("the facet has not three vertices");
            begin = corners.size();
        }
    }
    if (corners.size() != begin) fail("the file ends inside a facet");
}

}  // namespace

Model readStl(const std::filesystem::path& path)
{
    const std::string name = path.string();
    const std::vector<std::uint8_t> bytes = readFile(path, kMaxModelBytes);
    const ByteView view(bytes, name, ByteOrder::Little);
    Model model;
    auto& corners = model.mesh.positions;
    // A binary file may begin with "solid", too, so its size decides.
    if (bytes.size() >= kHeaderBytes &&
        (bytes.size() - kHeaderBytes) / kTriangleBytes == view.u32(80))
        readBinary(view, corners);
    else if (view.startsWith("solid"))
        readText({reinterpret_cast<const char*>(bytes.data()), bytes.size()}, name, corners);
    else
        throw InputError(name, "is neither a binary nor a text STL, or is cut off");
    for (std::uint32_t i = 0; i + 2 < corners.size(); i += 3)
        model.mesh.triangles.emplace_back(i, i + 1, i + 2);
    model.mesh.material_of.assign(model.mesh.triangles.size(), 0);
    model.materials.emplace_back().double_sided = true;
    return model;
}

}  // namespace insitu
