#!/usr/bin/env bash
# Checks the sources against .clang-format and .clang-tidy, and the length of files. clang-tidy reads again only what has
# changed since the last time.
#
#     tests/lint.sh [all]      clang-tidy over the program's sources; all: over those of the tests too
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/../cmake/setup.sh"

install_packages "${program_packages[@]}" "${test_packages[@]}" "${lint_packages[@]}"
cd "$root"

find vdbdither io ops tests cmake \( -name '*.h' -o -name '*.cpp' \) -print0 | xargs --null clang-format-14 --dry-run -Werror

# A longer file holds more than one concept.
long_files=$(find vdbdither io ops tests cmake \( -name '*.h' -o -name '*.cpp' -o -name '*.py' \) -print0 |
  xargs --null wc --lines | awk '$2 != "total" && $1 > 600 { print $2 ": " $1 " lines, the maximum is 600" }')
if [ -n "$long_files" ]; then
  echo "$long_files" >&2
  exit 1
fi

say "linting in $root/build/lint (minutes the first time)"
quietly cmake --preset lint
targets=(tidy)
if [ "${1:-}" = all ]; then targets+=(tidy_tests); fi
watched cmake --build --preset lint --target "${targets[@]}" -- -k 0
