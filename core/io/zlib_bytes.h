#pragma once

#include "core/io/byte_writer.h"

#include <optional>
#include <span>

namespace insitu {

/// A zlib stream (RFC 1950) of these bytes.
[[nodiscard]] Bytes deflated(std::span<const std::uint8_t> bytes);
/// What a zlib stream unpacks to; nothing when it is damaged or gives more than `max_bytes`.
[[nodiscard]] std::optional<Bytes> inflated(std::span<const std::uint8_t> stream,
                                            std::size_t max_bytes);

}  // namespace insitu
