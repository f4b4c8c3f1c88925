#pragma once

#include <span>
#include <string_view>

#include "vdbdither/engine/operator.h"
#include "vdbdither/engine/tool.h"

namespace vdbdither {

/// Every operator in the folder ops/, ordered by file name. CMake generates it.
std::span<const OperatorInfo* const> registeredOperators();

/// Every tool in the folder ops/, ordered by file name. CMake generates it.
std::span<const ToolInfo* const> registeredTools();

/// Returns the operator called `name`. Throws UsageError that suggests the nearest name.
const OperatorInfo& findOperator(std::string_view name);

/// Returns the tool called `name`, or null.
const ToolInfo* findTool(std::string_view name);

}  // namespace vdbdither
