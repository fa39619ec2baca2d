#include "pipeline/camera_simulator.h"

#include "core/check.h"
#include "core/io/exif.h"
#include "tests/support/tolerance.h"

#include <gtest/gtest.h>

#include <cmath>

namespace insitu {
namespace {

/// A body without noise.
SimulatedCameraBody quietBody()
{
    SimulatedCameraBody body;
    body.read_noise = body.photon_noise = 0.0;
    return body;
}

TEST(ToneCurve, RunsFromBlackToWhiteAndIsInvertible)
{
    const ToneCurve curve;
    for (int c = 0; c < 3; ++c) {
        EXPECT_EQ(encodeTone(curve, c, 0.0), 0.0);
        EXPECT_EQ(encodeTone(curve, c, -1.0), 0.0);
        EXPECT_NEAR(encodeTone(curve, c, 1.0), 1.0, tolerance::kDouble);
        EXPECT_NEAR(encodeTone(curve, c, 7.0), 1.0, tolerance::kDouble);
        double last = -1.0;
        for (int i = 0; i <= 100; ++i) {
            const double exposure = i / 100.0;
            const double value = encodeTone(curve, c, exposure);
            EXPECT_GT(value, last);
            last = value;
            EXPECT_NEAR(decodeTone(curve, c, value), exposure, tolerance::kDouble);
        }
    }
}

// Contrast 0 leaves the pure power; contrast 1 leaves s(1/2) = 1/2 and s(1/4) = 5/32.
TEST(ToneCurve, ClosedForms)
{
    const ToneCurve power{{2.0, 2.2, 1.0}, {0.0, 0.0, 1.0}};
    EXPECT_NEAR(encodeTone(power, 0, 0.25), 0.5, tolerance::kDouble);
    EXPECT_NEAR(encodeTone(power, 1, 0.5), std::pow(0.5, 1.0 / 2.2), tolerance::kDouble);
    EXPECT_NEAR(encodeTone(power, 2, 0.5), 0.5, tolerance::kDouble);
    EXPECT_NEAR(encodeTone(power, 2, 0.25), 5.0 / 32.0, tolerance::kDouble);
}

TEST(ToneCurve, TableIsTheSameCurve)
{
    const ToneCurve curve;
    const ResponseCurve table = responseTable(curve);
    for (int c = 0; c < 3; ++c)
        for (int z = 1; z < 256; ++z) {
            const double exposure = table.decode(c, z);
            EXPECT_NEAR(255.0 * encodeTone(curve, c, exposure), z, tolerance::kIterative);
            EXPECT_GT(exposure, table.decode(c, z - 1));
        }
}

// A constant patch has the code that the curve says, at every exposure time.
TEST(Photograph, ConstantPatch)
{
    const SimulatedCameraBody body = quietBody();
    const Rgb radiance(0.2f, 0.4f, 0.8f);
    const double scale = 3.0;
    for (const double seconds : {1.0, 0.25, 1.0 / 30.0}) {
        const EncodedImage photo =
            photograph(Image<Rgb>(4, 3, radiance), body, scale, seconds, 1, 1);
        for (int c = 0; c < 3; ++c) {
            const double exposure = static_cast<double>(radiance[c]) * scale * seconds;
            const long code = std::lround(255.0 * encodeTone(body.response, c, exposure));
            for (const auto& pixel : photo.codes.pixels())
                EXPECT_EQ(pixel[c], code) << "channel " << c << ", " << seconds << " s";
        }
    }
}

// Mean and variance of many noisy pixels, with the linear curve so that codes are exposures.
TEST(Photograph, NoiseHasTheModelsVariance)
{
    SimulatedCameraBody body;
    body.response = {glm::dvec3(1.0), glm::dvec3(0.0)};
    body.read_noise = 0.02;
    body.photon_noise = 0.002;
    const float exposure = 0.5f;
    const EncodedImage photo =
        photograph(Image<Rgb>(200, 200, Rgb(exposure)), body, 1.0, 1.0, 7, 3);
    double sum = 0.0;
    double squares = 0.0;
    const double n = 3.0 * static_cast<double>(photo.codes.pixelCount());
    for (const auto& pixel : photo.codes.pixels())
        for (int c = 0; c < 3; ++c) {
            const double value = pixel[c] / 255.0;
            sum += value;
            squares += value * value;
        }
    const double mean = sum / n;
    const double variance = squares / n - mean * mean;
    // Rounding to codes adds 1/12 code².
    const double expected = 0.02 * 0.02 + 0.002 * 0.5 + 1.0 / (12.0 * 255.0 * 255.0);
    EXPECT_NEAR(mean, 0.5, tolerance::kStandardErrors * std::sqrt(expected / n));
    // The variance of a normal sample's variance is 2σ⁴/n.
    EXPECT_NEAR(variance, expected, tolerance::kStandardErrors * expected * std::sqrt(2.0 / n));
}

TEST(Photograph, SameSeedSamePictureAndOtherShotsDiffer)
{
    SimulatedCameraBody body;
    const Image<Rgb> patch(20, 10, Rgb(0.3f));
    const EncodedImage first = photograph(patch, body, 1.0, 1.0, 5, 1);
    EXPECT_EQ(first.codes, photograph(patch, body, 1.0, 1.0, 5, 1).codes);
    EXPECT_NE(first.codes, photograph(patch, body, 1.0, 1.0, 5, 2).codes);
    EXPECT_NE(first.codes, photograph(patch, body, 1.0, 1.0, 6, 1).codes);
}

// A blurred step is the Gaussian's integral: Φ(d/σ) at distance d from the edge.
TEST(Photograph, BlurOfAStep)
{
    SimulatedCameraBody body = quietBody();
    body.response = {glm::dvec3(1.0), glm::dvec3(0.0)};
    body.blur_px = 2.0;
    Image<Rgb> step(40, 3);
    for (int y = 0; y < 3; ++y)
        for (int x = 20; x < 40; ++x)
            step(x, y) = Rgb(1.0f);
    const EncodedImage photo = photograph(step, body, 1.0, 1.0, 1, 1);
    for (int x = 10; x < 30; ++x) {
        const double distance = x + 0.5 - 20.0;
        const double expected = 0.5 * std::erfc(-distance / (2.0 * std::sqrt(2.0)));
        // One code of rounding and 0.3 % of the kernel cut off at 3σ.
        EXPECT_NEAR(photo.codes(x, 1).g / 255.0, expected, 1.0 / 255.0 + 0.003) << x;
    }
}

// The chosen share of the channel values lies at or below the code.
TEST(SensorScale, PutsThePercentileOnTheCode)
{
    SimulatedRoom room;
    room.body = quietBody();
    room.plate_percentile = 90.0;
    room.plate_code = 200.0;
    Image<Rgb> ramp(100, 1);
    for (int x = 0; x < 100; ++x)
        ramp(x, 0) = Rgb(0.01f * static_cast<float>(x + 1));
    const double seconds = 1.0 / 50.0;
    const double scale = sensorScale(ramp, room, seconds);
    const EncodedImage photo = photograph(ramp, room.body, scale, seconds, 1, 1);
    int below = 0;
    for (const auto& pixel : photo.codes.pixels())
        for (int c = 0; c < 3; ++c)
            if (pixel[c] <= 200) ++below;
    EXPECT_NEAR(below / 300.0, 0.90, 0.01);  // a step of the ramp

    EXPECT_THROW((void)sensorScale(Image<Rgb>(4, 4), room, seconds), InputError);
}

TEST(SimulatedExif, TellsExposureAndFocalLength)
{
    SimulatedCameraBody body;
    body.f_number = 5.6;
    body.iso = 200;
    const PhotoMetadata metadata =
        parseExif(simulatedExif(body, 1.0 / 30.0, 1000.0, 1280), 1280, 960);
    EXPECT_NEAR(metadata.exposure.seconds.value(), 1.0 / 30.0, 1e-6);  // a rational of 32 bits
    EXPECT_NEAR(metadata.exposure.f_number.value(), 5.6, 1e-6);
    EXPECT_EQ(metadata.exposure.iso, 200.0);
    EXPECT_EQ(metadata.make, body.make);
    EXPECT_EQ(metadata.model, body.model);
    EXPECT_NEAR(metadata.focal_mm.value(), 1000.0 * 36.0 / 1280.0, 1e-4);
    // The 35 mm equivalent is stored in whole millimetres.
    EXPECT_NEAR(metadata.focal_px.value(), 1000.0, 0.5 / 36.0 * 1280.0 + 0.01);
}

}  // namespace
}  // namespace insitu
