#include "core/response_curve.h"

#include "core/random.h"
#include "tests/support/tolerance.h"

#include <gtest/gtest.h>

#include <cmath>

namespace insitu {
namespace {

TEST(ResponseCurve, SrgbTable)
{
    const ResponseCurve curve = ResponseCurve::srgb();
    EXPECT_EQ(curve.source, "srgb");
    EXPECT_EQ(curve.decode(0, 0.0), 0.0);
    EXPECT_NEAR(curve.decode(1, 255.0), 1.0, tolerance::kDouble);
    EXPECT_NEAR(curve.decode(2, 128.0), 0.215860500113899, tolerance::kDouble);  // IEC 61966-2-1
}

TEST(ResponseCurve, InterpolatesBetweenCodes)
{
    ResponseCurve curve;
    for (std::size_t z = 0; z < 256; ++z)
        curve.exposure[1][z] = static_cast<double>(z * z);
    EXPECT_EQ(curve.decode(1, 10.0), 100.0);
    EXPECT_EQ(curve.decode(1, 10.25), 100.0 + 0.25 * 21.0);
    EXPECT_EQ(curve.encode(1, 110.5), 10.5);
    EXPECT_EQ(curve.decode(1, 255.0), 65025.0);
}

TEST(ResponseCurve, ClampsOutside)
{
    const ResponseCurve curve = ResponseCurve::srgb();
    EXPECT_EQ(curve.encode(0, -1.0), 0.0);
    EXPECT_EQ(curve.encode(0, 0.0), 0.0);
    EXPECT_EQ(curve.encode(0, 7.0), 255.0);
    EXPECT_EQ(curve.encode(0, std::nan("")), 0.0);
    EXPECT_EQ(curve.decode(0, -5.0), 0.0);
    EXPECT_EQ(curve.decode(0, 300.0), curve.decode(0, 255.0));
}

TEST(ResponseCurve, EncodeAndDecodeAreInverse)
{
    ResponseCurve curve;
    RandomStream random(6, 0, 0);
    for (auto& table : curve.exposure) {
        double exposure = 0.001;
        for (double& entry : table)
            entry = exposure += random.uniformDouble() * 0.1 + 1e-4;
    }
    for (int i = 0; i < 3000; ++i) {
        const double code = random.uniformDouble() * 255.0;
        EXPECT_NEAR(curve.encode(i % 3, curve.decode(i % 3, code)), code, 1e-9);
    }
    for (int code = 0; code < 256; ++code)
        EXPECT_NEAR(curve.encode(0, curve.decode(0, code)), code, 1e-9);
}

}  // namespace
}  // namespace insitu
