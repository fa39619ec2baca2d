#include "capture/merge_rows.h"

#include <algorithm>
#include <span>

// Frames are numbered from the longest, 0. Two numbers decide what a pixel's channel rests on:
//
//   open     the first frame after the last one in which the channel is clipped;
//   clear    the first frame after the last one in which anything in the 3x3 pixels around is.
//
// open <= clear. From `clear` on nothing is in doubt. The frames between the two are better by
// their exposure, and worse where a JPEG, demosaicing, blooming or a picture that was scaled down
// mixed clipped neighbours into them: they are used when the code of `open` agrees with that of
// `clear`. That also keeps a short frame's noise from passing for light: when they agree, it is
// `open` that says how bright the pixel is.
//
// Both numbers are made from rows of all values (3 a pixel) by comparisons and maxima that the
// compiler turns into vector code; then one look-up per pixel and channel gives the weights
// (MergeTables), and the sum is over the frames that these name.

namespace insitu {

namespace {

class RowMerger {
public:
    RowMerger(const MergeTables& tables, MergeResult& result)
        : tables_(tables),
          result_(result),
          count_(tables.frameCount()),
          width_(result.validity.width()),
          height_(result.validity.height()),
          values_(static_cast<std::size_t>(3 * width_)),
          rows_(static_cast<std::size_t>(count_ + MergeTables::kGroup)),
          clear_(values_),
          masked_(static_cast<std::size_t>(width_))
    {
        for (auto& open : open_)
            open.resize(values_);
        column_.resize(values_ + 2 * kMargin);
    }

    void run(int first, int last)
    {
        findOpen(std::max(first - 1, 0));
        findOpen(first);
        for (int y = first; y < last; ++y) {
            if (y + 1 < height_) findOpen(y + 1);
            findClear(y);
            findMasked(y);
            for (std::size_t k = 0; k < rows_.size(); ++k)
                rows_[k] = codesOf(std::min(static_cast<int>(k), count_ - 1), y);
            mergeRow(y);
        }
    }

private:
    /// Values beyond the ends of a row that a window of 3x3 pixels reaches.
    static constexpr std::size_t kMargin = 5;

    [[nodiscard]] const std::uint16_t* codesOf(int k, int y) const
    {
        return &tables_.frames()[static_cast<std::size_t>(k)].image->codes.row(y).data()->x;
    }
    [[nodiscard]] std::vector<std::int16_t>& openOf(int y)
    {
        return open_[static_cast<std::size_t>(y % 3)];
    }

    /// `open` of every value of row y.
    void findOpen(int y)
    {
        std::int16_t* open = openOf(y).data();
        std::fill_n(open, values_, std::int16_t{0});
        for (int k = 0; k < count_; ++k) {
            const std::uint16_t* codes = codesOf(k, y);
            const auto limit =
                static_cast<std::uint16_t>(tables_.frames()[static_cast<std::size_t>(k)].clip_code);
            const auto next = static_cast<std::int16_t>(k + 1);
            for (std::size_t i = 0; i < values_; ++i)
                open[i] = codes[i] > limit ? next : open[i];
        }
    }

    /// `clear` of every pixel of row y, at its first value: the maximum of nine values from three
    /// before it, in three rows.
    void findClear(int y)
    {
        std::int16_t* column = column_.data() + kMargin;
        std::ranges::copy(openOf(y), column);
        raise(column, openOf(std::max(y - 1, 0)).data());
        raise(column, openOf(std::min(y + 1, height_ - 1)).data());
        std::copy_n(column - 3, values_, clear_.data());
        for (std::ptrdiff_t offset = -2; offset <= 5; ++offset)
            raise(clear_.data(), column + offset);
    }

    void raise(std::int16_t* values, const std::int16_t* least) const
    {
        for (std::size_t i = 0; i < values_; ++i)
            values[i] = std::max(values[i], least[i]);
    }

    /// Pixels of row y at which some frame is excluded.
    void findMasked(int y)
    {
        std::ranges::fill(masked_, std::uint8_t{0});
        for (const MergeFrame& frame : tables_.frames()) {
            if (frame.excluded->empty()) continue;
            for (int x = 0; x < width_; ++x)
                masked_[static_cast<std::size_t>(x)] |= (*frame.excluded)(x, y);
        }
        any_masked_ = std::ranges::any_of(masked_, [](std::uint8_t m) { return m != 0; });
    }

    void mergeRow(int y)
    {
        const std::int16_t* open = openOf(y).data();
        float* radiance = &result_.radiance.pixels.row(y).data()->x;
        float* variance = &result_.variance.row(y).data()->x;
        std::uint8_t* validity = result_.validity.row(y).data();
        for (int x = 0; x < width_; ++x) {
            const std::size_t i = 3 * static_cast<std::size_t>(x);
            const int clear = clear_[i];
            unsigned flags = 0;
            if (any_masked_ && masked_[static_cast<std::size_t>(x)] != 0) {
                validity[x] = mergeMasked(x, y, clear, radiance + i, variance + i);
                continue;
            }
            unsigned black = kMergeBlack;
            for (int c = 0; c < 3; ++c) {
                const std::size_t v = i + static_cast<std::size_t>(c);
                int reference = open[v];
                if (reference != clear || clear == count_)
                    reference = chooseReference(i, c, reference, clear, flags);
                const int code =
                    rows_[static_cast<std::size_t>(std::min(reference, count_ - 1))][v];
                if (reference == count_) {
                    lowerBound(c, count_ - 1, code, radiance[v], variance[v]);
                    flags |= kMergeClipped;
                    black = 0;
                    continue;
                }
                const float* entry = tables_.entry(c, reference, code);
                const MergeEntry header = MergeTables::header(entry);
                radiance[v] = weightedSum(MergeTables::weights(entry),
                                          tables_.exposures(c),
                                          rows_.data() + reference,
                                          v,
                                          header.frames);
                variance[v] = header.variance;
                if (header.frames == 1) flags |= kMergeSingleFrame;
                if (!isBlack(reference, code)) black = 0;
            }
            validity[x] = static_cast<std::uint8_t>(flags | black);
        }
    }

    /// Sums that need not wait for each other.
    [[nodiscard]] static float weightedSum(const float* weights,
                                           const float* exposures,
                                           const std::uint16_t* const* rows,
                                           std::size_t value,
                                           int frames)
    {
        std::array<float, MergeTables::kGroup> sums{};
        for (int j = 0; j < frames; j += MergeTables::kGroup)
            for (int i = 0; i < MergeTables::kGroup; ++i)
                sums[static_cast<std::size_t>(i)] += weights[j + i] * exposures[rows[j + i][value]];
        return (sums[0] + sums[1]) + (sums[2] + sums[3]);
    }

    [[nodiscard]] bool isClipped(int k, int code) const
    {
        return code > tables_.frames()[static_cast<std::size_t>(k)].clip_code;
    }
    [[nodiscard]] bool isBlack(int k, int code) const
    {
        return code < tables_.frames()[static_cast<std::size_t>(k)].black_code;
    }

    void lowerBound(int c, int k, int code, float& radiance, float& variance) const
    {
        const MergeFrame& frame = tables_.frames()[static_cast<std::size_t>(k)];
        const int known = std::min(code, frame.image->max_code);
        radiance =
            static_cast<float>(static_cast<double>(tables_.exposures(c)[known]) / frame.exposure);
        variance = radiance * radiance;
    }

    /// Where one channel is clipped, a JPEG may show another clipped one as somewhat less: it
    /// shares colour between neighbours. So the others count as clipped early, when no other frame
    /// can tell.
    [[nodiscard]] bool isSuspect(int k, std::size_t pixel, int c) const
    {
        const MergeFrame& frame = tables_.frames()[static_cast<std::size_t>(k)];
        const std::uint16_t* codes = rows_[static_cast<std::size_t>(k)] + pixel;
        const int brightest = std::max({codes[0], codes[1], codes[2]});
        return brightest > frame.clip_code && codes[c] > frame.suspect_code;
    }

    /// The longest frame to be believed, given `open` and `clear`; frameCount(): none.
    [[nodiscard]] int chooseReference(
        std::size_t pixel, int c, int open, int clear, unsigned& flags) const
    {
        const std::size_t v = pixel + static_cast<std::size_t>(c);
        if (clear < count_) {
            int code = rows_[static_cast<std::size_t>(open)][v];
            while (open < clear) {
                const int next = rows_[static_cast<std::size_t>(open + 1)][v];
                if (tables_.agree(c, open, code, open + 1, next)) break;
                code = next;
                ++open;
            }
            return open;
        }
        while (open < count_ && isSuspect(open, pixel, c))
            ++open;
        if (open < count_) flags |= kMergeUnconfirmed;
        return open;
    }

    /// The same for a pixel at which some frames are excluded. Returns its validity.
    [[nodiscard]] std::uint8_t mergeMasked(
        int x, int y, int clear, float* radiance, float* variance)
    {
        allowed_.clear();
        for (int k = 0; k < count_; ++k) {
            const Image<std::uint8_t>& mask =
                *tables_.frames()[static_cast<std::size_t>(k)].excluded;
            if (mask.empty() || mask(x, y) == 0) allowed_.push_back(k);
        }
        if (allowed_.empty())
            for (int k = 0; k < count_; ++k)
                allowed_.push_back(k);
        unsigned flags = kMergeExcluded;
        unsigned black = kMergeBlack;
        for (int c = 0; c < 3; ++c)
            mergeMaskedChannel(x, c, clear, radiance[c], variance[c], flags, black);
        return static_cast<std::uint8_t>(flags | black);
    }

    void mergeMaskedChannel(
        int x, int c, int clear, float& radiance, float& variance, unsigned& flags, unsigned& black)
    {
        const std::size_t pixel = 3 * static_cast<std::size_t>(x);
        const std::size_t v = pixel + static_cast<std::size_t>(c);
        const auto codeOf = [&](int k) {
            return static_cast<int>(rows_[static_cast<std::size_t>(k)][v]);
        };
        auto first = allowed_.end();
        while (first != allowed_.begin() && !isClipped(first[-1], codeOf(first[-1])))
            --first;
        std::span<const int> used(first, allowed_.end());
        if (!used.empty() && used.back() < clear) {
            while (!used.empty() && isSuspect(used.front(), pixel, c))
                used = used.subspan(1);
            if (!used.empty()) flags |= kMergeUnconfirmed;
        }
        while (used.size() > 1 && used.front() < clear && clear <= used.back() &&
               !tables_.agree(c, used[0], codeOf(used[0]), used[1], codeOf(used[1])))
            used = used.subspan(1);
        if (used.empty()) {
            lowerBound(c, allowed_.back(), codeOf(allowed_.back()), radiance, variance);
            flags |= kMergeClipped;
            black = 0;
            return;
        }
        const MergeFrame& frame = tables_.frames()[static_cast<std::size_t>(used.front())];
        const int code = codeOf(used.front());
        const bool is_black = isBlack(used.front(), code);
        weights_.clear();
        const double predicted = static_cast<double>(tables_.exposures(c)[code]) / frame.exposure;
        variance = static_cast<float>(tables_.weigh(c, used, predicted, is_black, weights_));
        double sum = 0.0;
        for (std::size_t j = 0; j < weights_.size(); ++j)
            sum += weights_[j] * static_cast<double>(tables_.exposures(c)[codeOf(used[j])]);
        radiance = static_cast<float>(sum);
        if (weights_.size() == 1) flags |= kMergeSingleFrame;
        if (!is_black) black = 0;
    }

    const MergeTables& tables_;
    MergeResult& result_;
    int count_;
    int width_;
    int height_;
    std::size_t values_;
    std::array<std::vector<std::int16_t>, 3> open_;  ///< of three rows, by y % 3
    std::vector<std::int16_t> column_;
    std::vector<const std::uint16_t*> rows_;  ///< of each frame; the last one's again as padding
    std::vector<std::int16_t> clear_;
    std::vector<std::uint8_t> masked_;
    bool any_masked_ = false;
    std::vector<int> allowed_;     ///< frames not excluded at a pixel
    std::vector<double> weights_;  ///< of those in use
};

}  // namespace

void mergeRows(const MergeTables& tables, int first, int last, MergeResult& result)
{
    RowMerger(tables, result).run(first, last);
}

}  // namespace insitu
