// Irradiance of unoccluded surfaces of any normal under environments: speed against error.
//
// irradiance_cube ENVIRONMENT…
//
// Truth: the sum over all texels of the environment in double, for the 6·32² normals of a cube.
// Errors are root mean squares over normals and channels, relative to the mean irradiance of each
// channel. Beside ours (6·n² cells of light, a cube of 6·m² normals, bilinear between these): nine
// spherical harmonics of the environment [RamHan01]. Times are processor milliseconds on top of
// reading the file; cells and harmonics read every texel once.

#include "render/fiv/irradiance_cube.h"

#include "bench/fiv_baseline.h"
#include "bench/fiv_report.h"
#include "core/io/image_io.h"
#include "core/parallel.h"

#include <array>
#include <cmath>
#include <memory>
#include <numbers>

namespace {

using namespace insitu;
using report::Stopwatch;
using std::numbers::pi;

constexpr int kNormals = 32;

/// The nine real harmonics up to degree 2.
std::array<double, 9> harmonics(glm::dvec3 d)
{
    return {0.282095,
            0.488603 * d.y,
            0.488603 * d.z,
            0.488603 * d.x,
            1.092548 * d.x * d.y,
            1.092548 * d.y * d.z,
            0.315392 * (3.0 * d.z * d.z - 1.0),
            1.092548 * d.x * d.z,
            0.546274 * (d.x * d.x - d.y * d.y)};
}

class Harmonics {
public:
    explicit Harmonics(const EnvironmentMap& environment)
    {
        const Image<Rgb>& map = environment.pixels;
        std::vector<std::array<glm::dvec3, 9>> rows(static_cast<std::size_t>(map.height()));
        parallelFor(0, map.height(), [&](std::int64_t row) {
            const int y = static_cast<int>(row);
            const double solid_angle = environmentTexelSolidAngle(map.width(), map.height(), y);
            auto& sums = rows[static_cast<std::size_t>(row)];
            sums.fill(glm::dvec3(0.0));
            for (int x = 0; x < map.width(); ++x) {
                const auto basis = harmonics(environmentDirectionFromUv(
                    {(x + 0.5) / map.width(), (y + 0.5) / map.height()}));
                const glm::dvec3 light = solid_angle * glm::dvec3(map(x, y));
                for (std::size_t i = 0; i < 9; ++i)
                    sums[i] += basis[i] * light;
            }
        });
        sums_.fill(glm::dvec3(0.0));
        for (const auto& row : rows)
            for (std::size_t i = 0; i < 9; ++i)
                sums_[i] += row[i];
    }
    [[nodiscard]] glm::dvec3 at(glm::dvec3 normal) const
    {
        // The cosine lobe's own coefficients by degree: π, 2π/3, π/4.
        const auto basis = harmonics(normal);
        glm::dvec3 sum(0.0);
        for (std::size_t i = 0; i < 9; ++i)
            sum += (i == 0 ? pi : i < 4 ? 2.0 * pi / 3.0 : pi / 4.0) * basis[i] * sums_[i];
        return sum;
    }

private:
    std::array<glm::dvec3, 9> sums_{};
};

class Comparison {
public:
    explicit Comparison(const EnvironmentMap& environment)
    {
        const DirectionCells cells{kNormals};
        for (std::size_t pair = 0; pair < cells.pairCount(); ++pair) {
            normals_.push_back(cells.direction(pair));
            normals_.push_back(-cells.direction(pair));
        }
        truth_.resize(normals_.size());
        parallelFor(0, static_cast<std::int64_t>(normals_.size()), [&](std::int64_t i) {
            const auto at = static_cast<std::size_t>(i);
            truth_[at] = irradiance(environment, normals_[at]);
        });
        for (const glm::dvec3& e : truth_)
            mean_ += e / static_cast<double>(truth_.size());
    }
    template <class At>
    void print(const std::string& name, double seconds, const At& at) const
    {
        double square = 0.0;
        double most = 0.0;
        for (std::size_t i = 0; i < normals_.size(); ++i) {
            const glm::dvec3 off = (glm::dvec3(at(normals_[i])) - truth_[i]) / mean_;
            square += glm::dot(off, off) / 3.0;
            for (int c = 0; c < 3; ++c)
                most = std::max(most, std::abs(off[c]));
        }
        fmt::print("  {:<40} {:>8.1f} ms {:>8.3f} % {:>8.2f} %\n",
                   name,
                   1e3 * seconds,
                   100.0 * std::sqrt(square / static_cast<double>(normals_.size())),
                   100.0 * most);
    }

private:
    std::vector<glm::dvec3> normals_;
    std::vector<glm::dvec3> truth_;
    glm::dvec3 mean_{0.0};
};

void compare(const std::string& file)
{
    const EnvironmentMap environment{readRadiance(file).pixels};
    fmt::print("{} {}x{}: {:>41} {:>10}\n",
               std::filesystem::path(file).filename().string(),
               environment.pixels.width(),
               environment.pixels.height(),
               "RMS",
               "largest");
    const Comparison comparison(environment);
    {
        const Stopwatch watch;
        const Harmonics harmonics(environment);
        const double spent = watch.passed().processor;
        comparison.print("nine harmonics", spent, [&](glm::dvec3 n) { return harmonics.at(n); });
    }
    for (const auto& [light_cells, normal_cells] : {std::pair(16, 16), std::pair(32, 32)}) {
        const Stopwatch watch;
        const baseline::TexelLight texels = baseline::texelLight(environment, light_cells);
        PlaceLight light;
        light.geometry = std::make_shared<CellGeometry>(texels.cells);
        light.radiance = texels.radiance;
        light.change.assign(light.radiance.size(), Rgb(0.0f));
        const DirectionTable cube = irradianceCube(light, normal_cells);
        const double spent = watch.passed().processor;
        comparison.print(
            fmt::format("6x{0}x{0} cells, 6x{1}x{1} normals", light_cells, normal_cells),
            spent,
            [&](glm::dvec3 n) { return cube.lookUp(n); });
    }
}

}  // namespace

int main(int argc, char** argv)
{
    if (argc < 2) {
        fmt::print(stderr, "usage: irradiance_cube ENVIRONMENT...\n");
        return 2;
    }
    try {
        for (int i = 1; i < argc; ++i)
            compare(argv[i]);
        return 0;
    } catch (const std::exception& error) {
        fmt::print(stderr, "{}\n", error.what());
        return 1;
    }
}
