#pragma once

#include "composite/match/camera_match.h"
#include "composite/photo_layers.h"
#include "core/color_profile.h"
#include "core/finding.h"
#include "core/photo.h"
#include "core/response_curve.h"

#include <cstdint>

namespace insitu {

/// How the light that the objects add or take is put onto the photograph [Debevec98, section 6].
enum class CompositeForm {
    Ratio,       ///< L_photo · L_with / L_without, reflectance of each pixel by itself
    Difference,  ///< L_photo + (L_with − L_without) with reflectance smoothed over a window
    /// Between the two, pixel by pixel: as much of each pixel's own reflectance as stands out of
    /// the photograph's noise, the least mean square error when both are known [Lee80] section II.
    Mixed,
};

/// "ratio", "difference", "mixed".
[[nodiscard]] const char* compositeFormName(CompositeForm form);

struct CompositeOptions {
    CompositeForm form = CompositeForm::Ratio;
    /// Side of the window over which Difference smooths the reflectance, pixels, odd, >= 1. With 1
    /// both forms are identical for Lambert receivers.
    int reflectance_window = 9;
    /// A receiver brighter than this reflectance shines by itself; only so much of it can be
    /// shadowed. Unitless, in (0, 1].
    double max_reflectance = 0.95;
    /// Codes above this fraction of full scale count as clipped: a lower bound. In (0.5, 1].
    double clip_fraction = 0.985;
    /// Pixels whose predicted change stays below this many codes are left untouched, >= 0.
    double influence_codes = 0.5;

    [[nodiscard]] Findings validate() const;
};

struct Composite {
    EncodedImage image;             ///< same size and depth as the photograph
    Image<Rgb> linear;              ///< scene-linear radiance of the whole picture
    Image<std::uint8_t> influence;  ///< 1 where the photograph was changed
    double influence_fraction = 0.0;
    Findings findings;  ///< "composite-clipped-pixels"
};

/// Scene-linear radiance of a photograph: response⁻¹(code) / relative exposure, brought to Rec. 709
/// (ColorProfile::rec709_from_linear); what lies outside its primaries is cut.
[[nodiscard]] Image<Rgb> photographedRadiance(const EncodedImage& photo,
                                              const ResponseCurve& response,
                                              double relative_exposure,
                                              const glm::dmat3& rec709_from_linear = glm::dmat3(1));

/// What the composite makes of an HDR photograph (photoFromRadiance): its own values, bit for bit,
/// where nothing changed; elsewhere those of the composite's codes, grain included, or, beyond the
/// largest code, its linear values.
[[nodiscard]] Image<Rgb> radianceOfComposite(const Photo& photo, const Composite& composite);

/// Puts the rendered layers onto the photograph.
///
/// For each pixel, with E the receiver's irradiance and ρ = min(π L_photo / E_without, max),
///   L = object + (1 − alpha)·(L_photo + ρ/π·(E_with − E_without)),
/// and back through the photograph's own response and exposure. A clipped channel of the photograph
/// is a lower bound: there L_photo is the larger of the bound and what the light probe saw of the
/// same surface (layers.probe_radiance, scaled to the pixel's unclipped channels), and the channel
/// stays clipped unless the result falls below the clipping level. Pixels outside the influence
/// mask are the photograph's own codes.
///
/// The layers have the optics of the photograph's camera already (matchLayers); `match` gives every
/// changed pixel the grain that it lacks, and dithers what has none. A rendered pixel has none but
/// its own Monte Carlo error; a shadowed one keeps the photograph's noise in proportion to its
/// light.
///
/// All of this happens in the photograph's own primaries, into which the layers are brought (what
/// lies outside is cut), so that codes keep their meaning; `linear` is Rec. 709 again.
[[nodiscard]] Composite compositeDifferential(const EncodedImage& photo,
                                              const ResponseCurve& response,
                                              double relative_exposure,
                                              const PhotoLayers& layers,
                                              const CompositeOptions& options,
                                              const glm::dmat3& rec709_from_linear = glm::dmat3(1),
                                              const CameraMatch& match = {});

}  // namespace insitu
