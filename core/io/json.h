#pragma once

#include "core/finding.h"
#include "core/response_curve.h"

#include <glm/glm.hpp>
#include <nlohmann/json.hpp>

#include <filesystem>
#include <initializer_list>
#include <optional>
#include <span>
#include <string>
#include <string_view>

namespace insitu {

/// Strict JSON reading with positions. Included only by .cpp files, to keep build times down.

using Json = nlohmann::ordered_json;

/// Parses a file; a syntax error is an InputError with line and column.
[[nodiscard]] Json readJson(const std::filesystem::path& path);
/// Two-space indented, newline at the end, written atomically.
void writeJson(const std::filesystem::path& path, const Json& json);

/// One value of a JSON document that knows where it stands ("room[2].min_m"), so that every
/// complaint names file, position, cause and remedy. All getters throw InputError.
class JsonNode {
public:
    JsonNode(const Json& value, std::string file, std::string position = "")
        : value_(&value), file_(std::move(file)), position_(std::move(position))
    {
    }

    [[nodiscard]] const Json& value() const { return *value_; }
    [[nodiscard]] const std::string& file() const { return file_; }
    [[nodiscard]] const std::string& position() const { return position_; }

    /// This must be an object with no other keys than these; else an error with "did you mean".
    void expectKeys(std::span<const std::string_view> allowed) const;
    void expectKeys(std::initializer_list<std::string_view> allowed) const
    {
        expectKeys(std::span(allowed.begin(), allowed.size()));
    }
    [[nodiscard]] bool has(std::string_view key) const;
    [[nodiscard]] JsonNode at(std::string_view key) const;  ///< error when missing
    [[nodiscard]] std::optional<JsonNode> find(std::string_view key) const;
    [[nodiscard]] std::size_t size() const;              ///< this must be an array
    [[nodiscard]] JsonNode at(std::size_t index) const;  ///< error when out of range

    [[nodiscard]] double number() const;  ///< finite
    [[nodiscard]] double positive() const;
    [[nodiscard]] int integer() const;
    [[nodiscard]] bool boolean() const;
    [[nodiscard]] std::string text() const;
    [[nodiscard]] glm::dvec2 vec2() const;
    [[nodiscard]] glm::dvec3 vec3() const;

    [[noreturn]] void fail(const std::string& cause) const;

private:
    const Json* value_;
    std::string file_;
    std::string position_;
};

/// The nearest of `candidates` to `word` by edit distance, when near enough to be meant.
[[nodiscard]] std::optional<std::string> didYouMean(std::string_view word,
                                                    std::span<const std::string_view> candidates);
[[nodiscard]] inline std::optional<std::string> didYouMean(
    std::string_view word, std::initializer_list<std::string_view> candidates)
{
    return didYouMean(word, std::span(candidates.begin(), candidates.size()));
}

/// A list of the components.
[[nodiscard]] Json toJson(glm::dvec2 v);
[[nodiscard]] Json toJson(glm::dvec3 v);
[[nodiscard]] Json toJson(const ResponseCurve& curve);
/// A list of {"severity", "code", "message"}.
[[nodiscard]] Json toJson(const Findings& findings);
[[nodiscard]] ResponseCurve responseFromJson(const JsonNode& node);

}  // namespace insitu
