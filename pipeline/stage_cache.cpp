#include "pipeline/stage_cache.h"

#include "core/check.h"
#include "core/io/file.h"

#include <xxhash.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <system_error>
#include <vector>

namespace insitu {

namespace fs = std::filesystem;

namespace {

constexpr const char* kExtension = ".stage";

std::string digits(XXH128_hash_t hash)
{
    return fmt::format("{:016x}{:016x}", hash.high64, hash.low64);
}

/// A new build may compute something else: the program's own bytes are part of every key.
const std::string& programIdentity()
{
    static const std::string identity = [] {
        std::error_code error;
        const fs::path self = fs::read_symlink("/proc/self/exe", error);
        // Without it nothing may be found again: a key of this run only.
        if (error)
            return fmt::format("{}", std::chrono::steady_clock::now().time_since_epoch().count());
        const auto bytes = readFile(self);
        return digits(XXH3_128bits(bytes.data(), bytes.size()));
    }();
    return identity;
}

}  // namespace

struct ContentKey::State {
    XXH3_state_t* hash = XXH3_createState();
    ~State() { XXH3_freeState(hash); }
};

ContentKey::ContentKey(const std::string& stage) : state_(std::make_unique<State>())
{
    INSITU_CHECK(state_->hash != nullptr, "no memory for a hash");
    XXH3_128bits_reset(state_->hash);
    add(stage, programIdentity());
}

ContentKey::~ContentKey() = default;

void ContentKey::raw(const void* data, std::size_t count)
{
    XXH3_128bits_update(state_->hash, data, count);
}

ContentKey& ContentKey::addFile(const fs::path& path)
{
    const auto bytes = readFile(path);
    add(std::uint64_t{bytes.size()});
    raw(bytes.data(), bytes.size());
    return *this;
}

std::string ContentKey::text() const
{
    return digits(XXH3_128bits_digest(state_->hash));
}

StageCache::StageCache(fs::path folder, std::uintmax_t max_bytes)
    : folder_(std::move(folder)), max_bytes_(max_bytes)
{
}

std::optional<fs::path> StageCache::userFolder()
{
    const auto variable = [](const char* name) -> std::optional<fs::path> {
        const char* value = std::getenv(name);
        if (value == nullptr || *value == '\0') return std::nullopt;
        return fs::path(value);
    };
    if (const auto given = variable("INSITU_CACHE")) return given;
    if (const auto caches = variable("XDG_CACHE_HOME")) return *caches / "insitu";
    if (const auto home = variable("HOME")) return *home / ".cache" / "insitu";
    return std::nullopt;
}

std::optional<std::string> StageCache::read(const ContentKey& key) const
{
    std::error_code error;
    const fs::path path = folder_ / (key.text() + kExtension);
    if (folder_.empty() || !fs::is_regular_file(path, error)) return std::nullopt;
    std::string bytes;
    try {
        const auto all = readFile(path);
        bytes.assign(all.begin(), all.end());
    } catch (const InputError&) {
        return std::nullopt;
    }
    // The checksum stands first.
    constexpr std::size_t kChecksum = 32;
    if (bytes.size() < kChecksum ||
        digits(XXH3_128bits(bytes.data() + kChecksum, bytes.size() - kChecksum)) !=
            bytes.substr(0, kChecksum))
        return std::nullopt;
    // The file's time says when it was last of use, for trim().
    fs::last_write_time(path, fs::file_time_type::clock::now(), error);
    return bytes.substr(kChecksum);
}

void StageCache::write(const ContentKey& key, const std::string& bytes)
{
    try {
        fs::create_directories(folder_);
        const std::string checksum = digits(XXH3_128bits(bytes.data(), bytes.size()));
        writeTextFile(folder_ / (key.text() + kExtension), checksum + bytes);
        trim();
    } catch (const std::exception& error) {
        findings_.push_back(
            {Severity::Info,
             "cache-not-written",
             fmt::format("{}: results are not kept for the next run: {}; give another folder with "
                         "--cache, or --no-cache",
                         folder_.string(),
                         error.what())});
    }
}

void StageCache::trim() const
{
    struct Kept {
        fs::path path;
        std::uintmax_t bytes = 0;
        fs::file_time_type used;
    };
    std::vector<Kept> files;
    std::uintmax_t total = 0;
    for (const fs::directory_entry& entry : fs::directory_iterator(folder_)) {
        if (entry.path().extension() != kExtension) continue;
        std::error_code error;  // another program may have removed it meanwhile
        const Kept file{entry.path(), entry.file_size(error), entry.last_write_time(error)};
        if (error) continue;
        total += file.bytes;
        files.push_back(file);
    }
    std::ranges::sort(files, {}, &Kept::used);
    for (const Kept& file : files) {
        if (total <= max_bytes_) return;
        std::error_code error;
        fs::remove(file.path, error);
        total -= file.bytes;
    }
}

}  // namespace insitu
