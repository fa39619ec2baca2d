#pragma once

#include "composite/tonemap/operator.h"
#include "core/io/radiance_rows.h"

#include <functional>

namespace insitu {

/// Tone mapping of pictures of any height in bounded memory: each is read in strips, once for every
/// pass of the statistics and of the operator, and once to be mapped. The results are those of the
/// whole picture in memory, bit for bit.
///
/// Memory: 24 bytes times the width times SceneMapping::kStripRows, and 12 bytes for each row of
/// the operator's reach; operators that must see the whole (SceneMapping::kWhole) hold it.

/// measureScene() of a picture that is read in strips. Throws as `rows` and measureScene() do, and
/// CancelledError.
[[nodiscard]] SceneStatistics measureRows(RadianceRows& rows, Progress& progress);

/// Maps a picture; `take` gets the display's rows strip by strip, from the top. Throws as `rows`
/// and the operator do, and CancelledError.
void mapRows(RadianceRows& rows,
             const ToneMapOperator& tone_map,
             const SceneStatistics& statistics,
             const std::function<void(const Image<Rgb>& display)>& take,
             Progress& progress);

}  // namespace insitu
