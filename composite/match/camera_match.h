#pragma once

#include "composite/match/edge_profile.h"
#include "composite/match/grain.h"
#include "composite/photo_layers.h"
#include "core/color_profile.h"
#include "core/finding.h"
#include "core/photo.h"
#include "core/response_curve.h"

#include <glm/glm.hpp>

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace insitu {

/// Fall-off of light towards the corners: radiance times 1 / (1 + a r²)², r in half diagonals from
/// the centre; cos⁴ of the angle when a is (half diagonal / focal length)².
struct Vignetting {
    double a = 0.0;
    double sigma = 0.0;  ///< one standard deviation, from how the picture's sectors disagree

    [[nodiscard]] double factor(double r) const
    {
        const double d = 1.0 + a * r * r;
        return 1.0 / (d * d);
    }
};
/// From the radial gradients of flat areas in eight sectors about the centre, whose opposite pairs
/// cancel shading that runs across the picture. `usable` as in edgeProfiles. 0 with a sigma of
/// infinity when fewer than three of the four pairs can tell. Source: [ZheYuKanLin08] section 3, by
/// sectors.
[[nodiscard]] Vignetting estimateVignetting(const Image<Rgb>& radiance,
                                            const Image<std::uint8_t>& usable,
                                            glm::dvec2 centre_px);

/// A thin lens: what is at the distance d shows as a disc of `diameter_px · |1/d − 1/focus_m|`,
/// diameter_px = focal length in pixels · aperture in metres.
struct DepthOfField {
    double diameter_px = 0.0;  ///< pixels · metres, >= 0
    double focus_m = 1.0;      ///< > 0

    /// Standard deviation of the disc along one axis, pixels; `depth_m` > 0.
    [[nodiscard]] double sigmaAt(double depth_m) const;
};
/// Where the lens was focused, from how sharp the sharpest quarter of the edges is at each depth:
///     spread² = s² + (diameter/4)² (1/depth − 1/focus)²,
/// a regression of quantiles [KoeBas78], focus at or beyond the nearest edge. `depth_m` has the
/// photograph's size; <= 0 is unknown. Nothing when fewer than 30 edges lie at known depths, when
/// no defocus shows (half a pixel), when parts of the picture disagree by that much, or when one
/// sharpness explains the edges as well.
[[nodiscard]] std::optional<DepthOfField> estimateFocus(const std::vector<EdgeProfile>& edges,
                                                        const Image<float>& depth_m,
                                                        double diameter_px);
/// How sharp what is in focus is under that lens, by the same edges: standard deviation of the
/// blur, pixels, pixel's box taken off. Nothing when fewer than 30 edges lie at known depths.
[[nodiscard]] std::optional<double> blurInFocus(const std::vector<EdgeProfile>& edges,
                                                const Image<float>& depth_m,
                                                const DepthOfField& lens);

/// What the photograph's camera does to light, to be done to rendered layers too. The default does
/// nothing.
struct CameraMatch {
    double blur_px = 0.0;  ///< standard deviation, the pixel's box not included, >= 0
    std::optional<DepthOfField> depth_of_field;
    glm::dvec3 magnification{0.0};  ///< ChromaticAberration
    Vignetting vignetting;
    GrainModel grain;
    bool dither = false;  ///< rounds at random where there is no grain to hide the steps
    glm::dvec2 centre_px{0.0};
    std::uint64_t seed = 1;  ///< of grain and dither
};

struct CameraMatchOptions {
    bool grain = true;
    bool blur = true;
    bool vignetting = true;
    bool chromatic_aberration = true;
    bool depth_of_field = true;
    bool dither = true;
    /// Fall-off that is known, as Vignetting::a, > -1.
    std::optional<double> vignetting_a;
    /// Else: take estimateVignetting where it is over three deviations. Off by default: rooms are
    /// often lit brighter in the middle of their photographs (docs/validation.md).
    bool estimate_vignetting = false;
    /// Distance of focus in metres, > 0, when it is known.
    std::optional<double> focus_m;
    std::uint64_t seed = 1;

    [[nodiscard]] Findings validate() const;
};

/// What can be left out by name, and all of it.
inline const std::vector<std::string> kMatchParts = {
    "grain", "blur", "vignetting", "aberration", "focus", "dither", "all"};
/// Switches one of kMatchParts off.
void leaveOut(const std::string& part, CameraMatchOptions& options);

/// What is known about the camera beside its picture.
struct MatchedCamera {
    glm::dvec2 principal_px{0.0};
    /// Focal length in pixels · focal length in metres / f-number; 0 when EXIF lacks one.
    double aperture_px_m = 0.0;
};

struct CameraMatchEstimate {
    CameraMatch match;
    BlurEstimate blur;
    ChromaticAberration aberration;
    Vignetting vignetting;
    /// "grain-unknown", "blur-unknown", "camera-matched" with the figures.
    Findings findings;
};

/// All of it from the photograph. `radiance` is photographedRadiance, `depth_m` the distance of the
/// surfaces behind it (0 unknown; may be empty). Aberration, vignetting and focus count only where
/// they are over three deviations.
[[nodiscard]] CameraMatchEstimate estimateCameraMatch(const EncodedImage& photo,
                                                      const ResponseCurve& response,
                                                      const Image<Rgb>& radiance,
                                                      const Image<float>& depth_m,
                                                      const MatchedCamera& camera,
                                                      const CameraMatchOptions& options);

/// Vignetting, depth of field, blur and aberration, in this order. Pixels without an object or a
/// change of light within the blur's reach keep their layers exactly. Light under an object never
/// shows: where blur lifts its edge, the light of the uncovered pixels beside it goes on under it.
/// `receiver_depth_m`: of the surface behind each pixel, for its shadows' depth of field; <= 0
/// unknown, may be empty.
[[nodiscard]] PhotoLayers matchLayers(const RenderLayers& layers,
                                      const CameraMatch& match,
                                      const Image<float>& receiver_depth_m = {});

}  // namespace insitu
