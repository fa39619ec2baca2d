#pragma once

#include "reconstruct/primitive.h"

#include <filesystem>
#include <map>
#include <string>

namespace insitu {

/// Shapes by name.
using PrimitiveLibrary = std::map<std::string, PrimitiveShape>;

/// The shapes that come with the program: plane, panel, box, room-box, wedge, cylinder.
[[nodiscard]] const PrimitiveLibrary& builtinPrimitives();
/// The same as the text of a library file, to read and to begin one's own with.
[[nodiscard]] const std::string& builtinPrimitivesText();

/// Adds the shapes of a library file (docs/file_format.md, "Primitives"); a shape of a name that is
/// there already replaces it. InputError: file, position, cause; unknown keys get a suggestion. At
/// most 1000 shapes a file, and 64 parameters, 4096 vertices, 4096 faces of 256 corners a shape.
void addPrimitives(PrimitiveLibrary& library, const std::filesystem::path& path);

}  // namespace insitu
