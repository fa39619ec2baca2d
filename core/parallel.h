#pragma once

#include <cstdint>
#include <functional>

namespace insitu {

/// Runs `body(i)` for every i in [begin, end), in any order, on all threads allowed.
///
/// `body` must write only to places that belong to i: then results do not depend on the number
/// of threads. Exceptions from `body` reach the caller.
void parallelFor(std::int64_t begin,
                 std::int64_t end,
                 const std::function<void(std::int64_t)>& body);

/// Limits the threads of the whole process; 0 = all cores. Called once, by main or a test.
void setThreadCount(int threads);

}  // namespace insitu
