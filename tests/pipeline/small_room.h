#pragma once

#include "core/io/image_io.h"
#include "core/io/json.h"
#include "core/parallel.h"
#include "core/progress.h"
#include "pipeline/simulated_room.h"
#include "tests/support/errors.h"
#include "tests/support/temporary_folder.h"

#include <gtest/gtest.h>

#include <fstream>
#include <functional>
#include <string>

namespace insitu {

/// A small furnished room with a window, written into a folder of its own.
class SimulateRoom : public ::testing::Test {
protected:
    void SetUp() override
    {
        std::ofstream(folder_ / "tent.obj")
            << "v -50 0 -50\nv 50 0 -50\nv 50 0 50\nv -50 0 50\nv 0 80 0\n"
               "f 1 2 3 4\nf 1 5 2\nf 2 5 3\nf 3 5 4\nf 4 5 1\n";
        Image<Rgb> sky(16, 8, Rgb(0.5f, 0.7f, 1.0f));
        writeRadiance(folder_ / "sky.exr", sky);
    }
    void TearDown() override { setThreadCount(0); }

    [[nodiscard]] static Json good()
    {
        return Json::parse(R"({
          "format": "insitu-room", "version": 1,
          "room": {"min_m": [-2, 0, -2], "max_m": [2, 2.5, 3],
            "surfaces": {
              "floor": {"color_linear": [0.4, 0.25, 0.15], "size_m": 0.5,
                        "checker": {"second_linear": [0.3, 0.2, 0.1]}},
              "ceiling": {"color_linear": [0.8, 0.8, 0.8]},
              "left": {"color_linear": [0.7, 0.7, 0.6]}, "right": {"color_linear": [0.7, 0.7, 0.6]},
              "back": {"color_linear": [0.6, 0.7, 0.7]}, "front": {"color_linear": [0.7, 0.7, 0.6]}}},
          "windows": [{"wall": "left", "from_m": [-1, 0.8], "to_m": [1, 2.2]}],
          "environment": {"image": "sky.exr", "gain": [2, 2, 2]},
          "lamps": [{"corner_m": [0.5, 2.49, 0], "edge_u_m": [0.5, 0, 0], "edge_v_m": [0, 0, 0.5],
                     "radiance": [3, 2.5, 2]}],
          "boxes": [{"name": "crate", "min_m": [0.8, 0, -1.6], "max_m": [1.5, 0.6, -1],
                     "surface": {"color_linear": [0.3, 0.5, 0.3]}}],
          "furniture": [{"model": "tent.obj", "position_m": [-1.2, 0, -1.2], "scale": 0.01,
                         "matte": true}],
          "camera": {"position_m": [1.1, 1.4, 2.6], "target_m": [-0.1, 0.6, -0.5],
                     "focal_px": 52, "width": 64, "height": 48},
          "object": {"model": "tent.obj", "pivot": "bottom-center", "position_m": [0, 0, 0],
                     "scale": 0.008,
                     "material": {"base_color_linear": [0.5, 0.1, 0.1], "specular": 0}},
          "ball": {"center_m": [0, 0.4, 0], "radius_m": 0.06, "view_position_m": [0.4, 0.6, 1],
                   "size_px": 48},
          "photography": {"ball_seconds": [0.5, 0.03125]},
          "render": {"samples_per_pixel": 4, "ball_samples_per_pixel": 16,
                     "panorama_samples_per_pixel": 16, "panorama_width": 32},
          "seed": 3})");
    }

    [[nodiscard]] SimulatedRoom read(const Json& json) const
    {
        std::ofstream(folder_ / "room.json") << json.dump();
        return readSimulatedRoom(folder_ / "room.json");
    }

    [[nodiscard]] std::string complaint(const std::function<void(Json&)>& change) const
    {
        Json json = good();
        change(json);
        return inputErrorOf([&] { (void)read(json); });
    }

    TemporaryFolder folder_;
    Progress silent_;
};

}  // namespace insitu
