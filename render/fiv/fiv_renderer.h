#pragma once

#include "render/renderer.h"

namespace insitu {

/// renderInsertion() by technique fiv; options are valid.
[[nodiscard]] InsertionResult renderFiv(const Camera& camera,
                                        const RoomLight& room,
                                        const ObjectScene& objects,
                                        const InsertionOptions& options,
                                        Progress& progress);

}  // namespace insitu
