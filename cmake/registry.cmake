# A folder is a registry: ops/material_assign.cpp holds `extern const OperatorInfo material_assign`, and io/mesh/off.cpp
# `extern const MeshFormat off`. A file is named like what it defines.

# Generates the function that returns every TYPE that one of SOURCES defines, in the order of their names:
#   std::span<const TYPE* const> FUNCTION();   declared in HEADER
# Sets `table` to the generated source and `symbols` to the names. A source without a TYPE is passed over.
function(generate_table table symbols)
  cmake_parse_arguments(PARSE_ARGV 2 of "" "TYPE;FUNCTION;HEADER" "SOURCES")
  set(found "")
  foreach(source ${of_SOURCES})
    file(STRINGS ${source} declaration REGEX "^extern const ${of_TYPE} [a-z0-9_]+" LIMIT_COUNT 1)
    if(NOT declaration)
      continue()
    endif()
    get_filename_component(symbol ${source} NAME_WE)
    if(NOT declaration MATCHES " ${symbol}[^a-z0-9_]")
      message(FATAL_ERROR "${source} must call its ${of_TYPE} '${symbol}', as the file is called")
    endif()
    list(APPEND found ${symbol})
  endforeach()
  # In the order of the names that users see, in which words are joined by '-'.
  list(TRANSFORM found REPLACE "_" "-")
  list(SORT found)
  list(TRANSFORM found REPLACE "-" "_")

  set(declarations "")
  set(entries "")
  foreach(symbol ${found})
    string(APPEND declarations "extern const ${of_TYPE} ${symbol};\n")
    string(APPEND entries "      &${symbol},\n")
  endforeach()
  string(REGEX REPLACE "([A-Z])" "_\\1" name ${of_FUNCTION})
  string(TOLOWER ${name} name)
  set(output ${CMAKE_BINARY_DIR}/generated/${name}.cpp)
  file(CONFIGURE OUTPUT ${output} @ONLY CONTENT
"#include \"@of_HEADER@\"

#include <iterator>

namespace vdbdither {

@declarations@
std::span<const @of_TYPE@* const> @of_FUNCTION@() {
  static constexpr const @of_TYPE@* entries[] = {
@entries@      nullptr};
  return {entries, std::size(entries) - 1};
}

}  // namespace vdbdither
")
  set(${symbols} ${found} PARENT_SCOPE)
  set(${table} ${output} PARENT_SCOPE)
endfunction()

# Stops where one of SOURCES is not among the SYMBOLS of the tables made of them; KINDS names their types.
function(require_symbols)
  cmake_parse_arguments(PARSE_ARGV 0 of "" "KINDS" "SYMBOLS;SOURCES")
  foreach(source ${of_SOURCES})
    get_filename_component(symbol ${source} NAME_WE)
    if(NOT symbol IN_LIST of_SYMBOLS)
      message(FATAL_ERROR "${source} must define `extern const TYPE ${symbol}`, where TYPE is ${of_KINDS}")
    endif()
  endforeach()
endfunction()
