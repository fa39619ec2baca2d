#pragma once

#include "core/camera.h"
#include "core/finding.h"
#include "core/layers.h"
#include "core/progress.h"
#include "lighting/room_light.h"
#include "lighting/visibility_atlas.h"
#include "render/irradiance_filter.h"
#include "render/object_scene.h"
#include "render/room_with_objects.h"

#include <cstdint>
#include <filesystem>

namespace insitu {

/// How the layers of an insertion are computed; every technique gives the same layers.
enum class Technique {
    Reference,  ///< paths on Embree, noisy, as exact as it has time for
    Fiv,        ///< visibility atlas and local light: no noise, some bias, a fraction of the time
    Auto,       ///< Fiv if sampled pixels show that it keeps the bound, else Reference
};

/// "reference", "fiv", "auto".
[[nodiscard]] const char* techniqueName(Technique technique);

/// How much Technique::Fiv knows of where light comes from. All but Room only serve to measure what
/// leaving it out costs.
enum class FivLight {
    Room,     ///< near surfaces are near
    Distant,  ///< all light is as seen from the objects' centre, from infinity
    Cube,     ///< and nothing is hidden: irradiance for each normal, no shadows
};

/// Technique::Fiv. No seed: it draws no random numbers.
struct FivOptions {
    /// What the receivers lose is looked up in this; several objects share one.
    AtlasOptions atlas;
    /// Cells along the side of a cube's face for light on the objects themselves, [4, 64].
    int object_face_size = 16;
    /// Distance of the places from which the light of a surface is looked at, metres, > 0.
    double receiver_node_spacing_m = 0.5;
    /// The same around the objects.
    double object_node_spacing_m = 0.3;
    /// Between pixels, with/without is interpolated where that is off by less than this, >= 0.
    double interpolation_tolerance = 0.002;
    FivLight light = FivLight::Room;
    /// Points on the objects that tell what these send, > 0.
    int object_samples = 512;
    /// Where atlases are kept for other pictures of the same objects; empty: nowhere.
    std::filesystem::path atlas_folder;
};

struct InsertionOptions {
    Technique technique = Technique::Reference;
    /// Most samples of one pixel, > 0.
    int max_samples = 256;
    /// Fewest, before a pixel may stop early, in [1, max_samples].
    int min_samples = 16;
    /// A pixel stops when the relative standard error of its object radiance is below this and that
    /// of its with/without ratio below three times this (neighbours are averaged afterwards), for
    /// it and the pixels around it.
    /// >= 0; 0 = always max_samples. With Technique::Auto also the largest root mean square error
    /// of Fiv, as sampled (SampledError), at which its picture is taken.
    double target_error = 0.02;
    /// Stop after this many seconds; 0 = no limit. With a limit the result depends on the machine.
    double max_seconds = 0.0;
    std::uint64_t seed = 1;
    PathOptions path{.max_bounces = 6, .roulette_start = 3};
    InterreflectionOptions interreflection;
    IrradianceFilterOptions filter;
    FivOptions fiv;

    [[nodiscard]] Findings validate() const;
};

/// Error of a picture against the reference at random pixels that the objects change: of object
/// radiance relative to its mean, and of the receivers' with/without. The reference's own noise is
/// taken off; its inter-reflection is always counted.
struct SampledError {
    int pixels = 0;      ///< 0: was not sampled
    double rms = 0.0;    ///< root mean square
    double upper = 0.0;  ///< one-sided 95 % bound of it
};

struct InsertionResult {
    RenderLayers layers;
    Technique technique = Technique::Reference;  ///< that made the layers; never Auto
    SampledError fiv_error;                      ///< Auto: what it decided by
    /// Without inter-reflection: how far this picture is from the reference with it.
    SampledError no_interreflection_error;
    /// Samples per pixel; with Fiv the share of receivers that was computed, not interpolated.
    double mean_samples = 0.0;
    bool stopped_by_time = false;
    /// Root mean square of the ratio's standard error over the receivers: what noise is left.
    double ratio_error = 0.0;
    /// Fiv: bytes of its tables and the seconds it took to have them, made or read.
    std::size_t table_bytes = 0;
    double table_seconds = 0.0;
    double table_processor_seconds = 0.0;
    Findings findings;
};

/// Renders the room without and with the objects, as the photograph's camera sees it.
[[nodiscard]] InsertionResult renderInsertion(const Camera& camera,
                                              const RoomLight& room,
                                              const ObjectScene& objects,
                                              const InsertionOptions& options,
                                              Progress& progress);

/// Layers of that size, all black and transparent.
[[nodiscard]] RenderLayers emptyLayers(int width, int height);

}  // namespace insitu
