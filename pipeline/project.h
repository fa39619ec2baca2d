#pragma once

#include "calib/camera_solve.h"
#include "capture/light_probe.h"
#include "composite/foreground.h"
#include "core/finding.h"
#include "core/mesh.h"
#include "core/photo.h"
#include "reconstruct/scene_proxy.h"

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace insitu {

/// A photograph named by a project, with exposure members that override EXIF.
struct ProjectImage {
    std::filesystem::path path;
    Exposure exposure;  ///< only what the project file gives
};

/// `photo.white_balance`: how the photograph's exposure and colour follow from the light probe's
/// (pipeline/photo_balance.h).
struct ProjectWhiteBalance {
    enum class Mode { Auto, None, Solved, Given };
    Mode mode = Mode::Auto;
    glm::dvec3 gains{1.0};  ///< Given: the photograph's radiance over the probe's
};

/// An entry of `photo.foreground`: what stands before the objects (composite/foreground.h).
struct ProjectForeground {
    ForegroundMark mark;                        ///< without its mask
    std::optional<std::filesystem::path> mask;  ///< a picture of the photograph's size
};

enum class ProbeKind { MirrorBall, Angular, LatLong, CubeCross };

/// One bracket of the probe, and where it was taken from.
struct ProjectView {
    std::vector<ProjectImage> images;
    MirrorBall ball;  ///< mirror ball only; center_m is the probe's
    /// The file does not give the outline: captureProbe looks for it (pipeline/probe_outline.h).
    bool find_outline = false;
    /// Mirror ball only: its camera's place, or nothing when it is the photograph's camera.
    std::optional<glm::dvec3> view_position_m;
    glm::dvec3 view_up{0.0, 1.0, 0.0};  ///< upwards in the picture; for a place only
    glm::dvec2 crop_origin_px{0.0};
    /// A picture of the bracket's size, or nothing: what is not black in it is not used.
    std::optional<std::filesystem::path> mask;
};

enum class ReferenceKind { Card, Ball, Illuminance, Irradiance };

/// An entry of `light.probe.references`: what was measured of the light, to tell how strong lights
/// are that are clipped in every exposure (lighting/light_reference.h).
struct ProjectReference {
    ReferenceKind kind = ReferenceKind::Card;
    std::optional<glm::dvec3> position_m;  ///< nothing: the probe's centre
    glm::dvec3 normal{0.0, 1.0, 0.0};      ///< unit; not of a ball
    double sigma = 0.03;                   ///< relative standard deviation
    glm::dvec3 irradiance{0.0};            ///< Irradiance; Illuminance: lux, three times

    enum class Source { Probe, Photo, Own };
    Source source = Source::Probe;      ///< card or ball: whose pictures show it
    std::vector<ProjectImage> images;   ///< its own
    glm::dvec2 area_from_px{0.0};       ///< card: top left corner, in the full frame
    glm::dvec2 area_size_px{0.0};       ///< card
    glm::dvec2 center_px{0.0};          ///< ball: of its outline, in the full frame
    double radius_px = 0.0;             ///< ball
    double radius_m = 0.0;              ///< ball, with pictures of its own
    bool reflectance_known = true;      ///< false, of a ball: only its shading counts
    glm::dvec3 reflectance{1.0};        ///< Lambert's, (0, 1]
    glm::dvec3 view_position_m{0.0};    ///< ball, with pictures of its own: their camera
    glm::dvec3 view_up{0.0, 1.0, 0.0};  ///< likewise
};

/// `light.probe`: brackets of a light probe.
struct ProjectProbe {
    ProbeKind kind = ProbeKind::MirrorBall;
    std::vector<ProjectView> views;  ///< one; of a mirror ball, one or several
    glm::dvec3 center_m{0.0};
    /// `"center_m": "from-outline"`: placeProbeFromOutline (pipeline/probe_location.h) sets it, and
    /// that of the views' balls.
    bool center_from_outline = false;
    std::optional<std::filesystem::path> response;  ///< a saved response curve
    std::vector<ProjectReference> references;
};

struct ProjectLight {
    std::optional<ProjectProbe> probe;
    std::optional<std::filesystem::path> environment;  ///< instead of a probe
    glm::dvec3 center_m{0.0};                          ///< where the environment was captured
};

/// A piece of furniture to insert; see Placement for the order of pivot, scale, rotation, move.
struct ProjectObject {
    std::filesystem::path model;
    bool pivot_bottom_center = false;
    glm::dvec3 position_m{0.0};
    double rotation_y_deg = 0.0;
    double scale = 1.0;
    std::optional<Material> material;  ///< replaces the model's wholly
};

/// project.json, version 1, checked; every path is absolute.
struct Project {
    std::filesystem::path file;
    ProjectImage photo;
    ProjectWhiteBalance white_balance;
    std::vector<ProjectForeground> foreground;
    /// Distance at which the photograph is sharp, metres; absent: found from its edges, if any
    /// tell.
    std::optional<double> photo_focus_m;
    /// Fall-off of light towards its corners (Vignetting::a), given or to be estimated.
    std::optional<double> photo_vignetting;
    bool estimate_vignetting = false;
    std::optional<std::filesystem::path> camera_lines;
    std::optional<std::filesystem::path> camera_file;
    ProjectLight light;
    RoomDescription room;
    std::vector<ProjectObject> objects;
};

/// Reads and checks a project file (docs/file_format.md). InputError: file, position
/// ("objects[0].scale"), cause, remedy (a misspelt key gets a suggestion). Every file that the
/// project names must exist; an object's position must lie in the room when something encloses one
/// (reconstruct/room_bounds.h).
[[nodiscard]] Project readProject(const std::filesystem::path& path);

/// Reads a file that holds what `light.probe` holds, paths relative to it. InputError as
/// readProject; also a view through the photograph's camera, which is not known here.
[[nodiscard]] ProjectProbe readProbeFile(const std::filesystem::path& path);

/// Where the object stands, given its model's mesh as loaded (the pivot needs its bounds).
[[nodiscard]] Placement placementOf(const ProjectObject& object, const TriangleMesh& mesh);
/// The object's model, loaded, with its material replaced when the project says so, and where it
/// stands. InputError as readModel.
[[nodiscard]] PlacedModel loadObject(const ProjectObject& object);

}  // namespace insitu
