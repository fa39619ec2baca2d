#include "core/io/mapped_file.h"

#include "core/check.h"

#include <fcntl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <cerrno>
#include <system_error>

namespace insitu {

namespace fs = std::filesystem;

MappedFile::MappedFile(const fs::path& path)
{
    const auto fail = [&] {
        throw InputError(path.string(),
                         "cannot be read: " + std::generic_category().message(errno));
    };
    std::error_code error;
    if (!fs::exists(path, error)) throw InputError(path.string(), "no such file");
    if (!fs::is_regular_file(path, error)) throw InputError(path.string(), "not a file");
    size_ = static_cast<std::size_t>(fs::file_size(path, error));
    const int file = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
    if (file < 0) fail();
    if (size_ == 0) {
        ::close(file);
        return;
    }
    void* const address = ::mmap(nullptr, size_, PROT_READ, MAP_PRIVATE, file, 0);
    ::close(file);
    if (address == MAP_FAILED) fail();
    data_ = static_cast<const std::uint8_t*>(address);
}

MappedFile::~MappedFile()
{
    if (data_ != nullptr) ::munmap(const_cast<std::uint8_t*>(data_), size_);
}

}  // namespace insitu
