#pragma once

#include "core/image.h"
#include "core/io/image_io.h"

#include <cstdint>
#include <filesystem>
#include <memory>

namespace insitu {

/// The largest picture that is read in strips: what OpenEXR's sides of 65536 allow.
inline constexpr std::int64_t kMaxStripPixels = 1LL << 32;

/// A radiance picture that is read row by row, so that its height costs no memory.
class RadianceRows {
public:
    virtual ~RadianceRows() = default;

    [[nodiscard]] virtual int width() const = 0;
    [[nodiscard]] virtual int height() const = 0;
    /// Fills `rows`, as wide as the picture, with its rows from `first` on. Any order of calls
    /// gives the same; downwards is quick. InputError for damage and for values as readRadiance().
    virtual void read(int first, Image<Rgb>& rows) = 0;
};

/// What readRadiance() reads, with the same rules. OpenEXR: a strip costs its own rows and the
/// file's blocks or tiles that they lie in. Radiance and PFM: the file is mapped; pictures of the
/// rare kind that stores column by column are read whole. InputError.
[[nodiscard]] std::unique_ptr<RadianceRows> openRadianceRows(
    const std::filesystem::path& path, std::int64_t max_pixels = kMaxStripPixels);

/// A picture in memory, by its rows.
class ImageRows : public RadianceRows {
public:
    explicit ImageRows(Image<Rgb> image) : image_(std::move(image)) {}
    [[nodiscard]] int width() const override { return image_.width(); }
    [[nodiscard]] int height() const override { return image_.height(); }
    void read(int first, Image<Rgb>& rows) override;

private:
    Image<Rgb> image_;
};

}  // namespace insitu
