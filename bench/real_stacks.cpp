#include "bench/real_stacks.h"

#include "core/io/image_io.h"

#include <fmt/format.h>

#include <cmath>

namespace insitu::bench {

namespace {

namespace fs = std::filesystem;

BracketFrame readFrame(const fs::path& file, double seconds)
{
    BracketFrame frame;
    frame.name = file.filename().string();
    frame.image = readPhoto(file).image;
    frame.relative_exposure = seconds;
    return frame;
}

/// The pure blue border of shifted frames is no picture: masked, and a margin around it.
Stack readMemorial(const fs::path& data)
{
    Stack stack{"memorial16", {}, {}};
    std::vector<BracketFrame> frames;
    for (int k = 0; k < 16; ++k)
        frames.push_back(
            readFrame(data / fmt::format("brackets/memorial16/memorial00{}.png", 61 + k),
                      32.0 * std::pow(0.5, k)));
    const int width = frames.front().image.codes.width();
    const int height = frames.front().image.codes.height();
    // Only the rectangle that no frame's border touches: the methods are to see no border either.
    int left = 0;
    int right = width;
    int top = 0;
    int bottom = height;
    for (const BracketFrame& frame : frames) {
        const auto blue = [&](int x, int y) {
            const glm::u16vec3 p = frame.image.codes(x, y);
            return p.b > 250 && p.r < 5 && p.g < 5;
        };
        while (left < width / 3 && blue(left, height / 2))
            ++left;
        while (right > 2 * width / 3 && blue(right - 1, height / 2))
            --right;
        while (top < height / 3 && blue(width / 2, top))
            ++top;
        while (bottom > 2 * height / 3 && blue(width / 2, bottom - 1))
            --bottom;
    }
    constexpr int kMargin = 8;
    left += kMargin;
    top += kMargin;
    right -= kMargin;
    bottom -= kMargin;
    for (BracketFrame& frame : frames) {
        Image<glm::u16vec3> inner(right - left, bottom - top);
        for (int y = top; y < bottom; ++y)
            for (int x = left; x < right; ++x)
                inner(x - left, y - top) = frame.image.codes(x, y);
        frame.image.codes = std::move(inner);
    }
    stack.bracket = makeBracket(std::move(frames));
    return stack;
}

Stack readDesk(const fs::path& data)
{
    Stack stack{"piccante_desk_room", {}, {}};
    std::vector<fs::path> files;
    for (int k = 0; k < 7; ++k)
        files.push_back(data / fmt::format("brackets/piccante_desk_room/stack_room_exp_{}.jpg", k));
    stack.bracket = readBracket(files);
    return stack;
}

/// The ball cut from the full frames, the same pixels in each.
Stack readMeetingRoom(const fs::path& data)
{
    constexpr int kLeft = 3159 - 760;
    constexpr int kTop = 1833 - 760;
    constexpr int kSide = 1520;
    Stack stack{"ball_xuyiwen_meetingroom", {}, {}};
    std::vector<BracketFrame> frames;
    for (const int t : {20, 40, 80, 160, 250, 320, 3200, 4000}) {
        BracketFrame frame =
            readFrame(data / fmt::format("brackets/ball_xuyiwen_meetingroom/t{}.jpg", t), 1.0 / t);
        Image<glm::u16vec3> ball(kSide, kSide);
        for (int y = 0; y < kSide; ++y)
            for (int x = 0; x < kSide; ++x)
                ball(x, y) = frame.image.codes(kLeft + x, kTop + y);
        frame.image.codes = std::move(ball);
        frames.push_back(std::move(frame));
    }
    stack.bracket = makeBracket(std::move(frames));
    return stack;
}

}  // namespace

std::vector<Stack> readStacks(const fs::path& data)
{
    return {readMemorial(data), readDesk(data), readMeetingRoom(data)};
}

}  // namespace insitu::bench
