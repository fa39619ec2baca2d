#include "capture/deghost.h"

#include "capture/frame_comparison.h"
#include "capture/matched_pyramid.h"
#include "core/check.h"
#include "core/parallel.h"

#include <fmt/format.h>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <cmath>
#include <utility>

namespace insitu {

namespace {

using detail::FrameComparison;
using Mask = Image<std::uint8_t>;

/// More than half of a window of this side must disagree for a region to start there: noise alone
/// never does, and misplaced outlines are thinner.
constexpr int kWindow = 5;
/// Another frame takes the place of the reference in a region when its agreement with the others
/// is greater by this share of all comparisons.
constexpr double kVoteMargin = 0.05;
/// A frame that may be believed in a region measures at least this share of it.
constexpr double kLeastGoodShare = 0.8;

/// The mask's own memory.
cv::Mat asMat(Mask& mask)
{
    return {mask.height(), mask.width(), CV_8U, mask.pixels().data()};
}

void grow(Mask& mask, int radius)
{
    if (radius == 0) return;
    const int side = 2 * radius + 1;
    cv::Mat mat = asMat(mask);
    cv::dilate(mat, mat, cv::getStructuringElement(cv::MORPH_ELLIPSE, {side, side}));
}

/// Keeps what is connected with a place where most of a window is set, and is large enough.
void keepRegions(Mask& mask, int min_region_px)
{
    cv::Mat mat = asMat(mask);
    cv::Mat share;
    cv::boxFilter(mat, share, CV_32F, {kWindow, kWindow}, {-1, -1}, false, cv::BORDER_CONSTANT);
    cv::Mat labels;
    cv::Mat stats;
    cv::Mat centroids;
    const int count = cv::connectedComponentsWithStats(mat, labels, stats, centroids, 8, CV_32S);
    std::vector<char> dense(static_cast<std::size_t>(count), 0);
    for (int y = 0; y < mat.rows; ++y)
        for (int x = 0; x < mat.cols; ++x)
            if (mat.at<std::uint8_t>(y, x) != 0 && 2.0f * share.at<float>(y, x) > kWindow * kWindow)
                dense[static_cast<std::size_t>(labels.at<int>(y, x))] = 1;
    for (int y = 0; y < mat.rows; ++y) {
        for (int x = 0; x < mat.cols; ++x) {
            const int label = labels.at<int>(y, x);
            const bool keep = label != 0 && dense[static_cast<std::size_t>(label)] != 0 &&
                              stats.at<int>(label, cv::CC_STAT_AREA) >= min_region_px;
            mat.at<std::uint8_t>(y, x) = keep ? 1 : 0;
        }
    }
    // Holes in a region belong to it: a shirt may have the wall's colour in places.
    const int side = 2 * kWindow + 1;
    cv::morphologyEx(
        mat, mat, cv::MORPH_CLOSE, cv::getStructuringElement(cv::MORPH_ELLIPSE, {side, side}));
}

/// A connected region that disagrees in some frame.
using Region = std::vector<glm::ivec2>;

std::vector<Region> regionsOf(const std::vector<Mask>& masks)
{
    Mask any = masks.front();
    for (const Mask& mask : masks)
        for (std::size_t i = 0; i < mask.pixelCount(); ++i)
            any.pixels()[i] |= mask.pixels()[i];
    cv::Mat labels;
    const int count = cv::connectedComponents(asMat(any), labels, 8, CV_32S);
    std::vector<Region> regions(static_cast<std::size_t>(count - 1));
    for (int y = 0; y < labels.rows; ++y)
        for (int x = 0; x < labels.cols; ++x)
            if (const int label = labels.at<int>(y, x); label != 0)
                regions[static_cast<std::size_t>(label - 1)].emplace_back(x, y);
    return regions;
}

class Deghoster {
public:
    Deghoster(const Bracket& bracket, const ResponseCurve& response, const DeghostOptions& options)
        : options_(options),
          comparison_(bracket, response, options),
          count_(static_cast<int>(bracket.frames.size())),
          width_(bracket.frames.front().image.codes.width()),
          height_(bracket.frames.front().image.codes.height()),
          best_(detail::bestExposedFrame(bracket)),
          believed_(width_, height_)
    {
        believeBestExposed();
    }

    std::vector<Mask> masks()
    {
        std::vector<Mask> result = disagreement();
        bool changed = false;
        for (const Region& region : regionsOf(result))
            changed = vote(region) || changed;
        if (changed) result = disagreement();
        for (int k = 0; k < count_; ++k) {
            Mask& mask = result[static_cast<std::size_t>(k)];
            grow(mask, options_.grow_px);
            // The frame that is believed stays, so that never the last measurement goes.
            for (std::size_t i = 0; i < mask.pixelCount(); ++i)
                if (believed_.pixels()[i] == k) mask.pixels()[i] = 0;
        }
        return result;
    }

private:
    void believeBestExposed()
    {
        std::vector<int> order{best_};
        for (int distance = 1; distance < count_; ++distance)
            for (const int k : {best_ + distance, best_ - distance})
                if (k >= 0 && k < count_) order.push_back(k);
        parallelFor(0, height_, [&](std::int64_t row) {
            const int y = static_cast<int>(row);
            for (int x = 0; x < width_; ++x) {
                const auto good =
                    std::ranges::find_if(order, [&](int k) { return comparison_.isGood(k, x, y); });
                believed_(x, y) = good == order.end() ? best_ : *good;
            }
        });
    }

    /// Per frame the cleaned mask of where it disagrees with the frame that is believed.
    [[nodiscard]] std::vector<Mask> disagreement() const
    {
        std::vector<Mask> masks(static_cast<std::size_t>(count_), Mask(width_, height_));
        parallelFor(0, height_, [&](std::int64_t row) {
            const int y = static_cast<int>(row);
            for (int x = 0; x < width_; ++x) {
                const int j = believed_(x, y);
                for (int k = 0; k < count_; ++k)
                    if (k != j && comparison_.disagree(k, j, x, y))
                        masks[static_cast<std::size_t>(k)](x, y) = 1;
            }
        });
        parallelFor(0, count_, [&](std::int64_t k) {
            keepRegions(masks[static_cast<std::size_t>(k)], options_.min_region_px);
        });
        return masks;
    }

    /// Agreements less disagreements of frame j with the others where both measure, per pixel.
    [[nodiscard]] double agreementOf(int j, const Region& region) const
    {
        std::int64_t sum = 0;
        for (const glm::ivec2 p : region) {
            if (!comparison_.isGood(j, p.x, p.y)) continue;
            for (int k = 0; k < count_; ++k) {
                if (k == j) continue;
                if (comparison_.disagree(k, j, p.x, p.y))
                    --sum;
                else if (comparison_.isGood(k, p.x, p.y))
                    ++sum;
            }
        }
        return static_cast<double>(sum) / static_cast<double>(region.size());
    }

    /// Believes another frame in the region if most others do; true when it changes something.
    bool vote(const Region& region)
    {
        std::vector<double> agreement(static_cast<std::size_t>(count_));
        parallelFor(0, count_, [&](std::int64_t j) {
            const auto frame = static_cast<int>(j);
            const auto good = std::ranges::count_if(
                region, [&](glm::ivec2 p) { return comparison_.isGood(frame, p.x, p.y); });
            const bool eligible =
                static_cast<double>(good) >= kLeastGoodShare * static_cast<double>(region.size());
            agreement[static_cast<std::size_t>(j)] =
                eligible ? agreementOf(frame, region) : -static_cast<double>(count_);
        });
        const auto winner = std::ranges::max_element(agreement);
        const double margin = kVoteMargin * (count_ - 1);
        const auto best = static_cast<std::size_t>(best_);
        if (*winner <= -count_ || *winner < agreement[best] + margin) return false;
        const auto frame = static_cast<int>(winner - agreement.begin());
        for (const glm::ivec2 p : region)
            if (comparison_.isGood(frame, p.x, p.y)) believed_(p.x, p.y) = frame;
        return true;
    }

    DeghostOptions options_;
    FrameComparison comparison_;
    int count_;
    int width_;
    int height_;
    int best_;
    Image<int> believed_;  ///< per pixel the frame that the others are held against
};

void report(const Bracket& bracket, MovedPixels& moved)
{
    const std::size_t all = moved.masks.front().pixelCount();
    std::vector<std::uint8_t> any(all, 0);
    std::string frames;
    for (std::size_t k = 0; k < moved.masks.size(); ++k) {
        std::size_t here = 0;
        for (std::size_t i = 0; i < all; ++i) {
            here += moved.masks[k].pixels()[i];
            any[i] |= moved.masks[k].pixels()[i];
        }
        if (here > 0)
            frames += fmt::format("{}{} {:.2g} %",
                                  frames.empty() ? "" : ", ",
                                  bracket.frames[k].name,
                                  100.0 * static_cast<double>(here) / static_cast<double>(all));
    }
    const auto pixels = std::ranges::count(any, std::uint8_t{1});
    moved.moved_fraction = static_cast<double>(pixels) / static_cast<double>(all);
    if (pixels > 0)
        moved.findings.push_back(
            {Severity::Info,
             "bracket-ghosts-removed",
             fmt::format("something moved between the exposures in {:.2g} % of the picture; there "
                         "only what agrees is used (left out: {})",
                         100.0 * moved.moved_fraction,
                         frames)});
}

}  // namespace

Findings DeghostOptions::validate() const
{
    Findings findings;
    const auto check = [&](bool good, const char* name, double value, const char* range) {
        if (!good)
            findings.push_back({Severity::Error,
                                "deghost-options",
                                fmt::format("{} is {}, must be {}", name, value, range)});
    };
    check(sigmas > 0.0 && std::isfinite(sigmas), "sigmas", sigmas, "above 0");
    check(tolerance > 0.0 && tolerance < 1.0, "tolerance", tolerance, "between 0 and 1");
    check(min_region_px >= 1, "min_region_px", min_region_px, "at least 1");
    check(grow_px >= 0 && grow_px <= 100, "grow_px", grow_px, "between 0 and 100");
    return findings;
}

MovedPixels findMovedPixels(const Bracket& bracket,
                            const ResponseCurve& response,
                            const DeghostOptions& options)
{
    const Findings problems = options.validate();
    if (!problems.empty()) throw InputError("deghost options", problems.front().message);
    INSITU_CHECK(!bracket.frames.empty(), "empty bracket");
    MovedPixels moved;
    if (bracket.frames.size() == 1) {
        const Image<glm::u16vec3>& codes = bracket.frames.front().image.codes;
        moved.masks.emplace_back(codes.width(), codes.height());
        return moved;
    }
    moved.masks = Deghoster(bracket, response, options).masks();
    report(bracket, moved);
    return moved;
}

}  // namespace insitu
