#!/usr/bin/env bash
# Builds everything with counters of clang, runs the tests, and reports the share of the lines of each layer that they run.
# build/coverage/html shows every line. Left out are the tests in tests/support/coverage_unsuited.txt, which take minutes.
#
#     tests/coverage.sh [ctest arguments]
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/../cmake/setup.sh"

install_packages "${program_packages[@]}" "${test_packages[@]}" "${sanitize_packages[@]}"
cd "$root"
build=$root/build/coverage
say "building in $build (minutes the first time)"
quietly cmake --preset coverage
watched cmake --build --preset coverage

# Each process adds its counts to one of a few files. A test that kills a process loses the counts of that process.
rm -rf "$build/counts"
mkdir "$build/counts"
excluded=$(grep --invert-match --extended-regexp '^(#|$)' tests/support/coverage_unsuited.txt | cut --delimiter=' ' --fields=1 |
  paste --serial --delimiters='|')
say "running the tests"
status=0
LLVM_PROFILE_FILE="$build/counts/%4m.profraw" run_tests --preset coverage \
  --exclude-regex "^(${excluded:-none})\$" "$@" || status=$?

llvm-profdata-14 merge --sparse --output "$build/counts/all.profdata" "$build"/counts/*.profraw
objects=()
for program in "$build"/tests/{model,engine,io,kernels,ops}_test; do objects+=(--object "$program"); done
shown=("$build/vdbdither" "${objects[@]}" --instr-profile "$build/counts/all.profdata" --ignore-filename-regex "/(tests|usr|generated)/")
llvm-cov-14 export --summary-only "${shown[@]}" >"$build/coverage.json" 2>"$build/coverage.log"
llvm-cov-14 show --format html --output-dir "$build/html" "${shown[@]}" 2>>"$build/coverage.log"
/usr/bin/python3 tests/support/line_coverage.py "$build/coverage.json"
exit "$status"
