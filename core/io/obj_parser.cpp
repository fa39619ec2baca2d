#include "core/io/obj_parser.h"

#include "core/check.h"
#include "core/io/model_resources.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <utility>

namespace insitu {

namespace {

constexpr std::string_view kBlanks = " \t\r\f\v";

std::string_view trimmed(std::string_view text)
{
    const std::size_t first = text.find_first_not_of(kBlanks);
    if (first == std::string_view::npos) return {};
    return text.substr(first, text.find_last_not_of(kBlanks) - first + 1);
}

std::string lineName(std::size_t line)
{
    return fmt::format("line {}", line);
}

class ObjParser {
public:
    ObjParser(std::string_view text, const std::string& path) : lines_(text), path_(path)
    {
        file_.material_names.emplace_back();
        material_of_name_[""] = 0;
    }

    ObjFile parse()
    {
        while (lines_.next()) {
            parseLine();
            checkElementCount(std::max({file_.positions.size(),
                                        file_.texcoords.size(),
                                        file_.normals.size(),
                                        file_.corners.size()}),
                              path_);
        }
        checkRanges();
        return std::move(file_);
    }

private:
    using Words = std::vector<std::string_view>;

    [[noreturn]] void fail(const std::string& cause) const
    {
        throw InputError(path_, lineName(lines_.number()), cause);
    }

    void parseLine()
    {
        const Words& words = lines_.words();
        const std::string_view keyword = words[0];
        if (keyword == "v") {
            file_.positions.push_back(vec3(words));
            file_.has_vertex_colors |= words.size() >= 7;
        } else if (keyword == "vt") {
            if (words.size() < 2) fail("a texture coordinate needs a number");
            file_.texcoords.emplace_back(number(words[1]), words.size() > 2 ? number(words[2]) : 0);
        } else if (keyword == "vn") {
            file_.normals.push_back(vec3(words));
        } else if (keyword == "f" || keyword == "fo") {
            parseFace(words);
        } else if (keyword == "s") {
            parseSmoothing(words);
        } else if (keyword == "o") {
            ++object_;
        } else if (keyword == "usemtl") {
            useMaterial(std::string(lines_.argument()));
        } else if (keyword == "mtllib") {
            file_.material_libraries.emplace_back(lines_.argument());
        } else if (keyword != "g") {
            noteIgnored(std::string(keyword));
        }
    }

    glm::vec3 vec3(const Words& words) const
    {
        if (words.size() < 4) fail(fmt::format("'{}' needs three numbers", words[0]));
        return {number(words[1]), number(words[2]), number(words[3])};
    }

    float number(std::string_view word) const { return objNumber(word, path_, lines_.number()); }

    void parseFace(const Words& words)
    {
        if (words.size() < 4) {
            ++file_.faces_with_too_few_corners;
            return;
        }
        ObjFace face;
        face.first_corner = file_.corners.size();
        face.corner_count = words.size() - 1;
        face.smoothing = smoothing_ == 0 ? 0 : groupOf(object_, smoothing_);
        face.material = material_;
        face.line = lines_.number();
        for (std::size_t i = 1; i < words.size(); ++i)
            file_.corners.push_back(corner(words[i]));
        file_.faces.push_back(face);
    }

    // "p", "p/t", "p//n" or "p/t/n".
    ObjCorner corner(std::string_view word) const
    {
        std::array<std::int64_t, 3> indices = {kObjAbsent, kObjAbsent, kObjAbsent};
        const std::array<std::size_t, 3> counts = {
            file_.positions.size(), file_.texcoords.size(), file_.normals.size()};
        std::string_view rest = word;
        for (std::size_t i = 0; i < 3; ++i) {
            const std::size_t slash = rest.find('/');
            const std::string_view part = rest.substr(0, slash);
            if (!part.empty()) indices[i] = index(part, counts[i]);
            if (slash == std::string_view::npos) break;
            rest.remove_prefix(slash + 1);
            if (i == 2) fail(fmt::format("'{}' is no corner of a face", word));
        }
        if (indices[0] == kObjAbsent) fail(fmt::format("'{}' names no vertex", word));
        return {indices[0], indices[1], indices[2]};
    }

    std::int64_t index(std::string_view word, std::size_t count) const
    {
        std::int64_t value = 0;
        const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
        if (error != std::errc{} || end != word.data() + word.size() || value == 0)
            fail(fmt::format("'{}' is no index (they count from 1)", word));
        if (value > 0) return value - 1;
        if (value < -static_cast<std::int64_t>(count))
            fail(fmt::format("index {} reaches before the first of {} elements", value, count));
        return static_cast<std::int64_t>(count) + value;
    }

    void parseSmoothing(const Words& words)
    {
        if (words.size() < 2) fail("'s' needs a group number or 'off'");
        smoothing_ = 0;
        if (words[1] == "off" || words[1] == "null") return;
        if (words[1] == "on") {
            smoothing_ = 1;
            return;
        }
        const char* end = words[1].data() + words[1].size();
        if (std::from_chars(words[1].data(), end, smoothing_).ec != std::errc{} || smoothing_ < 0)
            fail(fmt::format("'{}' is no smoothing group", words[1]));
    }

    std::int32_t groupOf(std::size_t object, std::int64_t smoothing)
    {
        const auto next = static_cast<std::int32_t>(groups_.size() + 1);
        return groups_.try_emplace({object, smoothing}, next).first->second;
    }

    void useMaterial(const std::string& name)
    {
        const auto next = static_cast<std::uint32_t>(file_.material_names.size());
        const auto [entry, is_new] = material_of_name_.try_emplace(name, next);
        if (is_new) file_.material_names.push_back(name);
        material_ = entry->second;
    }

    void noteIgnored(const std::string& keyword)
    {
        constexpr std::size_t kNoted = 8;  // enough for a message; a hostile file has millions
        auto& ignored = file_.ignored_statements;
        if (ignored.size() < kNoted &&
            std::find(ignored.begin(), ignored.end(), keyword) == ignored.end())
            ignored.push_back(keyword.substr(0, 32));
    }

    // At the end, since a face may stand before its vertices.
    void checkRanges() const
    {
        const auto check =
            [&](std::int64_t index, std::size_t count, const char* what, const ObjFace& face) {
                if (index >= static_cast<std::int64_t>(count))
                    throw InputError(
                        path_,
                        lineName(face.line),
                        fmt::format("the face names {} {} of {}", what, index + 1, count));
            };
        for (const ObjFace& face : file_.faces)
            for (const ObjCorner& corner :
                 std::span(file_.corners).subspan(face.first_corner, face.corner_count)) {
                check(corner.position, file_.positions.size(), "vertex", face);
                check(corner.texcoord, file_.texcoords.size(), "texture coordinate", face);
                check(corner.normal, file_.normals.size(), "normal", face);
            }
    }

    ObjLines lines_;
    const std::string& path_;
    ObjFile file_;
    std::size_t object_ = 0;
    std::int64_t smoothing_ = 0;
    std::uint32_t material_ = 0;
    std::map<std::pair<std::size_t, std::int64_t>, std::int32_t> groups_;
    std::map<std::string, std::uint32_t> material_of_name_;
};

}  // namespace

std::string_view ObjLines::takeLine()
{
    const std::size_t end = rest_.find('\n');
    const std::string_view line = rest_.substr(0, end);
    rest_.remove_prefix(end == std::string_view::npos ? rest_.size() : end + 1);
    ++lines_taken_;
    return trimmed(line);
}

bool ObjLines::next()
{
    while (!rest_.empty()) {
        number_ = lines_taken_ + 1;
        line_ = takeLine();
        if (!line_.empty() && line_.back() == '\\' && line_.front() != '#') {
            joined_ = line_;
            while (!joined_.empty() && joined_.back() == '\\' && !rest_.empty()) {
                joined_.back() = ' ';
                joined_ += takeLine();
            }
            if (!joined_.empty() && joined_.back() == '\\') joined_.back() = ' ';
            line_ = trimmed(joined_);
        }
        words_.clear();
        for (std::string_view rest = line_; !rest.empty() && rest.front() != '#';) {
            const std::size_t end = std::min(rest.find_first_of(kBlanks), rest.size());
            words_.push_back(rest.substr(0, end));
            rest = trimmed(rest.substr(end));
        }
        if (!words_.empty()) return true;
    }
    return false;
}

std::string_view ObjLines::argument() const
{
    return trimmed(line_.substr(words_[0].size()));
}

float objNumber(std::string_view word, const std::string& path, std::size_t line)
{
    const std::string_view digits = word.size() > 1 && word.front() == '+' ? word.substr(1) : word;
    double value = 0.0;
    const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
    if (error != std::errc{} || end != digits.data() + digits.size())
        throw InputError(path, lineName(line), fmt::format("'{}' is no number", word));
    if (std::isfinite(value) && std::abs(value) > std::numeric_limits<float>::max())
        throw InputError(path, lineName(line), fmt::format("'{}' is too large", word));
    return static_cast<float>(value);
}

ObjFile parseObj(std::string_view text, const std::string& path)
{
    return ObjParser(text, path).parse();
}

}  // namespace insitu
