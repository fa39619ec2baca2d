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
    /// What T, without const, is made of.
    template <class T>
    struct Shape {
        static constexpr bool number = std::is_arithmetic_v<T> || std::is_enum_v<T>;
        static constexpr bool list = false, optional = false, image = false, fixed = false;
    };
    template <glm::length_t N, class T, glm::qualifier Q>
    struct Shape<glm::vec<N, T, Q>> : Shape<T> {
    };
    template <class T>
    struct Shape<std::vector<T>> : Shape<void> {
        static constexpr bool list = true;
    };
    template <class T, std::size_t N>
    struct Shape<std::array<T, N>> : Shape<void> {
        static constexpr bool fixed = true;
    };
    template <class T>
    struct Shape<std::optional<T>> : Shape<void> {
        static constexpr bool optional = true;
    };
    template <class T>
    struct Shape<Image<T>> : Shape<void> {
        static constexpr bool image = true;
    };

    template <class T>
    void visit(T& value)
    {
        using S = Shape<std::remove_const_t<T>>;
        if constexpr (S::number)
            sink_.raw(&value, sizeof(value));
        else if constexpr (PartsOf<T, std::string>)
            visitText(value);
        else if constexpr (S::list)
            visitList(value);
        else if constexpr (S::fixed)
            visitEach(value);
        else if constexpr (S::optional)
            visitOptional(value);
        else if constexpr (S::image)
            visitImage(value);
        else
            parts(*this, value);
    }
    void visitText(auto& text)
    {
        visitSize(text);
        sink_.raw(text.data(), text.size());
    }
    void visitList(auto& list)
    {
        visitSize(list);
        visitEach(list);
    }
    void visitSize(auto& range)
    {
        std::uint64_t size = range.size();
        visit(size);
        if constexpr (Sink::reading) {
            sink_.demand(size);
            range.resize(size);
        }
    }
    void visitEach(auto& range)
    {
        for (auto& element : range)
            visit(element);
    }
    void visitOptional(auto& optional)
    {
        bool present = optional.has_value();
        visit(present);
        if constexpr (Sink::reading) {
            optional.reset();
            if (present) optional.emplace();
        }
        if (present) visit(*optional);
    }
    void visitImage(auto& image)
    {
        int width = image.width();
        int height = image.height();
        (*this)(width, height);
        if constexpr (Sink::reading) {
            using Picture = std::remove_cvref_t<decltype(image)>;
            sink_.demand(sizeof(image.pixels()[0]), width, height);
            image = Picture(width, height);
        }
        sink_.raw(image.pixels().data(), image.pixels().size_bytes());
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
