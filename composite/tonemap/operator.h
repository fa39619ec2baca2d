#pragma once

#include "composite/tonemap/scene_statistics.h"
#include "composite/tonemap/scene_strip.h"
#include "core/photo.h"
#include "core/progress.h"

#include <memory>

namespace insitu {

/// A part of a picture, pixels; its corner at multiples of kGrid.
struct PixelBox {
    static constexpr int kGrid = 64;

    int left = 0, top = 0;
    int width = 0, height = 0;  ///< multiples of kGrid, but at the picture's border
};

/// An operator at work on one scene, strip by strip.
///
/// First come the passes that gather, each over all of the scene: strips from the top, without
/// overlap. Then strips are mapped, in any order; the result does not depend on how the scene is
/// cut, as long as strips begin at multiples of kStripRows.
class SceneMapping {
public:
    static constexpr int kStripRows = 512;
    /// Rows beyond any scene's.
    static constexpr int kWhole = 1 << 30;

    virtual ~SceneMapping() = default;

    [[nodiscard]] virtual int passes() const { return 0; }
    virtual void gather(int /*pass*/, const SceneStrip& /*strip*/) {}
    virtual void endPass(int /*pass*/) {}

    /// Known once all is gathered: how far above and below the rows to be mapped a strip must hold
    /// the scene's rows; kWhole: it must be the whole scene.
    [[nodiscard]] virtual int reach() const { return 0; }
    /// The strip must begin at a multiple of this, besides.
    [[nodiscard]] virtual int alignment() const { return 1; }
    /// Maps the scene's rows from `top` on into `display`, which is as wide as the scene and begins
    /// there. Calls are not thread-safe, but each uses all threads.
    virtual void map(const SceneStrip& strip,
                     int top,
                     Image<Rgb>& display,
                     Progress& progress) const = 0;

    /// Whether parts can be mapped by themselves: what a pixel becomes depends on the statistics
    /// and on what lies within reach() pixels around it, not on what was gathered.
    [[nodiscard]] virtual bool mapsBoxes() const { return false; }
    /// Maps one box of the whole scene into the whole display. Thread-safe for boxes that do not
    /// overlap.
    virtual void mapBox(const SceneStrip& /*whole*/,
                        const PixelBox& /*box*/,
                        Image<Rgb>& /*display*/) const
    {
    }
};

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
    void mapInto(Image<Rgb>& display,
                 const Image<Rgb>& scene,
                 const SceneStatistics& statistics,
                 Progress& progress) const;

    /// For a scene of this size, >= 1x1, that comes in strips.
    [[nodiscard]] virtual std::unique_ptr<SceneMapping> begin(
        int width, int height, const SceneStatistics& statistics) const = 0;
};

/// Display-linear colour through the sRGB curve, rounded to the nearest code; values outside [0, 1]
/// are clamped. `max_code` is 255 or 65535.
[[nodiscard]] EncodedImage encodeSrgb(const Image<Rgb>& display, int max_code = 255);

}  // namespace insitu
