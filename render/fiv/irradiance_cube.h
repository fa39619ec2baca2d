#pragma once

#include "lighting/place_light.h"

#include <vector>

namespace insitu {

/// A quantity >= 0 for all directions, on the cells of a cube, bilinear on each face. At least 2x2
/// cells a face.
class DirectionTable {
public:
    DirectionTable() = default;
    explicit DirectionTable(int face_size);

    [[nodiscard]] std::size_t size() const { return values_.size(); }
    [[nodiscard]] glm::dvec3 direction(std::size_t number) const;
    [[nodiscard]] Rgb& operator[](std::size_t number) { return values_[number]; }
    [[nodiscard]] const Rgb& operator[](std::size_t number) const { return values_[number]; }
    [[nodiscard]] Rgb lookUp(glm::dvec3 direction) const;

private:
    DirectionCells cells_{2};
    std::vector<Rgb> values_;  ///< number 2·pair + side
};

/// Irradiance of surfaces of any normal in a light, changes of the room included [Michael10, 3.1].
[[nodiscard]] DirectionTable irradianceCube(const PlaceLight& light, int face_size);

}  // namespace insitu
