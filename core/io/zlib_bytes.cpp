#include "core/io/zlib_bytes.h"

#include "core/check.h"

#include <zlib.h>

#include <algorithm>

namespace insitu {

Bytes deflated(std::span<const std::uint8_t> bytes)
{
    Bytes stream(compressBound(static_cast<uLong>(bytes.size())));
    uLongf size = static_cast<uLongf>(stream.size());
    const int status =
        compress(stream.data(), &size, bytes.data(), static_cast<uLong>(bytes.size()));
    INSITU_CHECK(status == Z_OK, "zlib status {}", status);
    stream.resize(size);
    return stream;
}

std::optional<Bytes> inflated(std::span<const std::uint8_t> stream, std::size_t max_bytes)
{
    constexpr std::size_t kStep = 1 << 16;
    z_stream state{};
    if (inflateInit(&state) != Z_OK) return std::nullopt;
    state.next_in = const_cast<Bytef*>(stream.data());  // zlib only reads there
    state.avail_in = static_cast<uInt>(std::min<std::size_t>(stream.size(), 1U << 30));
    Bytes bytes;
    int status = Z_OK;
    // Memory grows with what comes out, not with what is claimed.
    while (status == Z_OK && bytes.size() <= max_bytes) {
        const std::size_t before = bytes.size();
        bytes.resize(before + kStep);
        state.next_out = bytes.data() + before;
        state.avail_out = static_cast<uInt>(kStep);
        status = inflate(&state, Z_NO_FLUSH);
        bytes.resize(before + kStep - state.avail_out);
        if (status == Z_OK && bytes.size() == before) status = Z_BUF_ERROR;  // no more to come
    }
    inflateEnd(&state);
    if (status != Z_STREAM_END || bytes.size() > max_bytes) return std::nullopt;
    return bytes;
}

}  // namespace insitu
