#pragma once

#include "capture/alignment.h"
#include "capture/matched_pyramid.h"

#include <Eigen/Core>
#include <glm/glm.hpp>

#include <string>
#include <vector>

// Private to the module: Eigen in a header that is not installed.
namespace insitu::detail {

/// How frame b lies relative to frame a.
struct PairFit {
    bool found = false;
    std::string reason;  ///< why not
    /// Pixels of the full picture, corner convention.
    Eigen::Matrix3d b_from_a = Eigen::Matrix3d::Identity();
    AlignmentModel model = AlignmentModel::Translation;
    double sigma_px = 0.0;  ///< standard deviation of the corner that is known worst
};

[[nodiscard]] glm::dmat3 toGlm(const Eigen::Matrix3d& m);

[[nodiscard]] PairFit alignPair(const BracketFrame& a,
                                const BracketFrame& b,
                                const AlignmentOptions& options);

/// The longest way that a corner of a picture of this size goes.
[[nodiscard]] double cornerShift(const Eigen::Matrix3d& b_from_a, int width, int height);
/// The same between two transforms.
[[nodiscard]] double cornerDifference(const Eigen::Matrix3d& first,
                                      const Eigen::Matrix3d& second,
                                      int width,
                                      int height);

/// Two images of one level, smoothed, and the points at which they are compared.
struct RegistrationLevel {
    struct Point {
        float x = 0.0f;  ///< index of the column in a, as are y and the gradient
        float y = 0.0f;
        float value = 0.0f;
        float gradient_x = 0.0f;
        float gradient_y = 0.0f;
        int block = 0;  ///< which part of the picture
    };
    Image<float> a;
    Image<float> b;
    std::vector<Point> points;
    int blocks = 0;
    double scale = 1.0;  ///< pixels of the full picture per pixel
};

[[nodiscard]] RegistrationLevel makeLevel(const Image<float>& a,
                                          const Image<float>& b,
                                          double scale);

/// The translation that makes a and b most alike, by trying all up to `most` pixels of the full
/// picture on the coarsest level; of several that fit equally well the smallest. Levels from fine
/// to coarse; the result is in pixels of the full picture.
[[nodiscard]] Eigen::Vector2d searchTranslation(const std::vector<RegistrationLevel>& levels,
                                                double most);

/// b_from_a, its certainty and how alike the images are then.
struct RegistrationFit {
    bool valid = false;
    Eigen::Matrix3d b_from_a = Eigen::Matrix3d::Identity();  ///< pixels of the full picture
    double sigma_px = 0.0;     ///< of the worst corner, pixels of the full picture
    double correlation = 0.0;  ///< of the gradients at the points, in [-1, 1]
};

/// Gauss-Newton from `b_from_a`. `valid` is false when it runs away or nothing overlaps.
[[nodiscard]] RegistrationFit fitLevel(const RegistrationLevel& level,
                                       AlignmentModel model,
                                       const Eigen::Matrix3d& b_from_a);

}  // namespace insitu::detail
