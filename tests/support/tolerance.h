#pragma once

/// The tolerances of all tests: named, few, and explained. A test that needs another number says
/// why on that line; one is raised only with a written cause.
namespace insitu::tolerance {

/// Integers, copies, file round trips of half/float data.
inline constexpr double kExact = 0.0;
/// Relative; closed forms in double.
inline constexpr double kDouble = 1e-12;
/// Absolute, pixels; where a Newton iteration sets the floor.
inline constexpr double kIterative = 1e-6;
/// Relative; float image arithmetic.
inline constexpr double kFloat = 1e-5;
/// Relative (or the derived bound); sums over solid angle.
inline constexpr double kQuadrature = 1e-4;
/// Relative; analytic or automatic against numeric derivatives.
inline constexpr double kJacobian = 1e-6;
/// Standard errors, measured in the test, for Monte Carlo means.
inline constexpr double kStandardErrors = 4.0;

}  // namespace insitu::tolerance
