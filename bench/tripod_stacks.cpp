// What alignment and de-ghosting do to brackets from a tripod, which should come back as they were:
// the real stacks, the ball brackets of projects (truth rooms do not move at all).
//
// tripod_stacks [--masks FOLDER] DATA PROJECT...
//
// Per stack: the frame that seems to have moved most (pixels, its standard deviation), how many are
// taken to have moved; the share of the pixels that de-ghosting leaves out in some frame.

#include "bench/real_stacks.h"
#include "capture/alignment.h"
#include "capture/deghost.h"
#include "capture/response_recovery.h"
#include "core/io/image_io.h"
#include "pipeline/project.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <exception>
#include <filesystem>
#include <string>
#include <vector>

namespace {

using namespace insitu;
using Clock = std::chrono::steady_clock;
namespace fs = std::filesystem;

double secondsSince(Clock::time_point start)
{
    return std::chrono::duration<double>(Clock::now() - start).count();
}

bench::Stack readProjectStack(const fs::path& file)
{
    const Project project = readProject(file);
    std::vector<fs::path> files;
    std::vector<Exposure> exposures;
    for (const ProjectImage& image : project.light.probe->views.at(0).images) {
        files.push_back(image.path);
        exposures.push_back(image.exposure);
    }
    return {
        fs::absolute(file).parent_path().filename().string(), readBracket(files, exposures), {}};
}

/// White where a frame is left out, one picture a frame.
void writeMasks(const MovedPixels& moved, const bench::Stack& stack, const fs::path& folder)
{
    for (std::size_t k = 0; k < moved.masks.size(); ++k) {
        EncodedImage picture = stack.bracket.frames[k].image;
        const auto white = static_cast<std::uint16_t>(picture.max_code);
        for (std::size_t i = 0; i < picture.codes.pixelCount(); ++i)
            if (moved.masks[k].pixels()[i] != 0)
                picture.codes.pixels()[i] = glm::u16vec3(white, 0, white);
        writeEncoded(folder / fmt::format("{}_{}.png", stack.name, k), picture);
    }
}

void judge(const bench::Stack& stack, const fs::path& masks)
{
    auto start = Clock::now();
    const Alignment alignment = alignBracket(stack.bracket);
    const double align_seconds = secondsSince(start);
    std::size_t farthest = 0;
    int moved_frames = 0;
    std::string all;
    for (std::size_t k = 0; k < alignment.shift_px.size(); ++k) {
        if (alignment.shift_px[k] > alignment.shift_px[farthest]) farthest = k;
        moved_frames += alignment.frame_from_reference[k] != glm::dmat3(1.0) ? 1 : 0;
        all += fmt::format(" {:.2f}({:.2f})", alignment.shift_px[k], alignment.sigma_px[k]);
    }
    const ResponseRecovery recovery = recoverResponse(stack.bracket, {});
    Bracket corrected = stack.bracket;
    for (std::size_t k = 0; k < corrected.frames.size(); ++k)
        corrected.frames[k].relative_exposure *= recovery.exposure_scale[k];
    start = Clock::now();
    const MovedPixels moved = findMovedPixels(corrected, recovery.curve);
    fmt::print(
        "{:26} {:2} frames  {:5.2f} px ({:.2f})  {} moved, {:.2f} s   {:6.3f} % masked, {:.2f} s\n",
        stack.name,
        stack.bracket.frames.size(),
        alignment.shift_px[farthest],
        alignment.sigma_px[farthest],
        moved_frames,
        align_seconds,
        100.0 * moved.moved_fraction,
        secondsSince(start));
    fmt::print("  {}\n", all);
    if (!masks.empty()) writeMasks(moved, stack, masks);
}

}  // namespace

int main(int argc, char** argv)
{
    std::vector<fs::path> arguments(argv + 1, argv + argc);
    fs::path masks;
    if (arguments.size() >= 2 && arguments[0] == "--masks") {
        masks = arguments[1];
        fs::create_directories(masks);
        arguments.erase(arguments.begin(), arguments.begin() + 2);
    }
    if (arguments.empty()) {
        fmt::print(stderr, "usage: tripod_stacks [--masks FOLDER] DATA PROJECT...\n");
        return 2;
    }
    try {
        for (const bench::Stack& stack : bench::readStacks(arguments[0]))
            judge(stack, masks);
        for (std::size_t i = 1; i < arguments.size(); ++i)
            judge(readProjectStack(arguments[i]), masks);
    } catch (const std::exception& error) {
        fmt::print(stderr, "{}\n", error.what());
        return 1;
    }
    return 0;
}
