#pragma once

#include "core/camera.h"
#include "reconstruct/scene_solve.h"

#include <filesystem>
#include <string>
#include <vector>

namespace insitu {

/// Where a primitive's shape comes from, to name it again in a room.
struct ShapeSource {
    std::filesystem::path library;  ///< empty: built in
    std::filesystem::path model;    ///< a mesh instead of a shape of a library
};

/// A scene file (docs/file_format.md, "Scene"): what is to be solved, checked, names resolved,
/// targets before what refers to them.
struct SceneFile {
    SceneGraph graph;
    std::vector<ShapeSource> sources;  ///< one a primitive
    std::string room_items;  ///< a JSON list: entries that go to the room as they are (openings)
};

/// InputError: file, position, cause, remedy; misspelt names get a suggestion. At most 1000
/// primitives and 100 000 constraints; a model has at most 20 000 vertices.
[[nodiscard]] SceneFile readScene(const std::filesystem::path& path);

/// Writes the solved room: `room`, which a project reads, `primitives` with standard deviations,
/// `constraints` with residuals, `summary` and `findings`.
void writeReconstruction(const std::filesystem::path& path,
                         const SceneFile& scene,
                         const SceneEstimate& estimate);

}  // namespace insitu
