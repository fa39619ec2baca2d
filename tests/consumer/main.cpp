// A program of somebody else's: uses the installed package from core to pipeline.
#include <composite/tonemap/reinhard.h>
#include <core/io/image_io.h>
#include <evaluate/error_metrics.h>
#include <pipeline/project.h>

#include <cstdio>

int main(int argc, char** argv)
{
    if (argc != 2) return 2;
    // Write a radiance image, read it back, make it viewable and measure the step.
    insitu::Image<insitu::Rgb> scene(8, 8, insitu::Rgb(0.5f));
    scene(3, 4) = insitu::Rgb(2.0f, 1.0f, 0.25f);
    insitu::writeRadiance(argv[1], scene);
    const insitu::RadianceImage read = insitu::readRadiance(argv[1]);
    insitu::Progress silent;
    const auto display = insitu::makeReinhard({})->map(read.pixels, silent);
    const auto metrics = insitu::compareImages(scene, read.pixels);
    if (!metrics || metrics->nrmse != 0.0 || display.width() != 8) return 1;
    // Link the module that knows all others; a missing file must be refused by name.
    try {
        (void)insitu::readProject("no such project.json");
    } catch (const insitu::InputError& error) {
        std::printf("%s\n", error.what());
        return 0;
    }
    return 1;
}
