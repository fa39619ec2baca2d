// Whether tone mapping shows or hides what fullsphere irradiance vectors get wrong: the tables 17
// and 18 of [Michael10] 5.4 for our fields and the thesis's method.
//
//   fiv_tonemap [--pictures FOLDER] MODEL ENVIRONMENT…
//
// A floor in the shadow of MODEL, which itself is not drawn (it would hide pixels that may be
// wrong), before the environment, 512 x 384 pixels. Truth: brute force by rays over the same
// 6x32x32 directions. VDP % is the share of pixels whose difference from truth is seen, at 30
// pixels a degree: *before* of the radiance at the exposure that puts the brightest floor at 0.9 of
// the white, cut at the white; *after* of the picture by Ashikhmin's operator. NRMSE is that of the
// floor's radiance.
#include "bench/fiv_lights.h"
#include "bench/fiv_stage.h"
#include "composite/tonemap/ashikhmin.h"
#include "core/camera.h"
#include "core/environment_map.h"
#include "core/io/image_io.h"
#include "core/io/model_io.h"
#include "evaluate/visible_differences.h"

#include <CLI/CLI.hpp>

#include <numbers>

namespace insitu {
namespace {

using namespace fiv_bench;
namespace fs = std::filesystem;

/// What is behind a pixel: a place on the floor, or a direction into the environment.
struct View {
    Camera camera;
    std::vector<glm::ivec2> floor_pixels;  ///< in tiles of 8 x 4
    std::vector<glm::dvec3> floor_places;
};

View viewOf(const Stage& stage)
{
    const LocalFrame& local = stage.local();
    View view;
    const glm::dvec3 target(local.center.x, stage.floor.corner.y, local.center.z);
    view.camera =
        Camera::lookAt(target + local.radius * glm::dvec3(0.0, 3.0, 4.5), target, 600.0, 512, 384);
    const Camera& camera = view.camera;
    for (int top = 0; top < camera.height; top += 4)
        for (int left = 0; left < camera.width; left += 8)
            for (int y = top; y < top + 4; ++y)
                for (int x = left; x < left + 8; ++x) {
                    const glm::dvec3 ray = camera.rayDirection({x + 0.5, y + 0.5});
                    const double t = (target.y - camera.position_m.y) / ray.y;
                    const glm::dvec3 place = camera.position_m + t * ray;
                    const glm::dvec3 from_middle = glm::abs(place - target);
                    if (t <= 0.0 ||
                        std::max(from_middle.x, from_middle.z) > 0.5 * stage.floor.extent)
                        continue;
                    view.floor_pixels.emplace_back(x, y);
                    view.floor_places.push_back(place);
                }
    return view;
}

/// Radiance of the texel that a direction falls into.
Rgb radianceOf(const TexelLight& light, glm::dvec3 direction)
{
    const DirectedPair cell = light.cells.cellAt(direction);
    return light.radiance[2 * cell.pair + static_cast<std::size_t>(cell.side)];
}

/// The scene with its floor's irradiance; it reflects a half.
Image<Rgb> sceneOf(const View& view, const TexelLight& light, std::span<const Rgb> irradiance)
{
    Image<Rgb> scene(view.camera.width, view.camera.height);
    for (int y = 0; y < scene.height(); ++y)
        for (int x = 0; x < scene.width(); ++x)
            scene(x, y) = radianceOf(light, view.camera.rayDirection({x + 0.5, y + 0.5}));
    for (std::size_t i = 0; i < irradiance.size(); ++i)
        scene(view.floor_pixels[i].x, view.floor_pixels[i].y) =
            glm::max(irradiance[i], Rgb(0.0f)) * (0.5f / std::numbers::pi_v<float>);
    return scene;
}

Image<float> greyOf(const Image<Rgb>& display)
{
    Image<float> grey(display.width(), display.height());
    for (std::size_t i = 0; i < grey.pixelCount(); ++i)
        grey.pixels()[i] = std::clamp(luminance(display.pixels()[i]), 0.0f, 1.0f);
    return grey;
}

/// Compares techniques on one scene.
class Comparison {
public:
    Comparison(const View& view, const TexelLight& light, std::vector<Rgb> truth, fs::path pictures)
        : view_(view), light_(light), truth_(std::move(truth)), pictures_(std::move(pictures))
    {
        const Image<Rgb> scene = sceneOf(view_, light_, truth_);
        statistics_ = measureScene(scene);
        float brightest = 0.0f;
        for (const glm::ivec2 p : view_.floor_pixels)
            brightest = std::max(brightest, luminance(scene(p.x, p.y)));
        exposure_ = 0.9f / brightest;
        before_ = exposed(scene);
        after_ = tone_map_->map(scene, statistics_, silent);
    }

    void add(const std::string& light_name,
             const std::string& technique,
             const std::vector<Rgb>& irradiance)
    {
        const Image<Rgb> scene = sceneOf(view_, light_, irradiance);
        const Image<Rgb> before = exposed(scene);
        const Image<Rgb> after = tone_map_->map(scene, statistics_, silent);
        double square = 0.0;
        float least = 1e30f;
        float most = 0.0f;
        for (std::size_t i = 0; i < truth_.size(); ++i) {
            const Rgb off = irradiance[i] - truth_[i];
            square += static_cast<double>(glm::dot(off, off)) / 3.0;
            least = std::min({least, truth_[i].r, truth_[i].g, truth_[i].b});
            most = std::max({most, truth_[i].r, truth_[i].g, truth_[i].b});
        }
        fmt::print("{:<24} {:<34} {:>8.4f} {:>8.2f} {:>8.2f}\n",
                   light_name,
                   technique,
                   std::sqrt(square / static_cast<double>(truth_.size())) / (most - least),
                   seen(before_, before),
                   seen(after_, after));
        std::fflush(stdout);
        if (pictures_.empty()) return;
        const std::string name = light_name + "-" + std::to_string(written_++);
        writeEncoded(pictures_ / (name + "-before.png"), encodeSrgb(before));
        writeEncoded(pictures_ / (name + "-after.png"), encodeSrgb(after));
    }

private:
    [[nodiscard]] Image<Rgb> exposed(Image<Rgb> scene) const
    {
        for (Rgb& pixel : scene.pixels())
            pixel = glm::min(exposure_ * pixel, Rgb(1.0f));
        return scene;
    }
    [[nodiscard]] static double seen(const Image<Rgb>& truth, const Image<Rgb>& picture)
    {
        return visibleDifferences(greyOf(truth), greyOf(picture), {}, silent).percent_seen;
    }

    const View& view_;
    const TexelLight& light_;
    std::vector<Rgb> truth_;
    fs::path pictures_;
    std::unique_ptr<ToneMapOperator> tone_map_ = makeAshikhmin();
    SceneStatistics statistics_;
    float exposure_ = 1.0f;
    Image<Rgb> before_, after_;
    int written_ = 0;
};

std::vector<Rgb> irradianceAt(const View& view, const std::function<Rgb(glm::dvec3)>& shade)
{
    std::vector<Rgb> irradiance(view.floor_places.size());
    parallelFor(0, static_cast<std::int64_t>(irradiance.size()), [&](std::int64_t task) {
        const auto i = static_cast<std::size_t>(task);
        irradiance[i] = shade(view.floor_places[i]);
    });
    return irradiance;
}

/// What is left of the free irradiance where some is hidden.
std::vector<Rgb> left(const ObjectLight& object, std::vector<Rgb> hidden)
{
    const Rgb free = object.light.irradiance(kUp);
    for (Rgb& value : hidden)
        value = free - value;
    return hidden;
}

void compareLight(const Stage& stage,
                  const View& view,
                  const std::string& name,
                  const TexelLight& light,
                  const fs::path& pictures)
{
    const RayScene* const scenes[] = {&*stage.rays};
    Comparison comparison(
        view,
        light,
        irradianceAt(
            view,
            [&](glm::dvec3 x) { return baseline::bruteForce(scenes, light, x, glm::dvec3(kUp)); }),
        pictures);
    const ObjectLight object = litByTexels(stage, light, 256);
    std::vector<glm::vec3> places;
    for (const glm::dvec3 place : view.floor_places)
        places.push_back(stage.local().localFrom(place));
    std::vector<Rgb> hidden(places.size());
    const std::vector<glm::vec3> normals(places.size(), kUp);

    for (const baseline::TableSize size : {baseline::TableSize{32, 17, 15, 0.35, 8.0},
                                           baseline::TableSize{64, 33, 30, 0.35, 8.0},
                                           baseline::TableSize{256, 129, 30, 0.35, 8.0}}) {
        const std::string sized = fmt::format("{}x{}x{}", size.azimuths, size.polars, size.shells);
        if (size.azimuths <= 64) {
            const baseline::IrradianceCube cube(light, 32);
            const baseline::Table table(*stage.rays, stage.local(), light, size);
            const baseline::Occluder occluder{&table, stage.local().center, stage.local().radius};
            comparison.add(name, "thesis, by rays, " + sized, irradianceAt(view, [&](glm::dvec3 x) {
                               return baseline::shadowed(cube, {&occluder, 1}, x, glm::dvec3(kUp));
                           }));
        }
        const ShellField field(
            object, {size.azimuths, size.polars, size.shells, size.first_radii, size.last_radii});
        field.hiddenIrradiance(places, normals, hidden);
        comparison.add(name, "ours, shells, " + sized, left(object, hidden));
    }
    const PlaneField field(object, planeOf(stage.floor), {});
    comparison.add(name, "ours, plane", irradianceAt(view, [&](glm::dvec3 x) {
                       const glm::dvec3 from = (x - stage.floor.corner) / stage.floor.extent;
                       return object.light.irradiance(kUp) - field.at({from.x, from.z});
                   }));
    hiddenIrradiance(object, places, kUp, hidden);
    comparison.add(name, "ours, exact", left(object, hidden));
}

void run(const std::string& model,
         const std::vector<std::string>& environments,
         const fs::path& pictures)
{
    if (!pictures.empty()) fs::create_directories(pictures);
    Stage stage;
    stage.mesh = readModel(model).mesh;
    const TriangleMesh* const pointer = &stage.mesh;
    stage.rays.emplace(std::span<const TriangleMesh* const>(&pointer, 1));
    stage.atlas = buildVisibilityAtlas(stage.mesh, {}, silent);
    stage.put(boundingBox(stage.mesh).min.y, 0.0);
    const View view = viewOf(stage);
    fmt::print(
        "{:<24} {:<34} {:>8} {:>8} {:>8}\n", "light", "technique", "NRMSE", "before", "after");
    compareLight(
        stage, view, "one point light", patches({{{0.5, 0.8, 0.3}, 1.0, Rgb(100.0f)}}), pictures);
    compareLight(stage,
                 view,
                 "two area lights",
                 patches({{{0.6, 0.7, 0.3}, 0.97, Rgb(0.2f, 5.0f, 0.2f)},
                          {{-0.7, 0.5, 0.2}, 0.97, Rgb(5.0f, 0.2f, 0.2f)}}),
                 pictures);
    for (const std::string& file : environments) {
        const EnvironmentMap environment{readRadiance(file).pixels};
        compareLight(stage,
                     view,
                     fs::path(file).stem().string(),
                     baseline::texelLight(environment, 32),
                     pictures);
    }
}

}  // namespace
}  // namespace insitu

int main(int argc, char** argv)
{
    CLI::App app("Visible error of irradiance vectors before and after tone mapping");
    std::string model;
    std::vector<std::string> environments;
    std::string pictures;
    app.add_option("model", model)->required();
    app.add_option("environments", environments)->required();
    app.add_option("--pictures", pictures, "Folder for the pictures compared");
    CLI11_PARSE(app, argc, argv);
    try {
        insitu::run(model, environments, pictures);
        return 0;
    } catch (const std::exception& error) {
        fmt::print(stderr, "{}\n", error.what());
        return 1;
    }
}
