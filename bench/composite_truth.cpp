// How close the whole chain comes to rooms in which the object really stood.
//
//   composite_truth [--samples N] [--both] [--form ratio|difference]
//                   [--technique reference|fiv|auto|fiv-distant|fiv-cube]... [--cache FOLDER]
//                   [--pictures FOLDER] ROOM_FOLDER...
//
// A room is a folder with project.json, plate.jpg and, perhaps in a folder truth/, truth.json,
// truth_linear.exr, plate_linear.exr (perhaps reduced in size) and object_mask.png. A residual is
// the RMS over a region of the averaged error in linear light, divided by that of the untouched
// plate: 0 is perfect, 1 no better than doing nothing. Regions: "object" (mask above one half,
// averages over 5x5 pixels), "contact" (8 pixels around it, 3x3), "shadow" (what else the object
// changes by more than 2 %, 15x15). "far" pixels are more than 60 pixels from anything that it
// changes by 0.5 %. The line "bound" is the photograph times the true ratio of each pixel: what
// noise and clipped pixels of the photograph leave to be had.
//
// Several techniques are shown below each other; "render" and "cpu" are the seconds and processor
// seconds of the render stage without the objects' visibility atlases, which are made once a model
// ("tables" seconds). fiv-distant and fiv-cube leave out where light comes from, and what is
// hidden.
#include "core/check.h"
#include "core/io/image_io.h"
#include "core/io/json.h"
#include "pipeline/insert.h"

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <array>
#include <cstdio>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

namespace insitu {
namespace {

using Vec3Image = cv::Mat_<cv::Vec3d>;
using MaskImage = cv::Mat_<std::uint8_t>;  ///< 0 or 255

/// A table from fraction of full scale to exposure: the room's camera backwards.
class InverseCurve {
public:
    explicit InverseCurve(const JsonNode& curve)
    {
        for (std::size_t c = 0; c < 3; ++c) {
            const JsonNode values = curve.at(c);
            double highest = 0.0;
            for (std::size_t i = 0; i < values.size(); ++i) {
                // A flat step is made to rise by a trifle, so that the inverse exists.
                highest = std::max(highest, values.at(i).number() + 1e-9 * static_cast<double>(i));
                table_[c].push_back(highest);
            }
        }
    }

    [[nodiscard]] double operator()(std::size_t channel, double fraction) const
    {
        const std::vector<double>& table = table_[channel];
        if (fraction <= table.front()) return 0.0;
        if (fraction >= table.back()) return 1.0;
        const auto above = std::upper_bound(table.begin(), table.end(), fraction);
        const double below = *(above - 1);
        const double steps =
            static_cast<double>(above - table.begin() - 1) + (fraction - below) / (*above - below);
        return steps / static_cast<double>(table.size() - 1);
    }

private:
    std::array<std::vector<double>, 3> table_;
};

/// What the judge knows of a room. Exposures: 1 is where the sensor clips.
struct Truth {
    Vec3Image with;     ///< exposure of the plate's camera with the object, not clipped
    Vec3Image without;  ///< and without
    InverseCurve inverse;
    int reduction = 1;  ///< how many pixels of the photograph one of these images' is wide
    MaskImage object{};
    MaskImage contact{};
    MaskImage shadow{};
    MaskImage far{};  ///< in the photograph's size

    /// A window's side in pixels of the photograph, in those of the reduced pictures: odd.
    [[nodiscard]] int side(int pixels) const { return pixels / reduction / 2 * 2 + 1; }
};

struct Score {
    double object = 0.0;
    double contact = 0.0;
    double shadow = 0.0;
};

struct Touched {
    int far_pixels = 0;
    double far_codes = 0.0;  ///< largest change of a far pixel, 8-bit codes
    double share = 0.0;      ///< of all pixels
};

Vec3Image blurred(const Vec3Image& image, int side)
{
    Vec3Image out;
    cv::blur(image, out, {side, side});
    return out;
}

MaskImage grown(const MaskImage& mask, int side)
{
    MaskImage out;
    cv::dilate(mask, out, cv::Mat::ones(side, side, CV_8U));
    return out;
}

Vec3Image clipped(const Vec3Image& image)
{
    Vec3Image out;
    cv::min(image, cv::Scalar::all(1.0), out);
    return out;
}

template <class Pixel>
Vec3Image toMat(const Image<Pixel>& image, double scale)
{
    Vec3Image out(image.height(), image.width());
    out.forEach([&](cv::Vec3d& pixel, const int* at) {
        const glm::dvec3 value = glm::dvec3(image(at[1], at[0])) * scale;
        pixel = {value.r, value.g, value.b};
    });
    return out;
}

/// Codes in units of 8 bits, [0, 255].
Vec3Image eightBitCodes(const EncodedImage& image)
{
    return toMat(image.codes, 255.0 / image.max_code);
}

Vec3Image linearised(const Vec3Image& codes, const InverseCurve& inverse)
{
    Vec3Image out = codes.clone();
    out.forEach([&](cv::Vec3d& pixel, const int*) {
        for (int c = 0; c < 3; ++c)
            pixel[c] = inverse(static_cast<std::size_t>(c), pixel[c] / 255.0);
    });
    return out;
}

/// Share by which the object changes the light around a pixel.
cv::Mat_<double> influence(const Vec3Image& with, const Vec3Image& without, int side)
{
    const Vec3Image a = blurred(with, side);
    const Vec3Image b = blurred(without, side);
    cv::Mat_<double> out(a.size());
    out.forEach([&](double& share, const int* at) {
        const cv::Vec3d level = b(at[0], at[1]);
        const double change = cv::norm(a(at[0], at[1]) - level, cv::NORM_L1) / 3.0;
        share = change / std::max(cv::sum(level)[0] / 3.0, 1e-3);
    });
    return out;
}

/// Area averages over squares of `factor` pixels.
template <class Mat>
Mat reduced(const Mat& image, int factor)
{
    Mat out;
    cv::resize(image, out, {image.cols / factor, image.rows / factor}, 0.0, 0.0, cv::INTER_AREA);
    return out;
}

Truth readTruth(const std::filesystem::path& folder)
{
    const std::filesystem::path file = folder / "truth.json";
    const Json json = readJson(file);
    const JsonNode root(json, file.string());
    const JsonNode response = root.at("response");
    const double scale =
        response.at("sensor_scale").positive() * root.at("exposure_seconds").at("plate").positive();
    Truth truth{.with = toMat(readRadiance(folder / "truth_linear.exr").pixels, scale),
                .without = toMat(readRadiance(folder / "plate_linear.exr").pixels, scale),
                .inverse = InverseCurve(response.at("curve"))};
    MaskImage mask = cv::imread((folder / "object_mask.png").string(), cv::IMREAD_GRAYSCALE);
    truth.reduction = std::max(1, mask.cols / truth.with.cols);
    const cv::Size full = mask.size();
    if (full != truth.with.size() * truth.reduction || truth.with.size() != truth.without.size())
        throw InputError((folder / "object_mask.png").string(),
                         "its size is no multiple of the truth's");
    mask = reduced(mask, truth.reduction);
    const MaskImage marked(mask > 2);
    const MaskImage near = grown(marked, truth.side(17));
    const cv::Mat_<double> change =
        influence(clipped(truth.with), clipped(truth.without), truth.side(21));
    truth.object = mask > 127;
    truth.contact = near & ~grown(marked, truth.side(3));
    truth.shadow = (change > 0.02) & ~near;
    const MaskImage far(grown(MaskImage((change > 0.005) | near), truth.side(121)) == 0);
    cv::resize(far, truth.far, full, 0.0, 0.0, cv::INTER_NEAREST);
    return truth;
}

double residual(const Vec3Image& image, const Truth& truth, const MaskImage& region, int side)
{
    const Vec3Image got = blurred(image, side);
    const Vec3Image wanted = blurred(clipped(truth.with), side);
    const Vec3Image plate = blurred(clipped(truth.without), side);
    return cv::norm(got, wanted, cv::NORM_L2, region) /
           cv::norm(wanted, plate, cv::NORM_L2, region);
}

Score score(const Vec3Image& image, const Truth& truth)
{
    return {residual(image, truth, truth.object, truth.side(5)),
            residual(image, truth, truth.contact, truth.side(3)),
            residual(image, truth, truth.shadow, truth.side(15))};
}

/// The photograph, decoded without error, times the true ratio of each pixel.
Score bestPossible(const Vec3Image& plate_codes, const Truth& truth)
{
    const Vec3Image plate = reduced(linearised(plate_codes, truth.inverse), truth.reduction);
    Vec3Image floor;
    cv::max(truth.without, cv::Scalar::all(1e-9), floor);
    const Vec3Image ratio(truth.with / floor);
    return score(clipped(Vec3Image(plate.mul(ratio))), truth);
}

Touched touched(const Vec3Image& codes, const Vec3Image& plate_codes, const MaskImage& far)
{
    Touched out;
    int changed = 0;
    for (int y = 0; y < codes.rows; ++y)
        for (int x = 0; x < codes.cols; ++x) {
            const double change = cv::norm(codes(y, x) - plate_codes(y, x), cv::NORM_INF);
            if (change == 0.0) continue;
            ++changed;
            if (far(y, x) == 0) continue;
            ++out.far_pixels;
            out.far_codes = std::max(out.far_codes, change);
        }
    out.share = changed / static_cast<double>(codes.total());
    return out;
}

void printScore(const std::string& room, const std::string& mode, const Score& score)
{
    fmt::print("{:<14} {:<16}", room, mode);
    fmt::print(" {:>7.4f} {:>8.4f} {:>7.4f}", score.object, score.contact, score.shadow);
}

void printRest(const InsertResult& result, const Touched& change)
{
    double seconds = 0.0;
    StageTime rendering;
    for (const StageTime& time : result.times) {
        seconds += time.seconds;
        if (time.stage == "render") rendering = time;
    }
    const InsertionResult& render = result.render;
    fmt::print(" {:>7} {:>6.1f}", change.far_pixels, change.far_codes);
    fmt::print(" {:>8.2f} {:>7.1f}", 100.0 * change.share, seconds);
    fmt::print(" {:>7.2f} {:>7.2f} {:>6.2f}",
               rendering.seconds - render.table_seconds,
               rendering.processor_seconds - render.table_processor_seconds,
               render.table_seconds);
    fmt::print(" {:>7.2f} {:>9.5f}", render.mean_samples, render.ratio_error);
    fmt::print(" {:>7.4f} {:>6.4f}\n", render.fiv_error.rms, render.fiv_error.upper);
    std::fflush(stdout);
}

struct Technique {
    insitu::Technique technique = insitu::Technique::Fiv;
    FivLight light = FivLight::Room;
    bool interreflection = true;
};
const std::map<std::string, Technique> kTechniques{
    {"reference", {.technique = insitu::Technique::Reference}},
    {"reference-direct", {.technique = insitu::Technique::Reference, .interreflection = false}},
    {"fiv", {}},
    {"fiv-direct", {.interreflection = false}},
    {"fiv-distant", {.light = FivLight::Distant}},
    {"fiv-cube", {.light = FivLight::Cube}},
    {"auto", {.technique = insitu::Technique::Auto}}};

struct Arguments {
    InsertOptions options;
    std::vector<std::string> techniques = {"reference"};
    std::filesystem::path pictures;
    bool both = false;
    insitu::CompositeForm form = insitu::CompositeForm::Ratio;
    std::vector<std::string> unmatched;
    std::vector<std::filesystem::path> rooms;
};

void measure(std::filesystem::path folder, const Arguments& arguments)
{
    if (!folder.has_filename()) folder = folder.parent_path();
    const std::string room = folder.filename().string();
    const std::filesystem::path apart = folder / "truth";
    const Truth truth = readTruth(std::filesystem::exists(apart) ? apart : folder);
    const Vec3Image plate = eightBitCodes(readPhoto(folder / "plate.jpg").image);
    if (plate.size() != truth.far.size())
        throw InputError((folder / "plate.jpg").string(), "has another size than the truth");
    printScore(room, "bound", bestPossible(plate, truth));
    fmt::print("\n");
    const Project project = readProject(folder / "project.json");
    for (const std::string& name : arguments.techniques)
        for (const bool with_exif : {true, false}) {
            if (!with_exif && !arguments.both) continue;
            InsertOptions options = arguments.options;
            options.use_exif_focal = with_exif;
            const Technique& technique = kTechniques.at(name);
            options.render.technique = technique.technique;
            options.render.fiv.light = technique.light;
            options.render.interreflection.enabled = technique.interreflection;
            Progress silent;
            const InsertResult result = insertObjects(project, options, silent);
            const Vec3Image codes = eightBitCodes(result.composite.image);
            printScore(room,
                       with_exif ? name : name + "-l",
                       score(reduced(linearised(codes, truth.inverse), truth.reduction), truth));
            printRest(result, touched(codes, plate, truth.far));
            if (!arguments.pictures.empty())
                writeEncoded(
                    arguments.pictures / (room + "-" + name + ".png"), result.composite.image, {});
            if (!arguments.pictures.empty()) {
                const RenderLayers& layers = result.render.layers;
                cv::Mat_<cv::Vec3b> ratio(codes.rows, codes.cols);
                ratio.forEach([&](cv::Vec3b& pixel, const int* at) {
                    const Rgb w = layers.irradiance_with(at[1], at[0]);
                    const Rgb o = layers.irradiance_without(at[1], at[0]);
                    for (int c = 0; c < 3; ++c)
                        pixel[2 - c] = cv::saturate_cast<std::uint8_t>(
                            o[c] > 0.0f ? 200.0f * w[c] / o[c] : 0.0f);
                });
                cv::imwrite((arguments.pictures / (room + "-" + name + "-ratio.png")).string(),
                            ratio);
            }
        }
}

}  // namespace
}  // namespace insitu

int main(int argc, char** argv)
{
    CLI::App app("How close the whole chain comes to rooms in which the object really stood");
    insitu::Arguments arguments;
    insitu::InsertOptions& options = arguments.options;
    options.render.max_samples = 32;
    app.add_option("--samples", options.render.max_samples, "Most samples per pixel")
        ->check(CLI::PositiveNumber)
        ->capture_default_str();
    app.add_flag("--both", arguments.both, "Also without the focal length in EXIF (rows ...-l)");
    app.add_option("--form", arguments.form, "Composite form")
        ->transform(CLI::CheckedTransformer(std::map<std::string, insitu::CompositeForm>{
            {"ratio", insitu::CompositeForm::Ratio},
            {"difference", insitu::CompositeForm::Difference},
            {"mixed", insitu::CompositeForm::Mixed}}));
    app.add_option("--no-match", arguments.unmatched, "As in insert")
        ->delimiter(',')
        ->check(CLI::IsMember(insitu::kMatchParts));
    app.add_option("--technique", arguments.techniques, "One or several")
        ->check(CLI::IsMember(insitu::kTechniques))
        ->capture_default_str();
    app.add_option("--max-error", options.render.target_error, "As in insert")
        ->check(CLI::NonNegativeNumber)
        ->capture_default_str();
    app.add_option("--cache", options.cache_folder, "Folder that keeps light, layers and atlases");
    app.add_option("--atlases", options.render.fiv.atlas_folder, "Folder that keeps atlases only");
    app.add_option("--pictures", arguments.pictures, "Existing folder for the pictures");
    app.add_option("rooms", arguments.rooms, "Folders of truth rooms")->required();
    CLI11_PARSE(app, argc, argv)
    options.render.min_samples = std::min(options.render.min_samples, options.render.max_samples);
    options.composite.form = arguments.form;
    for (const std::string& part : arguments.unmatched)
        insitu::leaveOut(part, options.match);
    fmt::print("{} samples, {} form\n",
               options.render.max_samples,
               insitu::compositeFormName(arguments.form));
    fmt::print(
        "room           technique         object  contact  shadow  far px  codes changed% seconds  "
        "render "
        "    cpu tables samples  ratio se fiv rms  upper\n");
    try {
        for (const auto& room : arguments.rooms)
            insitu::measure(room, arguments);
    } catch (const std::exception& error) {
        fmt::print(stderr, "{}\n", error.what());
        return 1;
    }
    return 0;
}
