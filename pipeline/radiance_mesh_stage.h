#pragma once

#include "core/progress.h"
#include "lighting/radiance_mesh.h"
#include "pipeline/insert.h"

namespace insitu {

/// The captured light of a project as a radiance mesh, with what the stages had to tell.
struct ProjectRadianceMesh {
    RadianceMesh mesh;
    Findings findings;
};

/// Camera, light and room as insertObjects makes them, then the mesh; nothing is rendered. The
/// project's first object says where the light matters most. InputError and NoAnswerError as the
/// stages throw them.
[[nodiscard]] ProjectRadianceMesh projectRadianceMesh(const Project& project,
                                                      const InsertOptions& options,
                                                      const RadianceMeshOptions& mesh_options,
                                                      Progress& progress);

}  // namespace insitu
