#pragma once

#include "capture/bracket.h"
#include "core/response_curve.h"

#include <string>
#include <vector>

namespace insitu::bench {

/// One method's curve of one bracket.
struct Entry {
    std::string name;
    ResponseCurve curve;
    std::vector<double> scale;  ///< of the exposures, empty: as given
    double seconds = 0.0;
    std::string note;
};

/// Our methods, OpenCV's CalibrateDebevec (70 and 300 samples) and CalibrateRobertson, and
/// pfstools' Robertson when `pfshdrcalibrate` is on the PATH: all on the same frames, one after the
/// other.
[[nodiscard]] std::vector<Entry> recoverWithAll(const Bracket& bracket);

}  // namespace insitu::bench
