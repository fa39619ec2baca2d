#pragma once

#include "capture/bracket.h"

#include <cstdint>
#include <functional>
#include <vector>

namespace insitu::bench {

/// Exposure in [0, 1] -> code / 255, by channel.
using Response = std::function<double(std::size_t, double)>;
struct NamedResponse {
    const char* name;
    Response curve;
};
/// S-shaped, each channel its own.
[[nodiscard]] std::vector<NamedResponse> responses();

struct Sensor {
    double full_well = 60'000.0;  ///< electrons
    double read_noise = 3.0;      ///< electrons
};

/// 11 exposures 1 EV apart; the middle one shows the median at 18 % of full scale.
[[nodiscard]] Bracket photograph(const Image<Rgb>& scene,
                                 const Response& response,
                                 Sensor sensor,
                                 std::uint64_t seed);

/// RMS over codes 5 to 250 of the curve's error in EV, after one scale; infinite for a curve that
/// is not positive there.
[[nodiscard]] double errorEv(const ResponseCurve& curve,
                             const Response& response,
                             std::size_t channel);

/// The Cramér–Rao bound of a free table, were all radiances known: Poisson, read noise and
/// rounding, by all pixels that show a code. RMS over codes 5 to 250, EV, the worst channel.
/// Unknown radiances make it harder; a smooth curve, for which neighbouring codes speak too, may be
/// below it.
[[nodiscard]] double knownRadianceBound(const Bracket& bracket,
                                        const Response& response,
                                        Sensor sensor);

}  // namespace insitu::bench
