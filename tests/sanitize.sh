#!/usr/bin/env bash
# Builds everything with the instruments of a sanitizer and runs the tests that suit it. What is left out is told.
#
#     tests/sanitize.sh [asan|tsan] [ctest arguments]      asan: AddressSanitizer and UndefinedBehaviorSanitizer
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/../cmake/setup.sh"

preset=asan
case ${1:-} in asan | tsan)
  preset=$1
  shift
  ;;
esac

install_packages "${program_packages[@]}" "${test_packages[@]}" "${sanitize_packages[@]}"
cd "$root"
say "building in $root/build/$preset (minutes the first time)"
quietly cmake --preset "$preset"
quietly cmake --build --preset "$preset"

# Each line: whom it concerns, a regular expression of names, and why.
unsuited=()
while read -r whom names reason; do
  if [ "$whom" = both ] || [ "$whom" = "$preset" ]; then
    echo "not run by $preset: $names: $reason"
    unsuited+=("$names")
  fi
done < <(grep --invert-match --extended-regexp '^(#|$)' tests/support/sanitizers/unsuited.txt)
excluded=$(IFS='|' && echo "${unsuited[*]}")

# A test that takes seconds without takes a minute with them: no more at a time than there are cores.
ctest --preset "$preset" --parallel "$jobs" --exclude-regex "^(${excluded:-none})\$" "$@" </dev/null |
  grep --extended-regexp --invert-match '^ +Start |  Passed '
