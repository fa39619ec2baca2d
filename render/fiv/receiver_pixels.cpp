#include "render/fiv/receiver_pixels.h"

#include "core/color.h"
#include "core/parallel.h"

#include <algorithm>
#include <cmath>

namespace insitu {

namespace {

constexpr int kStep = 4;
/// Squares nearer to an object than this share of its radius are computed pixel by pixel.
constexpr double kNear = 0.12;
/// Corners of a square that differ by more are not interpolated, however even the slope.
constexpr float kMostRange = 0.2f;

/// One kind of light on all pixels: computed here and there, interpolated in between.
struct LightImage {
    std::vector<ReceiverIrradiance> values;
    std::vector<std::uint8_t> known;
};

class Pass {
public:
    Pass(const FivScene& scene,
         const std::vector<std::optional<ReceiverPlace>>& receivers,
         ReceiverLight& light,
         float tolerance,
         int width,
         int height)
        : scene_(scene),
          receivers_(receivers),
          light_(light),
          tolerance_(tolerance),
          width_(width),
          height_(height),
          columns_(std::max(1, (width + kStep - 2) / kStep)),
          rows_(std::max(1, (height + kStep - 2) / kStep))
    {
        for (const BoundingBox& b : scene.objects.bounds()) {
            const glm::dvec3 reach(0.5 * kNear * glm::length(b.max - b.min));
            near_.push_back({b.min - reach, b.max + reach});
        }
    }

    [[nodiscard]] LightImage cells() const
    {
        LightImage image = empty();
        evaluateCells(lattice(), image);
        evaluateCells(rest(image, [&](int x, int y) { return smoothCells(image, x, y); }), image);
        fill(image);
        return image;
    }

    [[nodiscard]] LightImage spots() const
    {
        LightImage image = empty();
        if (scene_.spots.spots().empty()) {
            std::fill(image.known.begin(), image.known.end(), std::uint8_t{1});
            return image;
        }
        evaluateSpots(lattice(), image);
        evaluateSpots(rest(image, [&](int x, int y) { return smoothSpots(image, x, y); }), image);
        fill(image);
        return image;
    }

private:
    [[nodiscard]] LightImage empty() const
    {
        return {std::vector<ReceiverIrradiance>(receivers_.size()),
                std::vector<std::uint8_t>(receivers_.size(), 0)};
    }
    [[nodiscard]] std::size_t at(int x, int y) const
    {
        return static_cast<std::size_t>(std::min(y, height_ - 1)) *
                   static_cast<std::size_t>(width_) +
               static_cast<std::size_t>(std::min(x, width_ - 1));
    }
    /// Pixels at the squares' corners, in blocks of 8 x 4.
    [[nodiscard]] std::vector<std::size_t> lattice() const
    {
        std::vector<std::size_t> pixels;
        for (int by = 0; by <= rows_; by += 4)
            for (int bx = 0; bx <= columns_; bx += 8)
                for (int j = by; j < std::min(by + 4, rows_ + 1); ++j)
                    for (int i = bx; i < std::min(bx + 8, columns_ + 1); ++i)
                        if (receivers_[at(i * kStep, j * kStep)])
                            pixels.push_back(at(i * kStep, j * kStep));
        return pixels;
    }
    /// Pixels of the squares that are not smooth.
    template <class Smooth>
    [[nodiscard]] std::vector<std::size_t> rest(const LightImage& image, const Smooth& smooth) const
    {
        std::vector<std::uint8_t> rough(static_cast<std::size_t>(columns_ * rows_));
        parallelFor(0, rows_, [&](std::int64_t j) {
            for (int i = 0; i < columns_; ++i)
                rough[static_cast<std::size_t>(j * columns_ + i)] =
                    !oneSurface(i, static_cast<int>(j)) || !smooth(i, static_cast<int>(j));
        });
        std::vector<std::size_t> pixels;
        std::vector<std::uint8_t> listed(image.known);
        for (int j = 0; j < rows_; ++j)
            for (int i = 0; i < columns_; ++i) {
                if (!rough[static_cast<std::size_t>(j * columns_ + i)]) continue;
                for (int y = j * kStep; y <= std::min((j + 1) * kStep, height_ - 1); ++y)
                    for (int x = i * kStep; x <= std::min((i + 1) * kStep, width_ - 1); ++x) {
                        if (listed[at(x, y)] || !receivers_[at(x, y)]) continue;
                        listed[at(x, y)] = 1;
                        pixels.push_back(at(x, y));
                    }
            }
        return pixels;
    }
    /// All pixels of a square show one flat surface.
    [[nodiscard]] bool oneSurface(int i, int j) const
    {
        const auto& first = receivers_[at(i * kStep, j * kStep)];
        if (!first) return false;
        for (int y = 0; y <= kStep; ++y)
            for (int x = 0; x <= kStep; ++x) {
                const auto& other = receivers_[at(i * kStep + x, j * kStep + y)];
                if (!other || other->face != first->face) return false;
            }
        return true;
    }
    template <class Visit>
    void corners(int i, int j, const Visit& visit) const
    {
        for (int y = 0; y <= 1; ++y)
            for (int x = 0; x <= 1; ++x)
                visit(at((i + x) * kStep, (j + y) * kStep));
    }
    /// with/without − 1 at a corner of the squares; nothing where another surface is seen.
    [[nodiscard]] std::optional<float> ratioAt(const LightImage& image,
                                               int i,
                                               int j,
                                               std::size_t face) const
    {
        if (i < 0 || j < 0 || i > columns_ || j > rows_) return std::nullopt;
        const std::size_t pixel = at(i * kStep, j * kStep);
        if (!receivers_[pixel] || receivers_[pixel]->face != face) return std::nullopt;
        const ReceiverIrradiance& value = image.values[pixel];
        const float without = luminance(value.without);
        return without > 0.0f ? luminance(value.change) / without : 0.0f;
    }
    /// How far linear interpolation may be off: second differences at the corners, over 8.
    [[nodiscard]] bool evenly(const LightImage& image, int i, int j) const
    {
        const std::size_t face = receivers_[at(i * kStep, j * kStep)]->face;
        float least = 1e30f;
        float most = -1e30f;
        float bend = 0.0f;
        float darkest = 1e30f;
        float brightest = 0.0f;
        for (int y = j; y <= j + 1; ++y)
            for (int x = i; x <= i + 1; ++x) {
                const float here = *ratioAt(image, x, y, face);
                const auto bendAlong = [&](int dx, int dy) {
                    const auto before = ratioAt(image, x - dx, y - dy, face);
                    const auto after = ratioAt(image, x + dx, y + dy, face);
                    if (before && after)
                        bend = std::max(bend, std::abs(*before - 2.0f * here + *after));
                };
                bendAlong(1, 0);
                bendAlong(0, 1);
                const float without = luminance(image.values[at(x * kStep, y * kStep)].without);
                least = std::min(least, here);
                most = std::max(most, here);
                darkest = std::min(darkest, without);
                brightest = std::max(brightest, without);
            }
        return bend <= 8.0f * tolerance_ && most - least <= kMostRange &&
               brightest - darkest <= kMostRange * brightest;
    }
    [[nodiscard]] bool smoothCells(const LightImage& image, int i, int j) const
    {
        bool near = false;
        corners(i, j, [&](std::size_t pixel) {
            const glm::dvec3 p = receivers_[pixel]->point;
            for (const BoundingBox& b : near_)
                near = near || (glm::all(glm::greaterThanEqual(p, b.min)) &&
                                glm::all(glm::lessThanEqual(p, b.max)));
        });
        return !near && evenly(image, i, j);
    }
    [[nodiscard]] bool smoothSpots(const LightImage& image, int i, int j) const
    {
        bool shade = false;
        corners(
            i, j, [&](std::size_t pixel) { shade = shade || light_.mayShade(*receivers_[pixel]); });
        return !shade && evenly(image, i, j);
    }

    void evaluateCells(const std::vector<std::size_t>& pixels, LightImage& image) const
    {
        std::vector<ReceiverPlace> places;
        for (const std::size_t pixel : pixels)
            places.push_back(*receivers_[pixel]);
        const std::vector<ReceiverIrradiance> found = light_.cells(places);
        for (std::size_t k = 0; k < pixels.size(); ++k) {
            image.values[pixels[k]] = found[k];
            image.known[pixels[k]] = 1;
        }
    }
    void evaluateSpots(const std::vector<std::size_t>& pixels, LightImage& image) const
    {
        constexpr std::int64_t kRun = 256;
        const auto count = static_cast<std::int64_t>(pixels.size());
        parallelFor(0, (count + kRun - 1) / kRun, [&](std::int64_t run) {
            for (std::int64_t k = run * kRun; k < std::min(count, (run + 1) * kRun); ++k) {
                const std::size_t pixel = pixels[static_cast<std::size_t>(k)];
                image.values[pixel] = light_.spots(*receivers_[pixel]);
                image.known[pixel] = 1;
            }
        });
    }
    /// Interpolates what is not known: it lies in squares of one surface, whose corners are known.
    void fill(LightImage& image) const
    {
        std::vector<ReceiverIrradiance> filled(image.values);
        parallelFor(0, height_, [&](std::int64_t row) {
            const int y = static_cast<int>(row);
            const int j = std::min(y / kStep, rows_ - 1);
            for (int x = 0; x < width_; ++x) {
                if (image.known[at(x, y)] || !receivers_[at(x, y)]) continue;
                const int i = std::min(x / kStep, columns_ - 1);
                const int right = std::min((i + 1) * kStep, width_ - 1);
                const int below = std::min((j + 1) * kStep, height_ - 1);
                const float tx = static_cast<float>(x - i * kStep) /
                                 static_cast<float>(std::max(1, right - i * kStep));
                const float ty = static_cast<float>(y - j * kStep) /
                                 static_cast<float>(std::max(1, below - j * kStep));
                ReceiverIrradiance sum;
                int corner = 0;
                corners(i, j, [&](std::size_t pixel) {
                    const float weight =
                        (corner % 2 ? tx : 1.0f - tx) * (corner / 2 ? ty : 1.0f - ty);
                    sum.without += weight * image.values[pixel].without;
                    sum.change += weight * image.values[pixel].change;
                    ++corner;
                });
                filled[at(x, y)] = sum;
            }
        });
        image.values = std::move(filled);
    }

    const FivScene& scene_;
    const std::vector<std::optional<ReceiverPlace>>& receivers_;
    ReceiverLight& light_;
    float tolerance_;
    int width_;
    int height_;
    int columns_;
    int rows_;
    std::vector<BoundingBox> near_;
};

}  // namespace

double renderReceiverPixels(const FivScene& scene,
                            const std::vector<std::optional<ReceiverPlace>>& receivers,
                            ReceiverLight& light,
                            double tolerance,
                            RenderLayers& layers,
                            Progress& progress)
{
    const int width = layers.alpha.width();
    const int height = layers.alpha.height();
    const Pass pass(scene, receivers, light, static_cast<float>(tolerance), width, height);
    const LightImage smooth = pass.cells();
    progress.checkpoint();
    const LightImage spots = pass.spots();
    progress.checkpoint();
    std::size_t computed = 0;
    std::size_t count = 0;
    for (std::size_t i = 0; i < receivers.size(); ++i) {
        if (!receivers[i]) continue;
        ++count;
        computed += smooth.known[i];
        ReceiverIrradiance sum = smooth.values[i];
        sum += spots.values[i];
        const ReceiverPlace& place = *receivers[i];
        const Rgb without = scene.room.irradianceScale(place.face, place.uv) * sum.without;
        layers.irradiance_without.pixels()[i] = without;
        layers.irradiance_with.pixels()[i] = glm::max(without + sum.change, Rgb(0.0f));
        layers.probe_radiance.pixels()[i] = scene.room.probeRadiance(place.face, place.uv);
    }
    return count > 0 ? static_cast<double>(computed) / static_cast<double>(count) : 0.0;
}

}  // namespace insitu
