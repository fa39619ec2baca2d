#include "lighting/see_through.h"

#include "core/parallel.h"

#include <gtest/gtest.h>

#include <functional>

namespace insitu {
namespace {

const Rgb kRoomColor(0.4f, 0.45f, 0.5f);
const Rgb kWood(0.3f, 0.15f, 0.06f);

/// A room of one colour with a table's box, and a camera that looks at it.
struct Table {
    SceneProxy proxy;
    FaceGrid<Rgb> radiance;
    std::vector<std::uint8_t> known;
    Camera camera = Camera::lookAt({0.0, 1.4, 1.8}, {0.0, 0.4, -1.0}, 120.0, 160, 120);

    static RoomDescription room()
    {
        RoomDescription description;
        description.boxes.push_back({{-2, 0, -3}, {2, 2.5, 2}, false, ""});
        description.boxes.push_back({{-0.6, 0, -1.5}, {0.6, 0.8, -0.6}, true, "table"});
        return description;
    }
    Table() : proxy(room()), radiance(proxy, 0.05), known(radiance.size(), 1)
    {
        for (std::size_t i = 0; i < radiance.size(); ++i) {
            radiance[i] = kRoomColor;
            radiance.setValid(i, true);
        }
    }
    [[nodiscard]] bool onBox(int x, int y) const
    {
        const auto hit =
            proxy.intersect(camera.position_m, camera.rayDirection({x + 0.5, y + 0.5}));
        return hit && proxy.faces()[hit->face].solid;
    }
    [[nodiscard]] Image<Rgb> photograph(const std::function<bool(int, int)>& wood) const
    {
        Image<Rgb> picture(camera.width, camera.height, kRoomColor);
        for (int y = 0; y < camera.height; ++y)
            for (int x = 0; x < camera.width; ++x)
                // Darker below the table, as floors are.
                picture(x, y) = onBox(x, y) ? (wood(x, y) ? kWood : 0.5f * kRoomColor) : kRoomColor;
        return picture;
    }
    [[nodiscard]] Image<std::uint8_t> look(const std::function<bool(int, int)>& wood) const
    {
        return findSeeThrough(camera, photograph(wood), proxy, radiance, known);
    }
};

TEST(SeeThrough, PixelsOfTheColorBehindSeeThrough)
{
    const Table table;
    const auto leg = [](int x, int) { return x / 20 % 2 == 0; };
    const Image<std::uint8_t> through = table.look(leg);
    int open = 0;
    for (int y = 0; y < 120; ++y)
        for (int x = 0; x < 160; ++x) {
            // The window of two pixels each way mixes colours where they meet.
            const bool inner = x % 20 >= 3 && x % 20 < 17 && table.onBox(x, y - 3) &&
                               table.onBox(x, y + 3) && table.onBox(x - 3, y) &&
                               table.onBox(x + 3, y);
            if (!table.onBox(x, y)) {
                ASSERT_EQ(through(x, y), 0) << x << ", " << y;
            }
            if (!inner) continue;
            ASSERT_EQ(through(x, y) != 0, !leg(x, y)) << x << ", " << y;
            open += through(x, y);
        }
    EXPECT_GT(open, 200);
}

TEST(SeeThrough, ABoxOfTheColorBehindItIsSolid)
{
    const Table table;
    for (const std::uint8_t pixel : table.look([](int, int) { return false; }).pixels())
        ASSERT_EQ(pixel, 0);
}

TEST(SeeThrough, WhatNobodyKnowsIsNotSeen)
{
    Table table;
    table.known.assign(table.known.size(), 0);
    for (const std::uint8_t pixel : table.look([](int x, int) { return x % 40 < 20; }).pixels())
        ASSERT_EQ(pixel, 0);
}

TEST(SeeThrough, SameForAnyNumberOfThreads)
{
    const Table table;
    const auto wood = [](int x, int y) { return (x + y) % 30 < 15; };
    setThreadCount(1);
    const Image<std::uint8_t> one = table.look(wood);
    setThreadCount(4);
    EXPECT_EQ(table.look(wood), one);
    setThreadCount(0);
}

TEST(SeeThrough, TheRayGoesOnBehindTheBox)
{
    const Table table;
    const auto hit = intersectBehindBoxes(table.proxy, {0.0, 0.4, 1.5}, {0, 0, -1});
    ASSERT_TRUE(hit);
    EXPECT_NEAR(hit->distance_m, 4.5, 1e-9);
    EXPECT_FALSE(table.proxy.faces()[hit->face].solid);
}

}  // namespace
}  // namespace insitu
