#include "capture/response_samples.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace insitu::detail {

namespace {

constexpr int kCodeBins = 32;
/// The picture is divided into this many cells a side for the spatial spread.
constexpr int kCells = 8;
/// Candidates looked at, at most: bounds the time for large pictures.
constexpr double kMaxCandidates = 60'000.0;

/// Mean codes per frame and channel (< 0: not useful) and how uneven the patch is.
struct Candidate {
    ResponseSample sample;
    double unevenness = 0.0;
    bool chosen = false;
    std::vector<float> mean;  ///< [frame * 3 + channel]
};

/// Spread of the patch with a margin of one pixel (JPEG shares colour between neighbours), in
/// codes, in the frame in which it is best exposed: there noise is low and slopes show.
double patchUnevenness(const Bracket& bracket, ResponseSample sample)
{
    double best = std::numeric_limits<double>::max();
    double best_distance = best;
    for (const BracketFrame& frame : bracket.frames) {
        double sum = 0.0;
        double squares = 0.0;
        double highest = 0.0;
        const int side = kPatchSide + 2;
        const int left = std::max(sample.x - 1, 0);
        const int top = std::max(sample.y - 1, 0);
        const int right = std::min(left + side, frame.image.codes.width());
        const int bottom = std::min(top + side, frame.image.codes.height());
        for (int y = top; y < bottom; ++y) {
            for (int x = left; x < right; ++x) {
                const double code = codeOn255(frame.image, x, y, 1);
                sum += code;
                squares += code * code;
                highest = std::max(highest, code);
            }
        }
        const double n = (right - left) * (bottom - top);
        const double mean = sum / n;
        const double distance = std::abs(mean - 128.0) + (highest > kHighestUsefulCode ? 1e3 : 0.0);
        if (distance >= best_distance) continue;
        best_distance = distance;
        best = std::sqrt(std::max(squares / n - mean * mean, 0.0));
    }
    return best;
}

std::vector<Candidate> listCandidates(const Bracket& bracket)
{
    const int width = bracket.frames.front().image.codes.width();
    const int height = bracket.frames.front().image.codes.height();
    const double area = static_cast<double>(width) * height;
    const int step =
        std::max(kPatchSide, static_cast<int>(std::ceil(std::sqrt(area / kMaxCandidates))));
    std::vector<Candidate> candidates;
    for (int y = 0; y + kPatchSide <= height; y += step) {
        for (int x = 0; x + kPatchSide <= width; x += step) {
            Candidate candidate;
            candidate.sample = {x, y};
            int useful = 0;
            for (const BracketFrame& frame : bracket.frames) {
                for (int c = 0; c < 3; ++c) {
                    const double mean = usefulMeanCode(frame.image, candidate.sample, c);
                    candidate.mean.push_back(static_cast<float>(mean));
                    useful += mean >= 0.0 ? 1 : 0;
                }
            }
            if (useful < 2) continue;
            candidate.unevenness = patchUnevenness(bracket, candidate.sample);
            candidates.push_back(std::move(candidate));
        }
    }
    std::ranges::stable_sort(candidates, [](const Candidate& a, const Candidate& b) {
        return a.unevenness < b.unevenness;
    });
    return candidates;
}

/// Takes the flattest candidates of one bin, at most `per_cell` from each cell of the picture.
int takeFrom(std::vector<Candidate>& candidates,
             const std::vector<std::size_t>& bin,
             int quota,
             int width,
             int height)
{
    const int per_cell = std::max(1, quota / 4);
    std::array<int, kCells * kCells> in_cell{};
    int taken = 0;
    int present = 0;
    for (const std::size_t i : bin) {
        if (present >= quota) break;
        Candidate& candidate = candidates[i];
        const int cell =
            candidate.sample.y * kCells / height * kCells + candidate.sample.x * kCells / width;
        int& count = in_cell[static_cast<std::size_t>(cell)];
        if (count >= per_cell) continue;
        ++count;
        ++present;
        if (candidate.chosen) continue;
        candidate.chosen = true;
        ++taken;
    }
    return taken;
}

}  // namespace

double usefulMeanCode(const EncodedImage& image, ResponseSample sample, int channel)
{
    const int limit = static_cast<int>(kHighestUsefulCode / 255.0 * image.max_code);
    const int left = std::max(sample.x - kPatchMargin, 0);
    const int top = std::max(sample.y - kPatchMargin, 0);
    const int right = std::min(sample.x + kPatchSide + kPatchMargin, image.codes.width());
    const int bottom = std::min(sample.y + kPatchSide + kPatchMargin, image.codes.height());
    for (int y = top; y < bottom; ++y) {
        for (int x = left; x < right; ++x) {
            const glm::u16vec3 codes = image.codes(x, y);
            if (std::max({codes.r, codes.g, codes.b}) > limit) return -1.0;
        }
    }
    double sum = 0.0;
    for (int y = sample.y; y < sample.y + kPatchSide; ++y)
        for (int x = sample.x; x < sample.x + kPatchSide; ++x)
            sum += codeOn255(image, x, y, channel);
    const double mean = sum / (kPatchSide * kPatchSide);
    return mean >= kLowestUsefulMean ? mean : -1.0;
}

std::vector<ResponseSample> selectResponseSamples(const Bracket& bracket, int count)
{
    std::vector<Candidate> candidates = listCandidates(bracket);
    const int width = bracket.frames.front().image.codes.width();
    const int height = bracket.frames.front().image.codes.height();
    std::vector<std::vector<std::size_t>> bins(bracket.frames.size() * 3 * kCodeBins);
    for (std::size_t i = 0; i < candidates.size(); ++i) {
        for (std::size_t k = 0; k < candidates[i].mean.size(); ++k) {
            const float mean = candidates[i].mean[k];
            if (mean < 0.0f) continue;
            const auto bin = static_cast<std::size_t>(mean * kCodeBins / 256.0f);
            bins[k * kCodeBins + bin].push_back(i);
        }
    }
    // Rare codes first: what is left of the budget goes to the common ones.
    std::ranges::stable_sort(bins,
                             [](const auto& a, const auto& b) { return a.size() < b.size(); });
    int left = count;
    for (std::size_t b = 0; b < bins.size() && left > 0; ++b) {
        if (bins[b].empty()) continue;
        const int quota = std::max(1, left / static_cast<int>(bins.size() - b));
        left -= takeFrom(candidates, bins[b], quota, width, height);
    }
    std::vector<ResponseSample> samples;
    for (const Candidate& candidate : candidates)
        if (candidate.chosen) samples.push_back(candidate.sample);
    return samples;
}

}  // namespace insitu::detail
