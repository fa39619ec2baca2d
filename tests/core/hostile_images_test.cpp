#include "core/io/byte_writer.h"
#include "core/io/exif.h"
#include "core/io/file.h"
#include "core/io/image_io.h"
#include "core/io/image_path.h"
#include "core/random.h"
#include "tests/support/data.h"
#include "tests/support/dng_writer.h"
#include "tests/support/temporary_folder.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <set>

namespace insitu {
namespace {

namespace fs = std::filesystem;

/// Enough for every honest file among the hostile ones; larger ones must be refused unread.
constexpr std::int64_t kPixelLimit = 4'000'000;
/// Far above what any of them takes, even with sanitizers: a hang is what must not pass.
constexpr double kSecondsPerFile = 20.0;

/// By extension; the files of some collections have none.
bool mayBeImage(const fs::path& path)
{
    static const std::set<std::string> extensions = {
        "", ".exr", ".hdr", ".pic", ".pfm", ".png", ".jpg", ".jpeg", ".tif", ".tiff", ".dng"};
    return extensions.contains(lowerCaseExtension(path));
}

enum class Outcome { Read, Refused };

/// Either a valid image or an InputError; any other exception fails the test.
Outcome readAs(bool radiance, const fs::path& path)
{
    try {
        if (radiance) {
            const Image<Rgb> pixels = readRadiance(path, kPixelLimit).pixels;
            for (const Rgb& pixel : pixels.pixels())
                for (int c = 0; c < 3; ++c)
                    if (!std::isfinite(pixel[c]) || pixel[c] < 0.0f)
                        ADD_FAILURE() << path << " gave " << pixel[c];
        } else {
            const Photo photo = readPhoto(path, kPixelLimit);
            EXPECT_GT(photo.image.codes.pixelCount(), 0u) << path;
        }
        return Outcome::Read;
    } catch (const InputError& error) {
        // Messages name the file first and stay on a screen.
        EXPECT_TRUE(std::string_view(error.what()).starts_with(path.string())) << error.what();
        EXPECT_LT(std::string_view(error.what()).size(), 1500u);
        return Outcome::Refused;
    } catch (const std::exception& error) {
        ADD_FAILURE() << path << ": " << error.what();
        return Outcome::Refused;
    }
}

/// With the reader that the extension asks for; without one, with both.
Outcome readAnything(const fs::path& path)
{
    const Outcome outcome = readAs(isRadianceFile(path), path);
    if (outcome == Outcome::Read || path.has_extension()) return outcome;
    return readAs(/*radiance=*/true, path);
}

TEST(HostileImages, EveryCollectedFileIsReadOrRefused)
{
    INSITU_NEEDS_DATA();
    const fs::path folder = dataFolder() / ".." / "hostile";
    ASSERT_TRUE(fs::exists(folder)) << "the hostile files lie beside the captures: " << folder;
    std::vector<fs::path> files;
    for (const auto& entry : fs::recursive_directory_iterator(folder))
        if (entry.is_regular_file() && mayBeImage(entry.path())) files.push_back(entry.path());
    std::sort(files.begin(), files.end());
    EXPECT_GT(files.size(), 500u);
    int refused = 0;
    for (const fs::path& file : files) {
        const auto start = std::chrono::steady_clock::now();
        refused += readAnything(file) == Outcome::Refused ? 1 : 0;
        const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - start;
        EXPECT_LT(seconds.count(), kSecondsPerFile) << file;
    }
    std::printf("%zu files, %d refused\n", files.size(), refused);
    EXPECT_GT(refused, 200);  // a reader that accepts all of this checks nothing
}

/// Valid small files of every format, to be damaged.
std::vector<fs::path> makeSeeds(const TemporaryFolder& folder)
{
    EncodedImage image{Image<glm::u16vec3>(24, 18), 255};
    Image<Rgb> radiance(24, 18);
    for (int y = 0; y < 18; ++y)
        for (int x = 0; x < 24; ++x) {
            image.codes(x, y) = {10 * x, 12 * y, x < 12 ? 40 : 200};
            radiance(x, y) = Rgb(x + 1, y + 1, x < 12 ? 0.25f : 8.0f);
        }
    PhotoMetadata metadata;
    metadata.exposure = {0.01, 4.0, 100.0};
    metadata.make = "Insitu";
    const std::vector<std::uint8_t> exif = makeExif(metadata, 24, 18);
    writeEncoded(folder / "a.png", image, exif);
    writeEncoded(folder / "a.jpg", image, exif);
    image.max_code = 65535;
    writeEncoded(folder / "b.png", image);
    for (const char* name : {"a.exr", "a.hdr", "a.pfm"})
        writeRadiance(folder / name, radiance);
    DngPicture raw;
    raw.sensor = Image<glm::u16vec3>(32, 24, glm::u16vec3(900));  // LibRaw's smallest is 22
    (void)folder.add("a.dng", makeDng(raw));
    raw.bayer = false;
    (void)folder.add("b.dng", makeDng(raw));
    writeRadiance(folder / "b.exr", radiance, /*half=*/true);
    return {folder / "a.png",
            folder / "a.jpg",
            folder / "b.png",
            folder / "a.exr",
            folder / "a.hdr",
            folder / "a.pfm",
            folder / "a.dng",
            folder / "b.dng",
            folder / "b.exr"};
}

/// One of: some bytes overwritten, cut off, a stretch removed, a stretch repeated, extremes put in.
Bytes damaged(const Bytes& whole, RandomStream& random)
{
    const auto size = static_cast<std::uint32_t>(whole.size());
    const std::size_t at = random.below(size);
    const std::size_t length = std::min<std::size_t>(1 + random.below(32), size - at);
    const std::span<const std::uint8_t> bytes(whole);
    Bytes result;
    switch (random.below(5)) {
        case 0:
            result = whole;
            for (std::uint32_t i = 1 + random.below(6); i > 0; --i)
                result[random.below(size)] = static_cast<std::uint8_t>(random.below(256));
            break;
        case 1:
            append(result, bytes.first(at));
            break;
        case 2:
            append(result, bytes.first(at));
            append(result, bytes.subspan(at + length));
            break;
        case 3:
            append(result, bytes.first(at + length));
            append(result, bytes.subspan(at));
            break;
        default:
            result = whole;
            // Headers are where lies hurt: keep to the first part of the file.
            for (std::size_t i = 0; i < 4; ++i)
                result[std::min<std::size_t>(at % 400 + i, size - 1)] =
                    static_cast<std::uint8_t>(random.below(2) == 0 ? 0xFF : 0x7F);
            break;
    }
    return result;
}

TEST(HostileImages, MutationsAreReadOrRefused)
{
    const TemporaryFolder folder;
    RandomStream random(20101122, 0, 0);
    constexpr int kMutations = 200;
    constexpr int kRawMutations = 60;  // LibRaw fills tables for 20 ms, however small the picture
    for (const fs::path& seed : makeSeeds(folder)) {
        ASSERT_EQ(readAnything(seed), Outcome::Read) << seed;
        const Bytes whole = readFile(seed);
        const std::string name = "mutated" + seed.extension().string();
        const int mutations = seed.extension() == ".dng" ? kRawMutations : kMutations;
        int refused = 0;
        for (int i = 0; i < mutations; ++i) {
            const fs::path path = folder.add(name, damaged(whole, random));
            refused += readAnything(path) == Outcome::Refused ? 1 : 0;
        }
        EXPECT_GT(refused, mutations / 10) << seed;
    }
}

}  // namespace
}  // namespace insitu
