#include "composite/tonemap/operator.h"

#include "core/color.h"
#include "core/parallel.h"

#include <algorithm>
#include <cmath>

namespace insitu {

void ToneMapOperator::mapInto(Image<Rgb>& display,
                              const Image<Rgb>& scene,
                              const SceneStatistics& statistics,
                              Progress& progress) const
{
    INSITU_CHECK(display.sameSize(scene), "{}x{}", display.width(), display.height());
    if (scene.empty()) return;
    progress.checkpoint();
    const SceneStrip whole(scene);
    const auto mapping = begin(scene.width(), scene.height(), statistics);
    for (int pass = 0; pass < mapping->passes(); ++pass) {
        mapping->gather(pass, whole);
        mapping->endPass(pass);
        progress.checkpoint();
    }
    mapping->map(whole, 0, display, progress);
    progress.checkpoint();
    progress.report("tone mapping", 1.0);
}

EncodedImage encodeSrgb(const Image<Rgb>& display, int max_code)
{
    INSITU_CHECK(max_code == 255 || max_code == 65535, "{}", max_code);
    EncodedImage result{Image<glm::u16vec3>(display.width(), display.height()), max_code};
    parallelFor(0, display.height(), [&](std::int64_t row) {
        const int y = static_cast<int>(row);
        for (int x = 0; x < display.width(); ++x)
            for (int c = 0; c < 3; ++c) {
                const double linear = std::clamp(static_cast<double>(display(x, y)[c]), 0.0, 1.0);
                result.codes(x, y)[c] =
                    static_cast<std::uint16_t>(std::lround(srgbFromLinear(linear) * max_code));
            }
    });
    return result;
}

}  // namespace insitu
