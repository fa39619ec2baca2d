#pragma once

#include "core/finding.h"
#include "core/io/json.h"

namespace insitu {

/// A list of {"severity", "code", "message"}, as reports hold it.
[[nodiscard]] inline Json findingsJson(const Findings& findings)
{
    Json list = Json::array();
    for (const Finding& finding : findings)
        list.push_back({{"severity", severityName(finding.severity)},
                        {"code", finding.code},
                        {"message", finding.message}});
    return list;
}

}  // namespace insitu
