#!/usr/bin/env bash
# Fuzzes every reader for hours, from the seeds of tests/cli/fuzz_test.py and the units of the nights before, and reports units,
# coverage and finds. A fuzzer stops at its first find.
#
#     tests/fuzz/nightly.sh [HOURS [FOLDER]]      8 hours in all, into build/fuzz
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/../../cmake/setup.sh"

hours=${1:-8}
folder=$(realpath --canonicalize-missing "${2:-$root/build/fuzz}")
install_packages "${program_packages[@]}" "${test_packages[@]}" "${sanitize_packages[@]}"
cd "$root"
mapfile -t fuzzers < <(basename --suffix .cpp --multiple tests/fuzz/*_fuzz.cpp)
say "building in $root/build/asan (minutes the first time)"
quietly cmake --preset asan
watched cmake --build --preset asan --target vdbdither_program default_mask "${fuzzers[@]}"

# As many at a time as there are cores; the machine is busy all the time.
rounds=$(((${#fuzzers[@]} + jobs - 1) / jobs))
seconds=$(awk -v hours="$hours" -v rounds="$rounds" 'BEGIN { print int(hours * 3600 / rounds) }')
say "fuzzing for $seconds s each"
mkdir -p "$folder"
export VDBDITHER_FUZZ_FOLDER=$folder VDBDITHER_FUZZ_SECONDS=$seconds
status=0
ctest --preset asan --tests-regex '^cli\.fuzz_test\.' --parallel "$jobs" >"$folder/ctest.log" </dev/null || status=$?

printf '%-20s %12s %8s %8s %8s  %s\n' fuzzer run kept cov ft finds
for fuzzer in "${fuzzers[@]}"; do
  log=$folder/$fuzzer/log
  run=$(sed --quiet 's/^stat::number_of_executed_units: *//p' "$log")
  read -r cov ft < <(sed --quiet --regexp-extended 's/.* cov: ([0-9]+) ft: ([0-9]+) .*/\1 \2/p' "$log" | tail --lines 1)
  finds=$(cd "$folder/$fuzzer" && find . -maxdepth 1 -type f ! -name log -printf '%f ')
  printf '%-20s %12s %8s %8s %8s  %s\n' "$fuzzer" "${run:-?}" "$(find "$folder/$fuzzer/units" -type f | wc --lines)" "${cov:-?}" "${ft:-?}" "${finds:-none}"
done
exit "$status"
