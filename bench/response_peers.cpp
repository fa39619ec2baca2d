// Response recovery beside its peers, in one process: error and seconds together.
//
//   response_peers synthetic ENVIRONMENT.exr...   brackets of a known response: RMS error in EV
//   response_peers held-out DATA_FOLDER           real brackets: predicted codes of held-out frames
//
// Peers: OpenCV's CalibrateDebevec (70 and 300 samples) and CalibrateRobertson, and, when
// `pfshdrcalibrate` is on the PATH, pfstools' Robertson.

#include "capture/held_out.h"
#include "capture/response_recovery.h"
#include "core/check.h"
#include "core/io/image_io.h"
#include "core/random.h"

#include <fmt/format.h>
#include <opencv2/core.hpp>
#include <opencv2/photo.hpp>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <functional>
#include <limits>
#include <string>
#include <vector>

namespace {

using namespace insitu;
namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

constexpr std::array kMethods = {ResponseMethod::Auto,
                                 ResponseMethod::Debevec,
                                 ResponseMethod::Mitsunaga,
                                 ResponseMethod::Robertson,
                                 ResponseMethod::Basis};

double secondsSince(Clock::time_point start)
{
    return std::chrono::duration<double>(Clock::now() - start).count();
}

/// One method's curve of one bracket.
struct Entry {
    std::string name;
    ResponseCurve curve;
    std::vector<double> scale;  ///< of the exposures, empty: as given
    double seconds = 0.0;
    std::string note;
};

/// What OpenCV wants.
struct OpenCvBracket {
    std::vector<cv::Mat> images;
    std::vector<float> seconds;
};

OpenCvBracket toOpenCv(const Bracket& bracket)
{
    OpenCvBracket result;
    for (const BracketFrame& frame : bracket.frames) {
        const auto& codes = frame.image.codes;
        cv::Mat image(codes.height(), codes.width(), CV_8UC3);
        for (int y = 0; y < codes.height(); ++y)
            for (int x = 0; x < codes.width(); ++x)
                for (int c = 0; c < 3; ++c)
                    image.at<cv::Vec3b>(y, x)[c] = cv::saturate_cast<uchar>(codes(x, y)[c]);
        result.images.push_back(image);
        result.seconds.push_back(static_cast<float>(frame.relative_exposure));
    }
    return result;
}

ResponseCurve fromOpenCv(const cv::Mat& table)
{
    ResponseCurve curve;
    for (int z = 0; z < 256; ++z)
        for (int c = 0; c < 3; ++c)
            curve.exposure[static_cast<std::size_t>(c)][static_cast<std::size_t>(z)] =
                static_cast<double>(table.at<cv::Vec3f>(z)[c]);
    return curve;
}

/// pfstools' Robertson on the same frames, as a subprocess; an empty curve when it is not
/// installed.
Entry runPfstools(const Bracket& bracket)
{
    Entry entry{"pfshdrcalibrate robertson", {}, {}, 0.0, "not installed"};
    if (std::system("command -v pfshdrcalibrate > /dev/null 2>&1") != 0) return entry;
    const fs::path folder = fs::temp_directory_path() / "insitu_response_peers";
    fs::create_directories(folder);
    std::string list;
    for (std::size_t k = 0; k < bracket.frames.size(); ++k) {
        const fs::path file = folder / fmt::format("frame_{:02}.png", k);
        writeEncoded(file, bracket.frames[k].image);
        list += fmt::format(
            "{} {} 8 100 0\n", file.string(), 1.0 / bracket.frames[k].relative_exposure);
    }
    std::FILE* out = std::fopen((folder / "list.hdrgen").c_str(), "w");
    INSITU_CHECK(out != nullptr, "no temporary file");
    std::fputs(list.c_str(), out);
    std::fclose(out);
    const std::string command = fmt::format(
        "cd {0} && pfsinhdrgen list.hdrgen | pfshdrcalibrate -c robertson -b 8 -s curve.m "
        "> /dev/null 2> /dev/null",
        folder.string());
    const auto start = Clock::now();
    const int failed = std::system(command.c_str());
    entry.seconds = secondsSince(start);
    std::FILE* in = failed != 0 ? nullptr : std::fopen((folder / "curve.m").c_str(), "r");
    entry.note = in == nullptr ? "failed" : "";
    // Octave matrices of rows "log10(exposure) code exposure", by channel.
    std::array<char, 256> line{};
    std::size_t channel = 0;
    std::size_t code = 0;
    while (in != nullptr && std::fgets(line.data(), line.size(), in) != nullptr) {
        double log_exposure = 0.0;
        double number = 0.0;
        double exposure = 0.0;
        if (std::sscanf(line.data(), "%lf %lf %lf", &log_exposure, &number, &exposure) < 2)
            continue;
        if (channel < 3 && code < 256)
            entry.curve.exposure[channel][code] = std::pow(10.0, log_exposure);
        if (++code == 256) {
            code = 0;
            ++channel;
        }
    }
    if (in != nullptr) std::fclose(in);
    return entry;
}

std::vector<Entry> runAll(const Bracket& bracket)
{
    std::vector<Entry> entries;
    for (const ResponseMethod method : kMethods) {
        ResponseOptions options;
        options.method = method;
        const auto start = Clock::now();
        ResponseRecovery recovery = recoverResponse(bracket, options);
        Entry entry{fmt::format("insitu {}", responseMethodName(method)),
                    std::move(recovery.curve),
                    std::move(recovery.exposure_scale),
                    secondsSince(start),
                    {}};
        if (recovery.method != method)
            entry.note = fmt::format("-> {}", responseMethodName(recovery.method));
        for (const Finding& finding : recovery.findings)
            if (finding.code != "response-method-chosen") entry.note += " " + finding.code;
        entries.push_back(std::move(entry));
    }
    const OpenCvBracket opencv = toOpenCv(bracket);
    const auto run = [&](const std::string& name, const auto& calibrate) {
        cv::Mat table;
        const auto start = Clock::now();
        calibrate->process(opencv.images, table, opencv.seconds);
        entries.push_back({name, fromOpenCv(table), {}, secondsSince(start), {}});
    };
    run("opencv debevec 70", cv::createCalibrateDebevec(70));
    run("opencv debevec 300", cv::createCalibrateDebevec(300));
    run("opencv robertson", cv::createCalibrateRobertson());
    entries.push_back(runPfstools(bracket));
    return entries;
}

// ---- synthetic brackets ------------------------------------------------------------------------

/// Exposure in [0, 1] -> code / 255, by channel.
using Response = std::function<double(std::size_t, double)>;
struct NamedResponse {
    const char* name;
    Response curve;
};

/// S-shaped, each channel its own.
std::vector<NamedResponse> responses()
{
    return {
        {"gamma and contrast",
         [](std::size_t c, double e) {
             const double y = std::pow(e, 0.42 + 0.03 * static_cast<double>(c));
             const double k = 0.45 + 0.1 * static_cast<double>(c);
             return y + k * y * (1.0 - y) * (2.0 * y - 1.0);
         }},
        {"sigmoid of ln exposure",
         [](std::size_t c, double e) {
             const double power = std::pow(e, 0.85 + 0.05 * static_cast<double>(c));
             const double half = std::pow(0.16 + 0.03 * static_cast<double>(c),
                                          0.85 + 0.05 * static_cast<double>(c));
             return std::pow(power / (power + half) * (1.0 + half), 0.85);
         }},
        {"filmic, a long toe",  // J. Hable's curve
         [](std::size_t c, double e) {
             const auto curve = [](double x) {
                 constexpr double kToe = 0.01 / 0.30;
                 return (x * (0.22 * x + 0.03) + 0.002) / (x * (0.22 * x + 0.3) + 0.06) - kToe;
             };
             const double white = 8.0 + 2.0 * static_cast<double>(c);
             return std::pow(std::max(curve(white * e), 0.0) / curve(white),
                             0.5 + 0.03 * static_cast<double>(c));
         }},
        {"toe and shoulder of a film",
         [](std::size_t c, double e) {
             const double t = 2.0 + 0.5 * static_cast<double>(c);
             const double y = (1.0 - std::exp(-t * std::pow(e, 0.6))) / (1.0 - std::exp(-t));
             return 0.35 * y * y * (3.0 - 2.0 * y) + 0.65 * y;
         }},
    };
}

struct Sensor {
    double full_well = 60'000.0;  ///< electrons
    double read_noise = 3.0;      ///< electrons
};

constexpr int kFrames = 11;

/// 11 exposures 1 EV apart; the middle one shows the median at 18 % of full scale.
Bracket photograph(const Image<Rgb>& scene,
                   const Response& response,
                   Sensor sensor,
                   std::uint64_t seed)
{
    std::vector<float> green;
    for (const Rgb pixel : scene.pixels())
        green.push_back(pixel.g);
    std::ranges::nth_element(green, green.begin() + green.size() / 2);
    const double middle = 0.18 / static_cast<double>(green[green.size() / 2]);
    constexpr std::size_t kSteps = 1 << 18;
    std::array<std::vector<double>, 3> code;  // of exposure squared: fine where curves are steep
    for (std::size_t c = 0; c < 3; ++c)
        for (std::size_t i = 0; i <= kSteps; ++i)
            code[c].push_back(
                255.0 *
                response(c, std::pow(static_cast<double>(i) / static_cast<double>(kSteps), 2)));
    std::vector<BracketFrame> frames;
    for (int k = 0; k < kFrames; ++k) {
        BracketFrame frame;
        frame.name = fmt::format("frame_{}", k);
        frame.relative_exposure = middle * std::pow(2.0, kFrames / 2 - k);
        frame.image.codes = Image<glm::u16vec3>(scene.width(), scene.height());
        for (int y = 0; y < scene.height(); ++y) {
            RandomStream random(seed, static_cast<std::uint64_t>(y), static_cast<std::uint64_t>(k));
            for (int x = 0; x < scene.width(); ++x) {
                for (int c = 0; c < 3; ++c) {
                    const double electrons = static_cast<double>(scene(x, y)[c]) *
                                             frame.relative_exposure * sensor.full_well;
                    const double noise =
                        random.normal() *
                        std::sqrt(electrons + sensor.read_noise * sensor.read_noise);
                    const double e = std::clamp((electrons + noise) / sensor.full_well, 0.0, 1.0);
                    const double place = std::sqrt(e) * static_cast<double>(kSteps);
                    frame.image.codes(x, y)[c] = static_cast<std::uint16_t>(
                        std::lround(code[static_cast<std::size_t>(c)]
                                        [static_cast<std::size_t>(std::lround(place))]));
                }
            }
        }
        frames.push_back(std::move(frame));
    }
    return makeBracket(std::move(frames));
}

/// RMS over codes 5 to 250 of the curve's error in EV, after one scale.
double errorEv(const ResponseCurve& curve, const Response& response, std::size_t channel)
{
    double sum = 0.0;
    double squares = 0.0;
    double count = 0.0;
    for (std::size_t z = 5; z <= 250; ++z) {
        double low = 0.0;
        double high = 1.0;
        for (int i = 0; i < 60; ++i) {
            const double half = 0.5 * (low + high);
            (response(channel, half) * 255.0 < static_cast<double>(z) ? low : high) = half;
        }
        const double value = curve.exposure[channel][z];
        if (!(value > 0.0)) return std::numeric_limits<double>::infinity();
        const double e = std::log2(value / high);
        sum += e;
        squares += e * e;
        count += 1.0;
    }
    return std::sqrt(std::max(squares / count - sum * sum / (count * count), 0.0));
}

/// The Cramér–Rao bound of a free table, were all radiances known: Poisson, read noise and
/// rounding, by all pixels that show a code. RMS over codes 5 to 250, EV, the worst channel.
/// Unknown radiances make it harder; a smooth curve, for which neighbouring codes speak too, may be
/// below it.
double knownRadianceBound(const Bracket& bracket, const Response& response, Sensor sensor)
{
    double worst = 0.0;
    for (std::size_t c = 0; c < 3; ++c) {
        std::array<double, 256> seen{};
        for (const BracketFrame& frame : bracket.frames)
            for (const glm::u16vec3 codes : frame.image.codes.pixels())
                seen[codes[static_cast<int>(c)]] += 1.0;
        double sum = 0.0;
        for (std::size_t z = 5; z <= 250; ++z) {
            std::array<double, 3> e{};  // exposures of z - 1/2, z, z + 1/2
            for (std::size_t i = 0; i < 3; ++i) {
                double low = 0.0;
                double high = 1.0;
                const double target = static_cast<double>(z) + 0.5 * static_cast<double>(i) - 0.5;
                for (int j = 0; j < 60; ++j) {
                    const double half = 0.5 * (low + high);
                    (response(c, half) * 255.0 < target ? low : high) = half;
                }
                e[i] = high;
            }
            const double electrons = e[1] * sensor.full_well;
            const double relative =
                (electrons + sensor.read_noise * sensor.read_noise) / (electrons * electrons) +
                std::pow((e[2] - e[0]) / e[1], 2) / 12.0;
            sum += relative / std::max(seen[z], 1.0);
        }
        worst = std::max(worst, std::sqrt(sum / 246.0) / std::log(2.0));
    }
    return worst;
}

void runSynthetic(const std::vector<fs::path>& environments)
{
    const std::array sensors = {Sensor{60'000.0, 3.0}, Sensor{16'000.0, 4.0}};
    for (const fs::path& path : environments) {
        const Image<Rgb> scene = readRadiance(path).pixels;
        for (const NamedResponse& response : responses()) {
            for (std::size_t s = 0; s < sensors.size(); ++s) {
                const Sensor sensor = sensors[s];
                const Bracket bracket = photograph(scene, response.curve, sensor, 7 + s);
                fmt::print(
                    "{}, {}, full well {:.0f} e, read noise {:.0f} e; bound with known "
                    "radiances {:.5f} EV\n",
                    path.stem().string(),
                    response.name,
                    sensor.full_well,
                    sensor.read_noise,
                    knownRadianceBound(bracket, response.curve, sensor));
                for (const Entry& entry : runAll(bracket)) {
                    if (entry.curve.exposure[0][128] == 0.0) {
                        fmt::print("  {:<26} {}\n", entry.name, entry.note);
                        continue;
                    }
                    std::array<double, 3> errors{};
                    for (std::size_t c = 0; c < 3; ++c)
                        errors[c] = errorEv(entry.curve, response.curve, c);
                    fmt::print("  {:<26} {:.5f} EV RMS worst ({:.5f} {:.5f} {:.5f}) {:6.3f} s {}\n",
                               entry.name,
                               *std::ranges::max_element(errors),
                               errors[0],
                               errors[1],
                               errors[2],
                               entry.seconds,
                               entry.note);
                }
            }
        }
    }
}

// ---- real brackets -----------------------------------------------------------------------------

struct Stack {
    std::string name;
    Bracket bracket;
    Image<std::uint8_t> mask;
};

BracketFrame readFrame(const fs::path& file, double seconds)
{
    BracketFrame frame;
    frame.name = file.filename().string();
    frame.image = readPhoto(file).image;
    frame.relative_exposure = seconds;
    return frame;
}

/// The pure blue border of shifted frames is no picture: masked, and a margin around it.
Stack readMemorial(const fs::path& data)
{
    Stack stack{"memorial16", {}, {}};
    std::vector<BracketFrame> frames;
    for (int k = 0; k < 16; ++k)
        frames.push_back(
            readFrame(data / fmt::format("brackets/memorial16/memorial00{}.png", 61 + k),
                      32.0 * std::pow(0.5, k)));
    const int width = frames.front().image.codes.width();
    const int height = frames.front().image.codes.height();
    // Only the rectangle that no frame's border touches: the methods are to see no border either.
    int left = 0;
    int right = width;
    int top = 0;
    int bottom = height;
    for (const BracketFrame& frame : frames) {
        const auto blue = [&](int x, int y) {
            const glm::u16vec3 p = frame.image.codes(x, y);
            return p.b > 250 && p.r < 5 && p.g < 5;
        };
        while (left < width / 3 && blue(left, height / 2))
            ++left;
        while (right > 2 * width / 3 && blue(right - 1, height / 2))
            --right;
        while (top < height / 3 && blue(width / 2, top))
            ++top;
        while (bottom > 2 * height / 3 && blue(width / 2, bottom - 1))
            --bottom;
    }
    constexpr int kMargin = 8;
    left += kMargin;
    top += kMargin;
    right -= kMargin;
    bottom -= kMargin;
    for (BracketFrame& frame : frames) {
        Image<glm::u16vec3> inner(right - left, bottom - top);
        for (int y = top; y < bottom; ++y)
            for (int x = left; x < right; ++x)
                inner(x - left, y - top) = frame.image.codes(x, y);
        frame.image.codes = std::move(inner);
    }
    stack.bracket = makeBracket(std::move(frames));
    return stack;
}

Stack readDesk(const fs::path& data)
{
    Stack stack{"piccante_desk_room", {}, {}};
    std::vector<fs::path> files;
    for (int k = 0; k < 7; ++k)
        files.push_back(data / fmt::format("brackets/piccante_desk_room/stack_room_exp_{}.jpg", k));
    stack.bracket = readBracket(files);
    return stack;
}

/// The ball cut from the full frames, the same pixels in each.
Stack readMeetingRoom(const fs::path& data)
{
    constexpr int kLeft = 3159 - 760;
    constexpr int kTop = 1833 - 760;
    constexpr int kSide = 1520;
    Stack stack{"ball_xuyiwen_meetingroom", {}, {}};
    std::vector<BracketFrame> frames;
    for (const int t : {20, 40, 80, 160, 250, 320, 3200, 4000}) {
        BracketFrame frame =
            readFrame(data / fmt::format("brackets/ball_xuyiwen_meetingroom/t{}.jpg", t), 1.0 / t);
        Image<glm::u16vec3> ball(kSide, kSide);
        for (int y = 0; y < kSide; ++y)
            for (int x = 0; x < kSide; ++x)
                ball(x, y) = frame.image.codes(kLeft + x, kTop + y);
        frame.image.codes = std::move(ball);
        frames.push_back(std::move(frame));
    }
    stack.bracket = makeBracket(std::move(frames));
    return stack;
}

void runHeldOut(const fs::path& data)
{
    for (const auto& read : {readMemorial, readDesk, readMeetingRoom}) {
        const Stack stack = read(data);
        fmt::print("{}, {} frames, {}x{}: mean error of predicted codes\n",
                   stack.name,
                   stack.bracket.frames.size(),
                   stack.bracket.frames.front().image.codes.width(),
                   stack.bracket.frames.front().image.codes.height());
        for (const Entry& entry : runAll(stack.bracket)) {
            if (entry.curve.exposure[0][128] == 0.0) {
                fmt::print("  {:<26} {}\n", entry.name, entry.note);
                continue;
            }
            HeldOutOptions options;
            options.mask = stack.mask;
            const double given = predictHeldOut(stack.bracket, entry.curve, options).mean_codes;
            options.exposure_scale = entry.scale;
            const HeldOutError error = predictHeldOut(stack.bracket, entry.curve, options);
            fmt::print(
                "  {:<26} {:.3f} codes ({:.3f} with the exposures as given), {} predictions, "
                "{:6.3f} s {}\n",
                entry.name,
                error.mean_codes,
                given,
                error.count,
                entry.seconds,
                entry.note);
        }
    }
}

}  // namespace

int main(int argc, char** argv)
{
    const std::string what = argc > 2 ? argv[1] : "";
    if (what != "synthetic" && what != "held-out") {
        fmt::print(stderr,
                   "usage: response_peers synthetic ENVIRONMENT.exr... | held-out DATA_FOLDER\n");
        return 2;
    }
    try {
        if (what == "synthetic")
            runSynthetic({argv + 2, argv + argc});
        else
            runHeldOut(argv[2]);
    } catch (const std::exception& error) {
        fmt::print(stderr, "{}\n", error.what());
        return 1;
    }
    return 0;
}
