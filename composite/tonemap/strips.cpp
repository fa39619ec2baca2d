#include "composite/tonemap/strips.h"

#include <algorithm>

namespace insitu {

namespace {

/// Calls visit(strip) with strips that follow each other, from the top.
template <class Visit>
void forEachStrip(RadianceRows& rows, bool whole, Progress& progress, const Visit& visit)
{
    const int step = whole ? rows.height() : SceneMapping::kStripRows;
    for (int first = 0; first < rows.height(); first += step) {
        progress.checkpoint();
        Image<Rgb> part(rows.width(), std::min(step, rows.height() - first));
        rows.read(first, part);
        visit(SceneStrip(part, first, rows.height()));
    }
}

}  // namespace

SceneStatistics measureRows(RadianceRows& rows, Progress& progress)
{
    SceneMeter meter;
    for (int pass = 0; pass < SceneMeter::kPasses; ++pass) {
        forEachStrip(
            rows, false, progress, [&](const SceneStrip& strip) { meter.gather(pass, strip); });
        meter.endPass(pass);
    }
    return meter.statistics();
}

void mapRows(RadianceRows& rows,
             const ToneMapOperator& tone_map,
             const SceneStatistics& statistics,
             const std::function<void(const Image<Rgb>& display)>& take,
             Progress& progress)
{
    const auto mapping = tone_map.begin(rows.width(), rows.height(), statistics);
    const bool whole = mapping->reach() >= SceneMapping::kWhole;
    for (int pass = 0; pass < mapping->passes(); ++pass) {
        forEachStrip(
            rows, whole, progress, [&](const SceneStrip& strip) { mapping->gather(pass, strip); });
        mapping->endPass(pass);
    }
    const int height = rows.height();
    const int step = whole ? height : SceneMapping::kStripRows;
    const int reach = whole ? 0 : mapping->reach();
    for (int top = 0; top < height; top += step) {
        progress.checkpoint();
        const int bottom = std::min(top + step, height);
        int first = std::max(0, top - reach);
        first -= first % mapping->alignment();
        Image<Rgb> part(rows.width(), std::min(height, bottom + reach) - first);
        rows.read(first, part);
        Image<Rgb> display(rows.width(), bottom - top);
        mapping->map(SceneStrip(part, first, height), top, display, progress);
        progress.checkpoint();
        take(display);
        progress.report("tone mapping", static_cast<double>(bottom) / height);
    }
}

}  // namespace insitu
