#include "render/renderer.h"

#include "render/fiv/fiv_renderer.h"
#include "render/reference_renderer.h"
#include "render/sampled_error.h"

#include <fmt/format.h>

namespace insitu {

const char* techniqueName(Technique technique)
{
    switch (technique) {
        case Technique::Reference:
            return "reference";
        case Technique::Fiv:
            return "fiv";
        case Technique::Auto:
            return "auto";
    }
    return "";
}

Findings InsertionOptions::validate() const
{
    Findings findings;
    const auto demand = [&](bool holds, const char* message) {
        if (!holds) findings.push_back({Severity::Error, "option-out-of-range", message});
    };
    demand(max_samples > 0, "max_samples must be > 0");
    demand(min_samples > 0 && min_samples <= max_samples,
           "min_samples must be in [1, max_samples]");
    demand(target_error >= 0.0, "target_error must be >= 0");
    demand(max_seconds >= 0.0, "max_seconds must be >= 0");
    demand(path.max_bounces >= 1, "path.max_bounces must be >= 1");
    demand(path.roulette_start >= 0, "path.roulette_start must be >= 0");
    demand(interreflection.rounds >= 0, "interreflection.rounds must be >= 0");
    demand(interreflection.samples_per_cell > 0, "interreflection.samples_per_cell must be > 0");
    demand(filter.levels >= 0 && filter.levels <= 10, "filter.levels must be in [0, 10]");
    demand(filter.range_sigmas > 0.0, "filter.range_sigmas must be > 0");
    append(findings, fiv.atlas.validate());
    demand(fiv.object_face_size >= 4 && fiv.object_face_size <= 64,
           "fiv.object_face_size must be in [4, 64]");
    demand(fiv.receiver_node_spacing_m > 0.0, "fiv.receiver_node_spacing_m must be > 0");
    demand(fiv.object_node_spacing_m > 0.0, "fiv.object_node_spacing_m must be > 0");
    demand(fiv.interpolation_tolerance >= 0.0, "fiv.interpolation_tolerance must be >= 0");
    demand(fiv.object_samples > 0, "fiv.object_samples must be > 0");
    return findings;
}

RenderLayers emptyLayers(int width, int height)
{
    RenderLayers layers;
    layers.object = layers.irradiance_without = layers.irradiance_with = layers.probe_radiance =
        Image<Rgb>(width, height);
    layers.alpha = layers.depth_m = layers.object_variance = layers.ratio_variance =
        Image<float>(width, height);
    return layers;
}

namespace {

InsertionResult renderChosen(const Camera& camera,
                             const RoomLight& room,
                             const ObjectScene& objects,
                             const InsertionOptions& options,
                             Progress& progress)
{
    if (options.technique == Technique::Reference)
        return renderReference(camera, room, objects, options, progress);
    InsertionResult quick = renderFiv(camera, room, objects, options, progress);
    if (options.technique == Technique::Fiv || objects.empty()) return quick;
    const SampledError error = sampleError(camera, room, objects, options, quick.layers, progress);
    const bool kept = error.upper <= options.target_error;
    InsertionResult result =
        kept ? std::move(quick) : renderReference(camera, room, objects, options, progress);
    result.fiv_error = error;
    result.findings.push_back(
        {Severity::Info,
         "technique-chosen",
         fmt::format(
             "technique {}: at {} sampled pixels fiv is off by {:.4f} (root mean square, at "
             "most {:.4f} with 95 %), the bound is {:.4f}",
             techniqueName(result.technique),
             error.pixels,
             error.rms,
             error.upper,
             options.target_error)});
    return result;
}

}  // namespace

InsertionResult renderInsertion(const Camera& camera,
                                const RoomLight& room,
                                const ObjectScene& objects,
                                const InsertionOptions& options,
                                Progress& progress)
{
    requireValid(options.validate(), "render options");
    InsertionResult result = renderChosen(camera, room, objects, options, progress);
    if (options.interreflection.enabled || objects.empty()) return result;
    const bool sampled = result.fiv_error.pixels > 0 && result.technique == Technique::Fiv;
    const SampledError error =
        sampled ? result.fiv_error
                : sampleError(camera, room, objects, options, result.layers, progress);
    result.no_interreflection_error = error;
    result.findings.push_back(
        {Severity::Info,
         "no-interreflection",
         fmt::format("without the light that objects and room send each other the picture is off "
                     "by {:.4f} at {} sampled pixels (root mean square, at most {:.4f} with 95 %)",
                     error.rms,
                     error.pixels,
                     error.upper)});
    return result;
}

}  // namespace insitu
