// How far automatic calibration is from the truth, and how often it knows.
//
//   calib_auto DATA [VIEWS]
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
#include "calib/exif_focal.h"
#include "calib/room_lines.h"
#include "core/camera.h"
#include "core/color.h"
#include "core/environment_map.h"
#include "core/io/image_io.h"
#include "core/io/json.h"
#include "core/random.h"

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

/// What is known about a photograph's camera.
struct Known {
    double focal_px = 0.0;         ///< 0: unknown
    std::optional<glm::dvec3> up;  ///< world's up in the camera's frame
};

struct Case {
    std::string name;
    EncodedImage image;
    std::optional<FocalPrior> exif;
    Known known;
};

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
        errors.vouched ? "yes" : "no: " + lines->objections.front());
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

glm::dvec3 jsonUp(const JsonNode& camera)
{
    return {camera.at("right_in_world").vec3().y,
            -camera.at("up_in_world").vec3().y,
            camera.at("forward_in_world").vec3().y};
}

Case load(const fs::path& file, const std::string& name)
{
    const Photo photo = readPhoto(file);
    Case one{name, photo.image, {}, {}};
    one.exif = focalFromExif(photo.metadata, photo.image.codes.width(), photo.image.codes.height());
    if (one.exif) one.known.focal_px = one.exif->focal_px;
    return one;
}

std::vector<Case> photographs(const fs::path& data)
{
    std::vector<Case> all;
    for (const char* room : {"truth-room-a", "truth-room-b", "truth-room-c"}) {
        Case one = load(data / room / "plate.jpg", room);
        const Json json = readJson(data / room / "truth.json");
        const JsonNode camera = JsonNode(json, "truth.json").at("camera");
        one.known = {camera.at("fx_px").number(), jsonUp(camera)};
        all.push_back(std::move(one));
    }
    const Json json = readJson(data / "rooms/yud/ground_truth.json");
    for (const char* name : {"P1020171.jpg", "P1020816.jpg"}) {
        Case one = load(data / "rooms/yud" / name, name);
        glm::dvec3 up = JsonNode(json, "ground_truth.json")
                            .at("images")
                            .at(name)
                            .at("vp_camera")
                            .at(std::size_t{1})
                            .vec3();
        if (up.y > 0.0) up = -up;
        one.known = {674.918, up};
        all.push_back(std::move(one));
    }
    // EXIF of the originals: 17 mm on full frame.
    for (const char* name : {"hannover_lichthof_indoor", "hannover_ihme_zentrum"}) {
        Case one = load(data / "rooms" / (std::string(name) + ".jpg"), name);
        one.known.focal_px = 944.0;
        one.exif = FocalPrior{944.0, 0.02};
        all.push_back(std::move(one));
    }
    all.push_back(
        load(data / "rooms/oneplus_calibrated/nick_apartment_scene.jpg", "nick_apartment"));
    all.back().known.focal_px = 3713.0;
    all.push_back(load(data / "rooms/cslab_phone.jpg", "cslab_phone"));
    all.push_back(load(data / "rooms/museum_one_point.jpg", "museum_one_point"));
    const fs::path brackets = data / "brackets";
    all.push_back(load(brackets / "ball_uiuc_office/empty.jpg", "uiuc_office"));
    all.push_back(load(brackets / "ball_olapietka_livingroom/raw0.jpg", "olapietka_livingroom"));
    all.push_back(load(brackets / "ball_tarik_dining/background.jpg", "tarik_dining"));
    all.push_back(load(brackets / "ball_xuyiwen_meetingroom/empty.jpg", "xuyiwen_meetingroom"));
    return all;
}

/// What a camera turned by `turn` (base camera from its own frame) would have taken.
template <class Look>
EncodedImage picture(int width, int height, double focal_px, Look look)
{
    EncodedImage image;
    image.codes = Image<glm::u16vec3>(width, height);
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x)
            image.codes(x, y) = look(glm::dvec3(
                (x + 0.5 - 0.5 * width) / focal_px, (y + 0.5 - 0.5 * height) / focal_px, 1.0));
    return image;
}

/// Camera from a frame that is level: first rolled, then pitched, then turned about the vertical.
glm::dmat3 turned(double yaw, double pitch, double roll)
{
    const glm::dmat3 about_y(
        glm::dvec3(std::cos(yaw), 0, -std::sin(yaw)), {0, 1, 0}, {std::sin(yaw), 0, std::cos(yaw)});
    const glm::dmat3 about_x(glm::dvec3(1, 0, 0),
                             {0, std::cos(pitch), std::sin(pitch)},
                             {0, -std::sin(pitch), std::cos(pitch)});
    const glm::dmat3 about_z(glm::dvec3(std::cos(roll), std::sin(roll), 0),
                             {-std::sin(roll), std::cos(roll), 0},
                             {0, 0, 1});
    return about_y * about_x * about_z;
}

double between(RandomStream& random, double low, double high)
{
    return low + (high - low) * random.uniformDouble();
}

/// Views of one photograph that lie inside it.
std::vector<Case> viewsOf(const Case& base, int count, std::uint64_t seed)
{
    std::vector<Case> views;
    const double w = base.image.codes.width();
    const double h = base.image.codes.height();
    const double long_side = std::max(w, h);
    Image<glm::vec3> codes(base.image.codes.width(), base.image.codes.height());
    for (int y = 0; y < codes.height(); ++y)
        for (int x = 0; x < codes.width(); ++x)
            codes(x, y) = glm::vec3(base.image.codes(x, y));
    RandomStream random(seed, 0, 0);
    for (int tries = 0; static_cast<int>(views.size()) < count && tries < 400 * count; ++tries) {
        const int width = static_cast<int>(std::min(1200.0, 0.85 * w));
        const int height = width * 2 / 3;
        const double zoom = between(random, 1.0, 1.5);
        const double focal = base.known.focal_px * zoom * width / (0.95 * long_side);
        const glm::dmat3 base_from_view = turned(glm::radians(between(random, -15, 15)),
                                                 glm::radians(between(random, -12, 12)),
                                                 glm::radians(between(random, -8, 8)));
        const auto toBase = [&](glm::dvec3 ray) {
            const glm::dvec3 d = base_from_view * ray;
            return glm::dvec2(d) / d.z * base.known.focal_px + 0.5 * glm::dvec2(w, h);
        };
        bool inside = true;
        for (const double sx : {-0.5, 0.5})
            for (const double sy : {-0.5, 0.5}) {
                const glm::dvec2 p = toBase({sx * width / focal, sy * height / focal, 1.0});
                inside = inside && p.x > 1 && p.y > 1 && p.x < w - 1 && p.y < h - 1;
            }
        if (!inside) continue;
        Case view{base.name, {}, FocalPrior{focal, 0.02}, {focal, {}}};
        if (base.known.up) view.known.up = glm::transpose(base_from_view) * *base.known.up;
        view.image = picture(width, height, focal, [&](glm::dvec3 ray) {
            const glm::dvec2 p = toBase(ray);
            return glm::u16vec3(sampleBilinear(codes, p.x, p.y) + 0.5f);
        });
        view.image.max_code = base.image.max_code;
        views.push_back(std::move(view));
    }
    return views;
}

/// Views of an equirectangular environment, 640x427.
std::vector<Case> panoramaViews(const fs::path& file, int count, std::uint64_t seed)
{
    const Image<Rgb> map = readRadiance(file).pixels;
    std::vector<float> values;
    for (const Rgb& pixel : map.pixels())
        values.push_back(luminance(pixel));
    std::nth_element(values.begin(), values.begin() + values.size() * 9 / 10, values.end());
    const float white = std::max(1e-6f, values[values.size() * 9 / 10]);
    RandomStream random(seed, 0, 0);
    std::vector<Case> views;
    for (int i = 0; i < count; ++i) {
        constexpr int kWidth = 640;
        constexpr int kHeight = 427;
        const double fov = glm::radians(between(random, 40, 75));
        const double focal = 0.5 * kHeight / std::tan(0.5 * fov);
        const glm::dmat3 level_from_view = turned(between(random, 0, glm::two_pi<double>()),
                                                  glm::radians(between(random, -20, 20)),
                                                  glm::radians(between(random, -8, 8)));
        Case view{file.stem().string(), {}, FocalPrior{focal, 0.02}, {focal, {}}};
        view.known.up = glm::transpose(level_from_view) * glm::dvec3(0, -1, 0);
        view.image = picture(kWidth, kHeight, focal, [&](glm::dvec3 ray) {
            const glm::dvec3 d = glm::normalize(level_from_view * ray);
            const double u = 0.5 + std::atan2(d.x, d.z) / glm::two_pi<double>();
            const double v = std::acos(std::clamp(-d.y, -1.0, 1.0)) / glm::pi<double>();
            const Rgb linear = sampleBilinear(map, u * map.width(), v * map.height()) / white;
            glm::u16vec3 codes;
            for (int c = 0; c < 3; ++c)
                codes[c] = static_cast<std::uint16_t>(
                    255.0f * std::pow(std::clamp(linear[c], 0.0f, 1.0f), 1.0f / 2.2f) + 0.5f);
            return codes;
        });
        views.push_back(std::move(view));
    }
    return views;
}

void measure(const fs::path& data, int count)
{
    const std::vector<Case> cases = photographs(data);
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
        for (const Case& view : viewsOf(cases[i], count, i + 1))
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
                             "shippable/hdri/interior.exr"})
        for (const Case& view : panoramaViews(data / file, count, 100))
            for (const bool with_exif : {false, true})
                panoramas[with_exif].push_back(
                    run(view, with_exif ? view.exif : std::nullopt, dump != nullptr));
    summarise("panoramas, no EXIF", panoramas[0]);
    summarise("panoramas, EXIF", panoramas[1]);
}

}  // namespace
}  // namespace insitu

int main(int argc, char** argv)
{
    if (argc < 2) {
        fmt::print(stderr, "usage: calib_auto DATA [VIEWS]\n");
        return 2;
    }
    try {
        insitu::measure(argv[1], argc > 2 ? std::max(1, std::atoi(argv[2])) : 20);
    } catch (const std::exception& error) {
        fmt::print(stderr, "{}\n", error.what());
        return 1;
    }
    return 0;
}
