#pragma once

#include "core/image.h"
#include "core/photo.h"
#include "core/response_curve.h"
#include "pipeline/simulated_room.h"

#include <array>
#include <cstdint>
#include <vector>

namespace insitu {

/// The simulated camera: radiance in, photograph out.
///
/// E = radiance · sensor_scale · seconds, blurred, with Gaussian noise of variance
/// read² + photon·E, clipped to [0, 1], through the tone curve, rounded to 8 bit.

/// Code/255 in [0, 1] of a sensor exposure; strictly increasing on [0, 1], clipped outside.
[[nodiscard]] double encodeTone(const ToneCurve& curve, int channel, double exposure);
/// Inverse on [0, 1]: the exposure that gives code/255 = value. Accurate to 1e-12.
[[nodiscard]] double decodeTone(const ToneCurve& curve, int channel, double value);
/// The same curve as the table that the rest of the program uses; exposure[c][255] = 1.
[[nodiscard]] ResponseCurve responseTable(const ToneCurve& curve);

/// The sensor scale with which `percentile` % of all channel values of `radiance` stay at or below
/// `code` when exposed for `seconds`. The image must not be black (InputError naming `source`).
[[nodiscard]] double sensorScale(const Image<Rgb>& radiance,
                                 const SimulatedRoom& room,
                                 double seconds);

/// One photograph. `shot` separates the noise of one picture from the next.
[[nodiscard]] EncodedImage photograph(const Image<Rgb>& radiance,
                                      const SimulatedCameraBody& body,
                                      double sensor_scale,
                                      double seconds,
                                      std::uint64_t seed,
                                      std::uint64_t shot);

/// EXIF of a photograph: time, f-number, ISO, make, model and, on a sensor 36 mm wide, the focal
/// length.
[[nodiscard]] std::vector<std::uint8_t> simulatedExif(const SimulatedCameraBody& body,
                                                      double seconds,
                                                      double focal_px,
                                                      int width);

}  // namespace insitu
