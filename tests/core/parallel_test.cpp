#include "core/parallel.h"

#include "core/check.h"
#include "core/random.h"

#include <gtest/gtest.h>

#include <atomic>
#include <vector>

namespace insitu {
namespace {

TEST(ParallelFor, VisitsEveryIndexOnce)
{
    std::vector<int> visits(10007);
    parallelFor(0, 10007, [&](std::int64_t i) { ++visits[static_cast<std::size_t>(i)]; });
    EXPECT_EQ(visits, std::vector<int>(10007, 1));
    std::atomic<int> calls = 0;
    parallelFor(5, 5, [&](std::int64_t) { ++calls; });
    EXPECT_EQ(calls, 0);
    parallelFor(-3, 2, [&](std::int64_t) { ++calls; });
    EXPECT_EQ(calls, 5);
}

TEST(ParallelFor, ExceptionsReachTheCaller)
{
    const auto body = [](std::int64_t i) {
        if (i == 77) throw InputError("file", "cause");
    };
    EXPECT_THROW(parallelFor(0, 1000, body), InputError);
}

TEST(ParallelFor, ResultsDoNotDependOnTheThreads)
{
    const auto run = [](int threads) {
        setThreadCount(threads);
        std::vector<double> values(5000);
        parallelFor(0, 5000, [&](std::int64_t i) {
            RandomStream stream(3, static_cast<std::uint64_t>(i), 0);
            values[static_cast<std::size_t>(i)] = stream.normal();
        });
        setThreadCount(0);
        return values;
    };
    const std::vector<double> one = run(1);
    EXPECT_EQ(run(2), one);
    EXPECT_EQ(run(7), one);
}

}  // namespace
}  // namespace insitu
