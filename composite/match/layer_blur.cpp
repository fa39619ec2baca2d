#include "composite/match/layer_blur.h"

#include "core/parallel.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

namespace insitu {

namespace {

/// Deviations are rounded to this, pixels, so that their taps can be kept.
constexpr double kSigmaStep = 1.0 / 32.0;

/// Rows that are blurred together: their sums stay in memory that is near.
constexpr int kStripRows = 64;

/// Every blur's taps, by rounded deviation.
class BlurTable {
public:
    explicit BlurTable(double max_sigma)
    {
        for (int i = 0; i <= static_cast<int>(std::ceil(max_sigma / kSigmaStep)); ++i)
            taps_.emplace_back(i * kSigmaStep);
    }
    [[nodiscard]] const BlurTaps& at(float sigma) const
    {
        const auto i = static_cast<std::size_t>(std::lround(sigma / kSigmaStep));
        return taps_[std::min(i, taps_.size() - 1)];
    }
    [[nodiscard]] int reach() const { return taps_.back().reach; }

private:
    std::vector<BlurTaps> taps_;
};

/// 1 within `reach` pixels of a set one.
Image<std::uint8_t> grown(const Image<std::uint8_t>& set, int reach)
{
    Image<std::uint8_t> wide(set.width(), set.height());
    Image<std::uint8_t> both(set.width(), set.height());
    const auto pass = [&](const Image<std::uint8_t>& from, Image<std::uint8_t>& to, bool across) {
        const int lines = across ? from.height() : from.width();
        const int length = across ? from.width() : from.height();
        parallelFor(0, lines, [&](std::int64_t line) {
            const int l = static_cast<int>(line);
            int last = -reach - 1;
            const auto at = [&](int i) { return across ? from(i, l) : from(l, i); };
            for (int i = 0; i < length + reach; ++i) {
                if (i < length && at(i)) last = i;
                const int target = i - reach;
                if (target >= 0 && target < length && last >= target - reach)
                    (across ? to(target, l) : to(l, target)) = 1;
            }
        });
    };
    pass(set, wide, true);
    pass(wide, both, false);
    return both;
}

/// What a blur adds up of the objects, and the mean deviation of what came.
struct ObjectSum {
    Rgb object{0.0f};
    Rgb coverage{0.0f};
    float variance = 0.0f;
    float depth = 0.0f;
    float sigma = 0.0f;
    float weight = 0.0f;

    void add(const ObjectSum& other, float w)
    {
        object += w * other.object;
        coverage += w * other.coverage;
        variance += w * w * other.variance;
        depth += w * other.depth;
        sigma += w * other.sigma;
        weight += w * other.weight;
    }
};

/// The same of the surfaces behind them, by how much of each is seen.
struct ReceiverSum {
    Rgb without{0.0f};
    Rgb with{0.0f};
    float seen = 0.0f;

    void add(const ReceiverSum& other, float w)
    {
        without += w * other.without;
        with += w * other.with;
        seen += w * other.seen;
    }
};

ObjectSum objectAt(const LayerBlur& blur, const PhotoLayers& layers, int x, int y)
{
    const Rgb covered = layers.coverage(x, y);
    if (covered == Rgb(0.0f) && layers.object(x, y) == Rgb(0.0f)) return {};
    return {layers.object(x, y),
            covered,
            layers.object_variance(x, y),
            covered.g * layers.depth_m(x, y),
            blur.object_sigma_px(x, y),
            1.0f};
}

ReceiverSum receiverAt(const PhotoLayers& layers, int x, int y)
{
    const float seen = 1.0f - layers.coverage(x, y).g;
    const Rgb without = layers.irradiance_without(x, y);
    if (!(seen > 0.0f) || without == Rgb(0.0f)) return {};
    return {seen * without, seen * layers.irradiance_with(x, y), seen};
}

/// Rows [top, bottom) of the picture, blurred across and then down: exact where the deviation does
/// not change, and, as it does, each pass by the deviation at its own pixel (receivers) or by that
/// of what comes (objects).
class BlurredRows {
public:
    BlurredRows(const BlurTable& table, const LayerBlur& blur, const PhotoLayers& sharp, int top)
        : table_(table), blur_(blur), sharp_(sharp), first_(top - table.reach())
    {
    }

    void run(const Image<std::uint8_t>& near, int bottom, PhotoLayers& result)
    {
        const int top = first_ + table_.reach();
        left_ = sharp_.object.width();
        right_ = 0;
        for (int y = top; y < bottom; ++y)
            for (int x = 0; x < sharp_.object.width(); ++x)
                if (near(x, y)) {
                    left_ = std::min(left_, x);
                    right_ = std::max(right_, x + 1);
                }
        if (left_ >= right_) return;
        const int rows = bottom - top + 2 * table_.reach();
        objects_ = Image<ObjectSum>(right_ - left_, rows);
        receivers_ = Image<ReceiverSum>(right_ - left_, rows);
        for (int row = 0; row < rows; ++row)
            blurAcross(row);
        for (int y = top; y < bottom; ++y)
            for (int x = left_; x < right_; ++x)
                if (near(x, y)) blurDown(x, y, result);
    }

private:
    /// Beyond the frame the picture goes on as at its edge.
    void blurAcross(int row)
    {
        const int width = sharp_.object.width();
        const int reach = table_.reach();
        const int y = std::clamp(first_ + row, 0, sharp_.object.height() - 1);
        std::vector<ObjectSum> objects;
        std::vector<ReceiverSum> receivers;
        bool any_object = false;
        for (int x = left_ - reach; x < right_ + reach; ++x) {
            const int from = std::clamp(x, 0, width - 1);
            objects.push_back(objectAt(blur_, sharp_, from, y));
            receivers.push_back(receiverAt(sharp_, from, y));
            any_object = any_object || objects.back().weight > 0.0f;
        }
        const auto n = static_cast<int>(objects.size());
        for (int i = 0; any_object && i < n; ++i) {
            const ObjectSum& from = objects[static_cast<std::size_t>(i)];
            if (from.weight == 0.0f) continue;
            const BlurTaps& its = table_.at(from.sigma);
            const int to = std::min(i - reach + its.reach, right_ - left_ - 1);
            for (int x = std::max(i - reach - its.reach, 0); x <= to; ++x)
                objects_(x, row).add(from,
                                     its.weight[static_cast<std::size_t>(std::abs(x + reach - i))]);
        }
        for (int x = left_; x < right_; ++x) {
            const BlurTaps& own = table_.at(blur_.receiver_sigma_px(x, y));
            ReceiverSum sum;
            for (int d = -own.reach; d <= own.reach; ++d)
                sum.add(receivers[static_cast<std::size_t>(x - left_ + reach + d)],
                        own.weight[static_cast<std::size_t>(std::abs(d))]);
            receivers_(x - left_, row) = sum;
        }
    }

    void blurDown(int x, int y, PhotoLayers& result) const
    {
        const int reach = table_.reach();
        const int row = y - first_;
        ObjectSum object;
        for (int d = -reach; d <= reach; ++d) {
            const ObjectSum& from = objects_(x - left_, row + d);
            if (from.weight == 0.0f) continue;
            object.add(
                from,
                table_.at(from.sigma / from.weight).weight[static_cast<std::size_t>(std::abs(d))]);
        }
        const BlurTaps& own = table_.at(blur_.receiver_sigma_px(x, y));
        ReceiverSum receiver;
        for (int d = -own.reach; d <= own.reach; ++d)
            receiver.add(receivers_(x - left_, row + d),
                         own.weight[static_cast<std::size_t>(std::abs(d))]);
        const float coverage = object.coverage.g;
        result.object(x, y) = object.object;
        result.coverage(x, y) = glm::min(object.coverage, Rgb(1.0f));
        result.object_variance(x, y) = object.variance;
        result.depth_m(x, y) = coverage > 0.0f ? object.depth / coverage : 0.0f;
        if (receiver.seen > 0.0f) {
            result.irradiance_without(x, y) = receiver.without / receiver.seen;
            result.irradiance_with(x, y) = receiver.with / receiver.seen;
        }
    }

    const BlurTable& table_;
    const LayerBlur& blur_;
    const PhotoLayers& sharp_;
    int first_;  ///< row of the picture that the sums begin with
    int left_ = 0;
    int right_ = 0;
    Image<ObjectSum> objects_;
    Image<ReceiverSum> receivers_;
};

/// Whether the objects change the light that falls here by more than a 4096th.
bool changesLight(Rgb without, Rgb with)
{
    const Rgb change = glm::abs(with - without);
    const Rgb least = without / 4096.0f;
    return change.r > least.r || change.g > least.g || change.b > least.b;
}

}  // namespace

BlurTaps::BlurTaps(double sigma_px)
{
    // A three-tap kernel (v/2, 1 − v, v/2) has the variance v exactly; a sampled Gaussian of less
    // than 0.7 pixels falls short of it.
    if (sigma_px < 0.7) {
        const double variance = sigma_px * sigma_px;
        reach = variance > 0.0 ? 1 : 0;
        weight[0] = static_cast<float>(1.0 - variance);
        weight[1] = static_cast<float>(0.5 * variance);
        return;
    }
    reach = std::min(kMaxReach, static_cast<int>(std::ceil(3.0 * sigma_px)));
    double sum = 0.0;
    std::array<double, kMaxReach + 1> w{};
    for (int i = 0; i <= reach; ++i) {
        w[static_cast<std::size_t>(i)] = std::exp(-0.5 * i * i / (sigma_px * sigma_px));
        sum += (i == 0 ? 1.0 : 2.0) * w[static_cast<std::size_t>(i)];
    }
    for (int i = 0; i <= reach; ++i)
        weight[static_cast<std::size_t>(i)] =
            static_cast<float>(w[static_cast<std::size_t>(i)] / sum);
}

void blurLayers(const LayerBlur& blur, PhotoLayers& layers)
{
    const BlurTable table(blur.max_sigma_px);
    const int reach = table.reach();
    if (reach == 0) return;
    const int width = layers.object.width();
    const int height = layers.object.height();
    Image<std::uint8_t> touched(width, height);
    for (std::size_t i = 0; i < touched.pixelCount(); ++i)
        touched.pixels()[i] =
            layers.coverage.pixels()[i] != Rgb(0.0f) || layers.object.pixels()[i] != Rgb(0.0f) ||
            changesLight(layers.irradiance_without.pixels()[i], layers.irradiance_with.pixels()[i]);
    const Image<std::uint8_t> near = grown(touched, reach);

    const PhotoLayers sharp = layers;
    const int strips = (height + kStripRows - 1) / kStripRows;
    parallelFor(0, strips, [&](std::int64_t strip) {
        const int top = static_cast<int>(strip) * kStripRows;
        BlurredRows(table, blur, sharp, top).run(near, std::min(top + kStripRows, height), layers);
    });
}

}  // namespace insitu
