#include "core/io/icc_profile.h"

#include "core/check.h"
#include "core/color.h"

#include <fmt/format.h>
#include <lcms2.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>

namespace insitu {

namespace {

/// Elements of the matrix and points of the curve that rounding in a profile of sRGB may change.
constexpr double kSrgbMatrix = 2e-3;
constexpr double kSrgbCurve = 5e-4;
/// What curves and a matrix may miss of a profile's tables, of the brightest channel; and the
/// level (of 1) below which that is measured against it instead.
constexpr double kTableError = 0.02;
constexpr double kDarkLevel = 0.02;
/// Colours a side on which that is tried.
constexpr int kGrid = 9;

template <auto Release>
struct Releaser {
    void operator()(auto* handle) const { Release(handle); }
};
using Context = std::unique_ptr<std::remove_pointer_t<cmsContext>, Releaser<cmsDeleteContext>>;
using Profile = std::unique_ptr<void, Releaser<cmsCloseProfile>>;
using Transform = std::unique_ptr<void, Releaser<cmsDeleteTransform>>;

/// What the device's channels give at full, in the profile's connection space (XYZ, D50).
std::optional<glm::dmat3> colorants(cmsHPROFILE profile)
{
    constexpr std::array kTags = {
        cmsSigRedColorantTag, cmsSigGreenColorantTag, cmsSigBlueColorantTag};
    glm::dmat3 columns;
    for (int c = 0; c < 3; ++c) {
        const auto* xyz =
            static_cast<const cmsCIEXYZ*>(cmsReadTag(profile, kTags[static_cast<std::size_t>(c)]));
        if (xyz == nullptr) return std::nullopt;
        columns[c] = {xyz->X, xyz->Y, xyz->Z};
    }
    return columns;
}

glm::dmat3 rec709FromPcs(cmsContext context)
{
    const Profile srgb(cmsCreate_sRGBProfileTHR(context));
    const auto columns = srgb ? colorants(srgb.get()) : std::nullopt;
    INSITU_CHECK(columns.has_value(), "the library's own sRGB has no colorants");
    return glm::inverse(*columns);
}

bool readCurves(cmsHPROFILE profile, ResponseCurve& curve)
{
    constexpr std::array kTags = {cmsSigRedTRCTag, cmsSigGreenTRCTag, cmsSigBlueTRCTag};
    for (std::size_t c = 0; c < 3; ++c) {
        const auto* tone = static_cast<const cmsToneCurve*>(cmsReadTag(profile, kTags[c]));
        if (tone == nullptr) return false;
        for (std::size_t z = 0; z < 256; ++z)
            curve.exposure[c][z] =
                static_cast<double>(cmsEvalToneCurveFloat(tone, static_cast<float>(z) / 255.0f));
    }
    return true;
}

/// Curves and a matrix from the tables of a profile, as far as they reproduce them.
class TableFit {
public:
    TableFit(cmsContext context, cmsHPROFILE profile)
        : rec709_from_pcs_(rec709FromPcs(context)),
          xyz_(cmsCreateXYZProfileTHR(context)),
          transform_(cmsCreateTransformTHR(context,
                                           profile,
                                           TYPE_RGB_DBL,
                                           xyz_.get(),
                                           TYPE_XYZ_DBL,
                                           INTENT_RELATIVE_COLORIMETRIC,
                                           cmsFLAGS_NOOPTIMIZE | cmsFLAGS_NOCACHE))
    {
    }

    [[nodiscard]] bool usable() const { return transform_ != nullptr; }

    void fit(ColorProfile& result) const
    {
        const glm::dvec3 black = rec709(glm::dvec3(0.0));
        for (int c = 0; c < 3; ++c) {
            glm::dvec3 full(0.0);
            full[c] = 1.0;
            const glm::dvec3 primary = rec709(full) - black;
            result.rec709_from_linear[c] = primary;
            auto& table = result.transfer.exposure[static_cast<std::size_t>(c)];
            for (std::size_t z = 0; z < table.size(); ++z) {
                const glm::dvec3 at = rec709(full * (static_cast<double>(z) / 255.0)) - black;
                table[z] = glm::dot(at, primary) / glm::dot(primary, primary);
            }
        }
    }

    /// Largest error of `result` over a grid, of the brightest channel.
    [[nodiscard]] double error(const ColorProfile& result) const
    {
        double worst = 0.0;
        for (int i = 0; i < kGrid * kGrid * kGrid; ++i) {
            const glm::dvec3 codes = glm::dvec3(i % kGrid, i / kGrid % kGrid, i / kGrid / kGrid) /
                                     static_cast<double>(kGrid - 1);
            glm::dvec3 linear;
            for (int c = 0; c < 3; ++c)
                linear[c] = result.transfer.decode(c, 255.0 * codes[c]);
            const glm::dvec3 truth = rec709(codes);
            const glm::dvec3 missed = glm::abs(result.rec709_from_linear * linear - truth);
            const double level = std::max({truth.r, truth.g, truth.b, kDarkLevel});
            worst = std::max(worst, std::max({missed.r, missed.g, missed.b}) / level);
        }
        return worst;
    }

private:
    [[nodiscard]] glm::dvec3 rec709(glm::dvec3 codes) const
    {
        cmsCIEXYZ xyz{};
        cmsDoTransform(transform_.get(), &codes, &xyz, 1);
        return rec709_from_pcs_ * glm::dvec3(xyz.X, xyz.Y, xyz.Z);
    }

    glm::dmat3 rec709_from_pcs_;
    Profile xyz_;
    Transform transform_;
};

/// Makes the curves finite and strictly increasing where they are so but for flat stretches; false
/// where they fall or end in nothing.
bool makeUsable(ResponseCurve& curve)
{
    constexpr double kFall = 1e-4;
    constexpr double kLeastStep = 1e-9;
    for (auto& table : curve.exposure) {
        if (!(table.back() > 0.1) || !std::isfinite(table.back()) || !std::isfinite(table[0]))
            return false;
        table[0] = std::max(table[0], 0.0);
        for (std::size_t z = 1; z < table.size(); ++z) {
            if (!std::isfinite(table[z]) || table[z] < table[z - 1] - kFall) return false;
            table[z] = std::max(table[z], table[z - 1] + kLeastStep);
        }
    }
    return true;
}

bool usable(const glm::dmat3& matrix)
{
    constexpr double kSmallestDeterminant = 1e-3;
    for (int column = 0; column < 3; ++column)
        for (int row = 0; row < 3; ++row)
            if (!std::isfinite(matrix[column][row])) return false;
    return std::abs(glm::determinant(matrix)) > kSmallestDeterminant;
}

/// Rounding in a profile of sRGB must not change a picture.
void snapToSrgb(ColorProfile& profile)
{
    double off_matrix = 0.0;
    for (int column = 0; column < 3; ++column)
        for (int row = 0; row < 3; ++row)
            off_matrix = std::max(
                off_matrix,
                std::abs(profile.rec709_from_linear[column][row] - glm::dmat3(1.0)[column][row]));
    if (off_matrix < kSrgbMatrix) profile.rec709_from_linear = glm::dmat3(1.0);
    const ResponseCurve srgb = ResponseCurve::srgb();
    double off_curve = 0.0;
    for (std::size_t c = 0; c < 3; ++c)
        for (std::size_t z = 0; z < 256; ++z)
            off_curve = std::max(off_curve,
                                 std::abs(profile.transfer.exposure[c][z] - srgb.exposure[c][z]));
    if (off_curve < kSrgbCurve) profile.transfer = srgb;
}

/// The description, as far as it is printable.
std::string nameOf(cmsHPROFILE profile)
{
    std::array<char, 64> text{};
    cmsGetProfileInfoASCII(
        profile, cmsInfoDescription, "en", "US", text.data(), static_cast<cmsUInt32Number>(63));
    std::string name(text.data());
    std::ranges::replace_if(
        name, [](char c) { return c < 0x20 || c > 0x7E; }, '?');
    return name.empty() ? "without a name" : name;
}

std::string convert(cmsContext context, cmsHPROFILE profile, ColorProfile& result)
{
    if (const auto columns = colorants(profile); columns && readCurves(profile, result.transfer)) {
        result.rec709_from_linear = rec709FromPcs(context) * *columns;
    } else {
        const TableFit tables(context, profile);
        if (!tables.usable()) return "holds neither a matrix nor tables that can be used";
        tables.fit(result);
        if (!usable(result.rec709_from_linear)) return "has no three primaries";
        if (const double error = tables.error(result); !(error < kTableError))
            return fmt::format("is made of tables that curves and a matrix miss by {:.0f} %",
                               100.0 * error);
    }
    if (!usable(result.rec709_from_linear)) return "has no three primaries";
    if (!makeUsable(result.transfer)) return "has curves that do not rise";
    return "";
}

}  // namespace

IccReading readIccProfile(std::span<const std::uint8_t> bytes)
{
    IccReading reading;
    const Context context(cmsCreateContext(nullptr, nullptr));
    const Profile profile(cmsOpenProfileFromMemTHR(
        context.get(), bytes.data(), static_cast<cmsUInt32Number>(bytes.size())));
    if (bytes.size() > kMaxIccBytes || !profile) {
        reading.problem = "is damaged";
        return reading;
    }
    if (cmsGetColorSpace(profile.get()) != cmsSigRgbData) {
        reading.problem = "is not one of RGB pictures";
        return reading;
    }
    reading.rgb = true;
    ColorProfile result;
    result.name = nameOf(profile.get());
    reading.problem = convert(context.get(), profile.get(), result);
    if (!reading.problem.empty()) return reading;
    snapToSrgb(result);
    result.transfer.source = "profile " + result.name;
    reading.profile = std::move(result);
    return reading;
}

}  // namespace insitu
