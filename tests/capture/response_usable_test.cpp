// A response serves in both directions: what is recovered by it is put back by it.
#include "capture/alignment.h"
#include "capture/response_recovery.h"
#include "tests/capture/synthetic_bracket.h"
#include "tests/support/data.h"

#include <gtest/gtest.h>

#include <cmath>

namespace insitu {
namespace {

/// Rise of ln exposure between two codes.
double rise(const ResponseCurve& curve, std::size_t channel, std::size_t from, std::size_t to)
{
    return std::log(curve.exposure[channel][to] / curve.exposure[channel][from]);
}

SyntheticCamera sameCurveForAll()
{
    SyntheticCamera camera;
    camera.curve = [](int, double e) { return std::pow(e, 0.45); };
    camera.read_variance = 1e-5;
    camera.shot_variance = 1e-3;
    return camera;
}

// Five cut-outs of a ball by a telephone: few places show bright codes, and a table without
// smoothness predicts them best, in steps that hold 40 codes.
TEST(UsableResponse, HasNoPlateaus)
{
    INSITU_NEEDS_DATA();
    std::vector<std::filesystem::path> files;
    for (const int part : {25, 60, 125, 200, 500})
        files.push_back(dataFolder() / "brackets" / "ball_uiuc_office" /
                        fmt::format("cp_t{}.jpg", part));
    const Bracket cut = readBracket(files, {}, FrameSizes::HandCut);
    const Bracket bracket = applyAlignment(cut, alignBracket(cut));
    const ResponseCurve curve = recoverResponse(bracket, {}).curve;
    for (std::size_t c = 0; c < 3; ++c)
        for (std::size_t z = 16; z + 12 <= 250; ++z)
            EXPECT_GT(rise(curve, c, z, z + 12), 0.02) << "channel " << c << ", code " << z;
}

// What no channel shows is continued alike in all: a grey there is as grey as below.
TEST(UsableResponse, GreysStayGreyBeyondWhatTheBracketShows)
{
    const Bracket bracket =
        photograph(tiles(160, 160, 10, 0.002, 0.5), {1.0, 0.5, 0.25, 0.125}, sameCurveForAll());
    for (const ResponseMethod method : {ResponseMethod::Debevec, ResponseMethod::Basis}) {
        ResponseOptions options;
        options.method = method;
        const ResponseCurve curve = recoverResponse(bracket, options).curve;
        const double green = rise(curve, 1, 190, 250);
        for (const std::size_t c : {0u, 2u})
            EXPECT_NEAR(rise(curve, c, 190, 250), green, 0.1 * green)
                << responseMethodName(method) << " " << c;
    }
}

}  // namespace
}  // namespace insitu
