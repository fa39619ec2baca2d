#include "lighting/hidden_picture.h"

#include "core/check.h"
#include "core/parallel.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <vector>

namespace insitu {

namespace {

/// Corners and middles of a rectangle of pixels, all of them inclusive.
struct Square {
    int x[3] = {0, 0, 0};
    int y[3] = {0, 0, 0};

    static Square between(int x0, int y0, int x1, int y1)
    {
        return {{x0, (x0 + x1) / 2, x1}, {y0, (y0 + y1) / 2, y1}};
    }
    [[nodiscard]] bool single() const { return x[2] - x[0] <= 1 && y[2] - y[0] <= 1; }
    [[nodiscard]] Square quarter(int i, int j) const
    {
        return between(x[i], y[j], x[i + 1], y[j + 1]);
    }
};

float share(int at, int from, int to)
{
    return to > from ? static_cast<float>(at - from) / static_cast<float>(to - from) : 0.0f;
}

class Picture {
public:
    Picture(const ObjectLight& object,
            int width,
            int height,
            std::span<const glm::vec3> places,
            glm::vec3 normal,
            const HiddenPictureOptions& options,
            std::span<Rgb> hidden)
        : object_(object),
          width_(width),
          height_(height),
          places_(places),
          normal_(normal),
          options_(options),
          hidden_(hidden),
          known_(places.size(), 0)
    {
        tolerance_ = static_cast<float>(options.max_error) * object.light.irradiance(normal);
    }

    double sum()
    {
        std::vector<Square> squares = firstSquares();
        for (const Square& s : squares)
            for (const int j : {0, 2})
                for (const int i : {0, 2})
                    want(s.x[i], s.y[j]);
        evaluate();
        while (!squares.empty()) {
            std::erase_if(squares, [](const Square& s) { return s.single(); });
            for (const Square& s : squares)
                for (int j = 0; j < 3; ++j)
                    for (int i = 0; i < 3; ++i)
                        want(s.x[i], s.y[j]);
            evaluate();
            std::vector<std::uint8_t> even(squares.size());
            parallelFor(0, static_cast<std::int64_t>(squares.size()), [&](std::int64_t k) {
                const auto at = static_cast<std::size_t>(k);
                even[at] = isEven(squares[at]) ? 1 : 0;
            });
            std::vector<Square> uneven;
            for (std::size_t k = 0; k < squares.size(); ++k)
                for (int quarter = 0; quarter < 4; ++quarter) {
                    const int i = quarter % 2;
                    const int j = quarter / 2;
                    // Of two pixels the first is the middle too: its half is empty.
                    if ((i == 0 && squares[k].x[0] == squares[k].x[1]) ||
                        (j == 0 && squares[k].y[0] == squares[k].y[1]))
                        continue;
                    (even[k] ? smooth_ : uneven).push_back(squares[k].quarter(i, j));
                }
            squares = std::move(uneven);
        }
        fill();
        return static_cast<double>(summed_) / static_cast<double>(places_.size());
    }

private:
    [[nodiscard]] std::size_t at(int x, int y) const
    {
        return static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) +
               static_cast<std::size_t>(x);
    }
    /// In blocks of 8 x 4: what is summed together should be neighbours.
    [[nodiscard]] std::vector<Square> firstSquares() const
    {
        std::vector<Square> squares;
        const int step = options_.step;
        for (int top = 0; top < std::max(height_ - 1, 1); top += 4 * step)
            for (int left = 0; left < std::max(width_ - 1, 1); left += 8 * step)
                for (int y = top; y < std::min(top + 4 * step, std::max(height_ - 1, 1)); y += step)
                    for (int x = left; x < std::min(left + 8 * step, std::max(width_ - 1, 1));
                         x += step)
                        squares.push_back(Square::between(
                            x, y, std::min(x + step, width_ - 1), std::min(y + step, height_ - 1)));
        return squares;
    }
    void want(int x, int y)
    {
        const std::size_t pixel = at(x, y);
        if (known_[pixel]) return;
        known_[pixel] = 1;
        wanted_.push_back(pixel);
    }
    /// Place on a Z-order curve: what is summed together should be neighbours.
    [[nodiscard]] std::uint64_t alongCurve(std::size_t pixel) const
    {
        const auto width = static_cast<std::size_t>(width_);
        const auto spread = [](std::uint64_t v) {
            v = (v | v << 16U) & 0x0000ffff0000ffffU;
            v = (v | v << 8U) & 0x00ff00ff00ff00ffU;
            v = (v | v << 4U) & 0x0f0f0f0f0f0f0f0fU;
            v = (v | v << 2U) & 0x3333333333333333U;
            return (v | v << 1U) & 0x5555555555555555U;
        };
        return spread(pixel % width) | spread(pixel / width) << 1U;
    }
    void evaluate()
    {
        std::ranges::sort(wanted_, {}, [this](std::size_t pixel) { return alongCurve(pixel); });
        std::vector<glm::vec3> places(wanted_.size());
        std::vector<Rgb> found(wanted_.size());
        for (std::size_t k = 0; k < wanted_.size(); ++k)
            places[k] = places_[wanted_[k]];
        hiddenIrradiance(object_, places, normal_, found, options_.bias_texels);
        for (std::size_t k = 0; k < wanted_.size(); ++k)
            hidden_[wanted_[k]] = found[k];
        summed_ += wanted_.size();
        wanted_.clear();
    }
    [[nodiscard]] Rgb between(const Square& s, int x, int y) const
    {
        const float tx = share(x, s.x[0], s.x[2]);
        const float ty = share(y, s.y[0], s.y[2]);
        const auto value = [&](int i, int j) { return hidden_[at(s.x[i], s.y[j])]; };
        return (value(0, 0) * (1.0f - tx) + value(2, 0) * tx) * (1.0f - ty) +
               (value(0, 2) * (1.0f - tx) + value(2, 2) * tx) * ty;
    }
    [[nodiscard]] bool isEven(const Square& s) const
    {
        for (int j = 0; j < 3; ++j)
            for (int i = 0; i < 3; ++i) {
                const Rgb off = glm::abs(hidden_[at(s.x[i], s.y[j])] - between(s, s.x[i], s.y[j]));
                if (off.r > tolerance_.r || off.g > tolerance_.g || off.b > tolerance_.b)
                    return false;
            }
        return true;
    }
    void fill()
    {
        // Right and lower edges belong to the next square, but at the picture's own.
        parallelFor(0, static_cast<std::int64_t>(smooth_.size()), [&](std::int64_t k) {
            const Square& s = smooth_[static_cast<std::size_t>(k)];
            const int right = s.x[2] == width_ - 1 ? s.x[2] : s.x[2] - 1;
            const int bottom = s.y[2] == height_ - 1 ? s.y[2] : s.y[2] - 1;
            for (int y = s.y[0]; y <= bottom; ++y)
                for (int x = s.x[0]; x <= right; ++x)
                    if (!known_[at(x, y)]) hidden_[at(x, y)] = between(s, x, y);
        });
    }

    const ObjectLight& object_;
    int width_;
    int height_;
    std::span<const glm::vec3> places_;
    glm::vec3 normal_;
    const HiddenPictureOptions& options_;
    std::span<Rgb> hidden_;
    std::vector<std::uint8_t> known_;
    std::vector<std::size_t> wanted_;
    std::vector<Square> smooth_;
    std::size_t summed_ = 0;
    Rgb tolerance_{0.0f};
};

}  // namespace

Findings HiddenPictureOptions::validate() const
{
    Findings problems;
    const auto demand = [&](bool good, const std::string& message) {
        if (!good) problems.push_back({Severity::Error, "hidden-picture-options", message});
    };
    demand(step >= 2 && step <= 64 && std::has_single_bit(static_cast<unsigned>(step)),
           fmt::format("step is {}, not a power of two in [2, 64]", step));
    demand(std::isfinite(max_error) && max_error > 0.0,
           fmt::format("max_error is {}, not above 0", max_error));
    demand(bias_texels >= 0.0f && bias_texels <= 4.0f,
           fmt::format("bias_texels is {}, not in [0, 4]", bias_texels));
    return problems;
}

double hiddenIrradianceOfPicture(const ObjectLight& object,
                                 int width,
                                 int height,
                                 std::span<const glm::vec3> places_local,
                                 glm::vec3 unit_normal,
                                 const HiddenPictureOptions& options,
                                 std::span<Rgb> hidden)
{
    requireValid(options.validate(), "hidden picture options");
    INSITU_CHECK(width > 0 && height > 0 &&
                     places_local.size() ==
                         static_cast<std::size_t>(width) * static_cast<std::size_t>(height) &&
                     hidden.size() == places_local.size(),
                 "{} places and {} results for {}x{}",
                 places_local.size(),
                 hidden.size(),
                 width,
                 height);
    return Picture(object, width, height, places_local, unit_normal, options, hidden).sum();
}

}  // namespace insitu
