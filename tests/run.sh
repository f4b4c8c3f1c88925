#!/usr/bin/env bash
# Builds everything and runs every test. Arguments go to ctest: tests/run.sh -R cli
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/../cmake/setup.sh"

install_packages "${program_packages[@]}" "${test_packages[@]}"
build_release

say "running the tests"
run_tests --preset release "$@"
