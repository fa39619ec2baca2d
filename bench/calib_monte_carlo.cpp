// Calibration on random rooms, beside the closed form on the same lines and the Cramér–Rao bound.
//
//   calib_monte_carlo [ROOMS [WORD]]    only the cells whose names hold WORD
//
// Each room has a camera of 24 mm (36 mm film), 6000x4000 pixels, turned off a wall by the cell's
// yaw, 6 to 14° down, rolled by up to 1.5°, and ten random edges an axis, spread over the picture's
// width. Columns: focal errors in
// percent (median and 90th percentile) of the closed form from the first two segments of both
// horizontal axes, of that from the best-conditioned pairs, of ours; the bound as a median (0.6745
// σ); rms of our error over each room's bound; 90th percentile over median, the same of an estimate
// whose errors are normal at each room's bound (exact, from the mixture's distribution), and the
// probability that so many rooms show our value or more of it by chance. Then the share of stated
// intervals of 1 σ and 1.96 σ that hold the truth.
#include "bench/monte_carlo_room.h"
#include "calib/camera_solve.h"
#include "core/check.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <string>

namespace insitu {
namespace {

using monte_carlo::Cell;
using monte_carlo::Room;

constexpr double kMedianSigma = 0.6744898;

double quantile(std::vector<double> values, double share)
{
    if (values.empty()) return 0.0;
    const auto at = values.begin() +
                    static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
    std::nth_element(values.begin(), at, values.end());
    return *at;
}

/// The value that |error| stays below with this probability when each room's error is normal with
/// its own σ.
double mixtureQuantile(const std::vector<double>& sigmas, double share)
{
    double low = 0.0;
    double high = 10.0 * *std::max_element(sigmas.begin(), sigmas.end());
    for (int i = 0; i < 100; ++i) {
        const double middle = 0.5 * (low + high);
        double below = 0.0;
        for (const double sigma : sigmas)
            below += std::erf(middle / (sigma * std::sqrt(2.0)));
        (below < share * static_cast<double>(sigmas.size()) ? low : high) = middle;
    }
    return low;
}

/// Probability that normal errors at these σ, one a room, show a 90th percentile of `ratio` medians
/// or more. 1000 draws, fixed seed.
double chanceOfRatio(const std::vector<double>& sigmas, double ratio)
{
    constexpr int kDraws = 1000;
    int above = 0;
    for (int draw = 0; draw < kDraws; ++draw) {
        RandomStream random(41, 0, static_cast<std::uint64_t>(draw));
        std::vector<double> errors;
        for (const double sigma : sigmas)
            errors.push_back(std::abs(sigma * random.normal()));
        above += quantile(errors, 0.9) >= ratio * quantile(errors, 0.5) ? 1 : 0;
    }
    return static_cast<double>(above) / kDraws;
}

/// Stated intervals against the truth.
struct Coverage {
    static constexpr std::size_t kCount = 10;
    static constexpr std::array<const char*, kCount> kNames = {
        "focal", "pitch", "yaw", "roll", "pos x", "pos y", "pos z", "along", "across", "height"};
    std::array<int, kCount> one{};
    std::array<int, kCount> two{};
    int rooms = 0;

    void add(std::size_t which, double error, double sigma)
    {
        one[which] += std::abs(error) < sigma ? 1 : 0;
        two[which] += std::abs(error) < 1.96 * sigma ? 1 : 0;
    }
};

/// Height above the floor at which the ray through `top` passes the vertical through `foot`.
double heightOver(const Camera& camera, glm::dvec3 foot, glm::dvec2 top)
{
    const glm::dvec3 ray = camera.rayDirection(top);
    const glm::dvec2 level(ray.x, ray.z);
    const glm::dvec2 to(foot.x - camera.position_m.x, foot.z - camera.position_m.z);
    return camera.position_m.y + ray.y * glm::dot(level, to) / glm::dot(level, level);
}

/// Where the object stands: half a metre from the origin; what the found camera makes of the pixel
/// at which it is seen.
void addPlacement(const Room& room, const CameraEstimate& found, Coverage& coverage)
{
    const glm::dvec3 truth(0.3, 0.0, -0.4);
    const glm::dvec2 pixel = room.camera.project(truth).value();
    const glm::dvec3 ray = found.camera.rayDirection(pixel);
    const glm::dvec3 seen = found.camera.position_m - ray * (found.camera.position_m.y / ray.y);
    const auto sigma = placementSigma(found, seen);
    if (!sigma) return;
    const glm::dvec2 away(seen.x - found.camera.position_m.x, seen.z - found.camera.position_m.z);
    const glm::dvec2 along = glm::normalize(away);
    const glm::dvec2 off(seen.x - truth.x, seen.z - truth.z);
    coverage.add(7, glm::dot(off, along), sigma->along_m);
    coverage.add(8, along.x * off.y - along.y * off.x, sigma->across_m);
    const glm::dvec2 top = room.camera.project(truth + glm::dvec3(0.0, 1.0, 0.0)).value();
    coverage.add(9, heightOver(found.camera, seen, top) - 1.0, sigma->height_m);
}

void addCoverage(const Room& room, const CameraEstimate& found, Coverage& coverage)
{
    const Camera& truth = room.camera;
    const Camera& camera = found.camera;
    ++coverage.rooms;
    coverage.add(0, camera.focal_px.x - truth.focal_px.x, found.focal_sigma_px);
    const glm::dmat3 a(camera.right, -camera.up, camera.forward);
    const glm::dmat3 b(truth.right, -truth.up, truth.forward);
    // Columns are the camera's axes in the world: aᵀ b takes the true camera's frame to the found.
    const glm::dmat3 turn = glm::transpose(a) * b;
    const glm::dvec3 skew =
        0.5 * glm::dvec3(turn[1][2] - turn[2][1], turn[2][0] - turn[0][2], turn[0][1] - turn[1][0]);
    for (int i = 0; i < 3; ++i) {
        coverage.add(1 + i, skew[i], found.turn_sigma_rad[i]);
        coverage.add(4 + i, camera.position_m[i] - truth.position_m[i], found.position_sigma_m[i]);
    }
    addPlacement(room, found, coverage);
}

struct Tally {
    std::vector<double> closed, closed_best, ours, bounds;
    double squared_ratio = 0.0;
    int failed = 0;
    int told = 0;  ///< findings that the principal point is assumed
    double seconds = 0.0;
    double closed_seconds = 0.0;
    Coverage coverage;
};

double now()
{
    return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch())
        .count();
}

struct Setting {
    Cell cell;
    double noise_px = 6.0;
    double offset_share = 0.0;     ///< σ of each coordinate of the principal point, of the width
    double principal_sigma = 0.0;  ///< told to the solver, share of the width
    bool rectangle = false;        ///< a rectangle of known ratio on the wall
};

/// A rectangle of 1.2 m by 0.8 m on a wall that both horizontal directions see at a slant.
void addRectangle(Room& room, RandomStream& random)
{
    for (;;) {
        const glm::dvec2 at(monte_carlo::between(random, 600, 5400),
                            monte_carlo::between(random, 600, 3400));
        const glm::dvec3 corner =
            room.camera.position_m +
            room.camera.rayDirection(at) * monte_carlo::between(random, 1.5, 3.0);
        const bool side = random.uniformDouble() < 0.5;
        const glm::dvec3 u = side ? glm::dvec3(0, 0, 1.2) : glm::dvec3(1.2, 0, 0);
        const glm::dvec3 v(0, 0.8, 0);
        MarkedRectangle rectangle;
        rectangle.ratio = 1.5;
        bool seen = true;
        const glm::dvec3 corners[4] = {corner, corner + u, corner + u + v, corner + v};
        for (std::size_t i = 0; i < 4; ++i) {
            const auto pixel = room.camera.project(corners[i]);
            seen = seen && pixel && monte_carlo::inPicture(*pixel);
            if (seen) rectangle.corners_px[i] = *pixel;
        }
        const glm::dvec2 a = rectangle.corners_px[2] - rectangle.corners_px[0];
        const glm::dvec2 b = rectangle.corners_px[3] - rectangle.corners_px[1];
        // Half the diagonals' cross product; one per cent of the picture is not edge-on.
        const double area = 0.5 * std::abs(a.x * b.y - a.y * b.x);
        if (!seen || area < 0.01 * monte_carlo::kWidth * monte_carlo::kHeight) continue;
        room.lines.rectangles = {rectangle};
        return;
    }
}

Tally run(const Setting& setting, int rooms)
{
    Tally tally;
    for (int i = 0; i < rooms; ++i) {
        RandomStream random(
            20, static_cast<std::uint32_t>(setting.cell.yaw_deg), static_cast<std::uint64_t>(i));
        Cell cell = setting.cell;
        const double offset = setting.offset_share * monte_carlo::kWidth;
        cell.principal_offset_px = {offset * random.normal(), offset * random.normal()};
        Room room = monte_carlo::randomRoom(cell, random);
        if (setting.rectangle) addRectangle(room, random);
        const LineSet lines = monte_carlo::marked(room, setting.noise_px, random);

        const double truth = monte_carlo::kFocalPx;
        const auto share = [&](const std::optional<double>& focal) {
            return focal ? 100.0 * std::abs(*focal / truth - 1.0) : 100.0;
        };
        const double begin = now();
        tally.closed.push_back(share(monte_carlo::closedFormFocal(lines, false)));
        tally.closed_seconds += now() - begin;
        tally.closed_best.push_back(share(monte_carlo::closedFormFocal(lines, true)));

        const double bound = monte_carlo::focalBound(
            room, setting.noise_px, setting.principal_sigma * monte_carlo::kWidth);
        tally.bounds.push_back(100.0 * bound);
        CalibrationOptions options;
        options.segment_sigma_px = setting.noise_px;
        options.principal_sigma = setting.principal_sigma;
        const double start = now();
        try {
            const CameraEstimate found = calibrateCamera(lines, options, "room");
            tally.seconds += now() - start;
            const double error = std::log(found.camera.focal_px.x / truth);
            tally.ours.push_back(share(found.camera.focal_px.x));
            tally.squared_ratio += error * error / (bound * bound);
            tally.told += hasFinding(found.findings, "principal-point-assumed") ? 1 : 0;
            addCoverage(room, found, tally.coverage);
        } catch (const NoAnswerError& error) {
            if (tally.failed++ == 0) fmt::print(stderr, "room {}: {}\n", i, error.what());
        }
    }
    return tally;
}

void printAccuracy(const std::string& name, const Tally& tally)
{
    const double median = quantile(tally.ours, 0.5);
    const double high = quantile(tally.ours, 0.9);
    fmt::print(
        "{:<28} {:>5.2f} {:>5.1f}  {:>5.2f} {:>5.1f}  {:>5.3f} {:>5.2f}  {:>6.3f} {:>6.3f} "
        "{:>5.2f} {:>5.2f} {:>5.3f} {:>4} {:>8.0f} {:>6.2f}\n",
        name,
        quantile(tally.closed, 0.5),
        quantile(tally.closed, 0.9),
        quantile(tally.closed_best, 0.5),
        quantile(tally.closed_best, 0.9),
        median,
        high,
        kMedianSigma * quantile(tally.bounds, 0.5),
        std::sqrt(tally.squared_ratio / static_cast<double>(tally.ours.size())),
        high / median,
        mixtureQuantile(tally.bounds, 0.9) / mixtureQuantile(tally.bounds, 0.5),
        chanceOfRatio(tally.bounds, high / median),
        tally.failed,
        1e6 * tally.seconds / static_cast<double>(tally.ours.size()),
        1e6 * tally.closed_seconds / static_cast<double>(tally.closed.size()));
}

void printCoverage(const std::string& name, const Tally& tally)
{
    fmt::print("{:<28}", name);
    const double rooms = tally.coverage.rooms;
    for (std::size_t i = 0; i < Coverage::kCount; ++i)
        fmt::print(" {:>4.1f}/{:<4.1f}",
                   100.0 * tally.coverage.one[i] / rooms,
                   100.0 * tally.coverage.two[i] / rooms);
    fmt::print("  {:.0f}\n", 100.0 * tally.told / rooms);
}

std::string nameOf(const Setting& setting)
{
    std::string name = fmt::format("{:.0f}°, {:.0f} px, {} axes",
                                   setting.cell.yaw_deg,
                                   setting.noise_px,
                                   setting.cell.uprights ? 3 : 2);
    if (setting.rectangle) name += ", rect";
    if (setting.principal_sigma > 0.0)
        name += fmt::format(
            ", pp {:.0f}/{:.0f} %", 100.0 * setting.offset_share, 100.0 * setting.principal_sigma);
    return name;
}

std::vector<Setting> settings()
{
    std::vector<Setting> all;
    for (const double yaw : {8.0, 15.0, 25.0, 40.0})
        for (const double noise : {2.0, 6.0})
            for (const bool uprights : {false, true})
                all.push_back({{yaw, uprights, 10, {}}, noise, 0.0, 0.0, false});
    for (const double share : {0.0, 0.02, 0.05})
        for (const bool uprights : {false, true})
            for (const double yaw : {15.0, 25.0, 40.0})
                for (const bool rectangle : {false, true})
                    all.push_back({{yaw, uprights, 10, {}},
                                   2.0,
                                   share,
                                   share > 0.0 ? share : 0.05,
                                   rectangle});
    return all;
}

}  // namespace
}  // namespace insitu

int main(int argc, char** argv)
{
    const int rooms = argc > 1 ? std::atoi(argv[1]) : 1000;
    const std::string word = argc > 2 ? argv[2] : "";
    if (rooms < 1 || argc > 3) {
        fmt::print(stderr, "usage: calib_monte_carlo [ROOMS [WORD]]\n");
        return 2;
    }
    std::vector<std::pair<std::string, insitu::Tally>> results;
    fmt::print("{:<28} {:>11}  {:>11}  {:>11}  {:>6} {:>6} {:>5} {:>5} {:>5} {:>4} {:>8} {:>6}\n",
               "cell (med, 90 %)",
               "two segs",
               "best two",
               "ours",
               "bound",
               "ratio",
               "90/50",
               "exact",
               "p",
               "fail",
               "us",
               "us 2s");
    for (const insitu::Setting& setting : insitu::settings()) {
        const std::string name = insitu::nameOf(setting);
        if (name.find(word) == std::string::npos) continue;
        results.emplace_back(name, insitu::run(setting, rooms));
        insitu::printAccuracy(results.back().first, results.back().second);
        std::fflush(stdout);
    }
    fmt::print("\n{:<28}", "coverage 1 σ / 1.96 σ, %");
    for (const char* name : insitu::Coverage::kNames)
        fmt::print(" {:>9}", name);
    fmt::print("  pp assumed %\n");
    for (const auto& [name, tally] : results)
        insitu::printCoverage(name, tally);
    return 0;
}
