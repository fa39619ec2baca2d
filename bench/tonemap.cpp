// Global, local and selective tone mapping side by side: speed and error in one run, the tables 12
// to 16 of [Michael10] for our operators.
//
//   tonemap [--runs N] [--threshold T] [--reinhard] [--saliency] [--inserted SHARE]
//       PICTURE[@MEGAPIXELS]…
//   tonemap --histogram [--threads N] PICTURE[@MEGAPIXELS]…
//
// Pictures are .exr, .hdr or .pfm; with @MEGAPIXELS resampled to that size first (by area, or cubic
// where it grows). Times are processor seconds of one thread, the least of N runs, without reading
// and writing of files; other programs on the machine count little then. Errors are those of
// the curve alone (GTM) and of selective mapping (STM) against the local operator (LTM); of
// pictures above 6 megapixels in their middle 2048x2048 pixels. Below 3 megapixels the local
// operator is also compared with its direct evaluation. The local operator is Ashikhmin's, or with
// --reinhard Reinhard's.
#include "bench/fiv_report.h"
#include "composite/tonemap/ashikhmin.h"
#include "composite/tonemap/frame_mapper.h"
#include "composite/tonemap/histogram_adjustment.h"
#include "composite/tonemap/reinhard.h"
#include "composite/tonemap/selective.h"
#include "core/io/image_io.h"
#include "core/parallel.h"
#include "evaluate/ssim.h"
#include "evaluate/visible_differences.h"
#include "tests/support/ashikhmin_direct.h"

#include <CLI/CLI.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/saliency.hpp>

#include <iostream>

namespace insitu {
namespace {

using report::fastest;

/// The operator's curve alone.
class GlobalPart : public SeparableOperator {
public:
    explicit GlobalPart(std::shared_ptr<const SeparableOperator> whole) : whole_(std::move(whole))
    {
    }
    [[nodiscard]] std::unique_ptr<ToneCurve> curve(const SceneStatistics& statistics) const override
    {
        return whole_->curve(statistics);
    }
    [[nodiscard]] std::unique_ptr<LocalAdaptation> local() const override { return nullptr; }

private:
    std::shared_ptr<const SeparableOperator> whole_;
};

/// "FILE" or "FILE@MEGAPIXELS".
Image<Rgb> readPicture(const std::string& argument)
{
    const auto at = argument.rfind('@');
    Image<Rgb> picture = readRadiance(argument.substr(0, at)).pixels;
    if (at == std::string::npos) return picture;
    const double pixels = 1e6 * std::stod(argument.substr(at + 1));
    const double scale = std::sqrt(pixels / static_cast<double>(picture.pixelCount()));
    Image<Rgb> resampled(static_cast<int>(std::lround(scale * picture.width())),
                         static_cast<int>(std::lround(scale * picture.height())));
    const auto matOf = [](Image<Rgb>& image) {
        return cv::Mat(image.height(), image.width(), CV_32FC3, &image(0, 0));
    };
    cv::Mat to = matOf(resampled);
    cv::resize(
        matOf(picture), to, to.size(), 0.0, 0.0, scale < 1.0 ? cv::INTER_AREA : cv::INTER_CUBIC);
    for (Rgb& pixel : resampled.pixels())
        pixel = glm::max(pixel, Rgb(0.0f));  // cubic overshoot
    return resampled;
}

Image<Rgb> middle(const Image<Rgb>& image)
{
    constexpr int kSide = 2048;
    if (image.pixelCount() < 6'000'000) return image;
    const int width = std::min(kSide, image.width());
    const int height = std::min(kSide, image.height());
    Image<Rgb> part(width, height);
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x)
            part(x, y) = image((image.width() - width) / 2 + x, (image.height() - height) / 2 + y);
    return part;
}

Image<float> displayGrey(const Image<Rgb>& display)
{
    Image<float> grey(display.width(), display.height());
    for (std::size_t i = 0; i < grey.pixelCount(); ++i)
        grey.pixels()[i] = luminance(display.pixels()[i]);
    return grey;
}

struct Errors {
    double ssim = 1.0;
    double vdp_percent = 0.0;
};

Errors errorsOf(const Image<Rgb>& local, const Image<Rgb>& other)
{
    Progress silent;
    setThreadCount(0);
    const Image<Rgb> a = middle(local);
    const Image<Rgb> b = middle(other);
    const Errors errors{
        structuralSimilarity(encodedGrey(a), encodedGrey(b), 1.0).mean,
        visibleDifferences(displayGrey(a), displayGrey(b), {}, silent).percent_seen};
    setThreadCount(1);
    return errors;
}

/// Fine-grained saliency of the curve's picture, [0, 1].
Image<float> saliencyOf(const Image<Rgb>& display)
{
    const Image<float> grey = encodedGrey(display);
    cv::Mat codes(grey.height(), grey.width(), CV_8UC3);
    for (int y = 0; y < grey.height(); ++y)
        for (int x = 0; x < grey.width(); ++x)
            codes.at<cv::Vec3b>(y, x) =
                cv::Vec3b::all(static_cast<unsigned char>(std::lround(255.0f * grey(x, y))));
    cv::Mat found;
    cv::saliency::StaticSaliencyFineGrained::create()->computeSaliency(codes, found);
    found.convertTo(found, CV_32F);
    Image<float> map(grey.width(), grey.height());
    for (int y = 0; y < grey.height(); ++y)
        for (int x = 0; x < grey.width(); ++x)
            map(x, y) = std::clamp(found.at<float>(y, x), 0.0f, 1.0f);
    return map;
}

/// The local operator against its direct evaluation, RMS in per cent of the display's white, where
/// no channel is cut off: of all pixels, and without those whose scale rounding decides.
void compareWithDirect(const Image<Rgb>& scene, const Image<Rgb>& local)
{
    setThreadCount(0);
    Image<std::uint8_t> undecided;
    const Image<double> expected = direct::displayLuminance(scene, {}, true, &undecided);
    setThreadCount(1);
    double sum = 0.0;
    double decided_sum = 0.0;
    double counted = 0.0;
    double decided = 0.0;
    for (std::size_t i = 0; i < scene.pixelCount(); ++i) {
        const Rgb& pixel = local.pixels()[i];
        if (std::max({pixel.r, pixel.g, pixel.b}) >= 1.0f || luminance(scene.pixels()[i]) == 0.0f)
            continue;  // black has no colour to scale
        const double squared =
            std::pow(static_cast<double>(luminance(pixel)) - expected.pixels()[i], 2);
        sum += squared;
        ++counted;
        if (undecided.pixels()[i] != 0) continue;
        decided_sum += squared;
        ++decided;
    }
    std::cout << fmt::format(
        "  LTM against its direct evaluation: {:.5f} % RMS; without the {:.0f} of {:.0f} pixels "
        "with a contrast within {} of the threshold {:.5f} %\n",
        100.0 * std::sqrt(sum / counted),
        counted - decided,
        counted,
        direct::kUndecided,
        100.0 * std::sqrt(decided_sum / decided));
}

struct BenchOptions {
    int runs = 5;
    double threshold = SelectiveOptions{}.importance_threshold;
    bool saliency = false;
    bool reinhard = false;
    double inserted = 0.0;
    bool histogram = false;
    int threads = 0;
    std::vector<std::string> pictures;
};

void benchInserted(const BenchOptions& options,
                   const Image<Rgb>& scene,
                   const SceneStatistics& statistics,
                   const std::shared_ptr<const SeparableOperator>& tone_map,
                   double local_seconds)
{
    Progress silent;
    SelectiveOptions selection;
    selection.importance = Image<float>(scene.width(), scene.height(), 0.0f);
    selection.always = selection.importance;
    const double side = std::sqrt(options.inserted);
    const auto inside = [&](int i, int size) {
        return std::abs((i + 0.5) / size - 0.5) < 0.5 * side;
    };
    for (int y = 0; y < scene.height(); ++y)
        for (int x = 0; x < scene.width(); ++x)
            if (inside(x, scene.width()) && inside(y, scene.height()))
                selection.always(x, y) = 1.0f;
    const auto selective = makeSelective(tone_map, selection);
    Image<Rgb> display(scene.width(), scene.height());
    const double seconds = fastest(options.runs, [&] {
                               selective->mapInto(display, scene, statistics, silent);
                           }).processor;
    std::cout << fmt::format("  object of {:.1f} % alone: selected {:.1f} %, {:.2f} times LTM\n",
                             100.0 * options.inserted,
                             100.0 * selectedShare(*tone_map, selection, scene),
                             local_seconds / seconds);
}

/// An object of that share that moves by a hundredth of the picture, frame after frame.
void benchFrames(const BenchOptions& options,
                 const Image<Rgb>& scene,
                 const std::shared_ptr<const SeparableOperator>& tone_map,
                 double local_seconds)
{
    Progress silent;
    FrameMapper mapper(tone_map);
    const double side = std::sqrt(options.inserted);
    double seconds = 0.0;
    double share = 0.0;
    constexpr int kFrames = 12;
    int counted = 0;
    for (int frame = 0; frame < kFrames; ++frame) {
        Image<Rgb> moved = scene;
        const auto left = static_cast<int>((0.2 + 0.01 * frame) * scene.width());
        const int top = scene.height() / 3;
        for (int y = top; y < top + static_cast<int>(side * scene.height()); ++y)
            for (int x = left; x < left + static_cast<int>(side * scene.width()); ++x)
                moved(x, y) *= 0.8f;
        const report::Stopwatch watch;
        (void)mapper.map(moved, 0.04, silent);
        const double taken = watch.passed().processor;
        // The first frame, and those in which the look changes, are mapped whole.
        if (mapper.mappedShare() == 1.0) continue;
        seconds += taken;
        share += mapper.mappedShare();
        ++counted;
    }
    if (counted == 0) return;
    std::cout << fmt::format(
        "  moved object of {:.1f} %: {:.1f} % of the pixels anew, {:.1f} ms a frame with "
        "statistics "
        "in {} of {} frames, {:.2f} times LTM\n",
        100.0 * options.inserted,
        100.0 * share / counted,
        1e3 * seconds / counted,
        counted,
        kFrames,
        local_seconds * counted / seconds);
}

void benchHistogram(const BenchOptions& options, const std::string& argument)
{
    Progress silent;
    const Image<Rgb> scene = readPicture(argument);
    const SceneStatistics statistics = measureScene(scene);
    Image<Rgb> display(scene.width(), scene.height());
    std::cout << fmt::format("{}, {}x{}\n", argument, scene.width(), scene.height());
    for (const double field : {40.0, 90.0, 150.0})
        for (const double light : {30.0, 0.03}) {
            HistogramAdjustmentOptions histogram;
            histogram.field_of_view_deg = field;
            histogram.viewing.scene_white_cd_m2 = light / statistics.log_average;
            const auto tone_map = makeHistogramAdjustment(histogram);
            const auto spent = fastest(
                options.runs, [&] { tone_map->mapInto(display, scene, statistics, silent); });
            std::cout << fmt::format(
                "  {:3.0f} degrees, log average {} cd/m²: {:.1f} frames/s by the clock, {:.1f} ms "
                "of "
                "processors\n",
                field,
                light,
                1.0 / spent.wall,
                1e3 * spent.processor);
        }
    std::cout << std::flush;
}

void benchPicture(const BenchOptions& options, const std::string& argument)
{
    Progress silent;
    const Image<Rgb> scene = readPicture(argument);
    const std::shared_ptr<const SeparableOperator> operator_whole =
        options.reinhard ? makeReinhardLocal({}) : makeAshikhmin();
    const GlobalPart global(operator_whole);
    SelectiveOptions selection;
    selection.importance_threshold = options.threshold;
    const auto selective = makeSelective(operator_whole, selection);
    SceneStatistics statistics;
    const double measuring =
        fastest(options.runs, [&] { statistics = measureScene(scene); }).processor;
    const auto timed = [&](const ToneMapOperator& tone_map, Image<Rgb>& display) {
        display = Image<Rgb>(scene.width(), scene.height());
        return fastest(options.runs, [&] { tone_map.mapInto(display, scene, statistics, silent); })
            .processor;
    };
    Image<Rgb> gtm;
    Image<Rgb> ltm;
    Image<Rgb> stm;
    const double global_seconds = timed(global, gtm);
    const double local_seconds = timed(*operator_whole, ltm);
    const double selective_seconds = timed(*selective, stm);
    const double megapixels = 1e-6 * static_cast<double>(scene.pixelCount());
    const auto by_clock = [&](int threads) {
        setThreadCount(threads);
        return megapixels / fastest(options.runs, [&] {
                                operator_whole->mapInto(ltm, scene, statistics, silent);
                            }).wall;
    };
    const double one_thread = by_clock(1);
    const double all_threads = by_clock(0);
    setThreadCount(1);
    const Errors global_errors = errorsOf(ltm, gtm);
    const Errors selective_errors = errorsOf(ltm, stm);
    std::cout << fmt::format(
        "{}\n  {}x{}, selected {:.1f} %, statistics {:.1f} MPix/s\n"
        "  GTM {:.1f} MPix/s, SSIM {:.4f}, VDP {:.2f} %, gain {:.2f}\n"
        "  LTM {:.1f} MPix/s, with statistics {:.1f}; by the clock {:.1f}, on all threads {:.1f}\n"
        "  STM {:.1f} MPix/s, {:.2f} times LTM, SSIM {:.4f}, VDP {:.2f} %, gain {:.2f}\n",
        argument,
        scene.width(),
        scene.height(),
        100.0 * selectedShare(*operator_whole, selection, scene),
        megapixels / measuring,
        megapixels / global_seconds,
        global_errors.ssim,
        global_errors.vdp_percent,
        1.0 / (global_seconds * std::max(global_errors.vdp_percent, 0.01)),
        megapixels / local_seconds,
        megapixels / (local_seconds + measuring),
        one_thread,
        all_threads,
        megapixels / selective_seconds,
        local_seconds / selective_seconds,
        selective_errors.ssim,
        selective_errors.vdp_percent,
        1.0 / (selective_seconds * std::max(selective_errors.vdp_percent, 0.01)));
    if (scene.pixelCount() < 3'000'000 && !options.reinhard) compareWithDirect(scene, ltm);
    if (options.inserted > 0.0)
        benchInserted(options, scene, statistics, operator_whole, local_seconds);
    if (options.inserted > 0.0) benchFrames(options, scene, operator_whole, local_seconds);
    std::cout << std::flush;
    if (!options.saliency) return;
    SelectiveOptions by_map = selection;
    by_map.importance = saliencyOf(gtm);
    const Errors errors =
        errorsOf(ltm, makeSelective(operator_whole, by_map)->map(scene, statistics, silent));
    std::cout << fmt::format("  by saliency: selected {:.1f} %, SSIM {:.4f}, VDP {:.2f} %\n",
                             100.0 * selectedShare(*operator_whole, by_map, scene),
                             errors.ssim,
                             errors.vdp_percent);
}

}  // namespace
}  // namespace insitu

int main(int argc, char** argv)
{
    CLI::App app("Global, local and selective tone mapping: speed against error");
    insitu::BenchOptions options;
    app.add_option("--runs", options.runs, "Runs, of which the quickest counts");
    app.add_option("--threshold", options.threshold, "Importance threshold");
    app.add_flag(
        "--reinhard", options.reinhard, "Reinhard's local operator in place of Ashikhmin's");
    app.add_flag("--saliency", options.saliency, "Also selection by a saliency map");
    app.add_option("picture", options.pictures, "FILE or FILE@MEGAPIXELS")->required();
    app.add_option("--inserted", options.inserted, "Also an object of this share of the picture");
    app.add_flag("--histogram", options.histogram, "Histogram adjustment in place of all else");
    app.add_option("--threads", options.threads, "Threads of --histogram; 0: all");
    CLI11_PARSE(app, argc, argv);
    insitu::setThreadCount(options.histogram ? options.threads : 1);
    if (options.histogram) {
        for (const std::string& picture : options.pictures)
            insitu::benchHistogram(options, picture);
        return 0;
    }
    for (const std::string& picture : options.pictures)
        insitu::benchPicture(options, picture);
    return 0;
}
