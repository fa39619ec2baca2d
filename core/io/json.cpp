#include "core/io/json.h"

#include "core/io/file.h"
#include "core/io/json_bytes.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <vector>

namespace insitu {

namespace {

/// 64 MiB: far above any project, and a bound for what a hostile file can make us hold.
constexpr std::int64_t kMaxJsonBytes = 64 << 20;
constexpr int kMaxDepth = 200;

/// "line:column" of a byte counted from one, as nlohmann's errors count.
std::string lineAndColumn(const std::vector<std::uint8_t>& bytes, std::size_t byte)
{
    const std::size_t end = std::min(byte == 0 ? 0 : byte - 1, bytes.size());
    std::size_t line = 1;
    std::size_t column = 1;
    for (std::size_t i = 0; i < end; ++i) {
        const bool new_line = bytes[i] == '\n';
        line += new_line ? 1 : 0;
        column = new_line ? 1 : column + 1;
    }
    return fmt::format("{}:{}", line, column);
}

/// What nlohmann says without its own prefix "[json.exception.parse_error.101] parse error at
/// line 1, column 2: ".
std::string causeOf(const std::string& what)
{
    const std::size_t bracket = what.find("] ");
    std::string cause = bracket == std::string::npos ? what : what.substr(bracket + 2);
    const std::size_t colon = cause.find(": ");
    if (cause.starts_with("parse error") && colon != std::string::npos)
        cause = cause.substr(colon + 2);
    return "not valid JSON: " + cause;
}

/// Refuses what the parser would accept silently: a key given twice, and nesting without end.
class StrictCallback {
public:
    explicit StrictCallback(std::string file) : file_(std::move(file)) {}

    bool operator()(int depth, Json::parse_event_t event, Json& parsed)
    {
        if (depth > kMaxDepth)
            throw InputError(file_, fmt::format("is nested deeper than {} levels", kMaxDepth));
        if (event == Json::parse_event_t::object_start) keys_.emplace_back();
        if (event == Json::parse_event_t::object_end) keys_.pop_back();
        if (event == Json::parse_event_t::key) {
            const std::string& key = parsed.get_ref<const std::string&>();
            if (!keys_.back().insert(key).second)
                throw InputError(file_, fmt::format("key \"{}\" is given twice", key));
        }
        return true;
    }

private:
    std::string file_;
    std::vector<std::set<std::string>> keys_;
};

const char* typeName(const Json& value)
{
    return value.type_name();
}

/// Levenshtein's distance, case ignored.
std::size_t editDistance(std::string_view a, std::string_view b)
{
    const auto lower = [](char c) {
        return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
    };
    std::vector<std::size_t> row(b.size() + 1);
    for (std::size_t j = 0; j <= b.size(); ++j)
        row[j] = j;
    for (std::size_t i = 1; i <= a.size(); ++i) {
        std::size_t diagonal = row[0];
        row[0] = i;
        for (std::size_t j = 1; j <= b.size(); ++j) {
            const std::size_t replaced = diagonal + (lower(a[i - 1]) == lower(b[j - 1]) ? 0 : 1);
            diagonal = row[j];
            row[j] = std::min({row[j] + 1, row[j - 1] + 1, replaced});
        }
    }
    return row[b.size()];
}

}  // namespace

Json readJson(const std::filesystem::path& path)
{
    return parseJson(readFile(path, kMaxJsonBytes), path.string());
}

Json parseJson(const std::vector<std::uint8_t>& bytes, const std::string& name)
{
    if (static_cast<std::int64_t>(bytes.size()) > kMaxJsonBytes)
        throw InputError(name, fmt::format("holds more than {} bytes of JSON", kMaxJsonBytes));
    try {
        return Json::parse(bytes, StrictCallback(name));
    } catch (const Json::parse_error& error) {
        throw InputError(name, lineAndColumn(bytes, error.byte), causeOf(error.what()));
    } catch (const Json::exception& error) {
        throw InputError(name, causeOf(error.what()));
    }
}

void writeJson(const std::filesystem::path& path, const Json& json)
{
    // Names of files and cameras may hold bytes that are no UTF-8: they become U+FFFD.
    writeTextFile(path, json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n");
}

void JsonNode::fail(const std::string& cause) const
{
    if (position_.empty()) throw InputError(file_, cause);
    throw InputError(file_, position_, cause);
}

void JsonNode::expectKeys(std::span<const std::string_view> allowed) const
{
    if (!value_->is_object())
        fail(fmt::format("must be an object {{…}}, not {}", typeName(*value_)));
    for (const auto& item : value_->items()) {
        if (std::find(allowed.begin(), allowed.end(), item.key()) != allowed.end()) continue;
        if (const auto meant = didYouMean(item.key(), allowed))
            fail(fmt::format("unknown key \"{}\"; did you mean \"{}\"?", item.key(), *meant));
        std::string names;
        for (const std::string_view key : allowed)
            names += fmt::format("{}\"{}\"", names.empty() ? "" : ", ", key);
        fail(fmt::format("unknown key \"{}\"; known are {}", item.key(), names));
    }
}

bool JsonNode::has(std::string_view key) const
{
    return value_->is_object() && value_->contains(key);
}

std::optional<JsonNode> JsonNode::find(std::string_view key) const
{
    if (!value_->is_object())
        fail(fmt::format("must be an object {{…}}, not {}", typeName(*value_)));
    const auto found = value_->find(key);
    if (found == value_->end()) return std::nullopt;
    const std::string position =
        fmt::format("{}{}{}", position_, position_.empty() ? "" : ".", key);
    return JsonNode(*found, file_, position);
}

JsonNode JsonNode::at(std::string_view key) const
{
    if (auto node = find(key)) return *std::move(node);
    fail(fmt::format("\"{}\" is missing", key));
}

std::size_t JsonNode::size() const
{
    if (!value_->is_array()) fail(fmt::format("must be a list […], not {}", typeName(*value_)));
    return value_->size();
}

JsonNode JsonNode::at(std::size_t index) const
{
    const std::size_t count = size();
    if (index >= count) fail(fmt::format("has {} entries; entry {} is missing", count, index));
    return JsonNode((*value_)[index], file_, fmt::format("{}[{}]", position_, index));
}

double JsonNode::number() const
{
    if (!value_->is_number()) fail(fmt::format("must be a number, not {}", typeName(*value_)));
    const double number = value_->get<double>();
    if (!std::isfinite(number)) fail("must be a finite number");
    return number;
}

double JsonNode::positive() const
{
    const double value = number();
    if (value <= 0.0) fail(fmt::format("must be above 0, not {}", value));
    return value;
}

int JsonNode::integer() const
{
    const double value = number();
    const bool fits = value >= std::numeric_limits<int>::min() &&
                      value <= std::numeric_limits<int>::max() && value == std::floor(value);
    if (!fits) fail(fmt::format("must be a whole number, not {}", value));
    return static_cast<int>(value);
}

bool JsonNode::boolean() const
{
    if (!value_->is_boolean())
        fail(fmt::format("must be true or false, not {}", typeName(*value_)));
    return value_->get<bool>();
}

std::string JsonNode::text() const
{
    if (!value_->is_string()) fail(fmt::format("must be a text, not {}", typeName(*value_)));
    return value_->get<std::string>();
}

glm::dvec2 JsonNode::vec2() const
{
    if (size() != 2) fail(fmt::format("must have 2 numbers, not {}", size()));
    return {at(std::size_t{0}).number(), at(std::size_t{1}).number()};
}

glm::dvec3 JsonNode::vec3() const
{
    if (size() != 3) fail(fmt::format("must have 3 numbers, not {}", size()));
    return {at(std::size_t{0}).number(), at(std::size_t{1}).number(), at(std::size_t{2}).number()};
}

std::optional<std::string> didYouMean(std::string_view word,
                                      std::span<const std::string_view> candidates)
{
    std::optional<std::string> best;
    std::size_t best_distance = std::max<std::size_t>(word.size() / 3, 2) + 1;
    for (const std::string_view candidate : candidates) {
        const std::size_t distance = editDistance(word, candidate);
        // Two letters away is another word when there are but three.
        if (distance >= best_distance || distance >= candidate.size()) continue;
        best_distance = distance;
        best = std::string(candidate);
    }
    return best;
}

Json toJson(glm::dvec2 v)
{
    return Json::array({v.x, v.y});
}

Json toJson(glm::dvec3 v)
{
    return Json::array({v.x, v.y, v.z});
}

Json toJson(const Findings& findings)
{
    Json list = Json::array();
    for (const Finding& finding : findings)
        list.push_back({{"severity", severityName(finding.severity)},
                        {"code", finding.code},
                        {"message", finding.message}});
    return list;
}

Json toJson(const ResponseCurve& curve)
{
    Json json;
    json["source"] = curve.source;
    json["exposure"] = curve.exposure;
    return json;
}

ResponseCurve responseFromJson(const JsonNode& node)
{
    node.expectKeys({"source", "exposure"});
    ResponseCurve curve;
    if (const auto source = node.find("source")) curve.source = source->text();
    const JsonNode channels = node.at("exposure");
    if (channels.size() != curve.exposure.size()) channels.fail("must have 3 lists: R, G, B");
    for (std::size_t c = 0; c < curve.exposure.size(); ++c) {
        auto& table = curve.exposure[c];
        const JsonNode list = channels.at(c);
        if (list.size() != table.size())
            list.fail(fmt::format("must have {} numbers, not {}", table.size(), list.size()));
        for (std::size_t z = 0; z < table.size(); ++z) {
            table[z] = list.at(z).number();
            if (table[z] < 0.0) list.at(z).fail("an exposure is not negative");
            if (z > 0 && table[z] <= table[z - 1])
                list.at(z).fail(fmt::format(
                    "{} is not above the entry before, {}; the exposures must strictly increase",
                    table[z],
                    table[z - 1]));
        }
    }
    return curve;
}

}  // namespace insitu
