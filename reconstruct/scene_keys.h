#pragma once

#include <initializer_list>
#include <string_view>

namespace insitu::keys {

/// The keys of a scene file (docs/file_format.md, "Scene"). A test compares them with
/// docs/scene.schema.json.
using SceneKeyList = std::initializer_list<std::string_view>;

inline const SceneKeyList kScene = {
    "format", "version", "library", "primitives", "constraints", "room", "note"};
inline const SceneKeyList kScenePrimitive = {"name",
                                             "shape",
                                             "model",
                                             "parameters",
                                             "position_m",
                                             "rotation_y_deg",
                                             "fixed",
                                             "stands_on",
                                             "against",
                                             "beside",
                                             "flush",
                                             "aligned_with",
                                             "solid",
                                             "note"};
inline const SceneKeyList kSceneNumber = {"value", "fixed", "sigma"};
inline const SceneKeyList kStandsOn = {"face", "gap_m", "height_m"};
inline const SceneKeyList kContact = {"face", "target", "gap_m"};
inline const SceneKeyList kAlignedWith = {"primitive", "turn_deg"};
inline const SceneKeyList kVertexConstraint = {"vertex", "at_px", "sigma_px", "note"};
inline const SceneKeyList kEdgeConstraint = {"edge", "from_px", "to_px", "sigma_px", "note"};
inline const SceneKeyList kLengthConstraint = {"length", "metres", "sigma_m", "note"};

}  // namespace insitu::keys
