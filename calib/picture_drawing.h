#pragma once

#include "core/camera.h"
#include "core/photo.h"

#include <glm/glm.hpp>

#include <span>
#include <string>

namespace insitu {

/// Drawing over an encoded picture, anti-aliased: for overlays that people look at.
///
/// Common rules: pixels in the convention of core/camera.h; what lies outside the picture is left
/// out; ends that are not finite draw nothing. Blending is done in the picture's codes.

/// How a line is drawn.
struct Ink {
    glm::vec3 color{1.0f};  ///< red, green, blue codes, 0 to 1
    double width_px = 1.5;  ///< > 0
    double opacity = 1.0;   ///< [0, 1]
};

void drawLine(EncodedImage& picture, glm::dvec2 from_px, glm::dvec2 to_px, const Ink& ink);
/// Lines from point to point, each pixel blended once.
void drawPolyline(EncodedImage& picture, std::span<const glm::dvec2> points_px, const Ink& ink);
/// A filled disc.
void drawDot(EncodedImage& picture, glm::dvec2 center_px, double radius_px, const Ink& ink);
/// Text whose first letter's lower left corner is `at_px`, capitals `height_px` high; ASCII.
void drawLabel(EncodedImage& picture,
               glm::dvec2 at_px,
               const std::string& text,
               double height_px,
               const Ink& ink);
/// A straight line of the world as `camera` sees it: the part in front of it, bent as its lens
/// does.
void drawWorldLine(EncodedImage& picture,
                   const Camera& camera,
                   glm::dvec3 from_m,
                   glm::dvec3 to_m,
                   const Ink& ink);

}  // namespace insitu
