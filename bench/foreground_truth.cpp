// foreground_truth ROOM_JSON FOLDER [SIZE SAMPLES]: a box is put before the object of a simulated
// room, which is rendered and photographed with and without the object. Inserts the object with the
// box unknown, as a solid box of the project, and as an outline of the photograph, and compares.
// The pictures go into FOLDER, the capture and what each way makes of it (box-unknown.png …).
// "Inside" is where the box stands before everything; the object's shadow may fall on it.

#include "core/io/image_io.h"
#include "pipeline/insert.h"
#include "pipeline/simulate.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <string>

namespace insitu {
namespace {

const RoomBox kOccluder{{0.35, 0.0, 0.95}, {0.75, 0.6, 1.15}, true, "stool"};

/// Outline of the box in the picture: convex hull of its corners, counter-clockwise.
std::vector<glm::dvec2> outlineOf(const Camera& camera)
{
    std::vector<glm::dvec2> points;
    for (int corner = 0; corner < 8; ++corner) {
        const glm::dvec3 at(corner & 1 ? kOccluder.max_m.x : kOccluder.min_m.x,
                            corner & 2 ? kOccluder.max_m.y : kOccluder.min_m.y,
                            corner & 4 ? kOccluder.max_m.z : kOccluder.min_m.z);
        points.push_back(*camera.project(at));
    }
    std::sort(points.begin(), points.end(), [](glm::dvec2 a, glm::dvec2 b) {
        return a.x < b.x || (a.x == b.x && a.y < b.y);
    });
    std::vector<glm::dvec2> hull;
    for (int side = 0; side < 2; ++side) {
        const std::size_t begin = hull.size();
        for (const glm::dvec2 p : points) {
            while (hull.size() >= begin + 2) {
                const glm::dvec2 a = hull[hull.size() - 1] - hull[hull.size() - 2];
                const glm::dvec2 b = p - hull.back();
                if (a.x * b.y - a.y * b.x > 0.0) break;
                hull.pop_back();
            }
            hull.push_back(p);
        }
        hull.pop_back();
        std::reverse(points.begin(), points.end());
    }
    return hull;
}

/// The same, marked by an unsteady hand: every corner off by up to this many pixels.
std::vector<glm::dvec2> marked(std::vector<glm::dvec2> outline, double off)
{
    RandomStream random(61, 0, 0);
    for (glm::dvec2& corner : outline)
        corner += off * (2.0 * glm::dvec2(random.uniformDouble(), random.uniformDouble()) - 1.0);
    return outline;
}

struct Judge {
    const EncodedImage& plate;
    const EncodedImage& truth;
    const Image<float>& object;    ///< where it is seen or would be
    const Image<float>& occluder;  ///< exact coverage
    Image<float> near;             ///< edge of the occluder
    std::filesystem::path folder;

    void report(const std::string& name, const EncodedImage& picture) const
    {
        std::string file = name + ".png";
        std::replace(file.begin(), file.end(), ' ', '-');
        writeEncoded(folder / file, picture);
        double inside = 0.0, edge = 0.0, shown = 0.0;
        int inside_count = 0, edge_count = 0, shown_count = 0, touched = 0;
        for (std::size_t i = 0; i < truth.codes.pixelCount(); ++i) {
            const glm::dvec3 off =
                glm::dvec3(picture.codes.pixels()[i]) - glm::dvec3(truth.codes.pixels()[i]);
            const double square = glm::dot(off, off) / 3.0;
            const float m = occluder.pixels()[i];
            const bool sure = m >= 1.0f && near.pixels()[i] <= 0.0f;
            if (sure) {
                inside += square;
                ++inside_count;
                touched += picture.codes.pixels()[i] != plate.codes.pixels()[i] ? 1 : 0;
            } else if (near.pixels()[i] > 0.0f) {
                edge += square;
                ++edge_count;
            } else if (object.pixels()[i] > 0.5f) {
                shown += square;
                ++shown_count;
            }
        }
        const auto rms = [](double sum, int count) { return std::sqrt(sum / std::max(1, count)); };
        fmt::print(
            "{:40} inside {:6.2f} codes rms, {:5} of {} pixels changed; edge {:6.2f} ({} "
            "px); object beside {:6.2f}\n",
            name,
            rms(inside, inside_count),
            touched,
            inside_count,
            rms(edge, edge_count),
            edge_count,
            rms(shown, shown_count));
    }
};

void run(const std::filesystem::path& room_file,
         const std::filesystem::path& folder,
         double size,
         int samples)
{
    SimulatedRoom room = readSimulatedRoom(room_file);
    SimulatedSurface green;
    green.color_linear = {0.06f, 0.16f, 0.09f};
    room.boxes.push_back({kOccluder, green, true});
    room.samples_per_pixel = room.ball_samples_per_pixel = room.panorama_samples_per_pixel =
        samples;
    room = resized(room, size);
    Progress silent;
    const SimulatedCapture capture = simulate(room, silent);
    std::filesystem::create_directories(folder);
    writeCapture(capture, room, folder);

    const Project with_box = readProject(folder / "project.json");
    Project without = with_box;
    std::erase_if(without.room.boxes, [](const RoomBox& box) { return box.name == "stool"; });
    // Marked on the photograph, in the true camera's picture.
    const std::vector<glm::dvec2> outline = outlineOf(room.camera);
    ForegroundMark exact;
    exact.polygon_px = outline;
    exact.feather_px = 0.0;
    const Image<float> occluder = foregroundCoverage(exact, capture.plate.image);
    exact.feather_px = 1.3;
    Image<float> near = foregroundCoverage(exact, capture.plate.image);
    for (float& value : near.pixels())
        value = value > 1e-3f && value < 1.0f - 1e-3f ? 1.0f : 0.0f;
    const Judge judge{
        capture.plate.image, capture.with.image, capture.truth.coverage, occluder, near, folder};

    InsertOptions options;
    options.render.max_samples = 24;
    options.render.min_samples = 8;
    options.render.interreflection.samples_per_cell = 64;
    judge.report("nothing inserted", capture.plate.image);
    judge.report("box unknown", insertObjects(without, options, silent).composite.image);
    judge.report("solid box of the room", insertObjects(with_box, options, silent).composite.image);
    const auto withMark = [&](Project project, double off, int refine) {
        ForegroundMark mark;
        mark.polygon_px = marked(outline, off);
        mark.refine_px = refine;
        project.foreground = {{mark, {}}};
        return project;
    };
    judge.report("outline, exact",
                 insertObjects(withMark(without, 0.0, 0), options, silent).composite.image);
    judge.report("outline, corners 2 px off",
                 insertObjects(withMark(without, 2.0, 0), options, silent).composite.image);
    judge.report("outline, 2 px off, refined",
                 insertObjects(withMark(without, 2.0, 6), options, silent).composite.image);
    judge.report("outline and solid box",
                 insertObjects(withMark(with_box, 0.0, 0), options, silent).composite.image);
}

}  // namespace
}  // namespace insitu

int main(int count, char** arguments)
{
    if (count != 3 && count != 5) {
        fmt::print(stderr, "foreground_truth ROOM_JSON FOLDER [SIZE SAMPLES]\n");
        return 2;
    }
    try {
        insitu::run(arguments[1],
                    arguments[2],
                    count == 5 ? std::stod(arguments[3]) : 0.4,
                    count == 5 ? std::stoi(arguments[4]) : 32);
    } catch (const std::exception& error) {
        fmt::print(stderr, "{}\n", error.what());
        return 1;
    }
    return 0;
}
