#pragma once

#include "core/camera.h"
#include "core/layers.h"
#include "core/progress.h"
#include "lighting/room_light.h"
#include "render/irradiance_filter.h"
#include "render/object_scene.h"
#include "render/room_with_objects.h"

#include <cstdint>
#include <string>

namespace insitu {

/// How the layers of an insertion are computed; every technique gives the same layers.
enum class Technique { Reference };

struct InsertionOptions {
    Technique technique = Technique::Reference;
    /// Most samples of one pixel, > 0.
    int max_samples = 256;
    /// Fewest, before a pixel may stop early, in [1, max_samples].
    int min_samples = 16;
    /// A pixel stops when the relative standard error of its object radiance is below this and that
    /// of its with/without ratio below three times this (neighbours are averaged afterwards), for
    /// it and the pixels around it.
    /// >= 0; 0 = always max_samples.
    double target_error = 0.02;
    /// Stop after this many seconds; 0 = no limit. With a limit the result depends on the machine.
    double max_seconds = 0.0;
    std::uint64_t seed = 1;
    PathOptions path{.max_bounces = 6, .roulette_start = 3};
    InterreflectionOptions interreflection;
    IrradianceFilterOptions filter;

    [[nodiscard]] Findings validate() const;
};

struct InsertionResult {
    RenderLayers layers;
    double mean_samples = 0.0;  ///< per pixel
    bool stopped_by_time = false;
    /// Root mean square of the ratio's standard error over the receivers: what noise is left.
    double ratio_error = 0.0;
};

/// Renders the room without and with the objects, as the photograph's camera sees it.
[[nodiscard]] InsertionResult renderInsertion(const Camera& camera,
                                              const RoomLight& room,
                                              const ObjectScene& objects,
                                              const InsertionOptions& options,
                                              Progress& progress);

}  // namespace insitu
