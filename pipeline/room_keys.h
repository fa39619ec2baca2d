#pragma once

#include "pipeline/project_keys.h"

namespace insitu::keys {

/// The keys of room.json (docs/file_format.md, "simulate").
inline const KeyList kSimulatedRoom = {"format",
                                       "version",
                                       "room",
                                       "windows",
                                       "environment",
                                       "lamps",
                                       "boxes",
                                       "furniture",
                                       "camera",
                                       "object",
                                       "ball",
                                       "photography",
                                       "lines",
                                       "render",
                                       "seed",
                                       "note"};
inline const KeyList kSimulatedBox = {"min_m", "max_m", "surfaces"};
inline const KeyList kSurfaces = {"floor", "ceiling", "left", "right", "back", "front"};
inline const KeyList kSurface = {
    "color_linear", "picture", "boards", "checker", "size_m", "roughness", "specular"};
inline const KeyList kBoards = {"width_m", "length_m", "variation", "along"};
inline const KeyList kChecker = {"second_linear"};
inline const KeyList kWindow = {"wall", "from_m", "to_m", "reveal_m", "frame_m"};
inline const KeyList kEnvironment = {"image", "rotation_y_deg", "gain"};
inline const KeyList kLamp = {"corner_m", "edge_u_m", "edge_v_m", "radiance"};
inline const KeyList kSolid = {"min_m", "max_m", "name", "surface", "in_project"};
inline const KeyList kFurniture = {"model",
                                   "pivot",
                                   "position_m",
                                   "rotation_y_deg",
                                   "scale",
                                   "material",
                                   "materials",
                                   "matte",
                                   "name",
                                   "in_project"};
inline const KeyList kSimulatedCamera = {"position_m", "target_m", "focal_px", "width", "height"};
inline const KeyList kSimulatedBall = {"center_m",
                                       "radius_m",
                                       "reflectance",
                                       "view_position_m",
                                       "further_view_positions_m",
                                       "size_px"};
inline const KeyList kPhotography = {"plate_seconds",
                                     "ball_seconds",
                                     "plate_percentile",
                                     "plate_code",
                                     "response",
                                     "read_noise",
                                     "photon_noise",
                                     "blur_px",
                                     "jpeg_quality",
                                     "f_number",
                                     "iso",
                                     "make",
                                     "model"};
inline const KeyList kResponse = {"gamma", "contrast"};
inline const KeyList kLines = {"noise_px"};
inline const KeyList kRender = {"samples_per_pixel",
                                "ball_samples_per_pixel",
                                "panorama_samples_per_pixel",
                                "panorama_width",
                                "max_bounces",
                                "roulette_start",
                                "denoise",
                                "truth_reduction"};

}  // namespace insitu::keys
