#pragma once

#include "vdbdither/engine/option_groups.h"
#include "vdbdither/model/ink_set.h"

namespace vdbdither {

/// Returns the coverages that the ICC output profile `options.icc` gives the inks of `set`.
///
/// A channel of the profile is an ink, 100 % a coverage of 1. What is missing to a sum of 1 is the
/// lightest ink that is no channel; a sum above 1 is divided. With a profile that was made for inks
/// on paper, which overprint, such a sum is usual, and colours become lighter than it says; a
/// profile that was characterized with coverages has none.
///
/// Throws UsageError if there is no such file, or if the channels and inks do not fit, and
/// DataError for a file that is not an ICC output profile.
///
/// Source: International Color Consortium: Specification ICC.1:2022 (Profile version 4.4).
CoverageTable readIccCoverages(const InkOptions& options, const InkSet& set);

}  // namespace vdbdither
