# The registry of operators is the folder ops/: material_assign.cpp defines `extern const OperatorInfo material_assign`.
function(generate_registry result)
  set(verbs "")
  foreach(source ${ARGN})
    get_filename_component(symbol ${source} NAME_WE)
    string(REPLACE "_" "-" verb ${symbol})
    list(APPEND verbs ${verb})
  endforeach()
  list(SORT verbs)

  set(declarations "")
  set(entries "")
  foreach(verb ${verbs})
    string(REPLACE "-" "_" symbol ${verb})
    string(APPEND declarations "extern const OperatorInfo ${symbol};\n")
    string(APPEND entries "    &${symbol},\n")
  endforeach()
  set(output ${CMAKE_BINARY_DIR}/generated/registry.cpp)
  file(CONFIGURE OUTPUT ${output} @ONLY CONTENT
"#include \"vdbdither/engine/registry.h\"

#include <iterator>

namespace vdbdither {

@declarations@
std::span<const OperatorInfo* const> registeredOperators() {
  static constexpr const OperatorInfo* entries[] = {
@entries@      nullptr};
  return {entries, std::size(entries) - 1};
}

}  // namespace vdbdither
")
  set(${result} ${output} PARENT_SCOPE)
endfunction()
