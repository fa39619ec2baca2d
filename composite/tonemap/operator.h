#pragma once

#include "composite/tonemap/scene_statistics.h"
#include "core/photo.h"
#include "core/progress.h"

namespace insitu {

/// A tone mapping operator: scene-linear radiance to what a display can show, for *viewing* HDR
/// pictures. The composite itself never passes one; it returns through the photograph's own
/// response.
///
/// Common rules. Global operators are one curve for all pixels, local ones look at a pixel's
/// surroundings; both fit, since an operator sees the whole image. A scene is finite and >= 0, of
/// any size and in any unit; a pixel that is not is an InputError which names it (readers of files
/// have already made negative values 0 and refused NaN, core/io/image_io.h). Black stays black.
/// Colours keep the ratios of their channels until one of them reaches the display's white. Calls
/// are thread-safe, and the result depends neither on the number of threads nor on the machine's
/// instruction set.
class ToneMapOperator {
public:
    virtual ~ToneMapOperator() = default;

    /// Curve from the scene's own statistics.
    /// Returns display-linear colour in [0, 1], same size; 1 is the display's white.
    [[nodiscard]] Image<Rgb> map(const Image<Rgb>& scene, Progress& progress) const
    {
        return map(scene, measureScene(scene), progress);
    }
    /// Curve from given statistics: those of a whole set of photographs, so that all of them get
    /// the same look.
    [[nodiscard]] Image<Rgb> map(const Image<Rgb>& scene,
                                 const SceneStatistics& statistics,
                                 Progress& progress) const
    {
        Image<Rgb> display(scene.width(), scene.height());
        mapInto(display, scene, statistics, progress);
        return display;
    }
    /// The same into an image of the scene's size, for callers that keep one from frame to frame.
    virtual void mapInto(Image<Rgb>& display,
                         const Image<Rgb>& scene,
                         const SceneStatistics& statistics,
                         Progress& progress) const = 0;
};

/// Display-linear colour through the sRGB curve, rounded to the nearest code; values outside [0, 1]
/// are clamped. `max_code` is 255 or 65535.
[[nodiscard]] EncodedImage encodeSrgb(const Image<Rgb>& display, int max_code = 255);

}  // namespace insitu
