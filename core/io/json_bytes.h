#pragma once

#include "core/io/json.h"

#include <cstdint>
#include <string>
#include <vector>

namespace insitu {

/// readJson for bytes that are in memory, part of a file `name`: the same strictness, and at most
/// the same size.
[[nodiscard]] Json parseJson(const std::vector<std::uint8_t>& bytes, const std::string& name);

}  // namespace insitu
