#pragma once

#include "capture/hdr_merge.h"
#include "capture/merge_tables.h"

namespace insitu {

/// Merges rows [first, last) into `result`, whose images have the bracket's size. Writes to these
/// rows only. `excluded` as for mergeBracket.
void mergeRows(const MergeTables& tables,
               const std::vector<Image<std::uint8_t>>* excluded,
               int first,
               int last,
               MergeResult& result);

}  // namespace insitu
