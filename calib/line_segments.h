#pragma once

#include <glm/glm.hpp>

#include <array>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace insitu {

/// What a user marks in a photograph to calibrate its camera (`lines.json`, docs/file_format.md).
///
/// Common rules: pixels in the convention of core/camera.h, in the upright photograph, and lengths
/// in metres. Points may lie outside the picture (a line drawn beyond its edge). Every complaint
/// is an InputError that names the file and the place in it ("segments[3].to_px").

enum class RoomAxis { X = 0, Y = 1, Z = 2 };

/// "x", "y" or "z".
[[nodiscard]] const char* axisName(RoomAxis axis);

/// An image segment that runs along a direction of the room. Which end is named first is free.
struct LineSegment {
    RoomAxis axis = RoomAxis::X;
    glm::dvec2 from_px{0.0};
    glm::dvec2 to_px{0.0};
    /// Points between the ends, in order, where the line was traced: they show how the lens bends.
    std::vector<glm::dvec2> via_px{};
};

/// A length known in metres: both ends on the floor, or from a floor point straight up.
struct KnownLength {
    enum class On { Floor, Vertical };
    glm::dvec2 from_px{0.0};  ///< for Vertical: the end on the floor
    glm::dvec2 to_px{0.0};
    On on = On::Floor;
    double metres = 0.0;
    double sigma_m = 0.0;  ///< 1σ of metres, 0 = exact
};

/// A point whose place in the world is known, for instance one measured on the floor.
struct KnownPoint {
    glm::dvec2 at_px{0.0};
    glm::dvec3 position_m{0.0};
    double sigma_m = 0.0;  ///< 1σ of each coordinate, 0 = exact
};

/// Something rectangular in any plane: a picture on a wall, a tile, a sheet of paper.
struct MarkedRectangle {
    std::array<glm::dvec2, 4> corners_px{};  ///< in order around it
    double ratio = 0.0;     ///< first side (from corner 0 to 1) over the second; 0 = unknown
    bool on_floor = false;  ///< it lies on the floor or level above it
};

/// Two lines on the floor that are at right angles, whatever their direction.
struct FloorRightAngle {
    glm::dvec2 corner_px{0.0};
    glm::dvec2 first_px{0.0};
    glm::dvec2 second_px{0.0};
};

/// Where the optical axis meets the picture, as known from elsewhere.
struct KnownPrincipalPoint {
    glm::dvec2 px{0.0};
    double sigma_px = 0.0;  ///< 1σ of each coordinate, 0 = exact
};

/// What "up" is in the camera's frame (x right, y down, z forward), by its accelerometer.
struct Gravity {
    glm::dvec3 up{0.0, -1.0, 0.0};
    double sigma_rad = 0.02;  ///< 1σ about each of the two axes at right angles to it, > 0
};

/// How far the lens bends lines: λ of core/camera.h. The default bends nothing.
struct MarkedDistortion {
    double division = 0.0;
    double sigma = 0.0;  ///< 1σ of division as a start and prior; 0 = exact
};

/// What the user marked in the photograph.
struct LineSet {
    int width = 0;
    int height = 0;
    std::vector<LineSegment> segments;
    glm::dvec2 origin_px{0.0};  ///< where the world's origin, a floor point, is seen
    std::optional<double> camera_height_m;
    double camera_height_sigma_m = 0.0;  ///< 1σ of camera_height_m, 0 = exact
    std::vector<KnownLength> lengths;
    MarkedDistortion distortion;
    /// Lines that are straight in the room, whatever their direction: three points or more each.
    std::vector<std::vector<glm::dvec2>> straight_lines;
    std::vector<MarkedRectangle> rectangles;
    std::vector<FloorRightAngle> right_angles;
    std::vector<KnownPoint> points;
    std::optional<KnownPrincipalPoint> principal_point;
    std::optional<Gravity> gravity;

    /// Throws InputError (naming `source`) unless sizes are positive, all numbers finite, every
    /// segment at least a pixel long and every length positive.
    void check(const std::string& source) const;
};

/// Reads and checks `lines.json`. An unknown key is an error with a suggestion.
[[nodiscard]] LineSet readLineSet(const std::filesystem::path& path);

/// InputError unless the lines were marked in a picture of this size.
void checkLinesMatchPhoto(const LineSet& lines, int width, int height, const std::string& source);

}  // namespace insitu
