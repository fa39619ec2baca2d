#pragma once

#include "core/camera.h"
#include "core/image.h"
#include "lighting/face_grid.h"
#include "reconstruct/scene_proxy.h"

#include <cstdint>
#include <vector>

namespace insitu {

/// What a solid box hides may be seen through it: the legs of a table leave most of its box empty.
///
/// A pixel of the photograph that meets a solid face first sees through it when its colour is that
/// of the surface behind, around the place that would be seen there: the two chromaticities
/// ln(R/G), ln(B/G) of a small window lie within three standard deviations of those of the known
/// texels around, and its brightness is one that they have too. Where nearly all pixels of a box
/// have the colour of what is behind them, the two cannot be told apart and the box counts as
/// solid.
///
/// photograph   radiance, same size as `camera`
/// radiance     of the proxy's faces, in the photograph's unit; `known` marks the texels that a
///              picture saw
/// Returns 1 for pixels that see through, 0 elsewhere. Same bytes for any number of threads.
[[nodiscard]] Image<std::uint8_t> findSeeThrough(const Camera& camera,
                                                 const Image<Rgb>& photograph,
                                                 const SceneProxy& proxy,
                                                 const FaceGrid<Rgb>& radiance,
                                                 const std::vector<std::uint8_t>& known);

/// The first surface along a ray that is not of a solid box.
[[nodiscard]] std::optional<ProxyHit> intersectBehindBoxes(const SceneProxy& proxy,
                                                           glm::dvec3 origin,
                                                           glm::dvec3 direction);

}  // namespace insitu
