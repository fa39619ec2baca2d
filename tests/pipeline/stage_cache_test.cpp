#include "pipeline/stage_cache.h"

#include "core/check.h"
#include "core/io/file.h"
#include "pipeline/stage_parts.h"
#include "tests/support/temporary_folder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <limits>

namespace insitu {
namespace {

namespace fs = std::filesystem;

CapturedLight someLight()
{
    CapturedLight light;
    light.environment.pixels = Image<Rgb>(4, 2, Rgb(0.25f, 1e-30f, 7e9f));
    light.environment.pixels(3, 1) = Rgb(1.0f / 3.0f);
    light.center_m = {0.1, -2.0, 3e-7};
    light.response = ResponseCurve::srgb();
    light.response_known = true;
    light.metadata.make = "A maker";
    light.metadata.exposure.iso = 400.0;
    light.metadata.exif = {0, 255, 7};
    light.findings = {{Severity::Warning, "merge-clipped", "too bright"}, {}};
    return light;
}

void expectEqual(const CapturedLight& a, const CapturedLight& b)
{
    EXPECT_EQ(a.environment.pixels, b.environment.pixels);
    EXPECT_EQ(a.center_m, b.center_m);
    EXPECT_EQ(a.response.exposure, b.response.exposure);
    EXPECT_EQ(a.response.source, b.response.source);
    EXPECT_EQ(a.response_known, b.response_known);
    EXPECT_EQ(a.radiance_unit_known, b.radiance_unit_known);
    EXPECT_EQ(a.metadata.make, b.metadata.make);
    EXPECT_EQ(a.metadata.exposure.iso, b.metadata.exposure.iso);
    EXPECT_EQ(a.metadata.exposure.seconds, b.metadata.exposure.seconds);
    EXPECT_EQ(a.metadata.exif, b.metadata.exif);
    ASSERT_EQ(a.findings.size(), b.findings.size());
    EXPECT_EQ(a.findings[0].code, b.findings[0].code);
    EXPECT_EQ(a.findings[0].severity, b.findings[0].severity);
}

fs::path onlyFile(const fs::path& folder)
{
    return fs::directory_iterator(folder)->path();
}

TEST(StageCache, GivesBackWhatWasKept)
{
    const TemporaryFolder folder;
    StageCache cache(folder / "new");
    const ContentKey key("light");
    EXPECT_FALSE(cache.find<CapturedLight>(key));
    cache.keep(key, someLight());
    const auto kept = cache.find<CapturedLight>(key);
    ASSERT_TRUE(kept);
    expectEqual(*kept, someLight());
    EXPECT_FALSE(cache.find<CapturedLight>(ContentKey("render")));
    EXPECT_TRUE(cache.findings().empty());
}

TEST(StageCache, WithoutAFolderKeepsNothing)
{
    StageCache cache;
    cache.keep(ContentKey("light"), someLight());
    EXPECT_FALSE(cache.find<CapturedLight>(ContentKey("light")));
    EXPECT_TRUE(cache.findings().empty());
}

TEST(StageCache, DamagedFilesCountAsAbsent)
{
    const TemporaryFolder folder;
    const ContentKey key("light");
    const std::string good = [&] {
        StageCache cache(folder.path());
        cache.keep(key, someLight());
        const auto bytes = readFile(onlyFile(folder.path()));
        return std::string(bytes.begin(), bytes.end());
    }();
    const fs::path file = onlyFile(folder.path());
    const std::string name = file.filename().string();
    const StageCache cache(folder.path());
    std::string flipped = good;
    flipped[good.size() / 2] = static_cast<char>(flipped[good.size() / 2] ^ 1);
    for (const std::string& bad :
         {flipped, good.substr(0, good.size() - 1), std::string("short")}) {
        folder.add(name, bad);
        EXPECT_FALSE(cache.find<CapturedLight>(key));
    }
    folder.add(name, good);
    EXPECT_TRUE(cache.find<CapturedLight>(key));
}

TEST(StageCache, RemovesTheOldestBeyondItsLimit)
{
    const TemporaryFolder folder;
    const std::string megabyte(1 << 20, 'x');
    StageCache cache(folder.path(), 5 << 19);  // 2.5 MiB
    const auto now = fs::file_time_type::clock::now();
    for (int i = 0; i < 3; ++i) {
        const ContentKey key(std::to_string(i));
        cache.keep(key, megabyte);
        const fs::path file = folder / (key.text() + ".stage");
        if (fs::exists(file)) fs::last_write_time(file, now - std::chrono::hours(10 - i));
    }
    EXPECT_FALSE(cache.find<std::string>(ContentKey("0")));
    EXPECT_TRUE(cache.find<std::string>(ContentKey("1")));
    EXPECT_TRUE(cache.find<std::string>(ContentKey("2")));
}

TEST(StageCache, AFolderThatCannotBeWrittenIsAFinding)
{
    const TemporaryFolder folder;
    folder.add("file", "x");
    StageCache cache(folder / "file/cache");
    cache.keep(ContentKey("light"), someLight());
    EXPECT_TRUE(hasFinding(cache.findings(), "cache-not-written"));
    EXPECT_FALSE(cache.find<CapturedLight>(ContentKey("light")));
}

TEST(ContentKey, DependsOnEveryValueAndOnTheirBorders)
{
    const TemporaryFolder folder;
    const auto text = [](auto... values) { return ContentKey("s").add(values...).text(); };
    EXPECT_EQ(text(1, 2.0), text(1, 2.0));
    EXPECT_NE(text(1, 2.0), text(2, 2.0));
    EXPECT_NE(text(std::string("ab"), std::string("c")), text(std::string("a"), std::string("bc")));
    EXPECT_NE(text(std::optional<int>()), text(std::optional<int>(0)));
    EXPECT_NE(text(Image<float>(2, 3)), text(Image<float>(3, 2)));
    EXPECT_NE(ContentKey("s").text(), ContentKey("t").text());

    const auto ofFile = [&](const char* bytes) {
        return ContentKey("s").addFile(folder.add("f", bytes)).text();
    };
    EXPECT_NE(ofFile("one"), ofFile("two"));
    EXPECT_THROW(ContentKey("s").addFile(folder / "none"), InputError);
}

TEST(ValueArchive, DataThatEndsEarlyTakesNoMemory)
{
    WritingSink written;
    const std::uint64_t huge = std::numeric_limits<std::uint64_t>::max();
    ValueArchive<WritingSink>{written}(huge);
    ReadingSink sink{written.bytes};
    std::vector<double> values;
    EXPECT_THROW((ValueArchive<ReadingSink>{sink}(values)), std::runtime_error);

    WritingSink image;
    const int side = 1 << 30;
    ValueArchive<WritingSink>{image}(side, side);
    ReadingSink image_sink{image.bytes};
    Image<Rgb> pixels;
    EXPECT_THROW((ValueArchive<ReadingSink>{image_sink}(pixels)), std::runtime_error);
}

}  // namespace
}  // namespace insitu
