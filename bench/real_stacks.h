#pragma once

#include "capture/bracket.h"

#include <filesystem>
#include <string>
#include <vector>

namespace insitu::bench {

/// A real bracket on which exposures are held out.
struct Stack {
    std::string name;
    Bracket bracket;
    Image<std::uint8_t> mask;
};

/// memorial16, piccante_desk_room and the ball of ball_xuyiwen_meetingroom, cut from the full
/// frames; `data` is the folder of the captures.
[[nodiscard]] std::vector<Stack> readStacks(const std::filesystem::path& data);

}  // namespace insitu::bench
