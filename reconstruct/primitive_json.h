#pragma once

#include "core/io/json.h"
#include "reconstruct/primitive_library.h"

#include <utility>
#include <vector>

namespace insitu {

/// Pieces that project and scene files share. Included only by .cpp files. All throw InputError
/// with file, position, cause and remedy.

/// `name` among `known`, or an error that calls it a `what` and suggests or lists what there is.
std::size_t indexOfName(const JsonNode& node,
                        std::string_view name,
                        std::span<const std::string> known,
                        std::string_view what);
/// The shape that a text names.
[[nodiscard]] const PrimitiveShape& findShape(const PrimitiveLibrary& library,
                                              const JsonNode& node);
/// The entries of `parameters`, with the index of each in the shape.
[[nodiscard]] std::vector<std::pair<std::size_t, JsonNode>> namedParameters(
    const JsonNode& node, const PrimitiveShape& shape);
/// A number within the parameter's range.
[[nodiscard]] double readParameterValue(const JsonNode& node, const PrimitiveParameter& parameter);

}  // namespace insitu
