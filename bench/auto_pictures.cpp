#include "bench/auto_pictures.h"

#include "calib/exif_focal.h"
#include "core/color.h"
#include "core/environment_map.h"
#include "core/io/image_io.h"
#include "core/io/json.h"
#include "core/random.h"

#include <glm/gtc/constants.hpp>

#include <algorithm>
#include <cmath>

namespace insitu::auto_pictures {

namespace {

namespace fs = std::filesystem;

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

}  // namespace

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
    for (std::size_t i = 0; i < all.size(); ++i)
        all[i].seed = i + 1;
    return all;
}

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

}  // namespace insitu::auto_pictures
