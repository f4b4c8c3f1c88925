#!/usr/bin/env bash
# Holds the sources against .clang-format and .clang-tidy: all of them, or those given.
#
#     tests/lint.sh [FILE.cpp ...]
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/../cmake/setup.sh"

install_packages "${program_packages[@]}" "${test_packages[@]}" "${lint_packages[@]}"
cd "$root"

mapfile -t formatted < <(find vdbdither io ops tests \( -name '*.h' -o -name '*.cpp' \) | sort)
clang-format-14 --dry-run -Werror "${formatted[@]}"

# clang-tidy reads the flags of a clang build; it has no use for precompiled headers.
quietly cmake --preset clang -B build/lint -DCMAKE_DISABLE_PRECOMPILE_HEADERS=ON
if [ $# -gt 0 ]; then
  checked=("$@")
else
  mapfile -t checked < <(find vdbdither io ops -name '*.cpp' | sort)
fi
check() {
  # The count of suppressed warnings is no finding.
  clang-tidy-14 -p build/lint --quiet "$1" 2>&1 | { grep --invert-match --extended-regexp '^[0-9]+ warnings (generated|treated)' || true; }
}
export -f check
printf '%s\0' "${checked[@]}" | xargs --null --max-args 1 --max-procs "$jobs" bash -o pipefail -c 'check "$1"' check
