#include "reconstruct/primitive_json.h"

#include <algorithm>

namespace insitu {

std::size_t indexOfName(const JsonNode& node,
                        std::string_view name,
                        std::span<const std::string> known,
                        std::string_view what)
{
    const auto found = std::find(known.begin(), known.end(), name);
    if (found != known.end()) return static_cast<std::size_t>(found - known.begin());
    const std::vector<std::string_view> names(known.begin(), known.end());
    if (const auto meant = didYouMean(name, names))
        node.fail(fmt::format("no {} \"{}\"; did you mean \"{}\"?", what, name, *meant));
    constexpr std::size_t kListed = 30;
    std::string list;
    for (std::size_t i = 0; i < std::min(kListed, known.size()); ++i)
        list += fmt::format("{}\"{}\"", i ? ", " : "", known[i]);
    node.fail(fmt::format("no {} \"{}\"; {}{}",
                          what,
                          name,
                          known.empty() ? "there is none" : "known are " + list,
                          known.size() > kListed ? " and more" : ""));
}

const PrimitiveShape& findShape(const PrimitiveLibrary& library, const JsonNode& node)
{
    std::vector<std::string> names;
    for (const auto& [name, shape] : library)
        names.push_back(name);
    return library.at(names[indexOfName(node, node.text(), names, "shape")]);
}

std::vector<std::pair<std::size_t, JsonNode>> namedParameters(const JsonNode& node,
                                                              const PrimitiveShape& shape)
{
    std::vector<std::string_view> names;
    for (const PrimitiveParameter& parameter : shape.parameters)
        names.push_back(parameter.name);
    node.expectKeys(std::span<const std::string_view>(names));
    std::vector<std::pair<std::size_t, JsonNode>> found;
    for (std::size_t i = 0; i < names.size(); ++i)
        if (const auto value = node.find(names[i])) found.emplace_back(i, *value);
    return found;
}

double readParameterValue(const JsonNode& node, const PrimitiveParameter& parameter)
{
    const double value = node.number();
    if (value < parameter.minimum || value > parameter.maximum)
        node.fail(fmt::format(
            "is {}; must lie in {} to {}", value, parameter.minimum, parameter.maximum));
    return value;
}

}  // namespace insitu
