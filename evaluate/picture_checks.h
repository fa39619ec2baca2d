#pragma once

#include "core/image.h"

#include <cmath>

namespace insitu {

/// InputError when sizes differ or a value is not finite, naming the pixel. Private to this module.
inline void requireComparable(const Image<float>& reference, const Image<float>& picture)
{
    if (!reference.sameSize(picture))
        throw InputError("picture",
                         fmt::format("is {}x{}, the reference {}x{}; sizes must be the same",
                                     picture.width(),
                                     picture.height(),
                                     reference.width(),
                                     reference.height()));
    for (const Image<float>* image : {&reference, &picture})
        for (int y = 0; y < image->height(); ++y)
            for (int x = 0; x < image->width(); ++x)
                if (!std::isfinite((*image)(x, y)))
                    throw InputError(image == &reference ? "reference" : "picture",
                                     fmt::format("pixel ({}, {})", x, y),
                                     "is not a finite value");
}

}  // namespace insitu
