#pragma once

#include "capture/bracket.h"
#include "capture/deghost.h"
#include "core/response_curve.h"

#include <array>
#include <cstdint>
#include <vector>

namespace insitu::detail {

/// Says of pixels in two frames whether both can show the same radiance.
///
/// A code z_j of frame j stands for an interval of radiance: a point when it is good, all above the
/// clipping limit, or all below the black one. Put into the codes of frame k through the response
/// curve, widened by noise, by the tolerance and by what lies a pixel beside, it must meet the
/// interval of z_k. Noise, and how far the curve is off, are measured for each pair of frames from
/// the bracket itself: medians over bins of codes, which what moves does not pull while most of
/// the picture is still.
class FrameComparison {
public:
    FrameComparison(const Bracket& bracket,
                    const ResponseCurve& response,
                    const DeghostOptions& options);

    /// Neither clipped nor black (with its surroundings: noise must not decide) nor excluded: a
    /// measurement of radiance.
    [[nodiscard]] bool isGood(int frame, int x, int y) const
    {
        return states_[static_cast<std::size_t>(frame)](x, y) == State::Good;
    }
    [[nodiscard]] bool isClipped(int frame, int x, int y) const
    {
        return states_[static_cast<std::size_t>(frame)](x, y) == State::Clipped;
    }
    /// Frames `k` and `j` cannot show the same here; false where one of them is excluded.
    [[nodiscard]] bool disagree(int k, int j, int x, int y) const;

private:
    enum class State : std::uint8_t { Good, Clipped, Black, Excluded };
    static constexpr int kBins = 16;
    /// For one channel of an ordered pair of frames: everything by code on 255.
    struct Table {
        std::array<float, 256> predicted{};  ///< code of k for a code of j
        std::array<float, kBins> bias{};     ///< by predicted code
        std::array<float, kBins> slack{};    ///< noise, by predicted code
    };
    using PairTables = std::array<Table, 3>;
    struct Range {
        float low = 0.0f;
        float high = 0.0f;
    };

    [[nodiscard]] PairTables measurePair(int k, int j) const;
    void measureNoise(int k, int j, int channel, Table& table) const;
    [[nodiscard]] float codeOn255(int frame, int x, int y, int channel) const;
    [[nodiscard]] float brightestOf(int frame, int x, int y) const;
    [[nodiscard]] State measureState(int frame, int x, int y) const;
    [[nodiscard]] bool isExcluded(int frame, int x, int y) const
    {
        return states_[static_cast<std::size_t>(frame)](x, y) == State::Excluded;
    }
    [[nodiscard]] Range predictedRange(int k, int j, int x, int y, int channel) const;
    [[nodiscard]] float slackAt(const Table& table, int channel, float code) const;
    [[nodiscard]] const Table& table(int k, int j, int channel) const
    {
        return tables_[static_cast<std::size_t>(k * count_ + j)][static_cast<std::size_t>(channel)];
    }

    const Bracket& bracket_;
    const ResponseCurve& response_;
    DeghostOptions options_;
    int count_;
    std::array<std::array<float, 256>, 3> tolerance_;  ///< in codes, by channel and code
    std::vector<Image<State>> states_;
    std::vector<PairTables> tables_;  ///< [k * count + j]
};

}  // namespace insitu::detail
