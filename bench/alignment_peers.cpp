// Aligning hand-held brackets, ours beside OpenCV's median threshold bitmaps and ECC: the same
// synthetic brackets, the error of the farthest corner in pixels and the seconds together.
//
// OpenCV's AlignMTB knows whole-pixel translations only; findTransformECC is started from our
// neighbour-wise search's place (the identity lies outside its reach) on 8-bit grey images, with
// the model that moved the camera.

#include "capture/alignment.h"
#include "tests/capture/handheld_scene.h"

#include <fmt/format.h>
#include <opencv2/photo.hpp>
#include <opencv2/video/tracking.hpp>

#include <chrono>
#include <cmath>
#include <cstdlib>
#include <exception>
#include <numbers>
#include <string>
#include <vector>

namespace {

using namespace insitu;
using Clock = std::chrono::steady_clock;

constexpr double kDegree = std::numbers::pi / 180.0;

double secondsSince(Clock::time_point start)
{
    return std::chrono::duration<double>(Clock::now() - start).count();
}

struct Case {
    std::string name;
    std::vector<glm::dmat3> frame_from_reference;
    double ev_step = 2.0;
    int ecc_motion = cv::MOTION_TRANSLATION;
};

struct Score {
    double error_px = 0.0;
    double seconds = 0.0;
    int failed = 0;
};

cv::Mat toMat(const EncodedImage& image)
{
    cv::Mat mat(image.codes.height(), image.codes.width(), CV_8UC3);
    for (int y = 0; y < mat.rows; ++y)
        for (int x = 0; x < mat.cols; ++x) {
            const glm::u16vec3 code = image.codes(x, y);
            mat.at<cv::Vec3b>(y, x) = cv::Vec3b(static_cast<std::uint8_t>(code.b),
                                                static_cast<std::uint8_t>(code.g),
                                                static_cast<std::uint8_t>(code.r));
        }
    return mat;
}

glm::dmat3 translation(double x, double y)
{
    glm::dmat3 m(1.0);
    m[2] = glm::dvec3(x, y, 1.0);
    return m;
}

void addError(Score& score,
              const glm::dmat3& found,
              const glm::dmat3& truth,
              const Bracket& bracket)
{
    const auto& codes = bracket.frames.front().image.codes;
    score.error_px =
        std::max(score.error_px, cornerError(found, truth, codes.width(), codes.height()));
}

Score judgeOurs(const Bracket& bracket, const Case& test, int reference)
{
    Score score;
    AlignmentOptions options;
    options.reference = reference;
    const auto start = Clock::now();
    const Alignment alignment = alignBracket(bracket, options);
    score.seconds = secondsSince(start);
    for (std::size_t k = 0; k < bracket.frames.size(); ++k)
        addError(score, alignment.frame_from_reference[k], test.frame_from_reference[k], bracket);
    for (const Finding& finding : alignment.findings)
        if (finding.severity == Severity::Warning) ++score.failed;
    return score;
}

Score judgeMtb(const Bracket& bracket, const Case& test, int reference)
{
    Score score;
    std::vector<cv::Mat> grey(bracket.frames.size());
    for (std::size_t k = 0; k < grey.size(); ++k)
        cv::cvtColor(toMat(bracket.frames[k].image), grey[k], cv::COLOR_BGR2GRAY);
    const auto start = Clock::now();
    const cv::Ptr<cv::AlignMTB> mtb = cv::createAlignMTB();
    std::vector<cv::Point> shifts(grey.size());
    for (std::size_t k = 0; k < grey.size(); ++k)
        shifts[k] = mtb->calculateShift(grey[static_cast<std::size_t>(reference)], grey[k]);
    score.seconds = secondsSince(start);
    for (std::size_t k = 0; k < grey.size(); ++k)
        addError(
            score, translation(-shifts[k].x, -shifts[k].y), test.frame_from_reference[k], bracket);
    return score;
}

/// Started from the truth rounded to 8 pixels: as good a start as a pyramid would give it.
Score judgeEcc(const Bracket& bracket, const Case& test, int reference)
{
    Score score;
    std::vector<cv::Mat> grey(bracket.frames.size());
    for (std::size_t k = 0; k < grey.size(); ++k)
        cv::cvtColor(toMat(bracket.frames[k].image), grey[k], cv::COLOR_BGR2GRAY);
    const auto start = Clock::now();
    for (std::size_t k = 0; k < grey.size(); ++k) {
        const glm::dmat3& truth = test.frame_from_reference[k];
        cv::Mat warp = cv::Mat::eye(test.ecc_motion == cv::MOTION_HOMOGRAPHY ? 3 : 2, 3, CV_32F);
        warp.at<float>(0, 2) = static_cast<float>(8.0 * std::round(truth[2].x / 8.0));
        warp.at<float>(1, 2) = static_cast<float>(8.0 * std::round(truth[2].y / 8.0));
        try {
            cv::findTransformECC(
                grey[static_cast<std::size_t>(reference)], grey[k], warp, test.ecc_motion);
        } catch (const cv::Exception&) {
            ++score.failed;
            continue;
        }
        glm::dmat3 found(1.0);
        for (int row = 0; row < warp.rows; ++row)
            for (int column = 0; column < 3; ++column)
                found[column][row] = warp.at<float>(row, column);
        // OpenCV's (0, 0) is a pixel's centre.
        addError(score, translation(0.5, 0.5) * found * translation(-0.5, -0.5), truth, bracket);
    }
    score.seconds = secondsSince(start);
    return score;
}

std::vector<Case> makeCases(int width, int height)
{
    const auto rigid = [&](double x, double y, double degrees) {
        return rigidMotion(width, height, {x, y}, degrees * kDegree);
    };
    const glm::dmat3 one(1.0);
    std::vector<Case> cases;
    cases.push_back({"static", {one, one, one, one, one}, 2.0, cv::MOTION_TRANSLATION});
    cases.push_back({"whole pixels",
                     {rigid(7, -4, 0), rigid(3, -2, 0), one, rigid(-5, 6, 0), rigid(-9, 12, 0)},
                     2.0,
                     cv::MOTION_TRANSLATION});
    cases.push_back(
        {"parts of pixels",
         {rigid(5.3, 2.6, 0), rigid(2.5, 1.5, 0), one, rigid(-2.4, 3.7, 0), rigid(-6.2, 5.1, 0)},
         2.0,
         cv::MOTION_TRANSLATION});
    cases.push_back(
        {"40 px",
         {rigid(40, 3.3, 0), rigid(20.4, 2, 0), one, rigid(-18.5, -3, 0), rigid(-39.6, -7.2, 0)},
         2.0,
         cv::MOTION_TRANSLATION});
    cases.push_back(
        {"2 degrees",
         {rigid(12, 5, 2), rigid(6.2, 3, 1), one, rigid(-7, 2, -1), rigid(-15, 4.5, -2)},
         2.0,
         cv::MOTION_EUCLIDEAN});
    const auto turned = [&](double x, double y, double z) {
        return turnedCamera(width, height, 0.9 * width, kDegree * glm::dvec3(x, y, z));
    };
    cases.push_back(
        {"turned camera",
         {turned(2, 1.5, 1), turned(1, 0.8, 0.5), one, turned(-1, 1, -0.4), turned(-1.5, 2, -1)},
         2.0,
         cv::MOTION_HOMOGRAPHY});
    cases.push_back(
        {"5 EV steps", {rigid(9.5, 6, 0.5), one, rigid(-7.3, 3, -0.5)}, 5.0, cv::MOTION_EUCLIDEAN});
    return cases;
}

void run(int width, int height, int seeds)
{
    fmt::print("{}x{}, {} seeds: worst corner error px / seconds a bracket / frames failed\n",
               width,
               height,
               seeds);
    fmt::print("{:16} {:>22} {:>22} {:>22}\n", "", "ours", "OpenCV MTB", "OpenCV ECC");
    for (const Case& test : makeCases(width, height)) {
        Score ours;
        Score mtb;
        Score ecc;
        const auto add = [&](Score& to, const Score& one) {
            to.error_px = std::max(to.error_px, one.error_px);
            to.seconds += one.seconds / seeds;
            to.failed += one.failed;
        };
        const auto count = static_cast<int>(test.frame_from_reference.size());
        const int reference = count / 2;
        for (int seed = 1; seed <= seeds; ++seed) {
            std::vector<double> exposures;
            for (int k = 0; k < count; ++k)
                exposures.push_back(4.0 * std::exp2(-test.ev_step * (k - reference)));
            const Bracket bracket =
                photographHandheld(RectangleScene(width, height, static_cast<std::uint64_t>(seed)),
                                   width,
                                   height,
                                   test.frame_from_reference,
                                   exposures,
                                   contrastyCamera(static_cast<std::uint64_t>(seed)));
            add(ours, judgeOurs(bracket, test, reference));
            add(mtb, judgeMtb(bracket, test, reference));
            add(ecc, judgeEcc(bracket, test, reference));
        }
        fmt::print("{:16}", test.name);
        for (const Score& score : {ours, mtb, ecc})
            fmt::print("  {:8.3f} {:7.3f} s {:2d}", score.error_px, score.seconds, score.failed);
        fmt::print("\n");
    }
}

}  // namespace

int main(int argc, char** argv)
{
    const int width = argc > 1 ? std::atoi(argv[1]) : 640;
    const int seeds = argc > 2 ? std::atoi(argv[2]) : 2;
    if (width < 64 || seeds < 1) {
        fmt::print(stderr, "usage: alignment_peers [WIDTH [SEEDS]]\n");
        return 2;
    }
    try {
        run(width, width * 2 / 3, seeds);
    } catch (const std::exception& error) {
        fmt::print(stderr, "{}\n", error.what());
        return 1;
    }
    return 0;
}
