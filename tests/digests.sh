#!/usr/bin/env bash
# Builds the program with gcc and clang, optimized and not, and checks that all of them write the same bytes with every
# instruction set, number of threads and slab height, fused, piped and by files. For nightly runs: tests/cli/digests_test.py
# holds the builds of every day to the digests that come out here.
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/../cmake/setup.sh"

install_packages "${program_packages[@]}" "${test_packages[@]}" "${sanitize_packages[@]}"
cd "$root"
programs=()
for preset in release clang debug clang-debug; do
  say "building in $root/build/$preset (minutes the first time)"
  quietly cmake --preset "$preset"
  watched cmake --build --preset "$preset" --target vdbdither_program default_mask
  programs+=("build/$preset/vdbdither")
done

say "comparing"
PYTHONDONTWRITEBYTECODE=1 PYTHONPATH=tests/support /usr/bin/python3 tests/support/digest_matrix.py "${programs[@]}"
