#pragma once

#include "core/photo.h"

#include <filesystem>
#include <memory>

namespace insitu {

/// Writes a picture strip by strip, as writeEncoded() does the whole: PNG (8 or 16 bit, sRGB) or
/// JPEG (8 bit, 4:2:0), under a temporary name until finish(). What is not finished leaves no file.
class EncodedRowWriter {
public:
    struct Format {
        int width = 0, height = 0;
        int max_code = 255;     ///< or 65535
        int jpeg_quality = 97;  ///< [1, 100]
    };

    /// InputError for another extension, for what a JPEG cannot hold, and where no file can be
    /// written.
    EncodedRowWriter(const std::filesystem::path& path, const Format& format);
    ~EncodedRowWriter();
    EncodedRowWriter(const EncodedRowWriter&) = delete;
    EncodedRowWriter& operator=(const EncodedRowWriter&) = delete;

    /// The next rows, from the top; as wide and deep as the picture.
    void write(const EncodedImage& rows);
    /// After the last row: closes the file and gives it its name.
    void finish();

    /// What encodes one format.
    class Encoder;

private:
    Format format_;
    std::filesystem::path path_, temporary_;
    int written_ = 0;
    bool finished_ = false;
    std::unique_ptr<Encoder> encoder_;
};

}  // namespace insitu
