// How far automatic calibration is from the truth, and how often it knows.
//
//   calib_auto DATA [VIEWS [WORD]]    only pictures whose names hold WORD
//
// DATA is the folder of real captures (tests/support/data.h). Three tables:
//   photographs   each as it is, without and with its focal length from EXIF
//   views         VIEWS (20) pictures that a turned and zoomed camera of known lens would have
//   taken
//                 at the same place, made from each photograph of known focal length
//   panoramas     VIEWS pictures of an equirectangular environment of low resolution each
// Columns: focal error, error of the vertical field of view, roll and pitch errors where the
// horizon is known; the doubts that the program states; whether it vouches for the answer. "Wrong"
// is an answer off by more than 15 % in focal length, or 3 degrees in roll or pitch.
#include "bench/auto_pictures.h"
#include "calib/room_lines.h"

#include <fmt/format.h>
#include <glm/gtc/constants.hpp>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>

namespace insitu {
namespace {

namespace fs = std::filesystem;

using auto_pictures::Case;

struct Errors {
    bool answered = false;
    bool vouched = false;
    double focal = 0.0;  ///< share
    double fov_deg = 0.0;
    std::optional<double> roll_deg, pitch_deg;

    [[nodiscard]] bool wrong() const
    {
        return std::abs(focal) > 0.15 || std::abs(roll_deg.value_or(0.0)) > 3.0 ||
               std::abs(pitch_deg.value_or(0.0)) > 3.0;
    }
};

double rollOf(glm::dvec3 up)
{
    return glm::degrees(std::atan2(up.x, -up.y));
}

double pitchOf(glm::dvec3 up)
{
    return glm::degrees(std::asin(std::clamp(up.z, -1.0, 1.0)));
}

Errors run(const Case& one, const std::optional<FocalPrior>& prior, bool print)
{
    const auto begin = std::chrono::steady_clock::now();
    const auto lines = findRoomLines(one.image, prior);
    const double seconds =
        std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    Errors errors;
    if (!lines) {
        if (print) fmt::print("{:<28} no answer\n", one.name);
        return errors;
    }
    errors.answered = true;
    errors.vouched = lines->objections.empty();
    const glm::dvec3 up = lines->camera_from_world[1];
    if (one.known.focal_px > 0.0) {
        const double half = 0.5 * one.image.codes.height();
        errors.focal = lines->focal_px / one.known.focal_px - 1.0;
        errors.fov_deg = 2.0 * glm::degrees(std::atan(half / lines->focal_px) -
                                            std::atan(half / one.known.focal_px));
    }
    if (one.known.up) {
        errors.roll_deg = rollOf(up) - rollOf(*one.known.up);
        errors.pitch_deg = pitchOf(up) - pitchOf(*one.known.up);
    }
    if (!print) return errors;
    const auto known = [](const std::optional<double>& value) {
        return value ? fmt::format("{:+.2f}", *value) : std::string("-");
    };
    fmt::print(
        "{:<28} {:<4} {:>8.1f} {:>7} {:>6} {:>6} {:>6} | {:>5.1f} {:>5.2f} {:>5.2f} {:>6.1f} {:>4} "
        "{:>4.1f} {}\n",
        one.name,
        prior ? "exif" : "-",
        lines->focal_px,
        one.known.focal_px > 0.0 ? fmt::format("{:+.2f}", 100.0 * errors.focal) : "-",
        one.known.focal_px > 0.0 ? fmt::format("{:+.2f}", errors.fov_deg) : "-",
        known(errors.roll_deg),
        known(errors.pitch_deg),
        100.0 * lines->focal_doubt,
        glm::degrees(lines->rotation_doubt),
        lines->explained,
        lines->margin,
        lines->segments.size(),
        seconds,
        fmt::format("[{:+.1f}±{:.1f}°] ",
                    glm::degrees(lines->angle_off),
                    glm::degrees(lines->angle_sigma)) +
            (lines->second ? fmt::format("({} askew by {:.1f}°) ",
                                         lines->second->segments,
                                         glm::degrees(lines->second->turn_rad))
                           : "") +
            (errors.vouched ? "yes" : "no: " + lines->objections.front()));
    return errors;
}

double median(std::vector<double> values)
{
    if (values.empty()) return 0.0;
    std::nth_element(values.begin(), values.begin() + values.size() / 2, values.end());
    return values[values.size() / 2];
}

void summarise(const std::string& what, const std::vector<Errors>& all)
{
    for (const bool vouched : {false, true}) {
        std::vector<double> focal, fov, roll, pitch;
        int count = 0;
        int wrong = 0;
        for (const Errors& one : all) {
            if (!one.answered || (vouched && !one.vouched)) continue;
            ++count;
            wrong += one.wrong() ? 1 : 0;
            focal.push_back(std::abs(one.focal) * 100.0);
            fov.push_back(std::abs(one.fov_deg));
            if (one.roll_deg) roll.push_back(std::abs(*one.roll_deg));
            if (one.pitch_deg) pitch.push_back(std::abs(*one.pitch_deg));
        }
        fmt::print(
            "{:<28} {:<10} {:>4} of {:>4}, wrong {:>3}; median focal {:.2f} %, vertical fov "
            "{:.2f}°, roll {:.2f}°, pitch {:.2f}°\n",
            what,
            vouched ? "vouched" : "all",
            count,
            all.size(),
            wrong,
            median(focal),
            median(fov),
            median(roll),
            median(pitch));
    }
}

void measure(const fs::path& data, int count, const std::string& word)
{
    std::vector<Case> cases = auto_pictures::photographs(data);
    std::erase_if(cases, [&](const Case& one) { return one.name.find(word) == std::string::npos; });
    fmt::print(
        "{:<28} {:<4} {:>8} {:>7} {:>6} {:>6} {:>6} | {:>5} {:>5} {:>5} {:>6} {:>4} {:>4} {}\n",
        "photograph",
        "prior",
        "focal px",
        "off %",
        "fov",
        "roll",
        "pitch",
        "±f %",
        "±rot",
        "expl.",
        "margin",
        "n",
        "s",
        "vouched for");
    std::vector<Errors> photos[2];
    for (const Case& one : cases)
        for (const bool with_exif : {false, true}) {
            if (with_exif && !one.exif) continue;
            const Errors errors = run(one, with_exif ? one.exif : std::nullopt, true);
            if (one.known.focal_px > 0.0) photos[with_exif].push_back(errors);
        }
    summarise("photographs, no EXIF", photos[0]);
    summarise("photographs, EXIF", photos[1]);

    const char* dump = std::getenv("INSITU_VERBOSE");
    std::vector<Errors> views[2];
    for (std::size_t i = 0; i < cases.size(); ++i) {
        // The perspective of these two was corrected: no known lens would show it.
        if (!(cases[i].known.focal_px > 0.0) || cases[i].name.starts_with("hannover")) continue;
        std::vector<Errors> own[2];
        for (const Case& view : auto_pictures::viewsOf(cases[i], count, cases[i].seed))
            for (const bool with_exif : {false, true})
                own[with_exif].push_back(
                    run(view, with_exif ? view.exif : std::nullopt, dump != nullptr));
        for (const int k : {0, 1}) {
            summarise(cases[i].name + (k ? ", EXIF" : ""), own[k]);
            views[k].insert(views[k].end(), own[k].begin(), own[k].end());
        }
    }
    summarise("views, no EXIF", views[0]);
    summarise("views, EXIF", views[1]);

    std::vector<Errors> panoramas[2];
    for (const char* file : {"hdri/pmndrs_apartment.hdr",
                             "hdri/pmndrs_lobby.hdr",
                             "hdri/pmndrs_workshop.hdr",
                             "hdri/pmndrs_warehouse.hdr",
                             "hdri/openexr_StageEnvLatLong.exr",
                             "shippable/hdri/interior.exr"}) {
        if (std::string(file).find(word) == std::string::npos) continue;
        for (const Case& view : auto_pictures::panoramaViews(data / file, count, 100))
            for (const bool with_exif : {false, true})
                panoramas[with_exif].push_back(
                    run(view, with_exif ? view.exif : std::nullopt, dump != nullptr));
    }
    summarise("panoramas, no EXIF", panoramas[0]);
    summarise("panoramas, EXIF", panoramas[1]);
}

}  // namespace
}  // namespace insitu

int main(int argc, char** argv)
{
    if (argc < 2) {
        fmt::print(stderr, "usage: calib_auto DATA [VIEWS [WORD]]\n");
        return 2;
    }
    try {
        insitu::measure(
            argv[1], argc > 2 ? std::max(1, std::atoi(argv[2])) : 20, argc > 3 ? argv[3] : "");
    } catch (const std::exception& error) {
        fmt::print(stderr, "{}\n", error.what());
        return 1;
    }
    return 0;
}
