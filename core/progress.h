#pragma once

#include "core/check.h"

#include <string_view>

namespace insitu {

/// How the library reports work in progress and learns that it should stop.
///
/// The library never prints; the command line draws a bar, tests pass `Progress{}` (silent).
/// Calls come from one thread at a time.
class Progress {
public:
    virtual ~Progress() = default;

    /// fraction in [0, 1] of the named stage.
    virtual void report(std::string_view /*stage*/, double /*fraction*/) {}
    [[nodiscard]] virtual bool cancelled() const { return false; }

    /// Throws CancelledError when the caller asked to stop.
    void checkpoint() const
    {
        if (cancelled()) throw CancelledError();
    }
};

}  // namespace insitu
