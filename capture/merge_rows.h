#pragma once

#include "capture/hdr_merge.h"
#include "capture/merge_tables.h"

namespace insitu {

/// Merges rows [first, last) into `result`, whose images have the bracket's size. Writes to these
/// rows only.
void mergeRows(const MergeTables& tables, int first, int last, MergeResult& result);

}  // namespace insitu
