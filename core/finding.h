#pragma once

#include "core/check.h"

#include <string>
#include <utility>
#include <vector>

namespace insitu {

enum class Severity { Info, Warning, Error };

/// What a stage has to tell about its answer: something guessed, doubtful or worth knowing.
///
/// `code` is stable, kebab-case and tested ("probe-clipped-highlights"); `message` is prose with
/// the numbers and what to do. Warnings make `--strict` exit with 4.
struct Finding {
    Severity severity = Severity::Info;
    std::string code;
    std::string message;
};

using Findings = std::vector<Finding>;

inline void append(Findings& to, Findings from)
{
    for (Finding& finding : from)
        to.push_back(std::move(finding));
}

[[nodiscard]] inline bool hasFinding(const Findings& findings, const std::string& code)
{
    for (const Finding& finding : findings)
        if (finding.code == code) return true;
    return false;
}

/// InputError with every problem that an options' validate() found, if any: the first thing a stage
/// does. `what` names the options ("merge options").
inline void requireValid(const Findings& problems, const std::string& what)
{
    if (problems.empty()) return;
    std::string all;
    for (const Finding& problem : problems)
        all += (all.empty() ? "" : "; ") + problem.message;
    throw InputError(what, all);
}

[[nodiscard]] inline const char* severityName(Severity severity)
{
    switch (severity) {
        case Severity::Info:
            return "info";
        case Severity::Warning:
            return "warning";
        case Severity::Error:
            return "error";
    }
    return "error";
}

}  // namespace insitu
