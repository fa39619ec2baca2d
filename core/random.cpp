#include "core/random.h"

#include <cmath>
#include <numbers>

namespace insitu {

double RandomStream::normal()
{
    const double radius = std::sqrt(-2.0 * std::log(1.0 - uniformDouble()));
    return radius * std::cos(2.0 * std::numbers::pi * uniformDouble());
}

}  // namespace insitu
