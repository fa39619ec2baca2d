#pragma once

#include "composite/tonemap/scene_strip.h"
#include "core/image.h"

#include <cstdint>

namespace insitu {

/// What tone curves are made from: the luminances of one picture, or of a set of pictures.
struct SceneStatistics {
    std::int64_t pixels = 0;
    double smallest = 0.0;  ///< least and largest luminance, unit of the scene
    double largest = 0.0;
    double mean = 0.0;
    /// exp(mean(log(delta + L))), delta a millionth of the mean, which saves black pixels from
    /// log(0) without a unit of its own. 0 when all is black.
    double log_average = 0.0;

    /// Those of both together: two photographs that share a curve.
    [[nodiscard]] SceneStatistics joined(const SceneStatistics& other) const;
};

/// measureScene() of a scene that comes in strips: kPasses passes over all of it, from the top.
class SceneMeter {
public:
    static constexpr int kPasses = 2;

    void gather(int pass, const SceneStrip& strip);
    void endPass(int pass);
    /// After the last pass.
    [[nodiscard]] const SceneStatistics& statistics() const { return statistics_; }

private:
    SceneStatistics statistics_;
    double sum_ = 0.0;  ///< of what the pass sums
};

/// Throws InputError naming the first pixel, in order of rows, that is not finite and >= 0.
/// Source: [Reinhard02] equation 1 for the log average.
[[nodiscard]] SceneStatistics measureScene(const Image<Rgb>& scene);

}  // namespace insitu
