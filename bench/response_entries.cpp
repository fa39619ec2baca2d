#include "bench/response_entries.h"

#include "capture/response_recovery.h"
#include "core/check.h"
#include "core/io/image_io.h"

#include <fmt/format.h>
#include <opencv2/core.hpp>
#include <opencv2/photo.hpp>
#include <unistd.h>

#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>

namespace insitu::bench {

namespace {

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
    const fs::path folder =
        fs::temp_directory_path() / fmt::format("insitu_response_peers_{}", ::getpid());
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
    fs::remove_all(folder);
    return entry;
}

}  // namespace

std::vector<Entry> recoverWithAll(const Bracket& bracket)
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

}  // namespace insitu::bench
