#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>

namespace insitu {

/// The bytes of a file, which the system reads where they are looked at and may drop again: large
/// files cost address space, not memory. The file must not shrink meanwhile.
class MappedFile {
public:
    /// InputError when missing, not a regular file or unreadable.
    explicit MappedFile(const std::filesystem::path& path);
    ~MappedFile();
    MappedFile(const MappedFile&) = delete;
    MappedFile& operator=(const MappedFile&) = delete;

    [[nodiscard]] std::span<const std::uint8_t> bytes() const { return {data_, size_}; }

private:
    const std::uint8_t* data_ = nullptr;
    std::size_t size_ = 0;
};

}  // namespace insitu
