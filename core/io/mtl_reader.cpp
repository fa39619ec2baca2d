#include "core/io/mtl_reader.h"

#include "core/io/file.h"
#include "core/io/model_resources.h"
#include "core/io/obj_parser.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <string_view>

namespace insitu {

namespace {

using Words = std::vector<std::string_view>;

/// The statements that interact, kept until the material is complete.
struct Draft {
    MtlMaterial result;
    std::optional<glm::vec3> specular;
    std::optional<float> shininess;
    std::optional<float> roughness;
    std::optional<float> opacity;       ///< d
    std::optional<float> transparency;  ///< Tr; some exporters write both, at odds: d wins
    float illumination_model = 2.0f;
};

void finish(Draft& draft, std::map<std::string, MtlMaterial>& materials)
{
    Material& material = draft.result.material;
    if (material.name.empty()) return;
    const bool highlight = draft.illumination_model >= 2.0f && draft.specular;
    const glm::vec3 ks = highlight ? *draft.specular : glm::vec3(0.0f);
    material.specular = std::clamp((ks.r + ks.g + ks.b) / 3.0f / 0.5f, 0.0f, 1.0f);
    const float exponent = std::clamp(draft.shininess.value_or(0.0f), 0.0f, 1000.0f);
    material.roughness =
        std::clamp(draft.roughness.value_or(1.0f - std::sqrt(exponent / 1000.0f)), 0.0f, 1.0f);
    const float alpha = draft.opacity.value_or(1.0f - draft.transparency.value_or(0.0f));
    material.alpha = std::clamp(alpha, 0.0f, 1.0f);
    material.alpha_mask = material.alpha < 1.0f;
    materials.insert_or_assign(material.name, draft.result);
}

int optionArguments(std::string_view option)
{
    struct Option {
        std::string_view name;
        int arguments;
    };
    // Up to three numbers after -o, -s, -t; -1 stands for "as many as are numbers".
    static constexpr std::array<Option, 13> kOptions = {{{"-blendu", 1},
                                                         {"-blendv", 1},
                                                         {"-boost", 1},
                                                         {"-cc", 1},
                                                         {"-mm", 2},
                                                         {"-o", -1},
                                                         {"-s", -1},
                                                         {"-t", -1},
                                                         {"-texres", 1},
                                                         {"-clamp", 1},
                                                         {"-bm", 1},
                                                         {"-imfchan", 1},
                                                         {"-type", 1}}};
    for (const Option& known : kOptions)
        if (known.name == option) return known.arguments;
    return 0;
}

bool looksNumeric(std::string_view word)
{
    return word.find_first_not_of("+-.0123456789eE") == std::string_view::npos;
}

void note(MtlMaterial& material, std::string_view what)
{
    if (material.ignored.size() > 200) return;
    if (!material.ignored.empty()) material.ignored += ", ";
    material.ignored += what.substr(0, 32);
}

// "map_Kd [-option value...] file name": the name may hold blanks.
void parseMap(const ObjLines& lines, MtlMaterial& material)
{
    const Words& words = lines.words();
    std::size_t at = 1;
    while (at < words.size() && words[at].size() > 1 && words[at][0] == '-') {
        const std::string_view option = words[at];
        const int arguments = optionArguments(option);
        if (option == "-clamp")
            material.clamp = at + 1 < words.size() && words[at + 1] == "on";
        else
            note(material, option);
        ++at;
        for (int i = 0; at < words.size() && (arguments < 0 ? i < 3 : i < arguments); ++i, ++at)
            if (arguments < 0 && !looksNumeric(words[at])) break;
    }
    if (at >= words.size()) return;
    const std::string_view argument = lines.argument();
    material.diffuse_map =
        argument.substr(static_cast<std::size_t>(words[at].data() - argument.data()));
}

class MtlParser {
public:
    MtlParser(std::string_view text, std::string path) : lines_(text), path_(std::move(path)) {}

    std::map<std::string, MtlMaterial> parse()
    {
        while (lines_.next())
            parseLine();
        finish(draft_, materials_);
        return std::move(materials_);
    }

private:
    void parseLine()
    {
        const std::string_view keyword = lines_.words()[0];
        Material& material = draft_.result.material;
        if (keyword == "newmtl") {
            finish(draft_, materials_);
            draft_ = Draft{};
            draft_.result.material.name = lines_.argument();
            draft_.result.material.double_sided = true;
        } else if (keyword == "Kd") {
            material.base_color = glm::clamp(color(), 0.0f, 1.0f);
        } else if (keyword == "Ks") {
            draft_.specular = color();
        } else if (keyword == "Ke") {
            material.emissive = glm::max(color(), 0.0f);
        } else if (keyword == "Ns") {
            draft_.shininess = number(1);
        } else if (keyword == "Pr") {
            draft_.roughness = number(1);
        } else if (keyword == "Pm") {
            material.metallic = std::clamp(number(1), 0.0f, 1.0f);
        } else if (keyword == "illum") {
            draft_.illumination_model = number(1);
        } else if (keyword == "d") {
            const bool halo = lines_.words().size() > 2 && lines_.words()[1] == "-halo";
            draft_.opacity = number(halo ? 2 : 1);
        } else if (keyword == "Tr") {
            draft_.transparency = number(1);
        } else if (keyword == "map_Kd") {
            parseMap(lines_, draft_.result);
        } else if (keyword.starts_with("map_") || keyword == "bump" || keyword == "norm" ||
                   keyword == "disp" || keyword == "decal" || keyword == "refl") {
            note(draft_.result, keyword);
        }
    }

    float number(std::size_t at) const
    {
        const Words& words = lines_.words();
        const std::string line = fmt::format("line {}", lines_.number());
        if (words.size() <= at)
            throw InputError(path_, line, fmt::format("'{}' needs a number", words[0]));
        const float value = objNumber(words[at], path_, lines_.number());
        if (!std::isfinite(value))
            throw InputError(path_, line, fmt::format("'{}' is not finite", words[0]));
        return value;
    }

    // "r g b" or "r" alone; spectral curves and CIE XYZ are not used by anyone we know of.
    glm::vec3 color() const
    {
        const Words& words = lines_.words();
        if (words.size() > 1 && (words[1] == "spectral" || words[1] == "xyz"))
            throw InputError(
                path_,
                fmt::format("line {}", lines_.number()),
                fmt::format("a colour given as '{}' is not supported; give r g b", words[1]));
        if (words.size() < 4) return glm::vec3(number(1));
        return {number(1), number(2), number(3)};
    }

    ObjLines lines_;
    std::string path_;
    Draft draft_;
    std::map<std::string, MtlMaterial> materials_;
};

}  // namespace

std::map<std::string, MtlMaterial> readMtl(const std::filesystem::path& path)
{
    const std::vector<std::uint8_t> bytes = readFile(path, kMaxModelBytes);
    return MtlParser({reinterpret_cast<const char*>(bytes.data()), bytes.size()}, path.string())
        .parse();
}

}  // namespace insitu
