#pragma once

#include <fmt/core.h>

#include <source_location>
#include <stdexcept>
#include <string>

namespace insitu {

/// A broken invariant: our own bug, never the user's. The message holds file, line and values.
class LogicError : public std::logic_error {
public:
    using std::logic_error::logic_error;
};

/// Bad input or environment (missing file, corrupt image, unknown required extension).
///
/// `what()` reads "<path>[:<position>]: <cause>"; the cause says what is wrong and what to do.
/// Caught once per program, never swallowed below `apps/`.
class InputError : public std::runtime_error {
public:
    InputError(const std::string& path, const std::string& cause)
        : std::runtime_error(path + ": " + cause)
    {
    }
    InputError(const std::string& path, const std::string& position, const std::string& cause)
        : std::runtime_error(path + ":" + position + ": " + cause)
    {
    }
};

/// Well-formed input that admits no answer (a calibration from a single axis). Exit code 3.
class NoAnswerError : public InputError {
public:
    using InputError::InputError;
};

/// The caller asked to stop (Progress::cancelled). Exit code 130.
class CancelledError : public std::runtime_error {
public:
    CancelledError() : std::runtime_error("cancelled") {}
};

namespace detail {
[[noreturn]] inline void failCheck(const char* condition,
                                   const std::string& message,
                                   std::source_location where)
{
    throw LogicError(fmt::format(
        "{}:{}: check failed: {}: {}", where.file_name(), where.line(), condition, message));
}
}  // namespace detail

}  // namespace insitu

/// INSITU_CHECK(cond, "format", values…): throws LogicError when an invariant does not hold.
#define INSITU_CHECK(condition, ...)                                                    \
    do {                                                                                \
        if (!(condition)) [[unlikely]]                                                  \
            ::insitu::detail::failCheck(                                                \
                #condition, fmt::format(__VA_ARGS__), std::source_location::current()); \
    } while (false)

/// The same for hot loops: compiled out with NDEBUG.
#ifdef NDEBUG
#define INSITU_DCHECK(condition, ...) \
    do {                              \
    } while (false)
#else
#define INSITU_DCHECK(condition, ...) INSITU_CHECK(condition, __VA_ARGS__)
#endif
