#pragma once

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>

namespace insitu {

/// The folder of real captures: $INSITU_DATA, or ../shared/data beside the checkout.
inline std::filesystem::path dataFolder()
{
    if (const char* folder = std::getenv("INSITU_DATA")) return folder;
    return std::filesystem::path(INSITU_SOURCE_DIR) / ".." / "shared" / "data";
}

}  // namespace insitu

/// First line of a test that needs the real captures: skipped where they are absent, failed in CI.
#define INSITU_NEEDS_DATA()                                                                     \
    if (!std::filesystem::exists(insitu::dataFolder())) {                                       \
        ASSERT_EQ(std::getenv("CI"), nullptr)                                                   \
            << "no " << insitu::dataFolder() << ": set INSITU_DATA";                            \
        GTEST_SKIP() << "no real captures at " << insitu::dataFolder() << " (set INSITU_DATA)"; \
    }
