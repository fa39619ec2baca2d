#pragma once

#include "composite/tonemap/operator.h"

#include <memory>

namespace insitu {

/// Global operators that OpenCV's photo module has, with its defaults but
/// for what is said.
enum class LibraryOperator {
    Drago,          ///< adaptive logarithms [Drago03]
    ReinhardDevlin  ///< photoreceptors [ReiDev05], each pixel adapted to itself
};

/// One of them. The curve is made from the picture alone: statistics only tell scenes without a
/// range, which become middle grey (18 %), or black. What it gives beyond white is cut, and what is
/// not finite shown black; the ratios of channels are kept or not as the operator does.
[[nodiscard]] std::unique_ptr<ToneMapOperator> makeLibraryOperator(LibraryOperator which);

}  // namespace insitu
