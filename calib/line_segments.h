#pragma once

#include <glm/glm.hpp>

#include <array>
#include <filesystem>
#include <optional>
#include <vector>

namespace insitu {

enum class RoomAxis { X = 0, Y = 1, Z = 2 };

/// An image segment that runs along a direction of the room.
struct LineSegment {
    RoomAxis axis = RoomAxis::X;
    glm::dvec2 from_px{0.0};
    glm::dvec2 to_px{0.0};
};

/// A length known in metres: both ends on the floor, or from a floor point straight up.
struct KnownLength {
    enum class On { Floor, Vertical };
    glm::dvec2 from_px{0.0};
    glm::dvec2 to_px{0.0};
    On on = On::Floor;
    double metres = 0.0;
};

/// What the user marked in the photograph (`lines.json`, docs/file_format.md).
struct LineSet {
    int width = 0;
    int height = 0;
    std::vector<LineSegment> segments;
    glm::dvec2 origin_px{0.0};  ///< where the world's origin, a floor point, is seen
    std::optional<double> camera_height_m;
    std::vector<KnownLength> lengths;
};

[[nodiscard]] LineSet readLineSet(const std::filesystem::path& path);

}  // namespace insitu
