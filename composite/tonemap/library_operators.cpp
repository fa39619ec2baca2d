#include "composite/tonemap/library_operators.h"

#include "core/check.h"
#include "core/color.h"

#include <opencv2/core.hpp>
#include <opencv2/core/utils/logger.hpp>
#include <opencv2/photo.hpp>

#include <algorithm>
#include <cmath>

namespace insitu {

namespace {

constexpr float kMiddleGrey = 0.18f;
/// Display-linear: we encode by ourselves.
constexpr float kNoGamma = 1.0f;

cv::Ptr<cv::Tonemap> create(LibraryOperator which)
{
    switch (which) {
        case LibraryOperator::Drago:
            return cv::createTonemapDrago(kNoGamma);
        case LibraryOperator::ReinhardDevlin:
            // Without its shift of intensity and adaptation to all the picture, which wash colours
            // out.
            return cv::createTonemapReinhard(kNoGamma, 0.0f, 0.0f, 0.0f);
    }
    return cv::createTonemap(kNoGamma);
}

/// Keeps the library's remarks about itself off the terminal.
class Quiet {
public:
    Quiet() : before_(cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_ERROR)) {}
    ~Quiet() { cv::utils::logging::setLogLevel(before_); }
    Quiet(const Quiet&) = delete;
    Quiet& operator=(const Quiet&) = delete;

private:
    cv::utils::logging::LogLevel before_;
};

/// The library measures a scene by itself, so it needs all of it at once.
class LibraryMapping : public SceneMapping {
public:
    LibraryMapping(LibraryOperator which, const SceneStatistics& statistics)
        : which_(which), statistics_(statistics)
    {
    }

    [[nodiscard]] int reach() const override { return kWhole; }
    void map(const SceneStrip& strip,
             int /*top*/,
             Image<Rgb>& display,
             Progress& progress) const override
    {
        const Image<Rgb>& scene = strip.rows;
        const SceneStatistics& statistics = statistics_;
        INSITU_CHECK(display.sameSize(scene), "{}x{}", display.width(), display.height());
        if (statistics.largest <= statistics.smallest) {
            const float level = statistics.largest > 0.0
                                    ? kMiddleGrey / static_cast<float>(statistics.largest)
                                    : 0.0f;
            for (std::size_t i = 0; i < scene.pixelCount(); ++i)
                display.pixels()[i] = glm::min(level * scene.pixels()[i], Rgb(1.0f));
            return;
        }
        // Channels in OpenCV's order. It brings the values to [0, 1] first, so that any unit will
        // do.
        cv::Mat source(scene.height(), scene.width(), CV_32FC3);
        for (int y = 0; y < scene.height(); ++y)
            for (int x = 0; x < scene.width(); ++x) {
                const Rgb value = scene(x, y);
                source.at<cv::Vec3f>(y, x) = {value.b, value.g, value.r};
            }
        cv::Mat mapped;
        try {
            const Quiet quiet;
            create(which_)->process(source, mapped);
        } catch (const cv::Exception& error) {
            throw InputError("tone mapping",
                             fmt::format("{}x{} pixels cannot be mapped by this operator ({}); "
                                         "choose another",
                                         scene.width(),
                                         scene.height(),
                                         error.err));
        }
        for (int y = 0; y < scene.height(); ++y)
            for (int x = 0; x < scene.width(); ++x) {
                const cv::Vec3f value = mapped.at<cv::Vec3f>(y, x);
                const bool black = scene(x, y) == Rgb(0.0f);
                for (int c = 0; c < 3; ++c) {
                    const float shown = value[2 - c];
                    display(x, y)[c] =
                        std::isfinite(shown) && !black ? std::clamp(shown, 0.0f, 1.0f) : 0.0f;
                }
            }
        progress.checkpoint();
    }

private:
    LibraryOperator which_;
    SceneStatistics statistics_;
};

class FromLibrary : public ToneMapOperator {
public:
    explicit FromLibrary(LibraryOperator which) : which_(which) {}

    [[nodiscard]] std::unique_ptr<SceneMapping> begin(
        int /*width*/, int /*height*/, const SceneStatistics& statistics) const override
    {
        return std::make_unique<LibraryMapping>(which_, statistics);
    }

private:
    LibraryOperator which_;
};

}  // namespace

std::unique_ptr<ToneMapOperator> makeLibraryOperator(LibraryOperator which)
{
    return std::make_unique<FromLibrary>(which);
}

}  // namespace insitu
