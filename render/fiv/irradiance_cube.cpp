#include "render/fiv/irradiance_cube.h"

#include "core/instruction_set.h"

#include <algorithm>
#include <cmath>

namespace insitu {

DirectionTable::DirectionTable(int face_size)
    : cells_{face_size}, values_(2 * cells_.pairCount(), Rgb(0.0f))
{
}

glm::dvec3 DirectionTable::direction(std::size_t number) const
{
    return cells_.direction(number / 2) * (number % 2 == 0 ? 1.0 : -1.0);
}

Rgb DirectionTable::lookUp(glm::dvec3 d) const
{
    const glm::dvec3 size = glm::abs(d);
    const int axis = size.x >= size.y && size.x >= size.z ? 0 : (size.y >= size.z ? 1 : 2);
    // Beyond the outermost centres of a face the values go on as they go between the last two.
    const int n = cells_.face_size;
    const auto at = [&](int other) {
        return std::clamp((d[other] / d[axis] + 1.0) * 0.5 * n - 0.5, -0.5, n - 0.5);
    };
    const double column = at((axis + 1) % 3);
    const double row = at((axis + 2) % 3);
    const int c0 = std::clamp(static_cast<int>(column), 0, n - 2);
    const int r0 = std::clamp(static_cast<int>(row), 0, n - 2);
    const int c1 = c0 + 1;
    const int r1 = r0 + 1;
    const float tx = static_cast<float>(column - c0);
    const float ty = static_cast<float>(row - r0);
    const auto value = [&](int r, int c) {
        return values_[2 * static_cast<std::size_t>((axis * n + r) * n + c) +
                       (d[axis] < 0.0 ? 1 : 0)];
    };
    const Rgb above = value(r0, c0) * (1.0f - tx) + value(r0, c1) * tx;
    const Rgb below = value(r1, c0) * (1.0f - tx) + value(r1, c1) * tx;
    return glm::max(above * (1.0f - ty) + below * ty, Rgb(0.0f));
}

namespace {

/// Directions of one side of a table's pairs, and what is summed for each.
struct PairSums {
    explicit PairSums(const DirectionTable& table)
        : x(table.size() / 2), y(x), z(x), red(x), green(x), blue(x)
    {
        for (std::size_t pair = 0; pair < x.size(); ++pair) {
            const glm::vec3 d(table.direction(2 * pair));
            x[pair] = d.x;
            y[pair] = d.y;
            z[pair] = d.z;
        }
    }
    std::vector<float> x, y, z, red, green, blue;
};

// The table's directions are independent of each other: any vector's width gives the same bytes.
INSITU_KERNEL void addEven(glm::vec3 d, Rgb light, PairSums& sums)
{
    const std::size_t count = sums.x.size();
    const float* x = sums.x.data();
    const float* y = sums.y.data();
    const float* z = sums.z.data();
    float* red = sums.red.data();
    float* green = sums.green.data();
    float* blue = sums.blue.data();
    for (std::size_t i = 0; i < count; ++i) {
        const float cosine = std::abs(x[i] * d.x + y[i] * d.y + z[i] * d.z);
        red[i] += cosine * light.r;
        green[i] += cosine * light.g;
        blue[i] += cosine * light.b;
    }
}

#if defined(__x86_64__)
INSITU_TARGET_AVX2 void addEvenAvx2(glm::vec3 d, Rgb light, PairSums& sums)
{
    addEven(d, light, sums);
}

INSITU_TARGET_AVX512 void addEvenAvx512(glm::vec3 d, Rgb light, PairSums& sums)
{
    addEven(d, light, sums);
}
#endif

void addEvenBase(glm::vec3 d, Rgb light, PairSums& sums)
{
    addEven(d, light, sums);
}

auto bestAddEven()
{
#if defined(__x86_64__)
    if (bestInstructionSet() == InstructionSet::Avx512) return addEvenAvx512;
    if (bestInstructionSet() == InstructionSet::Avx2) return addEvenAvx2;
#endif
    return addEvenBase;
}

}  // namespace

// With w = n·ω, max(w, 0) = (|w| + w) / 2: of light A along ω and B along −ω, n gets the half sum
// and −n the half difference of |w| (A + B), which is one sum for both, and of w (A − B), which is
// linear in n, so that one vector a channel is the whole sum.
DirectionTable irradianceCube(const PlaceLight& light, int face_size)
{
    DirectionTable table(face_size);
    PairSums even(table);
    glm::dmat3 odd(0.0);  // a column a channel
    const auto add = bestAddEven();
    for (std::size_t cell = 0; cell < light.radiance.size(); cell += 2) {
        const glm::vec3 d = light.geometry->directions[cell];
        const float solid_angle = light.geometry->solid_angles[cell];
        const auto arriving = [&](std::size_t from) {
            return solid_angle * glm::max(light.radiance[from] + light.change[from], Rgb(0.0f));
        };
        const Rgb along = arriving(cell);
        const Rgb against = arriving(cell + 1);
        add(d, along + against, even);
        odd += glm::outerProduct(glm::dvec3(d), glm::dvec3(along - against));
    }
    for (std::size_t pair = 0; pair < even.x.size(); ++pair) {
        const Rgb sum(even.red[pair], even.green[pair], even.blue[pair]);
        const Rgb difference(table.direction(2 * pair) * odd);
        table[2 * pair] = glm::max(0.5f * (sum + difference), Rgb(0.0f));
        table[2 * pair + 1] = glm::max(0.5f * (sum - difference), Rgb(0.0f));
    }
    return table;
}

}  // namespace insitu
