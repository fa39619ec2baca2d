#include "reconstruct/linear_expression.h"

#include "core/check.h"
#include "core/io/json.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <stdexcept>

namespace insitu {

namespace {

constexpr std::size_t kMaxLength = 512;
constexpr int kMaxDepth = 32;

bool isNameStart(char c)
{
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_';
}
bool isDigit(char c)
{
    return c >= '0' && c <= '9';
}

/// Recursive descent over sum, product and factor.
class Parser {
public:
    Parser(std::string_view text, std::span<const std::string> parameters)
        : text_(text), parameters_(parameters)
    {
    }

    LinearExpression parse()
    {
        if (text_.size() > kMaxLength)
            fail(fmt::format("has {} characters; at most {} are read", text_.size(), kMaxLength));
        LinearExpression result = sum(0);
        if (at_ < text_.size()) fail(fmt::format("'{}' is not expected here", text_[at_]));
        if (!std::isfinite(result.constant) ||
            !std::all_of(result.coefficients.begin(), result.coefficients.end(), [](double c) {
                return std::isfinite(c);
            }))
            fail("the numbers are too large");
        return result;
    }

private:
    [[noreturn]] void fail(const std::string& cause) const
    {
        throw std::invalid_argument(
            fmt::format("\"{}\", character {}: {}", text_.substr(0, kMaxLength), at_ + 1, cause));
    }
    char peek()
    {
        while (at_ < text_.size() && (text_[at_] == ' ' || text_[at_] == '\t'))
            ++at_;
        return at_ < text_.size() ? text_[at_] : '\0';
    }
    bool take(char wanted)
    {
        if (peek() != wanted) return false;
        ++at_;
        return true;
    }

    static bool isConstant(const LinearExpression& e)
    {
        return std::all_of(
            e.coefficients.begin(), e.coefficients.end(), [](double c) { return c == 0.0; });
    }
    static void add(LinearExpression& to, const LinearExpression& other, double factor)
    {
        to.constant += factor * other.constant;
        for (std::size_t i = 0; i < to.coefficients.size(); ++i)
            to.coefficients[i] += factor * other.coefficients[i];
    }
    static void scale(LinearExpression& e, double factor)
    {
        e.constant *= factor;
        for (double& c : e.coefficients)
            c *= factor;
    }

    LinearExpression sum(int depth)
    {
        LinearExpression result = product(depth);
        for (;;) {
            if (take('+'))
                add(result, product(depth), 1.0);
            else if (take('-'))
                add(result, product(depth), -1.0);
            else
                return result;
        }
    }

    LinearExpression product(int depth)
    {
        LinearExpression result = factor(depth);
        for (;;) {
            if (take('*')) {
                LinearExpression other = factor(depth);
                if (isConstant(result)) std::swap(result, other);
                if (!isConstant(other))
                    fail("two parameters are multiplied; coordinates must be linear in them");
                scale(result, other.constant);
            } else if (take('/')) {
                const LinearExpression divisor = factor(depth);
                if (!isConstant(divisor)) fail("only numbers may divide");
                if (divisor.constant == 0.0) fail("division by 0");
                scale(result, 1.0 / divisor.constant);
            } else {
                return result;
            }
        }
    }

    LinearExpression factor(int depth)
    {
        if (depth > kMaxDepth) fail("too many brackets or signs");
        if (take('-')) {
            LinearExpression result = factor(depth + 1);
            scale(result, -1.0);
            return result;
        }
        if (take('(')) {
            LinearExpression result = sum(depth + 1);
            if (!take(')')) fail("a ) is missing");
            return result;
        }
        const char c = peek();
        if (isDigit(c) || c == '.') return number();
        if (isNameStart(c)) return name();
        fail(c == '\0' ? "a number or a parameter is missing"
                       : fmt::format("'{}' is not expected here", c));
    }

    LinearExpression number()
    {
        LinearExpression result{0.0, std::vector<double>(parameters_.size(), 0.0)};
        const auto [end, error] =
            std::from_chars(text_.data() + at_, text_.data() + text_.size(), result.constant);
        if (error != std::errc()) fail("this number cannot be read");
        at_ = static_cast<std::size_t>(end - text_.data());
        return result;
    }

    LinearExpression name()
    {
        std::size_t end = at_;
        while (end < text_.size() && (isNameStart(text_[end]) || isDigit(text_[end])))
            ++end;
        const std::string_view word = text_.substr(at_, end - at_);
        const auto found = std::find(parameters_.begin(), parameters_.end(), word);
        if (found == parameters_.end()) {
            const std::vector<std::string_view> names(parameters_.begin(), parameters_.end());
            const auto meant = didYouMean(word, names);
            fail(fmt::format("no parameter \"{}\"{}",
                             word,
                             meant ? fmt::format("; did you mean \"{}\"?", *meant) : ""));
        }
        LinearExpression result{0.0, std::vector<double>(parameters_.size(), 0.0)};
        result.coefficients[static_cast<std::size_t>(found - parameters_.begin())] = 1.0;
        at_ = end;
        return result;
    }

    std::string_view text_;
    std::span<const std::string> parameters_;
    std::size_t at_ = 0;
};

}  // namespace

double LinearExpression::value(std::span<const double> parameters) const
{
    INSITU_DCHECK(parameters.size() == coefficients.size(),
                  "{} parameters, {} coefficients",
                  parameters.size(),
                  coefficients.size());
    double sum = constant;
    for (std::size_t i = 0; i < coefficients.size(); ++i)
        sum += coefficients[i] * parameters[i];
    return sum;
}

LinearExpression parseLinearExpression(std::string_view text,
                                       std::span<const std::string> parameters)
{
    return Parser(text, parameters).parse();
}

}  // namespace insitu
