#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace insitu {

/// constant + Σ coefficients[i] · parameters[i]: a coordinate of a primitive's vertex.
struct LinearExpression {
    double constant = 0.0;
    std::vector<double> coefficients;  ///< one a parameter of the primitive

    /// `parameters` has as many values as there are coefficients.
    [[nodiscard]] double value(std::span<const double> parameters) const;
    friend bool operator==(const LinearExpression&, const LinearExpression&) = default;
};

/// Reads "0.5*width_m - (height_m + 0.1)/2": numbers, parameter names, + - * / and brackets.
///
/// Nothing else is understood, and the result must be linear: of two factors one must be a number,
/// a divisor must be a number other than 0. At most 512 characters and 32 open brackets.
/// Throws std::invalid_argument, with the place and the cause, when the text is not of
/// this form; an unknown name gets a suggestion.
[[nodiscard]] LinearExpression parseLinearExpression(std::string_view text,
                                                     std::span<const std::string> parameters);

}  // namespace insitu
