# The registry is the folder ops/: material_assign.cpp holds `extern const OperatorInfo material_assign`, ssim.cpp
# `extern const ToolInfo ssim`. Sets `result` to a generated source and `operators` to the verbs of the operators.
function(generate_registry result operators)
  foreach(source ${ARGN})
    file(STRINGS ${source} declaration REGEX "^extern const (OperatorInfo|ToolInfo) [a-z0-9_]+" LIMIT_COUNT 1)
    get_filename_component(symbol ${source} NAME_WE)
    if(declaration MATCHES "const OperatorInfo ${symbol}[^a-z0-9_]")
      list(APPEND operator_symbols ${symbol})
    elseif(declaration MATCHES "const ToolInfo ${symbol}[^a-z0-9_]")
      list(APPEND tool_symbols ${symbol})
    else()
      message(FATAL_ERROR "${source} must define `extern const OperatorInfo ${symbol}` or `extern const ToolInfo ${symbol}`")
    endif()
  endforeach()

  set(declarations "")
  foreach(kind operator tool)
    list(SORT ${kind}_symbols)
    string(REPLACE "operator" "OperatorInfo" type ${kind})
    string(REPLACE "tool" "ToolInfo" type ${type})
    set(${kind}_entries "")
    foreach(symbol ${${kind}_symbols})
      string(APPEND declarations "extern const ${type} ${symbol};\n")
      string(APPEND ${kind}_entries "    &${symbol},\n")
    endforeach()
  endforeach()
  set(output ${CMAKE_BINARY_DIR}/generated/registry.cpp)
  file(CONFIGURE OUTPUT ${output} @ONLY CONTENT
"#include \"vdbdither/engine/registry.h\"

#include <iterator>

namespace vdbdither {

@declarations@
std::span<const OperatorInfo* const> registeredOperators() {
  static constexpr const OperatorInfo* entries[] = {
@operator_entries@      nullptr};
  return {entries, std::size(entries) - 1};
}

std::span<const ToolInfo* const> registeredTools() {
  static constexpr const ToolInfo* entries[] = {
@tool_entries@      nullptr};
  return {entries, std::size(entries) - 1};
}

}  // namespace vdbdither
")
  list(TRANSFORM operator_symbols REPLACE "_" "-" OUTPUT_VARIABLE verbs)
  set(${operators} ${verbs} PARENT_SCOPE)
  set(${result} ${output} PARENT_SCOPE)
endfunction()
