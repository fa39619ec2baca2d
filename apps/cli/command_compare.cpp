#include "apps/cli/command.h"
#include "core/color.h"
#include "core/io/image_io.h"
#include "core/io/json.h"
#include "evaluate/error_metrics.h"
#include "evaluate/ssim.h"
#include "evaluate/visible_differences.h"

#include <iostream>

namespace insitu::cli {

namespace {

namespace fs = std::filesystem;

struct CompareArguments {
    fs::path reference;
    fs::path picture;
    fs::path mask;
    fs::path json;
    bool vdp = false;
    ViewingConditions viewing;
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

/// What is judged as an observer sees it: of two encoded pictures only.
struct SeenMetrics {
    std::optional<double> ssim;         ///< nothing for pictures below 11x11 pixels
    std::optional<double> vdp_percent;  ///< when asked for
};

Image<float> luminanceOf(const Image<Rgb>& linear)
{
    Image<float> grey(linear.width(), linear.height());
    for (std::size_t i = 0; i < grey.pixelCount(); ++i)
        grey.pixels()[i] = luminance(linear.pixels()[i]);
    return grey;
}

/// Mean of a map over the mask's pixels; the map's middle is the mask's.
std::optional<double> meanWithin(const Image<float>& map, const PixelMask& mask)
{
    const int left = (mask.width() - map.width()) / 2;
    const int top = (mask.height() - map.height()) / 2;
    double sum = 0.0;
    double count = 0.0;
    for (int y = 0; y < map.height(); ++y)
        for (int x = 0; x < map.width(); ++x)
            if (mask(x + left, y + top) != 0) {
                sum += static_cast<double>(map(x, y));
                ++count;
            }
    return count > 0.0 ? std::optional(sum / count) : std::nullopt;
}

SeenMetrics compareAsSeen(const CompareArguments& arguments,
                          const Image<Rgb>& reference,
                          const Image<Rgb>& picture,
                          const PixelMask& mask,
                          Progress& progress)
{
    SeenMetrics seen;
    constexpr int kWindow = 11;
    if (std::min(reference.width(), reference.height()) >= kWindow) {
        const StructuralSimilarity similarity =
            structuralSimilarity(encodedGrey(reference), encodedGrey(picture), 1.0);
        seen.ssim = mask.empty() ? similarity.mean : meanWithin(similarity.map, mask);
    }
    if (!arguments.vdp) return seen;
    VisibleDifferences differences = visibleDifferences(
        luminanceOf(reference), luminanceOf(picture), arguments.viewing, progress);
    seen.vdp_percent = differences.percent_seen;
    if (mask.empty()) return seen;
    for (float& value : differences.probability.pixels())
        value = static_cast<double>(value) > kSeenProbability ? 100.0f : 0.0f;
    seen.vdp_percent = meanWithin(differences.probability, mask);
    return seen;
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

Json toJson(const ErrorMetrics& metrics,
            const std::optional<CodeDifference>& codes,
            const SeenMetrics& seen)
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
    if (seen.ssim) json["ssim"] = *seen.ssim;
    if (seen.vdp_percent) json["vdp_percent"] = *seen.vdp_percent;
    return json;
}

void printMetrics(const ErrorMetrics& metrics,
                  const std::optional<CodeDifference>& codes,
                  const SeenMetrics& seen)
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
    if (seen.ssim) std::cout << fmt::format("SSIM          {:.6g}\n", *seen.ssim);
    if (seen.vdp_percent) std::cout << fmt::format("VDP %         {:.6g}\n", *seen.vdp_percent);
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
    SeenMetrics seen;
    if (reference.encoded)
        seen = compareAsSeen(arguments, reference.linear, picture.linear, mask, context.progress());
    else if (arguments.vdp)
        throw InputError(arguments.reference.string(),
                         "is a radiance image; --vdp compares pictures for a display, tonemap both "
                         "first");
    context.print(judge(*metrics));
    printMetrics(*metrics, codes, seen);
    if (!arguments.json.empty()) writeJson(arguments.json, toJson(*metrics, codes, seen));
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
    command->add_flag("--vdp",
                      arguments->vdp,
                      "Also pixels whose difference is visible, in per cent (Daly's predictor)");
    command
        ->add_option("--pixels-per-degree",
                     arguments->viewing.pixels_per_degree,
                     "How near the observer of --vdp sits")
        ->check(CLI::PositiveNumber)
        ->capture_default_str();
    command
        ->add_option("--display-white-cd-m2",
                     arguments->viewing.white_cd_m2,
                     "Luminance of the display's white, for --vdp")
        ->check(CLI::PositiveNumber)
        ->capture_default_str();
    context.addCommonOptions(*command);
    command->footer(
        "Both are radiance images (.exr, .hdr, .pfm), or both encoded pictures (.png, .jpg, "
        ".tif),\n"
        "which are decoded from sRGB first.\n"
        "Examples:\n"
        "  insitu compare truth.png final.png --vdp\n"
        "  insitu compare truth.exr final.exr --mask shadow.png --json errors.json");
    command->callback([arguments, &context] { runCompare(*arguments, context); });
}

}  // namespace insitu::cli
