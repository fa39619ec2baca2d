#include "capture/noise_blocks.h"

#include <algorithm>
#include <cmath>

namespace insitu {

namespace {

constexpr int kSide = NoiseBlock::kSide;
constexpr int kPixels = kSide * kSide;
/// Codes used, fractions of full scale: away from black and from clipping.
constexpr double kLeastCode = 0.04;
constexpr double kGreatestCode = 0.97;

using Samples = std::array<double, kPixels>;

/// Takes the mean and the plane out of the samples; returns the mean.
double removePlane(Samples& samples)
{
    double sum = 0.0;
    double sum_x = 0.0;
    double sum_y = 0.0;
    constexpr double kMiddle = 0.5 * (kSide - 1);
    for (int i = 0; i < kPixels; ++i) {
        const double value = samples[static_cast<std::size_t>(i)];
        sum += value;
        sum_x += value * (i % kSide - kMiddle);
        sum_y += value * (i / kSide - kMiddle);
    }
    constexpr double kSquares = kPixels * (kSide * kSide - 1) / 12.0;
    const double mean = sum / kPixels;
    for (int i = 0; i < kPixels; ++i)
        samples[static_cast<std::size_t>(i)] -= mean + sum_x / kSquares * (i % kSide - kMiddle) +
                                                sum_y / kSquares * (i / kSide - kMiddle);
    return mean;
}

double meanProduct(const Samples& a, const Samples& b)
{
    double sum = 0.0;
    for (std::size_t i = 0; i < a.size(); ++i)
        sum += a[i] * b[i];
    return sum / NoiseBlock::kFreedoms;
}

double neighbourProduct(const Samples& a, const Samples& b)
{
    double sum = 0.0;
    for (std::size_t i = 0; i < a.size(); ++i)
        if (i % kSide + 1 < kSide) sum += (a[i] - b[i]) * (a[i + 1] - b[i + 1]);
    return sum / (kSide * (kSide - 1));
}

}  // namespace

NoiseBlockReader::NoiseBlockReader(const ResponseCurve& response, int max_code)
    : response_(response), max_code_(max_code)
{
    for (std::size_t c = 0; c < 3; ++c) {
        exposure_[c].resize(static_cast<std::size_t>(max_code) + 1);
        for (std::size_t z = 0; z < exposure_[c].size(); ++z)
            exposure_[c][z] =
                response.decode(static_cast<int>(c), static_cast<double>(z) * 255.0 / max_code);
    }
}

bool NoiseBlockReader::readSamples(
    const EncodedImage& image, int x0, int y0, int c, double factor, Samples& samples) const
{
    const int least = static_cast<int>(std::ceil(kLeastCode * max_code_));
    const int greatest = static_cast<int>(kGreatestCode * max_code_);
    const auto& table = exposure_[static_cast<std::size_t>(c)];
    std::size_t i = 0;
    for (int y = y0; y < y0 + kSide; ++y) {
        for (int x = x0; x < x0 + kSide; ++x) {
            const int code = image.codes(x, y)[c];
            if (code < least || code > greatest) return false;
            samples[i++] = factor * table[static_cast<std::size_t>(code)];
        }
    }
    return true;
}

std::array<std::vector<NoiseBlock>, 3> NoiseBlockReader::read(const BracketFrame& longer,
                                                              const BracketFrame& shorter,
                                                              std::int64_t most) const
{
    std::array<std::vector<NoiseBlock>, 3> blocks;
    if (shorter.image.max_code != max_code_ || longer.image.max_code != max_code_) return blocks;
    const double rho = longer.relative_exposure / shorter.relative_exposure;
    const std::int64_t columns = longer.image.codes.width() / kSide;
    const std::int64_t all = columns * (longer.image.codes.height() / kSide);
    const std::int64_t taken = std::min(all, most);
    Samples first{};
    Samples second{};
    for (std::int64_t i = 0; i < taken; ++i) {
        const std::int64_t place = i * all / taken;
        const int x0 = static_cast<int>(place % columns) * kSide;
        const int y0 = static_cast<int>(place / columns) * kSide;
        for (int c = 0; c < 3; ++c) {
            if (!readSamples(longer.image, x0, y0, c, 1.0, first)) continue;
            if (!readSamples(shorter.image, x0, y0, c, rho, second)) continue;
            NoiseBlock block;
            block.rho = rho;
            block.x1 = removePlane(first);
            block.x2 = removePlane(second) / rho;
            block.z1 = response_.encode(c, block.x1);
            block.z2 = response_.encode(c, block.x2);
            block.var1 = meanProduct(first, first);
            block.var2 = meanProduct(second, second);
            block.covariance = meanProduct(first, second);
            block.neighbours = neighbourProduct(first, second);
            blocks[static_cast<std::size_t>(c)].push_back(block);
        }
    }
    return blocks;
}

}  // namespace insitu
