#pragma once

#include "core/image.h"

#include <array>
#include <concepts>
#include <cstdint>
#include <cstring>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

namespace insitu {

/// True when `T`, const or not, is `Wanted`: one function then lists the parts of a value for
/// writing and reading alike.
template <class T, class Wanted>
concept PartsOf = std::same_as<std::remove_const_t<T>, Wanted>;

/// Walks through values for hashing, writing or reading: numbers, glm vectors, strings, vectors,
/// optionals and images by itself, other types by their parts(archive, value). A sink has
/// `void raw(bytes, count)` and `static constexpr bool reading`.
template <class Sink>
class ValueArchive {
public:
    explicit ValueArchive(Sink& sink) : sink_(sink) {}

    template <class... Values>
    void operator()(Values&... values)
    {
        (visit(values), ...);
    }

private:
    template <class T>
    static constexpr bool kPlain = std::is_arithmetic_v<T> || std::is_enum_v<T>;
    template <glm::length_t N, class T, glm::qualifier Q>
    static std::true_type plainVector(const glm::vec<N, T, Q>*);
    static std::false_type plainVector(const void*);

    template <class T>
    void visit(T& value)
    {
        using Plain = std::remove_const_t<T>;
        if constexpr (kPlain<Plain> || decltype(plainVector(static_cast<Plain*>(nullptr)))::value)
            sink_.raw(&value, sizeof(value));
        else
            container(value);
    }

    template <class T>
    void container(T& value)
    {
        parts(*this, value);
    }
    void container(PartsOf<std::string> auto& value)
    {
        resize(value);
        sink_.raw(value.data(), value.size());
    }
    template <class T>
    void container(std::vector<T>& value)
    {
        resize(value);
        elements(value);
    }
    template <class T>
    void container(const std::vector<T>& value)
    {
        resize(value);
        elements(value);
    }
    template <class T, std::size_t N>
    void container(std::array<T, N>& value)
    {
        elements(value);
    }
    template <class T, std::size_t N>
    void container(const std::array<T, N>& value)
    {
        elements(value);
    }
    template <class T>
    void container(std::optional<T>& value)
    {
        bool present = value.has_value();
        visit(present);
        if constexpr (Sink::reading) {
            value.reset();
            if (present) value.emplace();
        }
        if (present) visit(*value);
    }
    template <class T>
    void container(const std::optional<T>& value)
    {
        const bool present = value.has_value();
        visit(present);
        if (present) visit(*value);
    }
    template <class T>
    void container(Image<T>& image)
    {
        int width = image.width();
        int height = image.height();
        (*this)(width, height);
        if constexpr (Sink::reading) {
            sink_.demand(sizeof(T), width, height);
            image = Image<T>(width, height);
        }
        sink_.raw(image.pixels().data(), image.pixels().size_bytes());
    }
    template <class T>
    void container(const Image<T>& image)
    {
        const int width = image.width();
        const int height = image.height();
        (*this)(width, height);
        sink_.raw(image.pixels().data(), image.pixels().size_bytes());
    }

    template <class Range>
    void resize(Range& range)
    {
        std::uint64_t size = range.size();
        visit(size);
        if constexpr (Sink::reading) {
            sink_.demand(size);
            range.resize(size);
        }
    }
    template <class Range>
    void elements(Range& range)
    {
        for (auto& element : range)
            visit(element);
    }

    Sink& sink_;
};

/// Appends values to a string.
struct WritingSink {
    static constexpr bool reading = false;
    std::string bytes;
    void raw(const void* data, std::size_t count)
    {
        bytes.append(static_cast<const char*>(data), count);
    }
};

/// Takes values from bytes; std::runtime_error when there are too few.
struct ReadingSink {
    static constexpr bool reading = true;
    std::string_view bytes;
    void raw(void* data, std::size_t count)
    {
        demand(count);
        if (count > 0) std::memcpy(data, bytes.data(), count);
        bytes.remove_prefix(count);
    }
    /// That many more bytes at least, before memory is taken for them.
    void demand(std::uint64_t count) const
    {
        if (count > bytes.size()) throw std::runtime_error("the data ends early");
    }
    void demand(std::size_t size, int width, int height) const
    {
        if (width < 0 || height < 0) throw std::runtime_error("a negative size");
        const auto rows = static_cast<std::uint64_t>(height);
        if (width > 0 && rows > bytes.size() / size / static_cast<std::uint64_t>(width))
            throw std::runtime_error("the data ends early");
    }
};

}  // namespace insitu
