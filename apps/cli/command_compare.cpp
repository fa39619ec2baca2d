#include "apps/cli/command.h"
#include "core/io/image_io.h"
#include "core/io/json.h"
#include "evaluate/error_metrics.h"

#include <iostream>

namespace insitu::cli {

namespace {

namespace fs = std::filesystem;

struct CompareArguments {
    fs::path reference;
    fs::path picture;
    fs::path mask;
    fs::path json;
};

/// One image as given: radiance, or codes with what they decode to.
struct Comparable {
    Image<Rgb> linear;
    std::optional<EncodedImage> encoded;
};

Comparable readComparable(const fs::path& path)
{
    if (isRadianceFile(path)) return {readRadiance(path).pixels, std::nullopt};
    EncodedImage encoded = readPhoto(path).image;
    Image<Rgb> linear = decodeSrgb(encoded);
    return {std::move(linear), std::move(encoded)};
}

void requireSize(const fs::path& path, int width, int height, const Image<Rgb>& reference)
{
    if (width == reference.width() && height == reference.height()) return;
    throw InputError(path.string(),
                     fmt::format("is {}x{}, the reference is {}x{}; sizes must be the same",
                                 width,
                                 height,
                                 reference.width(),
                                 reference.height()));
}

/// A pixel counts when its green code is above half.
PixelMask readMask(const fs::path& path, const Image<Rgb>& reference)
{
    if (path.empty()) return {};
    const EncodedImage image = readPhoto(path).image;
    requireSize(path, image.codes.width(), image.codes.height(), reference);
    PixelMask mask(image.codes.width(), image.codes.height());
    for (std::size_t i = 0; i < mask.pixelCount(); ++i)
        mask.pixels()[i] = 2 * image.codes.pixels()[i].g > image.max_code ? 1 : 0;
    return mask;
}

Findings judge(const ErrorMetrics& metrics)
{
    Findings findings;
    if (metrics.black_pixels > 0)
        findings.push_back({Severity::Info,
                            "compare-black-reference",
                            fmt::format("{} of {} pixels are black in the reference and left out "
                                        "of RMS % and mean %",
                                        metrics.black_pixels,
                                        metrics.pixels)});
    return findings;
}

Json toJson(const ErrorMetrics& metrics, const std::optional<CodeDifference>& codes)
{
    const auto channels = [](const glm::dvec3& v) { return Json::array({v.x, v.y, v.z}); };
    Json json = {{"pixels", metrics.pixels},
                 {"nrmse", metrics.nrmse},
                 {"nrmse_channels", channels(metrics.nrmse_channels)},
                 {"rms_percent", metrics.rms_percent},
                 {"mean_percent", metrics.mean_percent},
                 {"rmse_channels", channels(metrics.rmse)},
                 {"range_channels", channels(metrics.range)},
                 {"max_difference", metrics.max_difference},
                 {"black_pixels", metrics.black_pixels}};
    if (codes) {
        json["differing_pixels"] = codes->differing_pixels;
        json["max_codes"] = codes->max_codes;
    }
    return json;
}

void printMetrics(const ErrorMetrics& metrics, const std::optional<CodeDifference>& codes)
{
    std::cout << fmt::format("pixels        {}\n", metrics.pixels)
              << fmt::format("NRMSE         {:.6g}\n", metrics.nrmse)
              << fmt::format("RMS %         {:.6g}\n", metrics.rms_percent)
              << fmt::format("mean %        {:.6g}\n", metrics.mean_percent)
              << fmt::format("max difference {:.6g}\n", metrics.max_difference);
    if (codes)
        std::cout << fmt::format("differing     {} pixels, at most by {} codes\n",
                                 codes->differing_pixels,
                                 codes->max_codes);
}

void runCompare(const CompareArguments& arguments, Context& context)
{
    context.start();
    if (!arguments.json.empty()) context.checkOutput(arguments.json);
    const Comparable reference = readComparable(arguments.reference);
    const Comparable picture = readComparable(arguments.picture);
    requireSize(
        arguments.picture, picture.linear.width(), picture.linear.height(), reference.linear);
    if (reference.encoded.has_value() != picture.encoded.has_value())
        throw InputError(arguments.picture.string(),
                         "a radiance image and an encoded picture have no common unit; tonemap "
                         "the one or linearise the other first");
    const PixelMask mask = readMask(arguments.mask, reference.linear);
    const auto metrics = compareImages(reference.linear, picture.linear, mask);
    if (!metrics)
        throw NoAnswerError(arguments.mask.string(), "the mask is black: no pixel to compare");
    std::optional<CodeDifference> codes;
    if (reference.encoded && reference.encoded->max_code == picture.encoded->max_code)
        codes = compareCodes(*reference.encoded, *picture.encoded, mask);
    context.print(judge(*metrics));
    printMetrics(*metrics, codes);
    if (!arguments.json.empty()) writeJson(arguments.json, toJson(*metrics, codes));
}

}  // namespace

void registerCompare(CLI::App& app, Context& context)
{
    auto arguments = std::make_shared<CompareArguments>();
    CLI::App* command =
        app.add_subcommand("compare", "Errors of a picture against a reference, as numbers");
    command->add_option("reference", arguments->reference, "What it should look like")->required();
    command->add_option("picture", arguments->picture, "What it does look like")->required();
    command->add_option("--mask", arguments->mask, "Compare only where this picture is bright");
    command->add_option("--json", arguments->json, "Write the numbers to this file");
    context.addCommonOptions(*command);
    command->footer(
        "Both are radiance images (.exr, .hdr, .pfm), or both encoded pictures (.png, .jpg, "
        ".tif),\n"
        "which are decoded from sRGB first.\n"
        "Examples:\n"
        "  insitu compare truth.png final.png\n"
        "  insitu compare truth.exr final.exr --mask shadow.png --json errors.json");
    command->callback([arguments, &context] { runCompare(*arguments, context); });
}

}  // namespace insitu::cli
