// Speed against error of direct light from an environment on a floor, 1024 x 768 pixels: irradiance
// vectors beside our own Monte Carlo reference, in one run.
//
// fiv_curve [--triangles N] MODEL ENVIRONMENT OUT_FOLDER
//
// The model's triangles are cut until there are N (88 000, as in the figures of Blender Cycles that
// docs/validation.md names). Errors are NRMSE [Michael10] eq. 17 over some 2000 pixels where the
// object hides more than 1 % of the light, against rays to 6x128x128 cells and 2000 directions of
// the light's own. Times are processor seconds of a whole frame; those of rays are extrapolated
// from these pixels.
#include "bench/fiv_lights.h"
#include "bench/fiv_report.h"
#include "bench/fiv_stage.h"
#include "core/io/image_io.h"
#include "core/io/model_io.h"
#include "core/random.h"
#include "lighting/environment_light.h"
#include "lighting/hidden_picture.h"

#include <CLI/CLI.hpp>

namespace {

using namespace insitu;
using namespace fiv_bench;
using report::Stopwatch;

constexpr int kWidth = 1024;
constexpr int kHeight = 768;

/// Cuts triangles into four, one after the other, until there are enough.
void subdivide(TriangleMesh& mesh, std::size_t triangles)
{
    for (std::size_t i = 0; mesh.triangles.size() + 3 <= triangles; ++i) {
        const glm::uvec3 t = mesh.triangles[i];
        const auto first = static_cast<std::uint32_t>(mesh.positions.size());
        for (int k = 0; k < 3; ++k)
            mesh.positions.push_back(0.5f *
                                     (mesh.positions[t[k]] + mesh.positions[t[(k + 1) % 3]]));
        mesh.triangles[i] = {first, first + 1, first + 2};
        for (std::uint32_t k = 0; k < 3; ++k)
            mesh.triangles.emplace_back(t[static_cast<int>(k)], first + k, first + (k + 2) % 3);
    }
    mesh.normals.clear();
    mesh.texcoords.clear();
    mesh.material_of.assign(mesh.triangles.size(), 0);
}

/// Calls visit(x, y) in tiles of 8 x 4 pixels.
template <class Visit>
void forEachPixel(const Visit& visit)
{
    for (int top = 0; top < kHeight; top += 4)
        for (int left = 0; left < kWidth; left += 8)
            for (int y = top; y < top + 4; ++y)
                for (int x = left; x < left + 8; ++x)
                    visit(x, y);
}

/// Floor places of the frame, in the model's units.
std::vector<glm::dvec3> framePlaces(const LocalFrame& local, double floor_y)
{
    std::vector<glm::dvec3> places;
    forEachPixel([&](int x, int y) {
        // Looking down 35 degrees from 6 radii away.
        const double u = (x + 0.5 - 0.5 * kWidth) / kWidth;
        const double v = (y + 0.5 - 0.5 * kHeight) / kWidth;
        const double down = std::sin(0.61) + v * std::cos(0.61);
        const double ahead = std::cos(0.61) - v * std::sin(0.61);
        const double t = 3.5 / std::max(down, 0.05);
        const glm::dvec3 from_center(u * t, 0.0, ahead * t - 5.0);
        places.push_back(local.center + local.radius * from_center);
        places.back().y = floor_y;
    });
    return places;
}

class Curve {
public:
    Curve(Stage& stage, const EnvironmentMap& environment)
        : stage_(stage), environment_(environment)
    {
        const double floor_y = boundingBox(stage.mesh).min.y - 1e-4 * stage.local().radius;
        places_ = framePlaces(stage.local(), floor_y);
        for (const glm::dvec3 place : places_)
            local_.push_back(stage.local().localFrom(place));
        hidden_.resize(places_.size());
        rows_.resize(places_.size());
        row_by_row_.resize(places_.size());
        forEachPixel([&](int x, int y) {
            const auto at = static_cast<std::size_t>(y * kWidth + x);
            row_by_row_[at] = local_[row_of_.size()];
            row_of_.push_back(at);
        });
    }

    void run()
    {
        const ObjectLight object = lit({.max_fine_directions = 48});
        hiddenIrradiance(object, local_, kUp, hidden_);
        chooseShadow(object.light.irradiance(kUp));
        trace();
        report::Table::printHead();
        for (const int fine : {0, 16, 48})
            exact(fine);
        for (const double max_error : {0.01, 0.03})
            ofPicture(max_error);
        plane(object);
        shells(object);
        for (const int samples : {4, 16, 64, 256, 1024})
            sampled(samples);
        turned();
    }
    void write(const std::filesystem::path& folder) const { table_.write(folder); }

private:
    [[nodiscard]] ObjectLight lit(const LightSplitOptions& split,
                                  const glm::dmat3& object_from_world = glm::dmat3(1.0)) const
    {
        return lightObject(stage_.mesh,
                           stage_.atlas,
                           splitLight(environment_, object_from_world, {32}, split),
                           {},
                           silent);
    }
    /// Pixels whose error counts.
    void chooseShadow(Rgb free)
    {
        std::vector<std::size_t> shadow;
        for (std::size_t i = 0; i < places_.size(); ++i)
            if (luminance(hidden_[i]) > 0.01f * luminance(free)) shadow.push_back(i);
        const std::size_t step = std::max<std::size_t>(1, shadow.size() / 2000);
        for (std::size_t k = 0; k < shadow.size(); k += step)
            pixels_.push_back(shadow[k]);
        fmt::print("{} triangles, {:.1f} % of the frame in shadow, {} pixels compared\n",
                   stage_.mesh.triangles.size(),
                   100.0 * static_cast<double>(shadow.size()) / static_cast<double>(places_.size()),
                   pixels_.size());
    }
    void trace()
    {
        const DirectionCells cells{128};
        const CellLight light = splitLight(environment_, glm::dmat3(1.0), cells, {2000, 1e-6});
        const Rgb free = light.irradiance(kUp);
        const double radius = stage_.local().radius;
        truth_.resize(pixels_.size());
        parallelFor(0, static_cast<std::int64_t>(pixels_.size()), [&](std::int64_t task) {
            const auto i = static_cast<std::size_t>(task);
            const glm::dvec3 x = places_[pixels_[i]];
            const glm::dvec3 to = stage_.local().center - x;
            const double distance = glm::length(to);
            const double cone =
                distance > radius ? std::sqrt(1.0 - radius * radius / distance / distance) : -1.0;
            glm::dvec3 hidden(0.0);
            const auto add = [&](const IrradianceVector& v, glm::dvec3 d) {
                const Rgb e = glm::max(v.along(kUp), Rgb(0.0f));
                if (e != Rgb(0.0f) && glm::dot(to, d) >= cone * distance &&
                    stage_.rays->occluded(x, d))
                    hidden += glm::dvec3(e);
            };
            for (std::size_t k = 0; k < light.along.size(); ++k) {
                add(light.along[k], cells.direction(k));
                add(light.against[k], -cells.direction(k));
            }
            for (std::size_t k = 0; k < light.fine.size(); ++k)
                add(light.fine[k], light.fine_directions[k]);
            truth_[i] = free - Rgb(hidden);
        });
    }
    [[nodiscard]] double errorOf(const std::function<Rgb(std::size_t)>& shown) const
    {
        double square = 0.0;
        float least = 1e30f;
        float most = 0.0f;
        for (std::size_t i = 0; i < pixels_.size(); ++i) {
            const Rgb off = shown(i) - truth_[i];
            square += static_cast<double>(glm::dot(off, off)) / 3.0;
            least = std::min({least, truth_[i].r, truth_[i].g, truth_[i].b});
            most = std::max({most, truth_[i].r, truth_[i].g, truth_[i].b});
        }
        return std::sqrt(square / static_cast<double>(pixels_.size())) / (most - least);
    }
    void add(const std::string& technique,
             double before,
             Stopwatch::Seconds shade,
             std::size_t memory,
             double error)
    {
        table_.add({"frame 1024x768",
                    technique,
                    before,
                    shade.processor,
                    static_cast<double>(memory) * 1e-6,
                    error,
                    fmt::format("{:.0f} ms by the clock", 1e3 * shade.wall)});
    }

    void exact(int fine)
    {
        const Stopwatch lighting;
        const ObjectLight object = lit({.max_fine_directions = fine});
        const double before = lighting.passed().processor;
        const auto shade =
            report::fastest(3, [&] { hiddenIrradiance(object, local_, kUp, hidden_); });
        const Rgb free = object.light.irradiance(kUp);
        add(fmt::format("ours, exact, {} fine directions", object.light.fine.size()),
            before,
            shade,
            stage_.atlas.silhouettes.memoryBytes(),
            errorOf([&](std::size_t i) { return free - hidden_[pixels_[i]]; }));
    }
    /// A part of the pixels, interpolated in between: a frame while the object is moved.
    void ofPicture(double max_error)
    {
        const Stopwatch lighting;
        const ObjectLight object = lit({.max_fine_directions = 16});
        const double before = lighting.passed().processor;
        double share = 0.0;
        const auto shade = report::fastest(3, [&] { share = frameOf(object, max_error); });
        const Rgb free = object.light.irradiance(kUp);
        add(fmt::format("ours, {:.0f} % of the pixels", 100.0 * share),
            before,
            shade,
            stage_.atlas.silhouettes.memoryBytes(),
            errorOf([&](std::size_t i) { return free - rows_[row_of_[pixels_[i]]]; }));
    }
    double frameOf(const ObjectLight& object, double max_error)
    {
        return hiddenIrradianceOfPicture(
            object, kWidth, kHeight, row_by_row_, kUp, {.max_error = max_error}, rows_);
    }
    void plane(const ObjectLight& object)
    {
        const double extent = 16.0 * stage_.local().radius;
        const glm::dvec3 corner =
            glm::dvec3(stage_.local().center.x, places_[0].y, stage_.local().center.z) -
            glm::dvec3(0.5 * extent, 0.0, 0.5 * extent);
        const Stopwatch building;
        const PlaneField field(
            object, {corner, {extent, 0.0, 0.0}, {0.0, 0.0, extent}}, {.tiles = 64});
        const double before = building.passed().processor;
        const auto shade = report::fastest(3, [&] {
            parallelFor(0, kHeight, [&](std::int64_t row) {
                for (std::size_t i = static_cast<std::size_t>(row) * kWidth;
                     i < static_cast<std::size_t>(row + 1) * kWidth;
                     ++i) {
                    const glm::dvec3 uv = (places_[i] - corner) / extent;
                    hidden_[i] = field.at({uv.x, uv.z});
                }
            });
        });
        const Rgb free = object.light.irradiance(kUp);
        add("ours, plane", before, shade, field.memoryBytes(), errorOf([&](std::size_t i) {
                return free - hidden_[pixels_[i]];
            }));
    }
    void shells(const ObjectLight& object)
    {
        const std::vector<glm::vec3> normals(local_.size(), kUp);
        const Stopwatch building;
        const ShellField field(object, {128, 65, 30, 0.35, 8.0});
        const double before = building.passed().processor;
        const auto shade =
            report::fastest(3, [&] { field.hiddenIrradiance(local_, normals, hidden_); });
        const Rgb free = object.light.irradiance(kUp);
        add("ours, shells 128x65x30",
            before,
            shade,
            field.memoryBytes(),
            errorOf([&](std::size_t i) { return free - hidden_[pixels_[i]]; }));
    }
    /// The reference's own way to direct light: directions drawn by power, a ray each.
    void sampled(int samples)
    {
        const EnvironmentLight light(environment_);
        std::vector<Rgb> shown(pixels_.size());
        const Stopwatch watch;
        parallelFor(0, static_cast<std::int64_t>(pixels_.size()), [&](std::int64_t task) {
            const auto i = static_cast<std::size_t>(task);
            RandomStream random(9, i, static_cast<std::uint64_t>(samples));
            glm::dvec3 sum(0.0);
            for (int k = 0; k < samples; ++k) {
                const double selector = random.uniformDouble();
                const glm::vec2 u(random.uniform(), random.uniform());
                const auto drawn = light.sample(places_[pixels_[i]], selector, u);
                if (!drawn || !(drawn->direction.y > 0.0) || !(drawn->pdf > 0.0)) continue;
                if (stage_.rays->occluded(places_[pixels_[i]], drawn->direction)) continue;
                sum += glm::dvec3(drawn->radiance) * (drawn->direction.y / drawn->pdf);
            }
            shown[i] = Rgb(sum / static_cast<double>(samples));
        });
        const auto spent = watch.passed();
        const double scale =
            static_cast<double>(places_.size()) / static_cast<double>(pixels_.size());
        add(fmt::format("reference, {} samples a pixel", samples),
            0.0,
            {spent.wall * scale, spent.processor * scale},
            0,
            errorOf([&](std::size_t i) { return shown[i]; }));
    }
    /// A turned object is the same atlas in another light; a moved one in the same.
    void turned()
    {
        const double angle = 0.3;
        const glm::dmat3 object_from_world({std::cos(angle), 0.0, -std::sin(angle)},
                                           {0.0, 1.0, 0.0},
                                           {std::sin(angle), 0.0, std::cos(angle)});
        const auto spent = report::fastest(3, [&] {
            const ObjectLight object = lit({.max_fine_directions = 16}, object_from_world);
            hiddenIrradiance(object, local_, kUp, hidden_);
        });
        add("ours, turned: light, silhouettes, frame", 0.0, spent, 0, -1.0);
        Stopwatch::Seconds light, frame;
        const auto in_part = report::fastest(3, [&] {
            const Stopwatch lighting;
            const ObjectLight object = lit({.max_fine_directions = 16}, object_from_world);
            light = lighting.passed();
            const Stopwatch shading;
            (void)frameOf(object, 0.01);
            frame = shading.passed();
        });
        add("ours, turned, part of the pixels", 0.0, in_part, 0, -1.0);
        add("  of it light and silhouettes", 0.0, light, 0, -1.0);
        add("  of it the frame", 0.0, frame, 0, -1.0);
    }

    Stage& stage_;
    const EnvironmentMap& environment_;
    std::vector<glm::dvec3> places_;
    std::vector<glm::vec3> local_;
    std::vector<Rgb> hidden_;
    std::vector<glm::vec3> row_by_row_;  ///< `local_` as a picture
    std::vector<Rgb> rows_;
    std::vector<std::size_t> row_of_;  ///< where in the picture a place is
    std::vector<std::size_t> pixels_;
    std::vector<Rgb> truth_;
    report::Table table_;
};

}  // namespace

int main(int argc, char** argv)
{
    CLI::App app("Speed against error of direct light on a floor");
    std::string model;
    std::string environment;
    std::string folder;
    std::size_t triangles = 88'000;
    app.add_option("model", model)->required();
    app.add_option("environment", environment)->required();
    app.add_option("folder", folder)->required();
    app.add_option("--triangles", triangles);
    CLI11_PARSE(app, argc, argv);
    try {
        Stage stage;
        stage.mesh = readModel(model).mesh;
        subdivide(stage.mesh, triangles);
        const TriangleMesh* const pointer = &stage.mesh;
        stage.rays.emplace(std::span<const TriangleMesh* const>(&pointer, 1));
        const Stopwatch watch;
        stage.atlas = buildVisibilityAtlas(stage.mesh, {}, silent);
        const auto spent = watch.passed();
        fmt::print("atlas: {:.2f} s, {:.2f} s of processors, {:.1f} MB\n",
                   spent.wall,
                   spent.processor,
                   static_cast<double>(stage.atlas.silhouettes.memoryBytes()) * 1e-6);
        const EnvironmentMap map{readRadiance(environment).pixels};
        Curve curve(stage, map);
        curve.run();
        curve.write(folder);
        return 0;
    } catch (const std::exception& error) {
        fmt::print(stderr, "{}\n", error.what());
        return 1;
    }
}
