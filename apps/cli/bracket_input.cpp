#include "apps/cli/bracket_input.h"

#include "core/io/json.h"

#include <charconv>
#include <cmath>
#include <map>
#include <optional>
#include <string_view>

namespace insitu::cli {

namespace {

std::optional<double> numberFromText(std::string_view text)
{
    double value = 0.0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error != std::errc() || end != text.data() + text.size()) return std::nullopt;
    return value;
}

std::vector<Exposure> exposuresFromText(const BracketArguments& arguments)
{
    if (arguments.exposures.empty()) return {};
    if (arguments.exposures.size() != arguments.images.size())
        throw InputError("--exposures",
                         fmt::format("{} exposure times for {} images; give one for each, in the "
                                     "same order",
                                     arguments.exposures.size(),
                                     arguments.images.size()));
    std::vector<Exposure> exposures;
    for (const std::string& text : arguments.exposures) {
        Exposure exposure;
        exposure.seconds = secondsFromText(text);
        exposures.push_back(exposure);
    }
    return exposures;
}

}  // namespace

double secondsFromText(const std::string& text)
{
    const std::size_t slash = text.find('/');
    const std::string_view all(text);
    const std::optional<double> above = numberFromText(all.substr(0, slash));
    const std::optional<double> below =
        slash == std::string::npos ? 1.0 : numberFromText(all.substr(slash + 1));
    if (above && below && *above > 0.0 && *below > 0.0 && std::isfinite(*above / *below))
        return *above / *below;
    throw InputError("--exposures",
                     fmt::format("'{}' is not an exposure time; write 1/60 or 0.5", text));
}

void addBracketOptions(CLI::App& command, BracketArguments& arguments)
{
    command
        .add_option(
            "images", arguments.images, "Exposures of one view (.jpg, .png, .tif, or all RAW)")
        ->required();
    command
        .add_option("--exposures",
                    arguments.exposures,
                    "Exposure times in seconds, one an image, such as 1/60,1/15 (default: EXIF)")
        ->delimiter(',');
    command.add_option(
        "--response", arguments.response, "Saved response curve (.json; default: recovered)");
    command.add_flag("--align",
                     arguments.capture.align,
                     "Lay the frames onto each other: for brackets held in the hand");
    command.add_flag("--deghost",
                     arguments.capture.deghost,
                     "Leave out what moved between the exposures (experimental: masks too much "
                     "where the response is uncertain)");
    command
        .add_option("--method",
                    arguments.capture.response.method,
                    "How the response is recovered: auto, debevec, mitsunaga, robertson or basis")
        ->transform(CLI::CheckedTransformer(
            std::map<std::string, ResponseMethod>{{"auto", ResponseMethod::Auto},
                                                  {"debevec", ResponseMethod::Debevec},
                                                  {"mitsunaga", ResponseMethod::Mitsunaga},
                                                  {"robertson", ResponseMethod::Robertson},
                                                  {"basis", ResponseMethod::Basis}},
            CLI::ignore_case));
    command.add_flag("!--no-refine-exposures",
                     arguments.capture.response.refine_exposures,
                     "Take the exposures as given, even where the pictures show other ratios");
    command
        .add_option("--samples",
                    arguments.capture.response.samples,
                    "Places of the picture used to recover the response")
        ->check(CLI::Range(50, 100'000))
        ->capture_default_str();
    command
        .add_option("--smoothness",
                    arguments.capture.response.smoothness,
                    "Weight of the penalty on bends of the recovered response")
        ->check(CLI::PositiveNumber)
        ->capture_default_str();
    command
        .add_option("--clip",
                    arguments.capture.merge.clip_fraction,
                    "Codes above this fraction of full scale count as overexposed")
        ->check(CLI::Range(0.501, 1.0))
        ->capture_default_str();
    command
        .add_option("--black",
                    arguments.capture.merge.black_fraction,
                    "Codes below this fraction of full scale count as black")
        ->check(CLI::Range(0.0, 0.499))
        ->capture_default_str();
}

CapturedRadiance mergeArguments(const BracketArguments& arguments,
                                Context& context,
                                FrameSizes sizes)
{
    Bracket bracket = readBracket(arguments.images, exposuresFromText(arguments), sizes);
    context.print(bracket.findings);
    std::optional<ResponseCurve> response;
    if (!arguments.response.empty()) {
        const Json json = readJson(arguments.response);
        response = responseFromJson(JsonNode(json, arguments.response.string()));
    }
    CapturedRadiance result = captureRadiance(std::move(bracket), response, arguments.capture);
    context.print(result.findings);
    return result;
}

}  // namespace insitu::cli
