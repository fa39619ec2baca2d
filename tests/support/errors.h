#pragma once

#include "core/check.h"

#include <gmock/gmock.h>

#include <string>

namespace insitu {

/// What `run` says when it throws an InputError; a test failure and "" when it does not.
template <class Run>
std::string inputErrorOf(const Run& run)
{
    try {
        run();
    } catch (const InputError& error) {
        return error.what();
    } catch (const std::exception& error) {
        ADD_FAILURE() << "not an InputError: " << error.what();
        return "";
    }
    ADD_FAILURE() << "no error";
    return "";
}

}  // namespace insitu
