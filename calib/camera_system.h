#pragma once

#include <Eigen/Core>
#include <glm/glm.hpp>

#include <array>
#include <optional>
#include <vector>

/// Internal to calib/: maximum-likelihood camera from observations with Gaussian errors and
/// equations between them (camera_constraints.h). Not installed.
///
/// Every marked coordinate, known length, prior is an observation x with a variance; every equation
/// g(θ, x̂) = 0 holds for the true x̂. Minimised is Σ (x − x̂)²/σ² over θ and x̂ subject to all
/// g = 0 (Gauss–Helmert model): for a given θ the x̂ are found block by block, blocks being
/// equations that share observations; over θ goes Levenberg–Marquardt with the whitened equations
/// S⁻½ g, S = B Σ Bᵀ at x̂. At the solution the inverse of Σ Aᵀ S⁻¹ A is the covariance, A the
/// derivative of the equations by θ. Source: [FoeWro16] sections 4.8 and 4.6.4.
namespace insitu::calibration {

/// Order of the unknowns θ. Rotation is a small turn in the camera's frame, applied last.
enum Unknown { kTurn = 0, kLogFocal = 3, kPrincipal = 4, kDivision = 6, kPosition = 7 };
inline constexpr int kUnknowns = 10;
using Matrix = Eigen::Matrix<double, kUnknowns, kUnknowns>;
using Vector = Eigen::Matrix<double, kUnknowns, 1>;

struct State {
    Eigen::Matrix3d camera_from_world = Eigen::Matrix3d::Identity();
    double log_focal = 0.0;
    Eigen::Vector2d principal_px = Eigen::Vector2d::Zero();
    double division = 0.0;
    Eigen::Vector3d position_m = Eigen::Vector3d::Zero();
};

enum class Kind {
    AlongAxis,
    StraightLine,
    WorldPoint,
    FloorLength,
    UprightLength,
    FloorRightAngle,
    Rectangle,
    FloorRectangle,
    Gravity,
    Number  ///< an unknown was itself observed
};

inline constexpr int kMostObservations = 8;
inline constexpr int kMostRows = 4;

struct Constraint {
    Kind kind = Kind::Number;
    int index = 0;  ///< room axis, or unknown
    std::vector<int> observations;
    int rows = 1;
    double ratio = 0.0;  ///< of a rectangle; 0 unknown
    std::array<Eigen::Vector3d, 2> across{
        Eigen::Vector3d::Zero(),
        Eigen::Vector3d::Zero()};  ///< of Gravity: unit vectors at right angles to it
    int item = -1;                 ///< which segment or length it stands for
    bool used = true;
};

struct Observation {
    double value = 0.0;
    double variance = 0.0;
};

struct Problem {
    std::vector<Observation> observations;
    std::vector<Constraint> constraints;
    std::array<bool, kUnknowns> free{};
    double half_diagonal_px = 1.0;
    double shortest_focal_px = 1.0;
    double longest_focal_px = 1.0;

    int observe(double value, double sigma);
};

/// w-statistics of one constraint: its error over the standard deviation that it should have
/// (unit normal when all is well), largest of its rows. Source: [Baarda68].
struct Test {
    double statistic = 0.0;
    /// For a constraint that is not used: the same for its prediction.
    bool predicted = false;
};

struct Solution {
    State state;
    double cost = 0.0;                    ///< Σ (x − x̂)²/σ², the priors' included
    Matrix information = Matrix::Zero();  ///< over all unknowns, also those that were not free
    std::vector<Test> tests;              ///< one per constraint
    double freedom = 0.0;                 ///< equations minus unknowns
    double division_gradient = 0.0;       ///< of half the cost by λ, whether λ is free or not
    bool converged = false;
};

/// Nothing when an equation means nothing at the start, or no step is finite.
[[nodiscard]] std::optional<Solution> solve(const Problem& problem, const State& start);

/// Inverse over the free unknowns; infinite on the diagonal of what is open, zero where not free.
[[nodiscard]] Matrix covarianceOf(const Matrix& information,
                                  const std::array<bool, kUnknowns>& free);

/// How the other free unknowns follow when `held` moves by one: the derivative, zero in `held`.
[[nodiscard]] Vector followers(const Matrix& information,
                               const std::array<bool, kUnknowns>& free,
                               int held);

}  // namespace insitu::calibration
