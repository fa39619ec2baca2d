#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

namespace insitu {

/// Shadows in frame buffers without range: what each light source adds to a receiver's radiance,
/// as steps of its encoded intensity, so that occluded sources can be subtracted from encoded
/// pixels one after the other. The compositor proper works on radiance (composite/differential.h);
/// this is the measured alternative for hardware that cannot, see docs/validation.md.
///
/// radiance      of the receiver with all light, >= 0
/// transfers     what each source gives it, >= 0, from the brightest down; together at most
///               `radiance`
/// in_first_set  for each source, which of two sets it belongs to; sources of a set are taken to be
///               occluded together with it and without the other
/// encode        radiance to intensity, increasing (the camera's response)
///
/// Intensity minus the sum of the occluded sources' steps is encode(radiance minus their transfers)
/// exactly when `encode` is linear, when none is occluded, and when exactly one set is (or its
/// brightest sources, without a gap); else about that, and never increasing in what is occluded.
/// Source: [GibCha03] 6.3.1, equations 4 and 5, figure 13.
[[nodiscard]] std::vector<double> intensityTransfers(
    double radiance,
    std::span<const double> transfers,
    std::span<const std::uint8_t> in_first_set,
    const std::function<double(double radiance)>& encode);

}  // namespace insitu
