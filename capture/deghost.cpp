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
/// A frame takes another one's place in a region when it agrees with so many more frames, a pixel.
constexpr double kVoteMargin = 0.05;

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
}

/// Holes in a region belong to it: a shirt may have the wall's colour in places.
void fillHoles(Mask& mask)
{
    const int side = 2 * kWindow + 1;
    cv::Mat mat = asMat(mask);
    cv::morphologyEx(
        mat, mat, cv::MORPH_CLOSE, cv::getStructuringElement(cv::MORPH_ELLIPSE, {side, side}));
}

/// A connected region in which the believed frame is in doubt.
using Region = std::vector<glm::ivec2>;

std::vector<Region> regionsOf(Mask& mask)
{
    cv::Mat labels;
    const int count = cv::connectedComponents(asMat(mask), labels, 8, CV_32S);
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
        Mask doubted = outvoted(result);
        for (const Region& region : regionsOf(doubted))
            changed = vote(region) || changed;
        if (changed) result = disagreement();
        for (Mask& mask : result) {
            fillHoles(mask);
            grow(mask, options_.grow_px);
        }
        keepOne(result);
        return result;
    }

private:
    void believeBestExposed()
    {
        // Where it is black the frames exposed more come first, else those exposed less.
        const auto orderFrom = [&](bool longer_first) {
            std::vector<int> order{best_};
            for (int distance = 1; distance < count_; ++distance)
                for (const int sign : {1, -1})
                    if (const int k = best_ + (longer_first ? -sign : sign) * distance;
                        k >= 0 && k < count_)
                        order.push_back(k);
            return order;
        };
        const std::vector<int> when_clipped = orderFrom(false);
        const std::vector<int> when_black = orderFrom(true);
        parallelFor(0, height_, [&](std::int64_t row) {
            const int y = static_cast<int>(row);
            for (int x = 0; x < width_; ++x) {
                const std::vector<int>& order =
                    comparison_.isClipped(best_, x, y) ? when_clipped : when_black;
                const auto good =
                    std::ranges::find_if(order, [&](int k) { return comparison_.isGood(k, x, y); });
                believed_(x, y) = good == order.end() ? best_ : *good;
            }
        });
    }

    /// Where growing has left no frame that measures anything, the believed one stays.
    void keepOne(std::vector<Mask>& masks) const
    {
        parallelFor(0, height_, [&](std::int64_t row) {
            const int y = static_cast<int>(row);
            for (int x = 0; x < width_; ++x) {
                Mask& believed = masks[static_cast<std::size_t>(believed_(x, y))];
                if (believed(x, y) == 0) continue;
                bool other = false;
                for (int k = 0; k < count_; ++k)
                    other = other || (masks[static_cast<std::size_t>(k)](x, y) == 0 &&
                                      comparison_.isGood(k, x, y));
                if (!other) believed(x, y) = 0;
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

    /// Where more frames disagree with the believed one than agree: who stood there was in it.
    [[nodiscard]] Mask outvoted(const std::vector<Mask>& masks) const
    {
        Mask result(width_, height_);
        parallelFor(0, height_, [&](std::int64_t row) {
            const int y = static_cast<int>(row);
            for (int x = 0; x < width_; ++x) {
                int against = 0;
                int with = 0;
                for (int k = 0; k < count_; ++k) {
                    if (k == believed_(x, y)) continue;
                    if (masks[static_cast<std::size_t>(k)](x, y) != 0)
                        ++against;
                    else if (comparison_.isGood(k, x, y))
                        ++with;
                }
                result(x, y) = against >= 2 && against > with ? 1 : 0;
            }
        });
        keepRegions(result, options_.min_region_px);
        fillHoles(result);
        return result;
    }

    /// How well frame j fits the others in a region, per pixel. Where it is clipped, that one
    /// exposed more is so too is what it foretells; that one exposed less is, agrees but says less.
    [[nodiscard]] double agreementOf(int j, const Region& region) const
    {
        std::int64_t halves = 0;
        for (const glm::ivec2 p : region) {
            const bool good = comparison_.isGood(j, p.x, p.y);
            const bool clipped = comparison_.isClipped(j, p.x, p.y);
            for (int k = 0; k < count_; ++k) {
                if (k == j) continue;
                if (comparison_.disagree(k, j, p.x, p.y))
                    halves -= 2;
                else if (good && comparison_.isGood(k, p.x, p.y))
                    halves += 2;
                else if (clipped && comparison_.isClipped(k, p.x, p.y))
                    halves += k < j ? 2 : 1;
            }
        }
        return 0.5 * static_cast<double>(halves) / static_cast<double>(region.size());
    }

    /// Does frame j contradict what is believed in most of the region?
    [[nodiscard]] bool contradicts(int j, const Region& region) const
    {
        const auto against = std::ranges::count_if(region, [&](glm::ivec2 p) {
            return j != believed_(p.x, p.y) &&
                   comparison_.disagree(j, believed_(p.x, p.y), p.x, p.y);
        });
        return 2 * against > static_cast<std::ptrdiff_t>(region.size());
    }

    /// Believes in the region the frame that fits the others best of those that contradict what is
    /// believed so far; true when that changes something.
    bool vote(const Region& region)
    {
        constexpr double kOut = -1e9;
        std::vector<double> agreement(static_cast<std::size_t>(count_), kOut);
        parallelFor(0, count_, [&](std::int64_t j) {
            const auto frame = static_cast<int>(j);
            if (contradicts(frame, region))
                agreement[static_cast<std::size_t>(j)] = agreementOf(frame, region);
        });
        int winner = 0;
        for (int k = 1; k < count_; ++k)
            if (agreement[static_cast<std::size_t>(k)] >
                agreement[static_cast<std::size_t>(winner)] + kVoteMargin)
                winner = k;
        if (agreement[static_cast<std::size_t>(winner)] == kOut) return false;
        bool changed = false;
        const int r = options_.grow_px;
        for (const glm::ivec2 p : region) {
            for (int y = std::max(p.y - r, 0); y <= std::min(p.y + r, height_ - 1); ++y) {
                for (int x = std::max(p.x - r, 0); x <= std::min(p.x + r, width_ - 1); ++x) {
                    changed = changed || believed_(x, y) != winner;
                    believed_(x, y) = winner;
                }
            }
        }
        return changed;
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
    requireValid(options.validate(), "deghost options");
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

void exclude(Bracket& bracket, const MovedPixels& moved)
{
    INSITU_CHECK(moved.masks.size() == bracket.frames.size(),
                 "{} masks for {} frames",
                 moved.masks.size(),
                 bracket.frames.size());
    for (std::size_t k = 0; k < moved.masks.size(); ++k) {
        Image<std::uint8_t>& own = bracket.frames[k].excluded;
        if (own.empty()) {
            own = moved.masks[k];
            continue;
        }
        for (std::size_t i = 0; i < own.pixelCount(); ++i)
            own.pixels()[i] |= moved.masks[k].pixels()[i];
    }
}

}  // namespace insitu
