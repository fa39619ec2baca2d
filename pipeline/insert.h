#pragma once

#include "capture/radiance_capture.h"
#include "composite/differential.h"
#include "core/environment_map.h"
#include "core/progress.h"
#include "lighting/light_reference.h"
#include "pipeline/photo_balance.h"
#include "pipeline/project.h"
#include "render/renderer.h"

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

namespace insitu {

struct InsertOptions {
    CaptureOptions capture;
    RoomLightOptions light;
    InsertionOptions render;
    CompositeOptions composite;
    CameraMatchOptions match;
    /// Take the focal length in EXIF into account.
    bool use_exif_focal = true;
    /// Where the results of stages are kept for the next run (stage_cache.h); empty: nowhere.
    std::filesystem::path cache_folder;
};

/// Seconds one stage took.
struct StageTime {
    std::string stage;
    double seconds = 0.0;
    double processor_seconds = 0.0;  ///< of all threads
    bool from_cache = false;
};

/// The light of a project: an environment seen from a place in the room.
struct CapturedLight {
    EnvironmentMap environment;
    glm::dvec3 center_m{0.0};
    ResponseCurve response;            ///< of the camera that took the probe
    bool response_known = false;       ///< recovered or given, not assumed
    bool radiance_unit_known = false;  ///< exposures are known, so that photographs compare
    PhotoMetadata metadata;
    /// What was measured of the light, all but what only the photograph shows.
    std::vector<ReferenceGroup> references;
    Findings findings;
};

struct InsertResult {
    Photo photo;
    ResponseCurve photo_response;
    double photo_relative_exposure = 1.0;
    CameraEstimate camera;
    CapturedLight light;
    InsertionResult render;
    CameraMatchEstimate match;
    PhotoLayers layers;  ///< what was put onto the photograph: matched, behind its foreground
    Composite composite;
    PhotoBalance balance;
    Findings findings;  ///< of all stages, in order
    std::vector<StageTime> times;
};

/// The camera of the project: from its lines or its file; InputError when the size is not the
/// photo's.
[[nodiscard]] CameraEstimate solveCamera(const Project& project,
                                         const Photo& photo,
                                         bool use_exif_focal);
/// Brackets → response → radiance → environment at the probe's centre, and what its references
/// measured. All views, and pictures of references, take the first one's response. `photo_camera`
/// may be absent when no view is the photograph's; `distance_to_room` as in UnwrapOptions.
/// InputError: also a mask that is not of its pictures' size.
[[nodiscard]] CapturedLight captureProbe(
    const ProjectProbe& probe,
    const Camera* photo_camera,
    const std::function<double(glm::dvec3 origin, glm::dvec3 direction)>& distance_to_room,
    const CaptureOptions& options,
    int width = 0);
/// captureProbe with the room's distances, or the environment file.
[[nodiscard]] CapturedLight captureLight(const Project& project,
                                         const SceneProxy& proxy,
                                         const Camera& photo_camera,
                                         const InsertOptions& options);
/// The whole main job, in memory. InputError and NoAnswerError as the stages throw them.
[[nodiscard]] InsertResult insertObjects(const Project& project,
                                         const InsertOptions& options,
                                         Progress& progress);

}  // namespace insitu
