// A photograph's response estimated from surfaces that the light probe sees too, beside the one
// that was recovered from the bracket of the same camera, as if that were not known.
//
// photo_response PROJECT…: stops off over the codes 30 to 230, rms and largest, of the estimate and
// of sRGB, all relative to code 128.
#include "pipeline/photo_response.h"

#include "core/io/image_io.h"
#include "pipeline/insert.h"

#include <fmt/format.h>

#include <cmath>
#include <cstdio>

namespace {

using namespace insitu;

struct Off {
    double square = 0.0, worst = 0.0;
};
Off compare(const ResponseCurve& curve, const ResponseCurve& truth)
{
    Off off;
    int count = 0;
    for (int c = 0; c < 3; ++c)
        for (int code = 30; code <= 230; ++code, ++count) {
            const double stops = std::log2(curve.decode(c, code) / curve.decode(c, 128) /
                                           (truth.decode(c, code) / truth.decode(c, 128)));
            off.square += stops * stops;
            off.worst = std::max(off.worst, std::abs(stops));
        }
    off.square = std::sqrt(off.square / count);
    return off;
}

void run(const std::string& file)
{
    const Project project = readProject(file);
    const Photo photo = readPhotograph(project.photo.path);
    const CameraEstimate camera = solveCamera(project, photo, true);
    const SceneProxy proxy(project.room);
    const CapturedLight light = captureLight(project, proxy, camera.camera, {});
    const ResponseCurve srgb = photo.metadata.color.transfer;
    const PhotoResponseEstimate estimate = estimatePhotoResponse(
        photo.image, srgb, commonPixels(camera.camera, proxy, light.environment, light.center_m));
    const Off assumed = compare(srgb, light.response);
    const Off ours = compare(estimate.curve, light.response);
    fmt::print(
        "{}\n  {} pixels, power {:.3f} ± {:.3f}, bend {:.3f} ± {:.3f}, spread {:.1f} % for "
        "{:.1f} %: {}\n  stops off, rms and largest: sRGB {:.3f}, {:.3f}; estimate {:.3f}, "
        "{:.3f}\n",
        file,
        estimate.pixels,
        estimate.power,
        estimate.power_sigma,
        estimate.bend,
        estimate.bend_sigma,
        100.0 * estimate.spread,
        100.0 * estimate.spread_assumed,
        estimate.differs ? "differs" : "sRGB stays",
        assumed.square,
        assumed.worst,
        ours.square,
        ours.worst);
    std::fflush(stdout);
}

}  // namespace

int main(int argc, char** argv)
{
    if (argc < 2) {
        fmt::print(stderr, "usage: photo_response PROJECT...\n");
        return 2;
    }
    for (int i = 1; i < argc; ++i) {
        try {
            run(argv[i]);
        } catch (const std::exception& error) {
            fmt::print(stderr, "{}: {}\n", argv[i], error.what());
        }
    }
    return 0;
}
