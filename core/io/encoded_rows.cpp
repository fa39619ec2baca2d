#include "core/io/encoded_rows.h"

#include "core/check.h"
#include "core/io/file.h"
#include "core/io/image_path.h"

#include <csetjmp>
#include <cstdio>
#include <fstream>
#include <vector>

// After <cstdio>, which it needs.
#include <jpeglib.h>
#include <png.h>

namespace insitu {

namespace fs = std::filesystem;

class EncodedRowWriter::Encoder {
public:
    explicit Encoder(const fs::path& temporary) : file(temporary, std::ios::binary) {}
    virtual ~Encoder() = default;
    virtual void start(const Format& format) = 0;
    virtual void write(const EncodedImage& rows) = 0;
    virtual void finish() = 0;

    /// Its state is looked at after every strip; the encoders themselves never see it fail.
    std::ofstream file;
};

namespace {

/// What a C library says before it jumps out.
struct LibraryError {
    std::jmp_buf jump;
    std::string message;
};

// --- PNG ---------------------------------------------------------------------------------------

extern "C" void writePngBytes(png_structp png, png_bytep bytes, png_size_t count)
{
    static_cast<std::ofstream*>(png_get_io_ptr(png))
        ->write(reinterpret_cast<const char*>(bytes), static_cast<std::streamsize>(count));
}
extern "C" void flushPngBytes(png_structp /*png*/) {}
extern "C" void failPng(png_structp png, png_const_charp message)
{
    auto* const error = static_cast<LibraryError*>(png_get_error_ptr(png));
    error->message = message;
    std::longjmp(error->jump, 1);
}
extern "C" void ignorePng(png_structp /*png*/, png_const_charp /*message*/) {}

class PngEncoder : public EncodedRowWriter::Encoder {
public:
    PngEncoder(const fs::path& temporary, const EncodedRowWriter::Format& format)
        : Encoder(temporary), deep_(format.max_code > 255)
    {
        png_ = png_create_write_struct(PNG_LIBPNG_VER_STRING, &error_, failPng, ignorePng);
        info_ = png_create_info_struct(png_);
    }
    ~PngEncoder() override { png_destroy_write_struct(&png_, &info_); }

    // In these functions nothing with a destructor stands between setjmp() and what may jump.
    void start(const EncodedRowWriter::Format& format) override
    {
        if (setjmp(error_.jump) != 0) return fail();
        png_set_user_limits(png_, 0x7FFFFFFF, 0x7FFFFFFF);
        png_set_write_fn(png_, &file, writePngBytes, flushPngBytes);
        png_set_IHDR(png_,
                     info_,
                     static_cast<png_uint_32>(format.width),
                     static_cast<png_uint_32>(format.height),
                     deep_ ? 16 : 8,
                     PNG_COLOR_TYPE_RGB,
                     PNG_INTERLACE_NONE,
                     PNG_COMPRESSION_TYPE_DEFAULT,
                     PNG_FILTER_TYPE_DEFAULT);
        png_set_sRGB(png_, info_, PNG_sRGB_INTENT_PERCEPTUAL);
        png_set_compression_level(png_, 6);
        png_set_compression_strategy(png_, 3);  // Z_RLE: quick, and as writeEncoded()
        png_write_info(png_, info_);
    }

    void write(const EncodedImage& rows) override
    {
        for (int y = 0; y < rows.codes.height(); ++y) {
            row_.clear();
            for (const glm::u16vec3& code : rows.codes.row(y))
                for (int c = 0; c < 3; ++c) {
                    if (deep_) row_.push_back(static_cast<png_byte>(code[c] >> 8));
                    row_.push_back(static_cast<png_byte>(code[c] & 255));
                }
            writeRow();
        }
    }
    void finish() override
    {
        if (setjmp(error_.jump) != 0) return fail();
        png_write_end(png_, info_);
    }

private:
    void writeRow()
    {
        if (setjmp(error_.jump) != 0) return fail();
        png_write_row(png_, row_.data());
    }
    [[noreturn]] void fail() const
    {
        throw InputError("PNG", "cannot be encoded: " + error_.message);
    }

    bool deep_;
    LibraryError error_;
    png_structp png_ = nullptr;
    png_infop info_ = nullptr;
    std::vector<png_byte> row_;
};

// --- JPEG --------------------------------------------------------------------------------------

/// libjpeg's way to hand over bytes: a buffer that it fills.
struct JpegTarget {
    jpeg_destination_mgr manager{};
    std::ofstream* file = nullptr;
    std::vector<JOCTET> buffer = std::vector<JOCTET>(1 << 16);

    void reset()
    {
        manager.next_output_byte = buffer.data();
        manager.free_in_buffer = buffer.size();
    }
    void flush(std::size_t count)
    {
        file->write(reinterpret_cast<const char*>(buffer.data()),
                    static_cast<std::streamsize>(count));
        reset();
    }
};
struct JpegErrors {
    jpeg_error_mgr manager{};
    LibraryError error;
};

JpegTarget* targetOf(j_compress_ptr jpeg)
{
    return reinterpret_cast<JpegTarget*>(jpeg->dest);
}

extern "C" void beginJpeg(j_compress_ptr jpeg)
{
    targetOf(jpeg)->reset();
}
extern "C" boolean flushJpeg(j_compress_ptr jpeg)
{
    targetOf(jpeg)->flush(targetOf(jpeg)->buffer.size());
    return TRUE;
}
extern "C" void endJpeg(j_compress_ptr jpeg)
{
    JpegTarget* const target = targetOf(jpeg);
    target->flush(target->buffer.size() - target->manager.free_in_buffer);
}
extern "C" void failJpeg(j_common_ptr jpeg)
{
    auto* const errors = reinterpret_cast<JpegErrors*>(jpeg->err);
    char message[JMSG_LENGTH_MAX];
    jpeg->err->format_message(jpeg, message);
    errors->error.message = message;
    std::longjmp(errors->error.jump, 1);
}

class JpegEncoder : public EncodedRowWriter::Encoder {
public:
    explicit JpegEncoder(const fs::path& temporary) : Encoder(temporary)
    {
        jpeg_.err = jpeg_std_error(&errors_.manager);
        errors_.manager.error_exit = failJpeg;
    }
    ~JpegEncoder() override { jpeg_destroy_compress(&jpeg_); }

    void start(const EncodedRowWriter::Format& format) override
    {
        if (setjmp(errors_.error.jump) != 0) return fail();
        jpeg_create_compress(&jpeg_);
        target_.file = &file;
        target_.manager.init_destination = beginJpeg;
        target_.manager.empty_output_buffer = flushJpeg;
        target_.manager.term_destination = endJpeg;
        jpeg_.dest = &target_.manager;
        jpeg_.image_width = static_cast<JDIMENSION>(format.width);
        jpeg_.image_height = static_cast<JDIMENSION>(format.height);
        jpeg_.input_components = 3;
        jpeg_.in_color_space = JCS_RGB;
        jpeg_set_defaults(&jpeg_);  // 4:2:0
        jpeg_set_quality(&jpeg_, format.jpeg_quality, TRUE);
        jpeg_start_compress(&jpeg_, TRUE);
    }

    void write(const EncodedImage& rows) override
    {
        for (int y = 0; y < rows.codes.height(); ++y) {
            row_.clear();
            for (const glm::u16vec3& code : rows.codes.row(y))
                for (int c = 0; c < 3; ++c)
                    row_.push_back(static_cast<JSAMPLE>(code[c]));
            writeRow();
        }
    }
    void finish() override
    {
        if (setjmp(errors_.error.jump) != 0) return fail();
        jpeg_finish_compress(&jpeg_);
    }

private:
    void writeRow()
    {
        JSAMPROW row = row_.data();
        if (setjmp(errors_.error.jump) != 0) return fail();
        jpeg_write_scanlines(&jpeg_, &row, 1);
    }
    [[noreturn]] void fail() const
    {
        throw InputError("JPEG", "cannot be encoded: " + errors_.error.message);
    }

    JpegErrors errors_;
    JpegTarget target_;
    jpeg_compress_struct jpeg_{};
    std::vector<JSAMPLE> row_;
};

std::unique_ptr<EncodedRowWriter::Encoder> makeEncoder(const fs::path& path,
                                                       const fs::path& temporary,
                                                       const EncodedRowWriter::Format& format)
{
    const std::string extension = lowerCaseExtension(path);
    if (extension == ".png") return std::make_unique<PngEncoder>(temporary, format);
    if (extension != ".jpg" && extension != ".jpeg")
        throw InputError(path.string(), "pictures are written as .png, .jpg or .jpeg");
    if (format.max_code != 255)
        throw InputError(path.string(), "a JPEG holds 8 bits; write a 16-bit image as PNG");
    constexpr int kLargestJpegSide = 65500;
    if (format.width > kLargestJpegSide || format.height > kLargestJpegSide)
        throw InputError(
            path.string(),
            fmt::format("a JPEG's sides are at most {} pixels; write a PNG", kLargestJpegSide));
    return std::make_unique<JpegEncoder>(temporary);
}

}  // namespace

EncodedRowWriter::EncodedRowWriter(const fs::path& path, const Format& format)
    : format_(format), path_(path), temporary_(temporaryName(path))
{
    INSITU_CHECK(format.width > 0 && format.height > 0 &&
                     (format.max_code == 255 || format.max_code == 65535) &&
                     format.jpeg_quality >= 1 && format.jpeg_quality <= 100,
                 "{}x{}, {}, {}",
                 format.width,
                 format.height,
                 format.max_code,
                 format.jpeg_quality);
    encoder_ = makeEncoder(path_, temporary_, format_);
    if (!encoder_->file) throw InputError(path_.string(), "cannot be written");
    try {
        encoder_->start(format_);
    } catch (...) {
        encoder_.reset();
        std::error_code error;
        fs::remove(temporary_, error);
        throw;
    }
}

EncodedRowWriter::~EncodedRowWriter()
{
    if (finished_) return;
    encoder_.reset();
    std::error_code error;
    fs::remove(temporary_, error);
}

void EncodedRowWriter::write(const EncodedImage& rows)
{
    INSITU_CHECK(rows.codes.width() == format_.width && rows.max_code == format_.max_code &&
                     written_ + rows.codes.height() <= format_.height,
                 "{} rows of {} after {}",
                 rows.codes.height(),
                 rows.codes.width(),
                 written_);
    encoder_->write(rows);
    written_ += rows.codes.height();
    if (!encoder_->file) throw InputError(path_.string(), "cannot be written: is the disk full?");
}

void EncodedRowWriter::finish()
{
    INSITU_CHECK(written_ == format_.height, "{} of {} rows", written_, format_.height);
    encoder_->finish();
    encoder_->file.close();
    if (!encoder_->file) throw InputError(path_.string(), "cannot be written: is the disk full?");
    renameInPlace(temporary_, path_);
    finished_ = true;
}

}  // namespace insitu
