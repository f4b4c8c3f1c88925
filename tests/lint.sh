#!/usr/bin/env bash
# Holds the sources against .clang-format and .clang-tidy. Only what has changed since the last time is read again.
#
#     tests/lint.sh [TARGET ...]      the program's sources, or those of other targets, such as io_test or all
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/../cmake/setup.sh"

install_packages "${program_packages[@]}" "${test_packages[@]}" "${lint_packages[@]}"
cd "$root"

find vdbdither io ops tests \( -name '*.h' -o -name '*.cpp' \) -print0 | xargs --null clang-format-14 --dry-run -Werror

# A build by clang that has clang-tidy read every source first. It has no use for optimized code.
say "linting in $root/build/lint (minutes the first time)"
quietly cmake --preset clang -B build/lint -DCMAKE_BUILD_TYPE=Debug -DBUILD_TESTING=ON \
  -DCMAKE_DISABLE_PRECOMPILE_HEADERS=ON '-DCMAKE_CXX_CLANG_TIDY=clang-tidy-14;--quiet'
if [ $# = 0 ]; then set -- vdbdither_program; fi
quietly cmake --build build/lint --target "$@" -- -k 0
