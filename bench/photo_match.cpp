// photo_match PHOTO…: what each photograph shows of its camera, and the seconds it takes to see.
#include "composite/differential.h"
#include "composite/match/camera_match.h"
#include "core/io/image_io.h"

#include <fmt/format.h>

#include <chrono>

namespace insitu {
namespace {

void show(const std::filesystem::path& path)
{
    const Photo photo = developed(readPhoto(path));
    const ResponseCurve& response = photo.metadata.color.transfer;
    const auto start = std::chrono::steady_clock::now();
    const GrainEstimate grain = estimateGrain(photo.image, response);
    const auto after_grain = std::chrono::steady_clock::now();
    CameraMatchOptions options;
    options.grain = false;
    options.estimate_vignetting = true;
    const glm::dvec2 size(photo.image.codes.width(), photo.image.codes.height());
    const CameraMatchEstimate match =
        estimateCameraMatch(photo.image,
                            response,
                            photographedRadiance(photo.image, response, 1.0),
                            {},
                            {0.5 * size, 0.0},
                            options);
    const auto end = std::chrono::steady_clock::now();
    const auto seconds = [](auto a, auto b) {
        return std::chrono::duration<double>(b - a).count();
    };
    fmt::print("{:<40} {:>5.0f}x{:<5.0f}", path.filename().string(), size.x, size.y);
    for (const double code : {30.0, 80.0, 130.0, 180.0, 230.0})
        fmt::print(" {:>5.2f}", grain.model.sigmaAt(1, code));
    const double corner = 0.5 * glm::length(size);
    fmt::print(
        "  {:>4.1f}  {:>5} {:>5.2f}±{:<5.2f} {:>+6.2f}±{:<4.2f} {:>+6.2f}±{:<4.2f}"
        " {:>6.3f}±{:<6.3f} {:>5.2f} {:>5.2f}\n",
        100.0 * grain.flat_fraction,
        match.blur.edges,
        match.blur.sigma_px,
        match.blur.sigma_of_sigma_px,
        corner * match.aberration.magnification.r,
        corner * match.aberration.magnification_sigma.r,
        corner * match.aberration.magnification.b,
        corner * match.aberration.magnification_sigma.b,
        match.vignetting.a,
        match.vignetting.sigma,
        seconds(start, after_grain),
        seconds(after_grain, end));
}

}  // namespace
}  // namespace insitu

int main(int argc, char** argv)
{
    fmt::print("{:<40} {:>11} {:>29}  {:>4}  {:>5} {:>11} {:>11} {:>11} {:>13} {:>5} {:>5}\n",
               "photograph",
               "pixels",
               "green sigma at 30 80 .. 230",
               "flat",
               "edges",
               "blur px",
               "red px",
               "blue px",
               "vignetting a",
               "s",
               "s");
    for (int i = 1; i < argc; ++i) {
        try {
            insitu::show(argv[i]);
        } catch (const std::exception& error) {
            fmt::print(stderr, "{}\n", error.what());
            return 1;
        }
    }
    return 0;
}
