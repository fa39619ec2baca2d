#pragma once

#include "capture/hdr_merge.h"

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace insitu {

/// One frame of the merge; codes in its own steps.
struct MergeFrame {
    const EncodedImage* image = nullptr;
    const Image<std::uint8_t>* excluded = nullptr;  ///< 1: not to be used; empty: all usable
    double exposure = 0.0;
    float inverse_exposure = 0.0f;
    int clip_code = 0;     ///< above: clipped
    int suspect_code = 0;  ///< above, beside a clipped channel: perhaps clipped
    int black_code = 0;    ///< below: black
};

/// How the frames at one pixel and channel are weighted, given its reference frame (the longest
/// one in use) and the code there: first in memory, followed by the weights of the reference frame
/// and the next shorter ones, zeros up to a multiple of kGroup. The radiance is the sum of weight
/// times exposure.
struct MergeEntry {
    float variance;  ///< of the radiance
    std::int32_t frames;
};

/// What the merge looks up by channel, frame and code. Built once per bracket.
class MergeTables {
public:
    /// Weights are padded to whole groups, so that the sums need few branches.
    static constexpr int kGroup = 4;

    /// Keeps references to its arguments. All frames have the same max_code.
    MergeTables(const Bracket& bracket,
                const ResponseCurve& response,
                const NoiseModel& noise,
                const MergeOptions& options);

    [[nodiscard]] const std::vector<MergeFrame>& frames() const { return frames_; }
    [[nodiscard]] int frameCount() const { return count_; }

    /// Exposures by code.
    [[nodiscard]] const float* exposures(int c) const
    {
        return exposures_[static_cast<std::size_t>(c)].data();
    }
    /// The entry of reference frame k with this code, at or below its clip_code.
    [[nodiscard]] const float* entry(int c, int k, int code) const
    {
        const int bin = code >> bin_shift_;
        return entries_.data() + static_cast<std::size_t>((c * count_ + k) * 256 + bin) * stride_;
    }
    [[nodiscard]] static MergeEntry header(const float* entry)
    {
        return {entry[0], std::bit_cast<std::int32_t>(entry[1])};
    }
    [[nodiscard]] static const float* weights(const float* entry) { return entry + kHeader; }

    /// Do the codes of two frames mean the same radiance, within their noise? The first one's, the
    /// longer exposure's, is brought to the second one's exposure.
    [[nodiscard]] bool agree(
        int c, int longer, int longer_code, int shorter, int shorter_code) const
    {
        const MergeFrame& a = frames_[static_cast<std::size_t>(longer)];
        const MergeFrame& b = frames_[static_cast<std::size_t>(shorter)];
        const float ratio = static_cast<float>(b.exposure) * a.inverse_exposure;
        const float found = exposures(c)[shorter_code];
        const float difference = found - ratio * exposures(c)[longer_code];
        const float* allowed = allowed_[static_cast<std::size_t>(c)].data();
        return difference * difference <= allowed[shorter_code >> bin_shift_] +
                                              ratio * ratio * allowed[longer_code >> bin_shift_];
    }

    /// The same as an entry for frames that do not follow each other: `used` in order of exposure,
    /// the first one the reference. Weights are added to `weights`; returns the variance.
    [[nodiscard]] double weigh(int c,
                               std::span<const int> used,
                               double radiance,
                               bool black,
                               std::vector<double>& weights) const;

private:
    static constexpr std::size_t kHeader = 2;

    struct FrameWeight {
        double weight;    ///< inverse variance, faded at the ends of the codes; 0: not to be used
        double variance;  ///< of the frame's radiance
    };
    [[nodiscard]] FrameWeight frameWeight(int c, int k, double radiance, bool reference) const;
    [[nodiscard]] double varianceAt(int c, double code) const;
    void buildFrames(const Bracket& bracket);
    void buildEntries();

    const ResponseCurve& response_;
    const NoiseModel& noise_;
    const MergeOptions& options_;
    std::vector<MergeFrame> frames_;
    int count_ = 0;
    int bin_shift_ = 0;  ///< code >> bin_shift is an 8-bit code
    std::array<std::vector<float>, 3> exposures_;
    std::array<std::array<double, 256>, 3> variance_{};  ///< of exposure, by 8-bit code
    std::array<std::array<float, 256>, 3> allowed_{};    ///< squared difference, by 8-bit code
    std::size_t stride_ = 0;
    std::vector<float> entries_;
};

}  // namespace insitu
