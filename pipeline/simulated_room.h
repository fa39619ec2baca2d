#pragma once

#include "core/mesh.h"
#include "pipeline/project.h"

#include <glm/glm.hpp>

#include <array>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace insitu {

/// What a surface of a simulated room looks like. All materials are evaluated by the path tracer.
struct SimulatedSurface {
    enum class Kind { Plain, Picture, Boards, Checker };
    Kind kind = Kind::Plain;
    glm::vec3 color_linear{0.8f};   ///< reflectance; of the first field of a checker, of wood
    glm::vec3 second_linear{0.2f};  ///< second field of a checker
    std::filesystem::path picture;  ///< Picture: an sRGB image, repeated
    double size_m = 1.0;            ///< width of a picture's tile or of a checker's field, > 0
    double board_width_m = 0.14;    ///< > 0
    double board_length_m = 1.4;    ///< mean, > 0
    double board_variation = 0.25;  ///< relative brightness spread between boards, [0, 1]
    bool boards_along_x = false;    ///< else along the surface's second direction
    float roughness = 1.0f;         ///< [0, 1]
    float specular = 0.0f;          ///< [0, 1]; 0 = pure Lambert
};

/// Walls are named as the camera sees them when it looks towards −z.
enum class RoomSide { Floor = 0, Ceiling, Left, Right, Back, Front };

/// A hole in a wall towards the environment. Coordinates in the wall: horizontal world coordinate
/// (z on left and right walls, x on back and front) and height.
struct SimulatedWindow {
    RoomSide wall = RoomSide::Left;
    glm::dvec2 from_m{0.0}, to_m{0.0};
    double reveal_m = 0.15;  ///< depth of the wall, >= 0; 0: no reveal and no frame
    double frame_m = 0.05;   ///< width of the frame's bars, >= 0; 0: none
};

struct SimulatedLamp {
    glm::dvec3 corner_m{0.0}, edge_u_m{0.0}, edge_v_m{0.0};  ///< shines towards u × v
    glm::vec3 radiance{1.0f};
};

struct SimulatedBox {
    RoomBox box;
    SimulatedSurface surface;
    bool in_project = true;  ///< is it marked as a solid box in the project that is written?
};

struct SimulatedFurniture {
    ProjectObject object;
    std::map<std::string, Material> materials;  ///< by the model's own names
    bool matte = false;  ///< every material becomes pure Lambert, textures kept
    std::string name;
    bool in_project = true;
};

/// Camera response Z/255 = s(E^(1/gamma)), s(y) = (1−k)·y + k·y²(3−2y): a display gamma under an
/// S-shaped contrast curve k, different per channel. E is clipped to [0, 1].
struct ToneCurve {
    glm::dvec3 gamma{2.2, 2.15, 2.05};      ///< > 0
    glm::dvec3 contrast{0.35, 0.32, 0.38};  ///< [0, 1]
};

struct SimulatedCameraBody {
    ToneCurve response;
    double read_noise = 0.0012;     ///< standard deviation of E, >= 0
    double photon_noise = 0.00025;  ///< variance of E per unit of E, >= 0
    double blur_px = 0.0;           ///< standard deviation of a Gaussian blur, >= 0
    int jpeg_quality = 97;          ///< 1 to 100
    double f_number = 8.0;
    double iso = 100.0;
    std::string make = "insitu";
    std::string model = "simulated camera";
};

/// room.json (docs/file_format.md), checked; paths absolute; world frame of core/camera.h with the
/// origin on the floor.
struct SimulatedRoom {
    std::filesystem::path file;
    RoomBox box;
    std::array<SimulatedSurface, 6> surfaces;  ///< by RoomSide
    std::vector<SimulatedWindow> windows;
    std::optional<std::filesystem::path> environment;
    double environment_rotation_deg = 0.0;  ///< counter-clockwise seen from above
    glm::vec3 environment_gain{1.0f};
    std::vector<SimulatedLamp> lamps;
    std::vector<SimulatedBox> boxes;
    std::vector<SimulatedFurniture> furniture;

    Camera camera;
    ProjectObject object;
    MirrorBall ball;  ///< center_px and radius_px for the square close-up
    int ball_size_px = 600;
    std::vector<glm::dvec3> ball_views_m;  ///< where the close-ups' camera was; one or more

    SimulatedCameraBody body;
    double plate_seconds = 1.0 / 30.0;
    std::vector<double> ball_seconds;
    /// The plate is exposed so that this share of its pixels lies below the code.
    double plate_percentile = 95.0;
    double plate_code = 235.0;
    double line_noise_px = 0.8;

    int samples_per_pixel = 256;
    int ball_samples_per_pixel = 64;
    int panorama_samples_per_pixel = 64;
    int panorama_width = 512;
    int max_bounces = 12;
    int roulette_start = 2;   ///< bounces before paths may end by chance, >= 0
    bool denoise = false;     ///< plate and truth: see pipeline/denoise.h
    int truth_reduction = 1;  ///< linear truth pictures are written this much smaller
    std::uint64_t seed = 1;
};

/// Reads and checks room.json. InputError as readProject.
[[nodiscard]] SimulatedRoom readSimulatedRoom(const std::filesystem::path& path);

/// The same room with every picture `factor` times as large (0 < factor <= 1): to try it out.
[[nodiscard]] SimulatedRoom resized(SimulatedRoom room, double factor);

}  // namespace insitu
