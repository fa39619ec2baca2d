#include "calib/foreign_cameras.h"
#include "calib/radial_match.h"
#include "core/check.h"
#include "core/io/file.h"

#include <fmt/format.h>
#include <glm/gtc/quaternion.hpp>

#include <charconv>
#include <cmath>
#include <map>
#include <sstream>

// COLMAP's text model. cameras.txt: CAMERA_ID MODEL WIDTH HEIGHT PARAMS…; images.txt: two lines a
// picture, IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME and its points, (Q, T) being camera from
// world with x right, y down, z forward. (0, 0) is the corner of the first pixel, as here.

namespace insitu::foreign {

namespace {

namespace fs = std::filesystem;

constexpr std::int64_t kMaxBytes = 256 << 20;

/// Where a line stands, for complaints.
struct Line {
    std::string file;
    int number = 0;
    std::vector<std::string> words;

    [[noreturn]] void fail(const std::string& cause) const
    {
        throw InputError(file, fmt::format("{}", number), cause);
    }
    [[nodiscard]] double value(std::size_t index) const
    {
        if (index >= words.size()) fail("has too few numbers");
        const std::string& word = words[index];
        double number_read = 0.0;
        const auto [end, error] =
            std::from_chars(word.data(), word.data() + word.size(), number_read);
        if (error != std::errc() || end != word.data() + word.size() || !std::isfinite(number_read))
            fail(fmt::format("\"{}\" is no finite number", word));
        return number_read;
    }
};

std::vector<Line> linesOf(const fs::path& path)
{
    const std::vector<std::uint8_t> bytes = readFile(path, kMaxBytes);
    std::istringstream stream(std::string(bytes.begin(), bytes.end()));
    std::vector<Line> lines;
    std::string text;
    for (int number = 1; std::getline(stream, text); ++number) {
        if (!text.empty() && text[0] == '#') continue;
        Line line{path.string(), number, {}};
        std::istringstream cells(text);
        for (std::string word; cells >> word;)
            line.words.push_back(word);
        lines.push_back(std::move(line));
    }
    return lines;
}

/// How a model's parameters are laid out: focal lengths, then the principal point, then distortion.
struct Model {
    int focals = 1;
    std::size_t distortions = 0;
};

const std::map<std::string, Model>& models()
{
    static const std::map<std::string, Model> all = {{"SIMPLE_PINHOLE", {1, 0}},
                                                     {"PINHOLE", {2, 0}},
                                                     {"SIMPLE_RADIAL", {1, 1}},
                                                     {"RADIAL", {1, 2}},
                                                     {"OPENCV", {2, 4}},
                                                     {"FULL_OPENCV", {2, 8}}};
    return all;
}

/// The distortion as the division model, and what that leaves out. `first` is k1's place.
void readDistortion(const Line& line,
                    std::size_t first,
                    std::size_t count,
                    CameraEstimate& estimate)
{
    bool other = false;  // tangential terms and k3 on
    bool any = false;
    for (std::size_t i = 0; i < count; ++i) {
        const double value = line.value(first + i);
        any = any || value != 0.0;
        other = other || (i >= 2 && value != 0.0);
    }
    if (!any) return;
    const RadialPolynomial polynomial{line.value(first), count > 1 ? line.value(first + 1) : 0.0};
    const auto match = divisionOf(polynomial, estimate.camera);
    if (match) estimate.camera.division = match->division;
    if (!match || other) {
        estimate.findings.push_back(
            {Severity::Warning,
             "camera-distortion-ignored",
             match
                 ? "the lens' tangential and higher terms are not modelled; k1 and k2 are"
                 : "the lens' distortion is beyond what is modelled and is not applied; undistort "
                   "the photograph first"});
        if (!match) return;
    }
    estimate.findings.push_back(
        {match->worst_px > 0.5 ? Severity::Warning : Severity::Info,
         "camera-distortion-converted",
         fmt::format("the lens' polynomial became the division model λ = {:.4f}, which agrees with "
                     "it at the corners and within {:.2f} px elsewhere",
                     match->division,
                     match->worst_px)});
}

void readIntrinsics(const Line& line, CameraEstimate& estimate)
{
    const auto model = models().find(line.words[1]);
    if (model == models().end())
        line.fail(
            fmt::format("camera model \"{}\" is not known here; use PINHOLE, SIMPLE_PINHOLE "
                        "or a radial one",
                        line.words[1]));
    const auto focals = static_cast<std::size_t>(model->second.focals);
    const std::size_t count = focals + 2 + model->second.distortions;
    if (line.words.size() != 4 + count)
        line.fail(fmt::format(
            "{} has {} parameters, here are {}", line.words[1], count, line.words.size() - 4));
    Camera& camera = estimate.camera;
    const glm::dvec2 size(line.value(2), line.value(3));
    if (!(size.x >= 1.0 && size.y >= 1.0 && size.x <= 1e5 && size.y <= 1e5) ||
        size != glm::floor(size))
        line.fail("width and height must be whole numbers from 1 to 100000");
    camera.width = static_cast<int>(size.x);
    camera.height = static_cast<int>(size.y);
    camera.focal_px = {line.value(4), line.value(3 + focals)};
    if (!(camera.focal_px.x > 0.0 && camera.focal_px.y > 0.0))
        line.fail("the focal length must be positive");
    camera.principal_px = {line.value(4 + focals), line.value(5 + focals)};
    readDistortion(line, 6 + focals, model->second.distortions, estimate);
}

void readPose(const Line& line, Camera& camera)
{
    const glm::dquat q(line.value(1), line.value(2), line.value(3), line.value(4));
    const glm::dvec3 t(line.value(5), line.value(6), line.value(7));
    if (!(std::abs(glm::length(q) - 1.0) < 1e-3)) line.fail("the quaternion is not of unit length");
    const glm::dmat3 camera_from_world = glm::mat3_cast(glm::normalize(q));
    const glm::dmat3 world_from_camera = glm::transpose(camera_from_world);
    camera.right = world_from_camera[0];
    camera.up = -world_from_camera[1];
    camera.forward = world_from_camera[2];
    camera.position_m = -(world_from_camera * t);
}

/// The pose lines of images.txt: every other one, since a picture without points has an empty line.
std::vector<Line> pictures(const fs::path& path)
{
    std::vector<Line> poses;
    const std::vector<Line> lines = linesOf(path);
    for (std::size_t i = 0; i < lines.size(); i += 2) {
        if (lines[i].words.empty()) break;
        if (lines[i].words.size() < 10)
            lines[i].fail("is no picture: IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME");
        poses.push_back(lines[i]);
    }
    if (poses.empty()) throw InputError(path.string(), "holds no picture");
    return poses;
}

/// NAME may hold spaces: the rest of the line.
std::string nameOf(const Line& line)
{
    std::string name = line.words[9];
    for (std::size_t i = 10; i < line.words.size(); ++i)
        name += " " + line.words[i];
    return name;
}

const Line& chosen(const std::vector<Line>& poses, const std::string& picture)
{
    if (picture.empty() || poses.size() == 1) return poses.front();
    for (const Line& line : poses)
        if (nameOf(line) == picture) return line;
    throw InputError(
        poses.front().file,
        fmt::format(
            "holds no picture \"{}\"; its first is \"{}\"", picture, nameOf(poses.front())));
}

}  // namespace

CameraEstimate readColmap(const fs::path& cameras_file, const std::string& picture)
{
    const std::vector<Line> poses = pictures(cameras_file.parent_path() / "images.txt");
    const Line& pose = chosen(poses, picture);
    CameraEstimate estimate;
    bool found = false;
    for (const Line& line : linesOf(cameras_file)) {
        if (line.words.empty()) continue;
        if (line.words.size() < 5) line.fail("is no camera: CAMERA_ID MODEL WIDTH HEIGHT PARAMS");
        if (line.words[0] != pose.words[8]) continue;
        readIntrinsics(line, estimate);
        found = true;
        break;
    }
    if (!found)
        throw InputError(cameras_file.string(),
                         fmt::format("holds no camera {}, which images.txt names for \"{}\"",
                                     pose.words[8],
                                     nameOf(pose)));
    readPose(pose, estimate.camera);
    estimate.findings.push_back(
        {Severity::Info,
         "camera-imported",
         fmt::format("from COLMAP, picture \"{}\"; its world is taken as it is, which must be Y up "
                     "and in metres",
                     nameOf(pose))});
    if (poses.size() > 1 && picture.empty())
        estimate.findings.push_back({Severity::Warning,
                                     "camera-several",
                                     fmt::format("images.txt holds {} pictures; the camera of the "
                                                 "first, \"{}\", is taken",
                                                 poses.size(),
                                                 nameOf(pose))});
    return estimate;
}

Findings writeColmap(const fs::path& cameras_file,
                     const Camera& camera,
                     const std::string& picture_name)
{
    const glm::dmat3 world_from_camera(camera.right, -camera.up, camera.forward);
    const glm::dmat3 camera_from_world = glm::transpose(world_from_camera);
    glm::dquat q = glm::normalize(glm::quat_cast(camera_from_world));
    if (q.w < 0.0) q = -q;
    const glm::dvec3 t = -(camera_from_world * camera.position_m);
    const fs::path folder = cameras_file.parent_path();
    const PolynomialMatch lens = polynomialOf(camera);
    const std::string parameters = fmt::format("{} {} {:.17g} {:.17g} {:.17g} {:.17g}",
                                               camera.width,
                                               camera.height,
                                               camera.focal_px.x,
                                               camera.focal_px.y,
                                               camera.principal_px.x,
                                               camera.principal_px.y);
    writeTextFile(cameras_file,
                  "# CAMERA_ID MODEL WIDTH HEIGHT PARAMS[]\n" +
                      (camera.division == 0.0
                           ? "1 PINHOLE " + parameters + "\n"
                           : fmt::format("1 OPENCV {} {:.17g} 0 0 0\n", parameters, lens.k1)));
    writeTextFile(folder / "images.txt",
                  fmt::format("# IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME\n"
                              "# POINTS2D[] as (X Y POINT3D_ID)\n"
                              "1 {:.17g} {:.17g} {:.17g} {:.17g} {:.17g} {:.17g} {:.17g} 1 {}\n\n",
                              q.w,
                              q.x,
                              q.y,
                              q.z,
                              t.x,
                              t.y,
                              t.z,
                              picture_name));
    writeTextFile(folder / "points3D.txt",
                  "# POINT3D_ID X Y Z R G B ERROR TRACK[] as (IMAGE_ID POINT2D_IDX)\n");
    if (camera.division == 0.0) return {};
    return {
        {lens.worst_px > 0.5 ? Severity::Warning : Severity::Info,
         "camera-distortion-converted",
         fmt::format("the lens' division model λ = {:.4f} became k1 = {:.4f}, which agrees with "
                     "it at the corners and within {:.2f} px elsewhere",
                     camera.division,
                     lens.k1,
                     lens.worst_px)}};
}

}  // namespace insitu::foreign
