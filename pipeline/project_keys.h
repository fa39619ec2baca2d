#pragma once

#include <initializer_list>
#include <string_view>

namespace insitu::keys {

/// The keys each object of a project file may have. The parser accepts exactly these, and a test
/// compares them with docs/project.schema.json, so that neither moves without the other.
using KeyList = std::initializer_list<std::string_view>;

inline const KeyList kProject = {
    "format", "version", "photo", "camera", "light", "room", "objects", "note"};
inline const KeyList kImage = {"image", "exposure_seconds", "f_number", "iso"};
inline const KeyList kPhoto = {"image",
                               "exposure_seconds",
                               "f_number",
                               "iso",
                               "white_balance",
                               "focus_m",
                               "vignetting",
                               "foreground"};
inline const KeyList kForeground = {
    "polygon_px", "mask", "distance_m", "feather_px", "refine_px", "note"};
inline const KeyList kCamera = {"lines", "file"};
inline const KeyList kLight = {"probe", "environment", "center_m"};
/// Of a probe with one view, whose keys stand beside its own, and of one with several.
inline const KeyList kProbe = {"kind",
                               "images",
                               "exposure_seconds",
                               "f_number",
                               "iso",
                               "ball",
                               "center_m",
                               "view",
                               "mask",
                               "views",
                               "response",
                               "references"};
inline const KeyList kProbeView = {
    "images", "exposure_seconds", "f_number", "iso", "ball", "view", "mask"};
inline const KeyList kBall = {
    "center_px", "radius_px", "radius_m", "reflectance", "crop_origin_px"};
inline const KeyList kView = {"position_m", "up"};
inline const KeyList kReferenceCard = {"type",
                                       "in",
                                       "images",
                                       "exposure_seconds",
                                       "f_number",
                                       "iso",
                                       "area_px",
                                       "reflectance",
                                       "position_m",
                                       "normal",
                                       "sigma_percent",
                                       "note"};
inline const KeyList kReferenceBall = {"type",
                                       "in",
                                       "images",
                                       "exposure_seconds",
                                       "f_number",
                                       "iso",
                                       "view",
                                       "center_px",
                                       "radius_px",
                                       "radius_m",
                                       "reflectance",
                                       "position_m",
                                       "sigma_percent",
                                       "note"};
inline const KeyList kReferenceIlluminance = {
    "type", "lux", "position_m", "normal", "sigma_percent", "note"};
inline const KeyList kReferenceIrradiance = {
    "type", "value", "position_m", "normal", "sigma_percent", "note"};
inline const KeyList kFloor = {"type", "height_m", "half_size_m"};
inline const KeyList kPlane = {"type", "corner_m", "edge_u_m", "edge_v_m", "corners_m"};
inline const KeyList kBox = {"type", "min_m", "max_m", "rotation_y_deg", "solid", "name"};
inline const KeyList kPrimitive = {
    "type", "shape", "library", "parameters", "position_m", "rotation_y_deg", "solid", "name"};
inline const KeyList kRoomFile = {
    "format", "version", "room", "primitives", "constraints", "summary", "findings", "note"};
inline const KeyList kMesh = {
    "type", "model", "position_m", "rotation_y_deg", "scale", "pivot", "name"};
inline const KeyList kOpening = {"type", "corners_m", "name"};
inline const KeyList kObject = {
    "model", "pivot", "position_m", "rotation_y_deg", "scale", "material"};
inline const KeyList kMaterial = {"base_color_linear", "roughness", "metallic", "specular"};

}  // namespace insitu::keys
