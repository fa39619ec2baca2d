#pragma once

#include "core/io/json.h"
#include "pipeline/project.h"

#include <filesystem>

namespace insitu {

/// Pieces of a project file that other files share (room.json of `insitu simulate`). Included only
/// by .cpp files. All throw InputError with file, position, cause and remedy.

/// The file a text names, relative to `folder`; an error when it is not there.
[[nodiscard]] std::filesystem::path existingFile(const JsonNode& node,
                                                 const std::filesystem::path& folder);
/// `material` of an object: pure numbers, no textures.
[[nodiscard]] Material readMaterial(const JsonNode& node);
/// One entry of `objects`.
[[nodiscard]] ProjectObject readObject(const JsonNode& node, const std::filesystem::path& folder);
/// `position_m`, `rotation_y_deg`, `scale` and `pivot` beside a `model`.
[[nodiscard]] ProjectObject readPlacedModel(const JsonNode& node,
                                            const std::filesystem::path& folder);
/// The whole `room` list.
[[nodiscard]] RoomDescription readRoom(const JsonNode& node, const std::filesystem::path& folder);
/// The same, or the name of a file that holds it: by itself, or as its `room`.
[[nodiscard]] RoomDescription readRoomOrFile(const JsonNode& node,
                                             const std::filesystem::path& folder);
/// An entry of `room` of type "primitive", placed.
[[nodiscard]] RoomPrimitive readPrimitive(const JsonNode& node,
                                          const std::filesystem::path& folder);
/// A box turned about the vertical through its centre.
[[nodiscard]] RoomPrimitive turnedBox(const RoomBox& box, double rotation_y_deg);
/// `min_m` and `max_m` of a box, checked.
[[nodiscard]] RoomBox readBox(const JsonNode& node);
/// `corners_m`: at least three points of a flat convex polygon.
[[nodiscard]] std::vector<glm::dvec3> readPolygon(const JsonNode& node);
/// `exposure_seconds`, `f_number` and `iso` beside a picture, as far as they are given.
[[nodiscard]] Exposure readExposure(const JsonNode& node);
/// A picture with its exposure: `photo`, or an entry of `images`.
[[nodiscard]] ProjectImage readImage(const JsonNode& node, const std::filesystem::path& folder);
/// `images` with the exposure members beside it: one time for all or a list, one an image.
[[nodiscard]] std::vector<ProjectImage> readImages(const JsonNode& node,
                                                   const std::filesystem::path& folder);
/// `light.probe.references`.
[[nodiscard]] std::vector<ProjectReference> readReferences(const JsonNode& list,
                                                           const std::filesystem::path& folder);
/// `light.probe`.
[[nodiscard]] ProjectProbe readProbe(const JsonNode& node, const std::filesystem::path& folder);
/// A number in [0, 1].
[[nodiscard]] double readFraction(const JsonNode& node);
/// A text that must be one of `choices`; else an error that lists them.
[[nodiscard]] std::string readChoice(const JsonNode& node,
                                     std::initializer_list<std::string_view> choices);

}  // namespace insitu
