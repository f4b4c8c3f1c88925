#pragma once

#include <string>
#include <string_view>

#include "vdbdither/engine/options.h"
#include "vdbdither/model/schema.h"

namespace vdbdither {

/// Adds to the history in the metadata of `schema` the line of the step that made its grids: a
/// command line with every value that the options have, then ` # ` and the version of the program.
/// Run again on the same inputs, it makes the same voxels (docs/decisions/0015-history-lines.md).
/// Ask after `plan`, which may have resolved values.
void addToHistory(Schema& schema, std::string_view verb, const Options& options);

}  // namespace vdbdither
