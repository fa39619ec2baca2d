#include "core/io/raw_read.h"

#include "core/io/byte_view.h"
#include "core/io/encoded_header.h"
#include "core/io/exif.h"
#include "core/io/exif_tags.h"
#include "core/io/image_path.h"
#include "core/parallel.h"

#include <libraw/libraw.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <set>

namespace insitu {

namespace {

using namespace std::string_view_literals;

/// Lossless compression of noise takes more than this; black frames do not take less than that.
constexpr std::int64_t kLargestRatio = 4096;
constexpr int kFullScale = 65535;
/// Adaptive homogeneity-directed, LibRaw's number of it.
constexpr int kDemosaicAhd = 3;

/// Whether the first directory of a TIFF says that it is a DNG or holds mosaicked data.
bool isRawTiff(const ByteView& file)
{
    constexpr int kDngVersion = 50706;
    constexpr int kPhotometric = 262;
    constexpr int kColorFilterArray = 32803;
    constexpr int kLinearRaw = 34892;
    const std::size_t directory = file.u32(4);
    if (!file.contains(directory, 2)) return false;
    const std::size_t entries = file.u16(directory);
    for (std::size_t i = 0; i < entries; ++i) {
        const std::size_t entry = directory + 2 + 12 * i;
        if (!file.contains(entry, 12)) return false;
        const int tag = file.u16(entry);
        const int value = file.u16(entry + 8);
        if (tag == kDngVersion) return true;
        if (tag == kPhotometric && (value == kColorFilterArray || value == kLinearRaw)) return true;
    }
    return false;
}

void demand(int status, const std::string& path, const char* step)
{
    if (status == LIBRAW_SUCCESS) return;
    throw InputError(path, fmt::format("cannot be {} as RAW: {}", step, LibRaw::strerror(status)));
}

/// Multipliers that make the camera's white neutral; the largest is 1.
glm::dvec3 whiteBalance(const libraw_colordata_t& color)
{
    glm::dvec3 as_shot(color.cam_mul[0], color.cam_mul[1], color.cam_mul[2]);
    const auto sane = [](const glm::dvec3& m) {
        constexpr double kLargest = 100.0;
        const double least = std::min({m.r, m.g, m.b});
        const double most = std::max({m.r, m.g, m.b});
        return std::isfinite(most) && least > 0.0 && most < kLargest * least;
    };
    if (!sane(as_shot)) as_shot = {color.pre_mul[0], color.pre_mul[1], color.pre_mul[2]};
    if (!sane(as_shot)) as_shot = glm::dvec3(1.0);
    return as_shot / std::max({as_shot.r, as_shot.g, as_shot.b});
}

/// Linear Rec. 709 from channels that all saturate at 1.
ColorProfile rawColor(const libraw_colordata_t& color, const glm::dvec3& balance, bool grey)
{
    ColorProfile profile;
    profile.name = "the camera's own";
    profile.transfer_is_response = true;
    profile.transfer.source = "linear";
    for (auto& table : profile.transfer.exposure)
        for (std::size_t z = 0; z < table.size(); ++z)
            table[z] = static_cast<double>(z) / 255.0;
    if (grey) return profile;
    const double least = std::min({balance.r, balance.g, balance.b});
    glm::dmat3 camera;
    for (int row = 0; row < 3; ++row)
        for (int column = 0; column < 3; ++column)
            camera[column][row] = static_cast<double>(color.rgb_cam[row][column]);
    constexpr double kSmallestDeterminant = 1e-3;
    const double determinant = glm::determinant(camera);
    // A camera whose colours LibRaw does not know counts as one with Rec. 709 primaries.
    if (!std::isfinite(determinant) || std::abs(determinant) < kSmallestDeterminant)
        camera = glm::dmat3(1.0);
    for (int c = 0; c < 3; ++c)
        profile.rec709_from_linear[c] = camera[c] * (balance[c] / least);
    return profile;
}

PhotoMetadata rawMetadata(const LibRaw& raw)
{
    const auto known = [](double value) -> std::optional<double> {
        return std::isfinite(value) && value > 0.0 ? std::optional(value) : std::nullopt;
    };
    const auto text = [](const char* from) {
        std::string result(from);
        std::ranges::replace_if(
            result, [](char c) { return c < 0x20 || c > 0x7E; }, '?');
        return result;
    };
    const auto& data = raw.imgdata;
    PhotoMetadata metadata;
    metadata.exposure.seconds = known(data.other.shutter);
    metadata.exposure.f_number = known(data.other.aperture);
    metadata.exposure.iso = known(data.other.iso_speed);
    metadata.focal_mm = known(data.other.focal_len);
    metadata.focal_35mm = known(data.lens.FocalLengthIn35mmFormat);
    metadata.make = text(data.idata.make);
    metadata.model = text(data.idata.model);
    // LibRaw's three turns in EXIF's numbers.
    metadata.orientation = data.sizes.flip == 3   ? 3
                           : data.sizes.flip == 5 ? 8
                           : data.sizes.flip == 6 ? 6
                                                  : 1;
    return metadata;
}

void checkSize(const LibRaw& raw,
               std::size_t bytes,
               const std::string& path,
               std::int64_t max_pixels)
{
    const auto& sizes = raw.imgdata.sizes;
    const std::int64_t width = std::max(sizes.raw_width, sizes.width);
    const std::int64_t height = std::max(sizes.raw_height, sizes.height);
    checkImageSize(path, width, height, max_pixels);
    checkImageSize(path, sizes.width, sizes.height, max_pixels);
    if (2 * width * height / kLargestRatio > static_cast<std::int64_t>(bytes))
        throw InputError(path,
                         fmt::format("declares {}x{} pixels, which cannot be stored in {} bytes; "
                                     "the file is damaged or made to exhaust memory",
                                     width,
                                     height,
                                     bytes));
    if (raw.imgdata.idata.colors != 3 && raw.imgdata.idata.colors != 1)
        throw InputError(path,
                         fmt::format("is from a sensor of {} colours; three are read",
                                     raw.imgdata.idata.colors));
}

/// Everything that would make the result depend on the single picture is off.
void setParameters(libraw_output_params_t& params, std::int64_t max_pixels)
{
    constexpr std::int64_t kBytesPerPixel = 16;
    params.max_raw_memory_mb =
        static_cast<unsigned>(std::max<std::int64_t>(64, max_pixels * kBytesPerPixel >> 20));
    params.output_bps = 16;
    params.output_color = 0;  // the sensor's own
    params.gamm[0] = params.gamm[1] = 1.0;
    params.no_auto_bright = 1;
    params.adjust_maximum_thr = 0.0f;
    params.highlight = 1;  // nothing is cut off by the white balance
    params.use_auto_wb = 0;
    params.use_camera_wb = 0;  // user_mul is it
    params.user_flip = 0;
    params.user_qual = kDemosaicAhd;
}

Image<glm::u16vec3> takeCodes(LibRaw& raw, const std::string& path, const glm::dvec3& balance)
{
    const auto release = [](libraw_processed_image_t* image) { LibRaw::dcraw_clear_mem(image); };
    int status = LIBRAW_SUCCESS;
    const std::unique_ptr<libraw_processed_image_t, decltype(release)> picture(
        raw.dcraw_make_mem_image(&status), release);
    demand(status, path, "developed");
    if (!picture || picture->bits != 16 || (picture->colors != 3 && picture->colors != 1))
        throw InputError(path, "was developed to something other than 16-bit colour");
    Image<glm::u16vec3> codes(picture->width, picture->height);
    const auto* from = reinterpret_cast<const std::uint16_t*>(picture->data);
    const int channels = picture->colors;
    parallelFor(0, codes.height(), [&](std::int64_t row) {
        const std::uint16_t* pixel = from + row * codes.width() * channels;
        for (glm::u16vec3& to : codes.row(static_cast<int>(row))) {
            for (int c = 0; c < 3; ++c) {
                const double value = pixel[channels == 3 ? c : 0] / balance[c];
                to[c] = static_cast<std::uint16_t>(
                    std::lround(std::min(value, static_cast<double>(kFullScale))));
            }
            pixel += channels;
        }
    });
    return codes;
}

Photo develop(LibRaw& raw,
              std::span<const std::uint8_t> bytes,
              const std::string& path,
              std::int64_t max_pixels)
{
    auto& data = raw.imgdata;
    setParameters(data.params, max_pixels);
    demand(raw.open_buffer(const_cast<std::uint8_t*>(bytes.data()), bytes.size()), path, "opened");
    checkSize(raw, bytes.size(), path, max_pixels);
    Photo photo;
    photo.metadata = rawMetadata(raw);
    const bool grey = data.idata.colors == 1;
    const glm::dvec3 balance = grey ? glm::dvec3(1.0) : whiteBalance(data.color);
    for (int c = 0; c < 4; ++c)
        data.params.user_mul[c] = static_cast<float>(balance[c == 3 ? 1 : c]);
    const long* linear = data.color.linear_max;
    const long saturation = std::min({linear[0], linear[1], linear[2]});
    if (saturation > 0 && saturation < static_cast<long>(data.color.maximum))
        data.params.user_sat = static_cast<int>(saturation);
    demand(raw.unpack(), path, "unpacked");
    photo.metadata.color = rawColor(data.color, balance, grey);
    demand(raw.dcraw_process(), path, "developed");
    photo.image = {takeCodes(raw, path, balance), kFullScale};
    return photo;
}

}  // namespace

bool isRawFile(std::span<const std::uint8_t> bytes, const std::filesystem::path& path)
{
    static const std::set<std::string> tiff_like = {".nef",
                                                    ".nrw",
                                                    ".arw",
                                                    ".sr2",
                                                    ".srf",
                                                    ".pef",
                                                    ".srw",
                                                    ".3fr",
                                                    ".iiq",
                                                    ".kdc",
                                                    ".dcr",
                                                    ".erf",
                                                    ".mef",
                                                    ".mos",
                                                    ".dng",
                                                    ".rwl"};
    const ByteView view(bytes, path.string(), ByteOrder::Big);
    if (view.startsWith("FUJIFILMCCD-RAW"sv) || view.startsWith("ftypcrx"sv, 4) ||
        view.startsWith("IIRO"sv) || view.startsWith("IIRS"sv) || view.startsWith("MMOR"sv) ||
        view.startsWith("IIU\0"sv))
        return true;
    const bool little = view.startsWith("II*\0"sv);
    if (!little && !view.startsWith("MM\0*"sv)) return false;
    if (view.startsWith("CR"sv, 8) || tiff_like.contains(lowerCaseExtension(path))) return true;
    return isRawTiff(ByteView(bytes, path.string(), little ? ByteOrder::Little : ByteOrder::Big));
}

Photo readRaw(std::span<const std::uint8_t> bytes,
              const std::filesystem::path& path,
              std::int64_t max_pixels)
{
    const std::string name = path.string();
    // LibRaw's object is too large for a stack, and not every build of it keeps its exceptions in.
    const auto raw = std::make_unique<LibRaw>(LIBRAW_OPIONS_NO_DATAERR_CALLBACK);
    Photo photo;
    try {
        photo = develop(*raw, bytes, name, max_pixels);
    } catch (const InputError&) {
        throw;
    } catch (const std::exception& error) {
        throw InputError(name, fmt::format("cannot be read as RAW: {}", error.what()));
    } catch (const LibRaw_exceptions&) {
        throw InputError(name, "cannot be read as RAW; it is damaged");
    }
    PhotoMetadata& metadata = photo.metadata;
    const int width = photo.image.codes.width();
    const int height = photo.image.codes.height();
    if (metadata.focal_35mm)
        metadata.focal_px = *metadata.focal_35mm / exif::kFilmWidthMm * std::max(width, height);
    metadata.exif = makeExif(metadata, width, height);
    return photo;
}

}  // namespace insitu
