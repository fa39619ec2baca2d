#pragma once

#include <glm/glm.hpp>

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace insitu {

/// A Wavefront OBJ file as it stands: no triangulation, no joining, no normals invented.

inline constexpr std::int64_t kObjAbsent = -1;

/// Indices from 0; kObjAbsent where the face did not give one. In range.
struct ObjCorner {
    std::int64_t position = 0;
    std::int64_t texcoord = kObjAbsent;
    std::int64_t normal = kObjAbsent;
};

struct ObjFace {
    std::size_t first_corner = 0;
    std::size_t corner_count = 0;  ///< >= 3
    std::int32_t smoothing = 0;    ///< 0 = flat; distinct for each (object, `s` number)
    std::uint32_t material = 0;    ///< index into material_names
    std::size_t line = 0;          ///< from 1
};

struct ObjFile {
    std::vector<glm::vec3> positions;
    std::vector<glm::vec2> texcoords;  ///< (0, 0) bottom left, as in the file
    std::vector<glm::vec3> normals;
    std::vector<ObjCorner> corners;
    std::vector<ObjFace> faces;
    std::vector<std::string> material_names;  ///< "" first: faces before any `usemtl`
    std::vector<std::string> material_libraries;
    /// What was there and is not used: "l" (lines), "curv" ..., each once.
    std::vector<std::string> ignored_statements;
    std::size_t faces_with_too_few_corners = 0;
    bool has_vertex_colors = false;
};

/// Parses the text. `s n` and `o` set the smoothing group: a group never reaches over objects, and
/// before any `s` (or after `s off`, `s 0`) faces are flat. Negative indices count from the last
/// element read so far. InputError names `path`, the line and the cause.
[[nodiscard]] ObjFile parseObj(std::string_view text, const std::string& path);

/// One line of a text in OBJ syntax, cut into words: comments and line continuations are resolved.
class ObjLines {
public:
    explicit ObjLines(std::string_view text) : rest_(text)
    {
        constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";
        if (rest_.starts_with(kByteOrderMark)) rest_.remove_prefix(kByteOrderMark.size());
    }

    /// Goes to the next line that holds a word; false at the end.
    [[nodiscard]] bool next();
    [[nodiscard]] std::size_t number() const { return number_; }  ///< from 1
    [[nodiscard]] const std::vector<std::string_view>& words() const { return words_; }
    /// All that follows the first word, trimmed: file and material names may hold blanks.
    [[nodiscard]] std::string_view argument() const;

private:
    [[nodiscard]] std::string_view takeLine();

    std::string_view rest_;
    std::string_view line_;
    std::string joined_;
    std::size_t number_ = 0;
    std::size_t lines_taken_ = 0;
    std::vector<std::string_view> words_;
};

/// A number in OBJ/MTL syntax, whatever the locale; InputError when it is none or is too large.
[[nodiscard]] float objNumber(std::string_view word, const std::string& path, std::size_t line);

}  // namespace insitu
