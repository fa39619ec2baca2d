#pragma once

#include "core/image.h"

#include <span>

namespace insitu {

/// Rows of a scene that is looked at strip by strip; a whole scene is one strip.
struct SceneStrip {
    const Image<Rgb>& rows;
    int first = 0;   ///< row of the scene that `rows` begins with
    int height = 0;  ///< of the scene

    /// The whole.
    explicit SceneStrip(const Image<Rgb>& scene) : rows(scene), height(scene.height()) {}
    SceneStrip(const Image<Rgb>& part, int first_row, int scene_height)
        : rows(part), first(first_row), height(scene_height)
    {
    }
    [[nodiscard]] int width() const { return rows.width(); }
    [[nodiscard]] int end() const { return first + rows.height(); }
    /// A row of the scene that the strip holds.
    [[nodiscard]] std::span<const Rgb> row(int y) const { return rows.row(y - first); }
    [[nodiscard]] const Rgb& operator()(int x, int y) const { return rows(x, y - first); }
};

}  // namespace insitu
