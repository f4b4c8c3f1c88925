# The targets `tidy` and `tidy_tests`: clang-tidy over the sources of the program, or of the tests. A source is read again
# when it or a header of the project that it includes has changed. The precompiled header saves half of the time.

find_program(CLANG_TIDY clang-tidy-14 REQUIRED)
find_program(LLVM_CONFIG llvm-config-14 REQUIRED)

execute_process(COMMAND ${LLVM_CONFIG} --includedir OUTPUT_VARIABLE llvm_headers OUTPUT_STRIP_TRAILING_WHITESPACE
                COMMAND_ERROR_IS_FATAL ANY)
add_library(own_declarations MODULE cmake/lint/own_declarations.cpp)
target_include_directories(own_declarations SYSTEM PRIVATE ${llvm_headers})
target_compile_options(own_declarations PRIVATE -fno-rtti -fvisibility-inlines-hidden)

# Adds the sources of the targets to `name`. `pch` is the precompiled header that their command lines include.
function(add_tidy name pch)
  set(checked "")
  foreach(target ${ARGN})
    get_target_property(folder ${target} SOURCE_DIR)
    get_target_property(sources ${target} SOURCES)
    # Generated sources have no style.
    list(FILTER sources EXCLUDE REGEX "^${CMAKE_BINARY_DIR}")
    foreach(source ${sources})
      cmake_path(ABSOLUTE_PATH source BASE_DIRECTORY ${folder})
      cmake_path(RELATIVE_PATH source BASE_DIRECTORY ${PROJECT_SOURCE_DIR} OUTPUT_VARIABLE shown)
      set(stamp ${CMAKE_BINARY_DIR}/tidy/${shown}.checked)
      cmake_path(GET stamp PARENT_PATH stamp_folder)
      file(MAKE_DIRECTORY ${stamp_folder})
      add_custom_command(
        OUTPUT ${stamp}
        COMMAND ${CLANG_TIDY} --quiet -p ${CMAKE_BINARY_DIR} --load=$<TARGET_FILE:own_declarations> ${source}
        COMMAND ${CMAKE_CXX_COMPILER} -std=c++20 "-I$<JOIN:$<TARGET_PROPERTY:${target},INCLUDE_DIRECTORIES>,;-I>"
                -MM -MT ${stamp} -MF ${stamp}.d ${source}
        COMMAND ${CMAKE_COMMAND} -E touch ${stamp}
        DEPENDS ${source} ${PROJECT_SOURCE_DIR}/.clang-tidy own_declarations ${pch}
        DEPFILE ${stamp}.d
        COMMENT "Reading ${shown}"
        COMMAND_EXPAND_LISTS VERBATIM)
      list(APPEND checked ${stamp})
    endforeach()
  endforeach()
  add_custom_target(${name} DEPENDS ${checked})
endfunction()

set(program_pch ${CMAKE_BINARY_DIR}/CMakeFiles/vdbdither_model.dir/cmake_pch.hxx.pch)
add_tidy(tidy ${program_pch} ${families} vdbdither_program)
if(BUILD_TESTING)
  add_tidy(tidy_tests ${CMAKE_BINARY_DIR}/tests/CMakeFiles/test_support.dir/cmake_pch.hxx.pch test_support model_test engine_test io_test kernels_test ops_test)
endif()
