#include "capture/probe_inpaint.h"

#include "capture/probe_checks.h"
#include "core/check.h"
#include "core/io/image_io.h"

#include <Eigen/Sparse>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace insitu {

using std::numbers::pi;

namespace {

bool insidePolygon(glm::dvec2 point, const std::vector<glm::dvec2>& corners)
{
    bool inside = false;
    for (std::size_t i = 0, j = corners.size() - 1; i < corners.size(); j = i++) {
        const glm::dvec2 a = corners[i];
        const glm::dvec2 b = corners[j];
        if ((a.y > point.y) == (b.y > point.y)) continue;
        if (point.x < a.x + (point.y - a.y) / (b.y - a.y) * (b.x - a.x)) inside = !inside;
    }
    return inside;
}

/// The masked texels, numbered, and the equations that tie them to their neighbours.
class SphereLaplace {
public:
    SphereLaplace(const Image<Rgb>& map, const ProbeMask& mask)
        : map_(map), numbers_(map.width(), map.height(), -1)
    {
        for (int y = 0; y < map.height(); ++y) {
            for (int x = 0; x < map.width(); ++x) {
                if (mask(x, y) == 0) continue;
                numbers_(x, y) = static_cast<int>(texels_.size());
                texels_.emplace_back(x, y);
            }
        }
    }

    [[nodiscard]] const std::vector<glm::ivec2>& texels() const { return texels_; }

    [[nodiscard]] Eigen::MatrixXd solve() const
    {
        const auto count = static_cast<Eigen::Index>(texels_.size());
        std::vector<Eigen::Triplet<double>> entries;
        Eigen::MatrixXd known = Eigen::MatrixXd::Zero(count, 3);
        const int w = map_.width();
        const int h = map_.height();
        for (int i = 0; i < count; ++i) {
            const glm::ivec2 t = texels_[static_cast<std::size_t>(i)];
            double sum = 0.0;
            const auto tie = [&](int x, int y, double conductance) {
                sum += conductance;
                const int other = numbers_(x, y);
                if (other >= 0) {
                    entries.emplace_back(i, other, -conductance);
                } else {
                    for (int c = 0; c < 3; ++c)
                        known(i, c) += conductance * static_cast<double>(map_(x, y)[c]);
                }
            };
            // A texel is twice as wide in azimuth, 2 pi / w, as rows are high, pi / h = 2 pi / w:
            // both steps are equal and cancel.
            const double along = 1.0 / std::sin(pi * (t.y + 0.5) / h);
            tie((t.x + 1) % w, t.y, along);
            tie((t.x + w - 1) % w, t.y, along);
            if (t.y > 0) tie(t.x, t.y - 1, std::sin(pi * t.y / h));
            if (t.y + 1 < h) tie(t.x, t.y + 1, std::sin(pi * (t.y + 1) / h));
            entries.emplace_back(i, i, sum);
        }
        Eigen::SparseMatrix<double> laplace(count, count);
        laplace.setFromTriplets(entries.begin(), entries.end());
        const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> solver(laplace);
        INSITU_CHECK(solver.info() == Eigen::Success, "{} unknowns", count);
        return solver.solve(known);
    }

private:
    const Image<Rgb>& map_;
    Image<int> numbers_;
    std::vector<glm::ivec2> texels_;
};

}  // namespace

ProbeMask maskFromPolygons(int width,
                           int height,
                           const std::vector<std::vector<glm::dvec2>>& polygons_px)
{
    ProbeMask mask(width, height);
    for (const std::vector<glm::dvec2>& corners : polygons_px) {
        if (corners.size() < 3)
            throw InputError(
                "probe mask",
                fmt::format("a polygon of {} corners; at least 3 are needed", corners.size()));
        glm::dvec2 low = corners[0];
        glm::dvec2 high = corners[0];
        for (const glm::dvec2 corner : corners) {
            if (!(std::isfinite(corner.x) && std::isfinite(corner.y)))
                throw InputError("probe mask", "a polygon's corner is not finite");
            low = glm::min(low, corner);
            high = glm::max(high, corner);
        }
        const glm::ivec2 first(glm::clamp(low, glm::dvec2(0.0), glm::dvec2(width, height)));
        const glm::ivec2 last(
            glm::clamp(glm::ceil(high), glm::dvec2(0.0), glm::dvec2(width, height)));
        for (int y = first.y; y < last.y; ++y)
            for (int x = first.x; x < last.x; ++x)
                if (insidePolygon({x + 0.5, y + 0.5}, corners)) mask(x, y) = 1;
    }
    return mask;
}

ProbeMask readProbeMask(const std::filesystem::path& path, int width, int height)
{
    const EncodedImage image = readPhoto(path).image;
    if (image.codes.width() != width || image.codes.height() != height)
        throw InputError(path.string(),
                         fmt::format("{}x{} pixels; the mask must be as large as the pictures that "
                                     "it masks, {}x{}",
                                     image.codes.width(),
                                     image.codes.height(),
                                     width,
                                     height));
    ProbeMask mask(width, height);
    for (std::size_t i = 0; i < mask.pixelCount(); ++i) {
        const glm::u16vec3 code = image.codes.pixels()[i];
        mask.pixels()[i] = 2 * std::max({code.r, code.g, code.b}) > image.max_code ? 1 : 0;
    }
    return mask;
}

ProbeMask maskFromCaps(int map_width, const std::vector<SphereCap>& caps)
{
    detail::checkMapWidth(map_width);
    ProbeMask mask(map_width, map_width / 2);
    for (const SphereCap& cap : caps) {
        const double length = glm::length(cap.direction);
        if (!(std::isfinite(length) && length > 0.0))
            throw InputError("probe mask", "a cap's direction is not a direction");
        if (!(cap.radius_rad >= 0.0 && cap.radius_rad <= pi))
            throw InputError(
                "probe mask",
                fmt::format("a cap's radius is {} radians, must be in [0, pi]", cap.radius_rad));
        const double cosine = std::cos(cap.radius_rad);
        for (int y = 0; y < mask.height(); ++y) {
            for (int x = 0; x < mask.width(); ++x) {
                const glm::dvec3 d = environmentDirectionFromUv(
                    {(x + 0.5) / mask.width(), (y + 0.5) / mask.height()});
                if (glm::dot(d, cap.direction) >= cosine * length) mask(x, y) = 1;
            }
        }
    }
    return mask;
}

void inpaintProbe(LightProbe& probe, const ProbeMask& mask)
{
    Image<Rgb>& map = probe.environment.pixels;
    detail::checkRadiance(map);
    if (!mask.sameSize(map))
        throw InputError("probe mask",
                         fmt::format("{}x{} texels for a map of {}x{}",
                                     mask.width(),
                                     mask.height(),
                                     map.width(),
                                     map.height()));
    const SphereLaplace laplace(map, mask);
    if (laplace.texels().empty()) return;
    if (laplace.texels().size() == map.pixelCount())
        throw NoAnswerError("probe mask",
                            "it covers everything the probe shows: leave some of it out");
    const Eigen::MatrixXd values = laplace.solve();
    double share = 0.0;
    for (std::size_t i = 0; i < laplace.texels().size(); ++i) {
        const glm::ivec2 t = laplace.texels()[i];
        share += environmentTexelSolidAngle(map.width(), map.height(), t.y) / (4.0 * pi);
        const auto row = static_cast<Eigen::Index>(i);
        map(t.x, t.y) = glm::max(Rgb(values(row, 0), values(row, 1), values(row, 2)), 0.0f);
    }
    probe.findings.push_back(
        {Severity::Info,
         "probe-inpainted",
         fmt::format("{:.2f} % of the sphere is masked and was painted in from its surroundings",
                     100.0 * share)});
}

}  // namespace insitu
