#include "capture/frame_comparison.h"

#include "core/parallel.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace insitu::detail {

namespace {

/// On 255: codes below the first count as black, above the second one as clipped.
constexpr float kBlackCode = 6.0f;
constexpr float kClipCode = 248.0f;
/// A pixel measures something when its brightest channel is at least this, in the mean of 3 x 3.
constexpr float kLeastGoodCode = 16.0f;
constexpr float kDoubtfulCode = 210.0f;
/// The medians of a bin may be off by this share of the exposure, from a response curve or an
/// exposure time that is not quite right; more is something that moved.
constexpr double kMostBias = 0.4;
/// Pixels looked at for the noise of a pair of frames, about.
constexpr double kNoiseSamples = 60'000.0;
/// A bin with fewer takes the noise of the whole range.
constexpr std::size_t kLeastInBin = 40;
/// Rounding alone: 1 / sqrt(12) in each frame.
constexpr float kLeastSigma = 0.45f;

float lookUp(const std::array<float, 256>& table, float code)
{
    const float z = std::clamp(code, 0.0f, 255.0f);
    const auto low = std::min<std::size_t>(static_cast<std::size_t>(z), 254);
    return table[low] + (z - static_cast<float>(low)) * (table[low + 1] - table[low]);
}

/// Beside a clipped channel another high one may be off: JPEG shares colour between neighbours.
bool isDoubtful(float code, float brightest)
{
    return brightest > kClipCode && code <= kClipCode && code > kDoubtfulCode;
}

float medianOf(std::vector<float>& values)
{
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::nth_element(values.begin(), middle, values.end());
    return *middle;
}

/// Median and robust standard deviation.
struct Spread {
    float middle = 0.0f;
    float sigma = kLeastSigma;
};

Spread spreadOf(std::vector<float> values)
{
    Spread spread;
    if (values.empty()) return spread;
    spread.middle = medianOf(values);
    for (float& value : values)
        value = std::abs(value - spread.middle);
    spread.sigma = std::max(1.4826f * medianOf(values), kLeastSigma);
    return spread;
}

/// A value between the middles of bins.
template <std::size_t Bins>
float betweenBins(const std::array<float, Bins>& values, float code)
{
    const float place =
        std::clamp(code * static_cast<float>(Bins) / 256.0f - 0.5f, 0.0f, Bins - 1.0f);
    const auto low = std::min(static_cast<std::size_t>(place), Bins - 2);
    return values[low] + (place - static_cast<float>(low)) * (values[low + 1] - values[low]);
}

std::size_t binOf(float code, int bins)
{
    return static_cast<std::size_t>(
        std::clamp(static_cast<int>(code * static_cast<float>(bins) / 256.0f), 0, bins - 1));
}

}  // namespace

FrameComparison::FrameComparison(const Bracket& bracket,
                                 const ResponseCurve& response,
                                 const DeghostOptions& options)
    : bracket_(bracket),
      response_(response),
      options_(options),
      count_(static_cast<int>(bracket.frames.size()))
{
    for (int c = 0; c < 3; ++c) {
        for (int z = 0; z < 256; ++z) {
            const double exposure = response.decode(c, z);
            const double more = response.encode(c, exposure * (1.0 + options.tolerance)) - z;
            const double less = z - response.encode(c, exposure * (1.0 - options.tolerance));
            tolerance_[static_cast<std::size_t>(c)][static_cast<std::size_t>(z)] =
                static_cast<float>(std::max({more, less, 1.0}));
        }
    }
    const int width = bracket.frames.front().image.codes.width();
    const int height = bracket.frames.front().image.codes.height();
    states_.assign(static_cast<std::size_t>(count_), Image<State>(width, height));
    parallelFor(0, height, [&](std::int64_t row) {
        const int y = static_cast<int>(row);
        for (int k = 0; k < count_; ++k)
            for (int x = 0; x < width; ++x)
                states_[static_cast<std::size_t>(k)](x, y) = measureState(k, x, y);
    });
    tables_.resize(static_cast<std::size_t>(count_ * count_));
    parallelFor(0, static_cast<std::int64_t>(count_) * count_, [&](std::int64_t i) {
        const int k = static_cast<int>(i) / count_;
        const int j = static_cast<int>(i) % count_;
        if (k != j) tables_[static_cast<std::size_t>(i)] = measurePair(k, j);
    });
}

float FrameComparison::codeOn255(int frame, int x, int y, int channel) const
{
    const EncodedImage& image = bracket_.frames[static_cast<std::size_t>(frame)].image;
    return static_cast<float>(image.codes(x, y)[channel]) * 255.0f /
           static_cast<float>(image.max_code);
}

float FrameComparison::brightestOf(int frame, int x, int y) const
{
    return std::max(
        {codeOn255(frame, x, y, 0), codeOn255(frame, x, y, 1), codeOn255(frame, x, y, 2)});
}

FrameComparison::State FrameComparison::measureState(int frame, int x, int y) const
{
    const BracketFrame& source = bracket_.frames[static_cast<std::size_t>(frame)];
    if (!source.excluded.empty() && source.excluded(x, y) != 0) return State::Excluded;
    if (brightestOf(frame, x, y) > kClipCode) return State::Clipped;
    float sum = 0.0f;
    float count = 0.0f;
    const Image<glm::u16vec3>& codes = source.image.codes;
    for (int ny = std::max(y - 1, 0); ny <= std::min(y + 1, codes.height() - 1); ++ny) {
        for (int nx = std::max(x - 1, 0); nx <= std::min(x + 1, codes.width() - 1); ++nx) {
            sum += brightestOf(frame, nx, ny);
            count += 1.0f;
        }
    }
    return sum >= kLeastGoodCode * count ? State::Good : State::Black;
}

FrameComparison::PairTables FrameComparison::measurePair(int k, int j) const
{
    const double ratio = bracket_.frames[static_cast<std::size_t>(k)].relative_exposure /
                         bracket_.frames[static_cast<std::size_t>(j)].relative_exposure;
    PairTables tables;
    for (int c = 0; c < 3; ++c) {
        Table& table = tables[static_cast<std::size_t>(c)];
        for (int z = 0; z < 256; ++z)
            table.predicted[static_cast<std::size_t>(z)] =
                static_cast<float>(response_.encode(c, ratio * response_.decode(c, z)));
        measureNoise(k, j, c, table);
    }
    return tables;
}

void FrameComparison::measureNoise(int k, int j, int channel, Table& table) const
{
    const int width = bracket_.frames.front().image.codes.width();
    const int height = bracket_.frames.front().image.codes.height();
    const int step = std::max(
        1, static_cast<int>(std::sqrt(static_cast<double>(width) * height / kNoiseSamples)));
    std::array<std::vector<float>, kBins> bins;
    std::vector<float> all;
    for (int y = step / 2; y < height; y += step) {
        for (int x = step / 2; x < width; x += step) {
            // Where k is clipped counts as well: without, only its darker deviations would be seen.
            if (isExcluded(k, x, y) || !isGood(j, x, y)) continue;
            const float code = codeOn255(j, x, y, channel);
            const float other = codeOn255(k, x, y, channel);
            const float predicted = lookUp(table.predicted, code);
            if (std::min(code, other) < kBlackCode || predicted > kClipCode) continue;
            bins[binOf(predicted, kBins)].push_back(other - predicted);
            all.push_back(other - predicted);
        }
    }
    const Spread whole = spreadOf(std::move(all));
    for (std::size_t b = 0; b < bins.size(); ++b) {
        const Spread spread = bins[b].size() >= kLeastInBin ? spreadOf(std::move(bins[b])) : whole;
        const double middle = (static_cast<double>(b) + 0.5) * 256.0 / kBins;
        const double exposure = response_.decode(channel, middle);
        const auto least =
            static_cast<float>(response_.encode(channel, exposure * (1.0 - kMostBias)) - middle);
        const auto most =
            static_cast<float>(response_.encode(channel, exposure * (1.0 + kMostBias)) - middle);
        table.bias[b] = std::clamp(spread.middle, std::min(least, 0.0f), std::max(most, 0.0f));
        table.slack[b] = static_cast<float>(options_.sigmas) * spread.sigma;
    }
}

float FrameComparison::slackAt(const Table& table, int channel, float code) const
{
    return std::max(betweenBins(table.slack, code),
                    lookUp(tolerance_[static_cast<std::size_t>(channel)], code));
}

FrameComparison::Range FrameComparison::predictedRange(
    int k, int j, int x, int y, int channel) const
{
    const Table& tables = table(k, j, channel);
    const float brightest = brightestOf(j, x, y);
    const float code = codeOn255(j, x, y, channel);
    const auto limit = [&](float z, float sign) {
        const float predicted = lookUp(tables.predicted, z);
        return predicted + betweenBins(tables.bias, predicted) +
               sign * slackAt(tables, channel, predicted);
    };
    constexpr float kInfinity = std::numeric_limits<float>::infinity();
    Range range{limit(code, -1.0f), limit(code, 1.0f)};
    if (code > kClipCode || isDoubtful(code, brightest)) range.high = kInfinity;
    if (isDoubtful(code, brightest)) range.low = -kInfinity;
    if (code < kBlackCode) range = {-kInfinity, limit(kBlackCode, 1.0f)};
    return range;
}

bool FrameComparison::disagree(int k, int j, int x, int y) const
{
    if (isExcluded(k, x, y) || isExcluded(j, x, y)) return false;
    const float brightest = brightestOf(k, x, y);
    const int width = bracket_.frames.front().image.codes.width();
    const int height = bracket_.frames.front().image.codes.height();
    for (int c = 0; c < 3; ++c) {
        const float code = codeOn255(k, x, y, c);
        if (isDoubtful(code, brightest)) continue;
        constexpr float kInfinity = std::numeric_limits<float>::infinity();
        const Range own{code < kBlackCode ? -kInfinity : std::min(code, kClipCode),
                        code > kClipCode ? kInfinity : std::max(code, kBlackCode)};
        const auto meets = [&](const Range& range) {
            return range.low <= own.high && own.low <= range.high;
        };
        Range range = predictedRange(k, j, x, y, c);
        if (meets(range)) continue;
        for (int ny = std::max(y - 1, 0); ny <= std::min(y + 1, height - 1); ++ny) {
            for (int nx = std::max(x - 1, 0); nx <= std::min(x + 1, width - 1); ++nx) {
                const Range beside = predictedRange(k, j, nx, ny, c);
                range = {std::min(range.low, beside.low), std::max(range.high, beside.high)};
            }
        }
        if (!meets(range)) return true;
    }
    return false;
}

}  // namespace insitu::detail
