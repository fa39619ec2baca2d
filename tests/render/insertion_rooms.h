#pragma once

#include "lighting/room_light.h"
#include "render/renderer.h"

/// Rooms and lights that the tests of insertions share.
namespace insitu {

inline Progress g_silent;

inline EnvironmentMap uniform(float radiance)
{
    return {Image<Rgb>(128, 64, Rgb(radiance))};
}

inline RoomDescription closedRoom()
{
    RoomDescription room;
    room.boxes.push_back({{-2, 0, -3}, {2, 2.5, 2}, false, ""});
    return room;
}

/// Coarse enough for tests to be quick.
inline RoomLightOptions coarse()
{
    RoomLightOptions options;
    options.texel_m = 0.1;
    options.cell_m = 0.5;
    options.rays_per_cell = 64;
    return options;
}

/// Technique `fiv`, likewise.
inline InsertionOptions coarseFiv()
{
    InsertionOptions options;
    options.technique = Technique::Fiv;
    options.fiv.atlas = {16, 48, 2};
    options.fiv.object_face_size = 8;
    options.fiv.object_samples = 64;
    return options;
}

}  // namespace insitu
