#pragma once

#include "core/color.h"
#include "core/io/byte_writer.h"

#include <glm/glm.hpp>
#include <lcms2.h>

#include <array>

namespace insitu {

/// Chromaticities of red, green and blue; the white is D65.
struct Primaries {
    glm::dvec2 red, green, blue;
};
inline constexpr Primaries kRec709 = {{0.64, 0.33}, {0.30, 0.60}, {0.15, 0.06}};
inline constexpr Primaries kDisplayP3 = {{0.680, 0.320}, {0.265, 0.690}, {0.150, 0.060}};
inline constexpr Primaries kAdobeRgb = {{0.64, 0.33}, {0.21, 0.71}, {0.15, 0.06}};
inline constexpr glm::dvec2 kD65 = {0.3127, 0.3290};

/// XYZ of linear channels whose sum is white (SMPTE RP 177).
inline glm::dmat3 xyzFrom(const Primaries& p)
{
    const auto xyz = [](glm::dvec2 c) { return glm::dvec3(c.x / c.y, 1, (1 - c.x - c.y) / c.y); };
    glm::dmat3 columns(xyz(p.red), xyz(p.green), xyz(p.blue));
    const glm::dvec3 scale = glm::inverse(columns) * xyz(kD65);
    for (int c = 0; c < 3; ++c)
        columns[c] *= scale[c];
    return columns;
}

/// The closed form: both have the same white, so nothing has to be adapted.
inline glm::dmat3 rec709From(const Primaries& p)
{
    return glm::inverse(xyzFrom(kRec709)) * xyzFrom(p);
}

inline cmsToneCurve* srgbCurve()
{
    const std::array<cmsFloat64Number, 5> p = {2.4, 1 / 1.055, 0.055 / 1.055, 1 / 12.92, 0.04045};
    return cmsBuildParametricToneCurve(nullptr, 4, p.data());
}
inline cmsToneCurve* gammaCurve(double gamma)
{
    return cmsBuildGamma(nullptr, gamma);
}
inline cmsToneCurve* fallingCurve()
{
    const std::array<cmsUInt16Number, 4> table = {0, 50000, 20000, 65535};
    return cmsBuildTabulatedToneCurve16(nullptr, 4, table.data());
}

inline Bytes bytesOf(cmsHPROFILE profile)
{
    cmsUInt32Number size = 0;
    cmsSaveProfileToMem(profile, nullptr, &size);
    Bytes bytes(size);
    cmsSaveProfileToMem(profile, bytes.data(), &size);
    cmsCloseProfile(profile);
    return bytes;
}

/// A matrix/TRC profile of an RGB device; the curve is freed.
inline Bytes makeProfile(const Primaries& p, cmsToneCurve* curve)
{
    const auto xyY = [](glm::dvec2 c) { return cmsCIExyY{c.x, c.y, 1.0}; };
    const cmsCIExyY white = xyY(kD65);
    const cmsCIExyYTRIPLE primaries = {xyY(p.red), xyY(p.green), xyY(p.blue)};
    const std::array<cmsToneCurve*, 3> curves = {curve, curve, curve};
    const Bytes bytes = bytesOf(cmsCreateRGBProfile(&white, &primaries, curves.data()));
    cmsFreeToneCurve(curve);
    return bytes;
}

inline Bytes makeGreyProfile()
{
    cmsToneCurve* curve = gammaCurve(2.2);
    const Bytes bytes = bytesOf(cmsCreateGrayProfile(cmsD50_xyY(), curve));
    cmsFreeToneCurve(curve);
    return bytes;
}

/// What a table profile does to colours: those of `primaries` with sRGB's curve, and, where
/// `twist` is not 0, more blue the more red and green differ, which no matrix does.
struct TableModel {
    glm::dmat3 d50_from_linear;
    double twist = 0.0;
};

inline cmsInt32Number tableEntry(const cmsUInt16Number in[], cmsUInt16Number out[], void* cargo)
{
    const auto& model = *static_cast<const TableModel*>(cargo);
    glm::dvec3 linear;
    for (int c = 0; c < 3; ++c)
        linear[c] = linearFromSrgb(in[c] / 65535.0);
    linear.b += model.twist * (linear.r - linear.g) * (linear.r - linear.g);
    const glm::dvec3 xyz = model.d50_from_linear * linear;
    const cmsCIEXYZ value = {xyz.x, xyz.y, xyz.z};
    cmsFloat2XYZEncoded(out, &value);
    return 1;
}

/// A profile that holds nothing but a table of 33 points a side to XYZ.
inline Bytes makeTableProfile(const Primaries& p, double twist)
{
    // D50 from D65 by Bradford, ICC.1:2010 annex E, column by column.
    const glm::dmat3 d50_from_d65(1.0478112,
                                  0.0295424,
                                  -0.0092345,
                                  0.0228866,
                                  0.9904844,
                                  0.0150436,
                                  -0.0501270,
                                  -0.0170491,
                                  0.7521316);
    TableModel model = {d50_from_d65 * xyzFrom(p), twist};
    cmsHPROFILE profile = cmsCreateProfilePlaceholder(nullptr);
    cmsSetProfileVersion(profile, 2.1);
    cmsSetDeviceClass(profile, cmsSigDisplayClass);
    cmsSetColorSpace(profile, cmsSigRgbData);
    cmsSetPCS(profile, cmsSigXYZData);
    cmsPipeline* pipeline = cmsPipelineAlloc(nullptr, 3, 3);
    cmsStage* table = cmsStageAllocCLut16bit(nullptr, 33, 3, 3, nullptr);
    cmsStageSampleCLut16bit(table, tableEntry, &model, 0);
    cmsPipelineInsertStage(pipeline, cmsAT_END, table);
    cmsWriteTag(profile, cmsSigAToB0Tag, pipeline);
    const Bytes bytes = bytesOf(profile);
    cmsPipelineFree(pipeline);
    return bytes;
}

}  // namespace insitu
