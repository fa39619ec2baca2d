#include "core/parallel.h"

#include <tbb/global_control.h>
#include <tbb/parallel_for.h>

#include <memory>

namespace insitu {

namespace {
std::unique_ptr<tbb::global_control>& threadLimit()
{
    static std::unique_ptr<tbb::global_control> limit;
    return limit;
}
}  // namespace

void parallelFor(std::int64_t begin,
                 std::int64_t end,
                 const std::function<void(std::int64_t)>& body)
{
    tbb::parallel_for(begin, end, [&](std::int64_t i) { body(i); });
}

void setThreadCount(int threads)
{
    threadLimit().reset();
    if (threads > 0)
        threadLimit() = std::make_unique<tbb::global_control>(
            tbb::global_control::max_allowed_parallelism, static_cast<std::size_t>(threads));
}

}  // namespace insitu
