#pragma once

#include "core/finding.h"
#include "pipeline/value_archive.h"

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>

namespace insitu {

/// What a stage's result depends on, as a 128-bit hash (XXH3) of the stage's name, the program
/// itself and all values given. Equal keys mean equal results.
class ContentKey {
public:
    static constexpr bool reading = false;

    explicit ContentKey(const std::string& stage);
    ~ContentKey();

    template <class... Values>
    ContentKey& add(const Values&... values)
    {
        ValueArchive<ContentKey>{*this}(values...);
        return *this;
    }
    /// The bytes of a file; InputError as readFile.
    ContentKey& addFile(const std::filesystem::path& path);
    /// 32 hexadecimal digits.
    [[nodiscard]] std::string text() const;

    void raw(const void* data, std::size_t count);

private:
    struct State;
    std::unique_ptr<State> state_;
};

/// Results of stages, kept in a folder and found again by the content they were made from.
///
/// Every file carries a checksum; one that is damaged counts as absent. Files appear whole or not
/// at all, so that programs may share a folder. The oldest ones are removed when the folder grows
/// beyond its limit. A folder that cannot be written costs time, not the result: finding
/// "cache-not-written".
class StageCache {
public:
    /// Keeps nothing.
    StageCache() = default;
    explicit StageCache(std::filesystem::path folder, std::uintmax_t max_bytes = 2ULL << 30);

    /// $INSITU_CACHE, else insitu/ in $XDG_CACHE_HOME, else in ~/.cache; nothing without a home.
    [[nodiscard]] static std::optional<std::filesystem::path> userFolder();

    /// The value kept under `key`.
    template <class Value>
    [[nodiscard]] std::optional<Value> find(const ContentKey& key) const
    {
        const std::optional<std::string> bytes = read(key);
        if (!bytes) return std::nullopt;
        Value value;
        ReadingSink sink{*bytes};
        ValueArchive<ReadingSink>{sink}(value);
        return value;
    }
    template <class Value>
    void keep(const ContentKey& key, const Value& value)
    {
        if (folder_.empty()) return;
        WritingSink sink;
        ValueArchive<WritingSink>{sink}(value);
        write(key, sink.bytes);
    }
    [[nodiscard]] const Findings& findings() const { return findings_; }

private:
    [[nodiscard]] std::optional<std::string> read(const ContentKey& key) const;
    void write(const ContentKey& key, const std::string& bytes);
    void trim() const;

    std::filesystem::path folder_;
    std::uintmax_t max_bytes_ = 0;
    Findings findings_;
};

}  // namespace insitu
