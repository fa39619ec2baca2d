#pragma once

#include "composite/tonemap/operator.h"
#include "core/finding.h"

#include <memory>
#include <optional>

namespace insitu {

/// How fast the look follows the scene from frame to frame.
struct AdaptationOptions {
    /// Time after which 63 % of a change has been followed, seconds, >= 0; 0: at once.
    double time_constant_s = 0.4;

    /// "tonemap-adaptation".
    [[nodiscard]] Findings validate() const;
};

/// Statistics of frame after frame, without jumps and flicker: logarithms follow exponentially, and
/// what is in use changes only once it is off by 0.2 %, about half a code.
class AdaptationSmoother {
public:
    /// InputError for bad options.
    explicit AdaptationSmoother(const AdaptationOptions& options = {});

    /// What to map a frame with that comes `seconds` (>= 0) after the one before. Of the first, and
    /// after reset(), its own.
    [[nodiscard]] const SceneStatistics& next(const SceneStatistics& measured, double seconds);
    /// Before a cut to another scene.
    void reset() { used_.reset(); }

private:
    AdaptationOptions options_;
    SceneStatistics followed_;
    std::optional<SceneStatistics> used_;
};

/// Maps frames of one view, one after the other, as an interactive viewer shows them. Where neither
/// the look nor the pixels that count have changed since the frame before, its result stays: with
/// operators that look a few dozen pixels around (separable ones, selective or not) the cost of a
/// moved object is that of its own pixels. Results are those of the operator, bit for bit.
class FrameMapper {
public:
    explicit FrameMapper(std::shared_ptr<const ToneMapOperator> tone_map,
                         const AdaptationOptions& options = {});

    /// The display for a scene that comes `seconds` after the one before; valid until the next
    /// call. Throws as ToneMapOperator::map does.
    [[nodiscard]] const Image<Rgb>& map(const Image<Rgb>& scene,
                                        double seconds,
                                        Progress& progress);
    /// Share of the last frame's pixels that were mapped anew, [0, 1].
    [[nodiscard]] double mappedShare() const { return mapped_share_; }

private:
    std::shared_ptr<const ToneMapOperator> tone_map_;
    AdaptationSmoother smoother_;
    SceneStatistics statistics_;
    std::unique_ptr<SceneMapping> mapping_;
    Image<Rgb> scene_, display_;
    double mapped_share_ = 0.0;
};

}  // namespace insitu
