#pragma once

#include "core/io/exif.h"
#include "core/io/image_io.h"
#include "tests/capture/synthetic_bracket.h"
#include "tests/cli/run_program.h"
#include "tests/support/temporary_folder.h"

#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

namespace insitu {

/// A bracket of tiles on disk, as PNG (no EXIF) or JPEG (with exposure times).
class MergeAndProbe : public testing::Test {
protected:
    void SetUp() override
    {
        SyntheticCamera camera;
        camera.curve = [](int, double e) { return std::pow(e, 0.45); };
        scene_ = tiles(160, 160, 8, 0.01, 20.0);
        const Bracket bracket = photograph(scene_, seconds_, camera);
        for (const BracketFrame& frame : bracket.frames) {
            PhotoMetadata metadata;
            metadata.exposure.seconds = frame.relative_exposure;
            const auto name = folder_ / (frame.name + ".jpg");
            writeEncoded(name, frame.image, makeExif(metadata));
            writeEncoded(folder_ / (frame.name + ".png"), frame.image);
        }
    }

    std::vector<std::string> command(const std::string& name,
                                     const std::string& extension,
                                     std::vector<std::string> more) const
    {
        std::vector<std::string> arguments = {name};
        for (std::size_t k = 0; k < seconds_.size(); ++k)
            arguments.push_back((folder_ / fmt::format("frame_{}{}", k, extension)).string());
        arguments.insert(arguments.end(), more.begin(), more.end());
        return arguments;
    }
    std::string file(const std::string& name) const { return (folder_ / name).string(); }

    TemporaryFolder folder_;
    Image<Rgb> scene_;
    std::vector<double> seconds_ = {1.0, 0.5, 0.25, 0.125, 1.0 / 16};
};

}  // namespace insitu
