#pragma once

#include "calib/camera_solve.h"
#include "calib/line_segments.h"
#include "calib/orientation.h"

#include <glm/glm.hpp>

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace insitu {

/// Several photographs of one room, and what they have in common.

/// One photograph.
struct RoomView {
    std::string name;
    LineSet
        lines;  ///< its own segments, origin, height or lengths (the first view's origin counts)
    /// Views of the same `camera` share one focal length. Empty: this view has its own.
    std::string camera;
    std::optional<FocalPrior> exif;
    std::filesystem::path image;  ///< as the file names it; may be empty
};

/// A point of the room that several photographs show.
struct SharedPoint {
    std::string name;
    bool on_floor = false;
    std::map<std::size_t, glm::dvec2> seen_px;  ///< by the view's index
};

/// A distance between two shared points.
struct SharedLength {
    std::size_t from = 0;
    std::size_t to = 0;
    double metres = 0.0;
    double sigma_m = 0.002;
};

struct RoomViews {
    std::vector<RoomView> views;
    std::vector<SharedPoint> points;
    std::vector<SharedLength> lengths;

    /// Throws InputError (naming `source`) unless there are views, names differ, every point is
    /// seen by two views (one is enough on the floor) and every number is finite and possible.
    void check(const std::string& source) const;
};

/// Reads and checks `views.json` (docs/file_format.md) with the lines files that it names; EXIF
/// focal lengths come from the images. InputError with file, position and cause.
[[nodiscard]] RoomViews readRoomViews(const std::filesystem::path& path);

/// The cameras of all views in the world of the first one (its axes, its origin), in one solve.
struct JoinedViews {
    std::vector<CameraEstimate> cameras;  ///< in the order of the views
    std::vector<glm::dvec3> points_m;     ///< of the shared points
    double chi_squared = 0.0;
    double freedom = 0.0;
    Findings findings;
};

/// Least squares over every camera's rotation and place, the focal length of each camera body and
/// the shared points: distances of segments' ends from the lines through their middles and
/// vanishing points, places of points in the pictures, heights, lengths, EXIF. Every marked
/// coordinate has an error of `options.segment_sigma_px`. Begins with each view by itself
/// (calibrateCamera); the axes of a view may be turned by quarters about the upright one against
/// the first's: its x is what points right in its own picture. The deviations are those of the
/// inverse information matrix.
///
/// A view after the first must share at least two points with those before it, one of them on the
/// floor.
/// Findings: "views-joined" (counts, residuals), "views-inconsistent" when χ² is larger than one in
/// a thousand would be.
/// NoAnswerError: a view that cannot be joined, or no convergence; those of calibrateCamera, which
/// then names the view.
/// Source: [FoeWro16] chapter 15 (bundle adjustment).
[[nodiscard]] JoinedViews joinViews(const RoomViews& room,
                                    const CalibrationOptions& options,
                                    const std::string& source);

}  // namespace insitu
