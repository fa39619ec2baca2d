#include "apps/cli/command.h"
#include "apps/cli/tonemap_options.h"
#include "core/io/image_io.h"
#include "pipeline/report.h"
#include "pipeline/stage_cache.h"

#include <map>

namespace insitu::cli {

namespace {

struct InsertArguments {
    std::filesystem::path project;
    std::filesystem::path output;
    std::filesystem::path hdr;
    std::filesystem::path tonemapped;
    TonemapOptions tone;
    std::filesystem::path layers;
    std::filesystem::path report;
    Technique technique = Technique::Reference;
    CompositeForm form = CompositeForm::Ratio;
    std::vector<std::string> unmatched;
    bool ignore_exif_focal = false;
    bool no_cache = false;
    InsertOptions options;
};

/// 1 where the composite's codes are no longer those of the photograph: objects and their shadows.
Image<float> changedPixels(const InsertResult& result)
{
    const EncodedImage& before = result.photo.image;
    const EncodedImage& after = result.composite.image;
    Image<float> changed(after.codes.width(), after.codes.height(), 1.0f);
    if (before.max_code != after.max_code) return changed;
    for (std::size_t i = 0; i < changed.pixelCount(); ++i)
        if (before.codes.pixels()[i] == after.codes.pixels()[i]) changed.pixels()[i] = 0.0f;
    return changed;
}

void writeTonemapped(const std::filesystem::path& path,
                     const InsertArguments& arguments,
                     const CLI::App& command,
                     const InsertResult& result,
                     Context& context)
{
    const auto tone_map = arguments.tone.make(command, changedPixels(result));
    // Codes of an HDR photograph are no picture's depth.
    const int max_code = result.photo.radiance.empty() ? result.composite.image.max_code : 255;
    writeEncoded(path,
                 encodeSrgb(tone_map->map(result.composite.linear, context.progress()), max_code));
}

/// The composite as its name says: radiance, the photograph's own kind of picture, or, of an HDR
/// photograph, a view of it.
void writePicture(const InsertArguments& arguments,
                  const CLI::App& command,
                  const InsertResult& result,
                  Context& context)
{
    constexpr int kJpegQuality = 97;
    const PhotoMetadata& metadata = result.photo.metadata;
    if (isRadianceFile(arguments.output))
        writeRadiance(arguments.output, result.composite.linear);
    else if (!result.photo.radiance.empty())
        writeTonemapped(arguments.output, arguments, command, result, context);
    else
        writeEncoded(
            arguments.output, result.composite.image, metadata.exif, kJpegQuality, metadata.icc);
}

void runInsert(InsertArguments& arguments, const CLI::App& command, Context& context)
{
    context.start();
    for (const auto& path : {arguments.output,
                             arguments.hdr,
                             arguments.tonemapped,
                             arguments.layers,
                             arguments.report})
        if (!path.empty()) context.checkOutput(path);

    InsertOptions& options = arguments.options;
    options.render.seed = context.options.seed;
    options.light.seed = context.options.seed;
    options.render.interreflection.seed = context.options.seed;
    options.render.min_samples = std::min(options.render.min_samples, options.render.max_samples);
    options.render.technique = arguments.technique;
    options.composite.form = arguments.form;
    for (const std::string& part : arguments.unmatched)
        leaveOut(part, options.match);
    options.match.seed = context.options.seed;
    options.use_exif_focal = !arguments.ignore_exif_focal;

    if (arguments.no_cache)
        options.cache_folder.clear();
    else if (options.cache_folder.empty())
        options.cache_folder = StageCache::userFolder().value_or("");

    const Project project = readProject(arguments.project);
    // Wrong flags are told before the work, not after it.
    const bool view_of_radiance =
        isRadianceFile(project.photo.path) && !isRadianceFile(arguments.output);
    if (!arguments.tonemapped.empty() || view_of_radiance) (void)arguments.tone.make(command);
    const InsertResult result = insertObjects(project, options, context.progress());
    context.print(result.findings);

    writePicture(arguments, command, result, context);
    if (!arguments.hdr.empty()) writeRadiance(arguments.hdr, result.composite.linear);
    if (!arguments.tonemapped.empty())
        writeTonemapped(arguments.tonemapped, arguments, command, result, context);
    if (!arguments.layers.empty()) writeLayers(arguments.layers, result);
    if (!arguments.report.empty())
        writeReport(arguments.report, project, options, result, arguments.output);
}

}  // namespace

void registerInsert(CLI::App& app, Context& context)
{
    auto arguments = std::make_shared<InsertArguments>();
    InsertionOptions& render = arguments->options.render;
    CLI::App* command =
        app.add_subcommand("insert", "Put furniture into a photograph: the whole chain");
    command->add_option("project", arguments->project, "Project file (.json)")->required();
    command
        ->add_option("-o,--output",
                     arguments->output,
                     "Picture to write: .png or .jpg (of an HDR photograph by the tone mapping "
                     "flags), or the linear composite (.exr, .hdr)")
        ->required();
    command->add_option("--hdr", arguments->hdr, "Also write the linear composite (.exr, .hdr)");
    command->add_option("--tonemapped",
                        arguments->tonemapped,
                        "Also write the linear composite mapped for a display (.png, .jpg), by the "
                        "tone mapping flags; selective: objects and shadows always count");
    command->add_option("--layers", arguments->layers, "Also write all layers (.exr)");
    command->add_option("--report", arguments->report, "Also write findings and figures (.json)");
    command
        ->add_option("--technique",
                     arguments->technique,
                     "How light is computed: reference (paths, noisy, slow) or fiv (visibility "
                     "atlas and local light: no noise, a little bias, many times as quick) or auto "
                     "(fiv if sampled pixels show that it keeps "
                     "--max-error)")
        ->transform(CLI::CheckedTransformer(
            std::map<std::string, Technique>{{"reference", Technique::Reference},
                                             {"fiv", Technique::Fiv},
                                             {"auto", Technique::Auto}}))
        ->default_str("reference");
    command
        ->add_option("--max-error",
                     render.target_error,
                     "Relative error of the light: reference stops at it, auto asks it of fiv")
        ->check(CLI::NonNegativeNumber)
        ->capture_default_str();
    command->add_option("--samples", render.max_samples, "Most samples per pixel (reference)")
        ->check(CLI::PositiveNumber)
        ->capture_default_str();
    command
        ->add_option(
            "--max-seconds", render.max_seconds, "Stop rendering after this time; 0: no limit")
        ->check(CLI::NonNegativeNumber)
        ->capture_default_str();
    command->add_flag("!--no-interreflection",
                      render.interreflection.enabled,
                      "Leave out the light that objects and room send each other; the report says "
                      "what that costs");
    command
        ->add_option("--composite",
                     arguments->form,
                     "How the change of light is put onto the photograph: ratio, difference, or "
                     "mixed pixel by pixel by the photograph's noise")
        ->transform(CLI::CheckedTransformer(
            std::map<std::string, CompositeForm>{{"ratio", CompositeForm::Ratio},
                                                 {"difference", CompositeForm::Difference},
                                                 {"mixed", CompositeForm::Mixed}}))
        ->default_str("ratio");
    command
        ->add_option("--no-match",
                     arguments->unmatched,
                     "What of the photograph's look the objects are not to get: grain, blur, "
                     "vignetting, aberration, focus, dither, all")
        ->delimiter(',')
        ->check(CLI::IsMember(kMatchParts));
    command->add_flag(
        "--ignore-exif-focal", arguments->ignore_exif_focal, "Calibrate from the lines alone");
    command->add_flag("--align",
                      arguments->options.capture.align,
                      "Lay the probe's frames onto each other: for brackets held in the hand");
    command->add_option("--cache",
                        arguments->options.cache_folder,
                        "Folder in which the results of stages are kept for the next run "
                        "(default: $INSITU_CACHE, or insitu/ in the user's cache folder)");
    command->add_flag("--no-cache", arguments->no_cache, "Neither use nor keep results of stages");
    arguments->tone.addTo(*command);
    context.addCommonOptions(*command);
    command->footer(
        "Examples:\n"
        "  insitu insert project.json -o final.png --technique auto --max-error 0.03\n"
        "  insitu insert project.json -o final.png --hdr final.exr --report report.json "
        "--max-error 0.002\n"
        "  insitu insert project.json -o final.png --tonemapped view.png --operator ashikhmin\n"
        "A photograph may be an .exr or .hdr picture: then final.exr keeps every value that the\n"
        "objects do not change, and final.png is a view of it.");
    command->callback([arguments, command, &context] { runInsert(*arguments, *command, context); });
}

}  // namespace insitu::cli
