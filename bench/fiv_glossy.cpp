// Technique fiv on glossy objects beside the path tracer: each material of a list in the place of
// the project's own.
//
// fiv_glossy [--samples N] [--roughness R…] [--pictures FOLDER] PROJECT
//
// Errors are of the object's layer over the pixels that it covers wholly, averaged over 5x5 pixels,
// root mean square relative to the layer's own: of fiv against the mean of two references with N
// samples a pixel each, their noise (half their difference) taken off in squares. Times are
// processor seconds of the render stage without atlases. FOLDER keeps the objects as PFM;
// references that are there already are not rendered again.
#include "core/check.h"
#include "core/io/image_io.h"
#include "pipeline/insert.h"

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include <cmath>
#include <cstdio>

namespace {

using namespace insitu;

struct Rendered {
    Image<Rgb> object;
    Image<float> alpha;
    double processor_s = 0.0;
};

Rendered render(const Project& project, InsertOptions options)
{
    Progress silent;
    InsertResult result = insertObjects(project, options, silent);
    Rendered rendered{std::move(result.render.layers.object),
                      std::move(result.render.layers.alpha),
                      -result.render.table_seconds};
    for (const StageTime& time : result.times)
        if (time.stage == "render") rendered.processor_s += time.processor_seconds;
    return rendered;
}

/// What an earlier run left in the folder, or what `render` gives, and then left there.
template <class Render>
Rendered keptOr(const std::filesystem::path& folder, const std::string& name, const Render& render)
{
    const auto object = folder / (name + ".pfm");
    const auto coverage = folder / (name + "-coverage.pfm");
    if (folder.empty()) return render();
    if (std::filesystem::exists(object) && std::filesystem::exists(coverage)) {
        Rendered kept{readRadiance(object).pixels, {}, 0.0};
        const Image<Rgb> alpha = readRadiance(coverage).pixels;
        kept.alpha = Image<float>(alpha.width(), alpha.height());
        for (std::size_t i = 0; i < alpha.pixelCount(); ++i)
            kept.alpha.pixels()[i] = alpha.pixels()[i].g;
        return kept;
    }
    Rendered made = render();
    Image<Rgb> alpha(made.alpha.width(), made.alpha.height());
    for (std::size_t i = 0; i < alpha.pixelCount(); ++i)
        alpha.pixels()[i] = Rgb(made.alpha.pixels()[i]);
    std::filesystem::create_directories(folder);
    writeRadiance(object, made.object);
    writeRadiance(coverage, alpha);
    return made;
}

/// Mean squares over 5x5 windows that the object covers, of a picture made of pixels.
template <class Pixel>
double meanSquare(const Image<float>& alpha, const Pixel& pixel)
{
    constexpr int kWindow = 5;
    double square = 0.0;
    int windows = 0;
    for (int top = 0; top + kWindow <= alpha.height(); top += kWindow)
        for (int left = 0; left + kWindow <= alpha.width(); left += kWindow) {
            glm::dvec3 sum(0.0);
            bool covered = true;
            for (int y = top; y < top + kWindow; ++y)
                for (int x = left; x < left + kWindow; ++x) {
                    covered = covered && alpha(x, y) > 0.999f;
                    sum += glm::dvec3(pixel(x, y)) / double{kWindow * kWindow};
                }
            if (!covered) continue;
            square += glm::dot(sum, sum) / 3.0;
            ++windows;
        }
    return windows > 0 ? square / windows : 0.0;
}

void compare(const Project& given,
             int samples,
             const std::filesystem::path& pictures,
             bool metal,
             float roughness)
{
    Project project = given;
    Material material;
    material.base_color = glm::vec3(0.6f, 0.5f, 0.4f);
    material.metallic = metal ? 1.0f : 0.0f;
    material.roughness = roughness;
    for (ProjectObject& object : project.objects)
        object.material = material;
    InsertOptions options;
    leaveOut("all", options.match);
    options.render.max_samples = options.render.min_samples = samples;
    const std::string name = fmt::format("{}-{:.1f}", metal ? "metal" : "dielectric", roughness);
    const auto reference = [&](const char* which) {
        return keptOr(pictures, name + which, [&] { return render(project, options); });
    };
    const Rendered one = reference("-one");
    options.render.seed = 77;
    const Rendered other = reference("-other");
    options.render.technique = Technique::Fiv;
    const Rendered fiv = render(project, options);
    const auto mean = [&](int x, int y) { return 0.5f * (one.object(x, y) + other.object(x, y)); };
    const double level = meanSquare(one.alpha, mean);
    const double noise = meanSquare(
        one.alpha, [&](int x, int y) { return 0.5f * (one.object(x, y) - other.object(x, y)); });
    const double off =
        meanSquare(one.alpha, [&](int x, int y) { return fiv.object(x, y) - mean(x, y); });
    fmt::print("{:<10} {:>5.1f} {:>9.1f} {:>9.1f} {:>9.4f} {:>9.4f}\n",
               metal ? "metal" : "dielectric",
               roughness,
               one.processor_s,
               fiv.processor_s,
               std::sqrt(noise / level),
               std::sqrt(std::max(0.0, off - noise) / level));
    std::fflush(stdout);
    if (!pictures.empty()) writeRadiance(pictures / (name + "-fiv.pfm"), fiv.object);
}

}  // namespace

int main(int argc, char** argv)
{
    CLI::App app("Technique fiv on glossy objects beside the path tracer");
    std::string file;
    std::string pictures;
    std::vector<float> roughnesses = {0.1f, 0.3f, 0.6f, 1.0f};
    int samples = 32;
    app.add_option("project", file)->required();
    app.add_option("--samples", samples);
    app.add_option("--roughness", roughnesses);
    app.add_option("--pictures", pictures, "Keeps the objects of both");
    CLI11_PARSE(app, argc, argv);
    try {
        const Project project = readProject(file);
        fmt::print("{:<10} {:>5} {:>9} {:>9} {:>9} {:>9}\n",
                   "material",
                   "rough",
                   "ref., s",
                   "fiv, s",
                   "noise",
                   "fiv off");
        for (const bool metal : {false, true})
            for (const float roughness : roughnesses)
                compare(project, samples, pictures, metal, roughness);
        return 0;
    } catch (const std::exception& error) {
        fmt::print(stderr, "{}\n", error.what());
        return 1;
    }
}
