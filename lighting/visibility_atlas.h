#pragma once

#include "core/finding.h"
#include "lighting/direction_cells.h"
#include "lighting/silhouettes.h"

#include <filesystem>

namespace insitu {

/// How finely an atlas looks at its object. Memory: 3·face_size²·resolution²·5 bytes.
struct AtlasOptions {
    /// Cells along the side of a face of the cube of directions, [2, 128]. The light's cells are as
    /// large as these, which dominates the error; concentrated light gets cells of its own.
    int face_size = 32;
    /// Texels along a silhouette's side, [16, 512]. It spans the object's outline, not its sphere.
    int resolution = 64;
    /// Samples along a texel's side, from which its coverage comes, [1, 8].
    int samples = 2;

    [[nodiscard]] Findings validate() const;
    [[nodiscard]] bool operator==(const AtlasOptions&) const = default;
};

/// Which directions an object hides from a place, independent of any light: one silhouette for each
/// pair of opposite cells of the sphere of directions. It answers for every place, outside and
/// inside the bounding sphere, without sampling positions. Directions are in the axes of the mesh
/// that it was made from: a turned object keeps its atlas. Either the light is turned instead, or
/// the atlas is placed (placedAtlas).
struct VisibilityAtlas {
    AtlasOptions options;
    glm::dmat3 axes{1.0};       ///< the object's, as columns; a rotation
    SilhouetteSet silhouettes;  ///< one a pair of `cells()`, in its order

    [[nodiscard]] DirectionCells cells() const { return {options.face_size, axes}; }
};

/// InputError for bad options or more memory than 4 GiB; CancelledError when `progress` says so.
[[nodiscard]] VisibilityAtlas buildVisibilityAtlas(const TriangleMesh& mesh,
                                                   const AtlasOptions& options,
                                                   Progress& progress);

/// The same, kept in `folder` under a name made from the content of the mesh and the options.
///
/// A file that is damaged, cut off, of another version or another machine's byte order is not
/// believed: the atlas is built anew and the file replaced, finding "atlas-file-damaged". A folder
/// that cannot be written costs time only: finding "atlas-not-kept".
struct CachedAtlas {
    VisibilityAtlas atlas;
    bool from_file = false;
    Findings findings;
};
[[nodiscard]] CachedAtlas cachedVisibilityAtlas(const TriangleMesh& mesh,
                                                const AtlasOptions& options,
                                                const std::filesystem::path& folder,
                                                Progress& progress);
/// The atlas of an object where it stands: its directions, places and normals are the world's from
/// here on. Exact, and no silhouette is drawn: `placement` turns the atlas of the mesh as loaded.
/// `placed_mesh` is that mesh in the world.
[[nodiscard]] VisibilityAtlas placedAtlas(VisibilityAtlas atlas,
                                          const Placement& placement,
                                          const TriangleMesh& placed_mesh);

/// The file that an atlas is kept in.
[[nodiscard]] std::filesystem::path atlasFile(const TriangleMesh& mesh,
                                              const AtlasOptions& options,
                                              const std::filesystem::path& folder);

/// Shares of the light of the cell around `unit_direction` that the object hides from a place.
[[nodiscard]] float hiddenShare(const VisibilityAtlas& atlas,
                                glm::vec3 x_local,
                                glm::dvec3 unit_direction,
                                float bias_texels = 0.0f);

}  // namespace insitu
