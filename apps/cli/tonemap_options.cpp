#include "apps/cli/tonemap_options.h"

#include "composite/tonemap/library_operators.h"
#include "core/io/image_io.h"

#include <algorithm>
#include <array>
#include <vector>

namespace insitu::cli {

namespace {

/// Which operators each flag belongs to; "selective" also takes those of the operator it selects.
struct FlagUse {
    const char* flag;
    std::vector<std::string> operators;
};

const std::vector<FlagUse>& flagUses()
{
    static const std::vector<FlagUse> uses = {{"--key", {"reinhard", "reinhard-local"}},
                                              {"--white", {"reinhard", "reinhard-local"}},
                                              {"--contrast-threshold", {"ashikhmin"}},
                                              {"--scene-white-cd-m2", {"ashikhmin", "histogram"}},
                                              {"--display-white-cd-m2", {"ashikhmin", "histogram"}},
                                              {"--display-black-cd-m2", {"histogram"}},
                                              {"--field-of-view-deg", {"histogram"}},
                                              {"--veil", {"histogram"}},
                                              {"--acuity", {"histogram"}},
                                              {"--mesopic-color", {"histogram"}},
                                              {"--base-contrast", {"durand"}},
                                              {"--select", {"selective"}},
                                              {"--importance-threshold", {"selective"}},
                                              {"--importance", {"selective"}},
                                              {"--always", {"selective"}}};
    return uses;
}

/// Codes of a picture's green channel as numbers in [0, 1].
Image<float> readMap(const std::filesystem::path& path)
{
    if (path.empty()) return {};
    const EncodedImage picture = readPhoto(path).image;
    Image<float> map(picture.codes.width(), picture.codes.height());
    for (std::size_t i = 0; i < map.pixelCount(); ++i)
        map.pixels()[i] =
            static_cast<float>(picture.codes.pixels()[i].g) / static_cast<float>(picture.max_code);
    return map;
}

}  // namespace

void TonemapOptions::addTo(CLI::App& command)
{
    const std::size_t others = command.get_options().size();
    command
        .add_option("--operator",
                    name_,
                    "global: reinhard, drago, reinhard-devlin; local: reinhard-local, ashikhmin, "
                    "durand; selective (local where it matters); histogram (what an "
                    "observer there could see)")
        ->check(CLI::IsMember({"reinhard",
                               "drago",
                               "reinhard-devlin",
                               "reinhard-local",
                               "ashikhmin",
                               "durand",
                               "selective",
                               "histogram"}))
        ->capture_default_str();
    command
        .add_option(
            "--key", reinhard_.key, "Where the average luminance lands (reinhard, reinhard-local)")
        ->check(CLI::PositiveNumber)
        ->capture_default_str();
    command
        .add_option("--white",
                    reinhard_.white,
                    "Smallest scaled luminance shown as white; default: the brightest pixel "
                    "(reinhard, reinhard-local)")
        ->check(CLI::PositiveNumber);
    command
        .add_option("--base-contrast",
                    durand_.base_contrast,
                    "Contrast that is left of large-scale brightness (durand)")
        ->check(CLI::PositiveNumber)
        ->capture_default_str();
    command
        .add_option("--contrast-threshold",
                    ashikhmin_.contrast_threshold,
                    "Local contrast that ends a pixel's neighbourhood (ashikhmin)")
        ->check(CLI::Range(0.0, 1.0))
        ->capture_default_str();
    command
        .add_option("--scene-white-cd-m2",
                    viewing_.scene_white_cd_m2,
                    "Luminance of scene value 1 (ashikhmin, histogram); default: the log average "
                    "becomes 30")
        ->check(CLI::PositiveNumber);
    command
        .add_option("--display-white-cd-m2",
                    viewing_.display_white_cd_m2,
                    "Luminance of the display's white (ashikhmin, histogram)")
        ->check(CLI::PositiveNumber)
        ->capture_default_str();
    command
        .add_option("--display-black-cd-m2",
                    histogram_.display_black_cd_m2,
                    "Luminance of the display's black where it stands (histogram)")
        ->check(CLI::PositiveNumber)
        ->capture_default_str();
    command
        .add_option("--field-of-view-deg",
                    histogram_.field_of_view_deg,
                    "Horizontal field of view of the picture (histogram)")
        ->check(CLI::Range(0.0, 170.0))
        ->capture_default_str();
    command
        .add_flag("--veil,!--no-veil", histogram_.veil, "Light scattered in the eye (histogram)")
        ->default_str("true");
    command.add_flag("--acuity,!--no-acuity", histogram_.acuity, "Blur of dim light (histogram)")
        ->default_str("true");
    command
        .add_flag("--mesopic-color,!--no-mesopic-color",
                  histogram_.color,
                  "Loss of colour in dim light (histogram)")
        ->default_str("true");
    command.add_option("--select", selected_, "Operator whose local part is selected (selective)")
        ->check(CLI::IsMember({"ashikhmin", "reinhard-local"}))
        ->capture_default_str();
    command
        .add_option("--importance-threshold",
                    importance_threshold_,
                    "Sobel gradient of ln luminance, or map value, that is important (selective)")
        ->check(CLI::PositiveNumber)
        ->capture_default_str();
    command.add_option("--importance",
                       importance_,
                       "Picture to take importance from in place of the gradient (selective)");
    command.add_option(
        "--always", always_, "Picture, white where the local part always counts (selective)");
    const std::vector<CLI::Option*> options = command.get_options();
    for (std::size_t i = others; i < options.size(); ++i)
        options[i]->group("Tone mapping");
}

bool TonemapOptions::sharesCurves() const
{
    static const std::vector<std::string> separable = {
        "reinhard", "reinhard-local", "ashikhmin", "selective"};
    return std::find(separable.begin(), separable.end(), name_) != separable.end();
}

std::unique_ptr<SeparableOperator> TonemapOptions::makeSeparable(const std::string& name) const
{
    if (name == "reinhard") return makeReinhard(reinhard_);
    if (name == "reinhard-local") return makeReinhardLocal(reinhard_);
    AshikhminOptions options = ashikhmin_;
    options.viewing = viewing_;
    return makeAshikhmin(options);
}

std::unique_ptr<ToneMapOperator> TonemapOptions::make(const CLI::App& command,
                                                      const Image<float>& always) const
{
    const bool selective = name_ == "selective";
    for (const FlagUse& use : flagUses()) {
        const auto takes = [&](const std::string& name) {
            return std::find(use.operators.begin(), use.operators.end(), name) !=
                   use.operators.end();
        };
        if (command.count(use.flag) > 0 && !takes(name_) && !(selective && takes(selected_)))
            throw CLI::ValidationError(use.flag,
                                       "is not a flag of operator " + name_ +
                                           "; leave it out or choose " + use.operators.front());
    }
    if (name_ == "histogram") {
        HistogramAdjustmentOptions histogram = histogram_;
        histogram.viewing = viewing_;
        return makeHistogramAdjustment(histogram);
    }
    if (name_ == "durand") return makeDurand(durand_);
    if (name_ == "drago") return makeLibraryOperator(LibraryOperator::Drago);
    if (name_ == "reinhard-devlin") return makeLibraryOperator(LibraryOperator::ReinhardDevlin);
    if (!selective) return makeSeparable(name_);
    SelectiveOptions options;
    options.importance_threshold = importance_threshold_;
    options.importance = readMap(importance_);
    options.always = readMap(always_);
    if (options.always.empty()) options.always = always;
    if (options.always.sameSize(always))
        for (std::size_t i = 0; i < always.pixelCount(); ++i)
            options.always.pixels()[i] = std::max(options.always.pixels()[i], always.pixels()[i]);
    return makeSelective(makeSeparable(selected_), std::move(options));
}

}  // namespace insitu::cli
