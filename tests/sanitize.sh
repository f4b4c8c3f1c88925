#!/usr/bin/env bash
# Builds everything with the instruments of a sanitizer and runs the tests that suit it. What is left out is told.
#
#     tests/sanitize.sh [asan|tsan] [ctest arguments]      asan: AddressSanitizer and UndefinedBehaviorSanitizer
#                                                          tsan: ThreadSanitizer
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/../cmake/setup.sh"

# Builds the source of Debian's own libtbb with ThreadSanitizer into a folder, where the programs of that preset look first:
# of the libtbb without instruments it does not see how work goes from thread to thread, and takes that for races.
build_tbb() {
  local folder=$1 version apt
  version=$(dpkg-query --show --showformat='${source:Version}' libtbb-dev)
  if [ -e "$folder/$version" ]; then return; fi
  say "building libtbb $version in $folder"
  rm -rf "$folder"
  mkdir -p "$folder"/apt/{sources,lists/partial,cache/archives/partial}
  # The sources of what the machine's own lists name.
  apt-get indextargets 'Created-By: Packages' 'Release: bookworm' \
    --format 'deb-src [signed-by=/usr/share/keyrings/debian-archive-keyring.gpg] $(SITE) $(RELEASE) $(COMPONENT)' |
    sort --unique >"$folder/apt/sources/source.list"
  apt=(-o Dir::Etc::SourceList=/dev/null -o Dir::Etc::SourceParts="$folder/apt/sources" -o Dir::State::Lists="$folder/apt/lists"
    -o Dir::Cache="$folder/apt/cache" -o APT::Sandbox::User=)
  quietly apt-get "${apt[@]}" update
  (cd "$folder/apt" && quietly apt-get "${apt[@]}" source "onetbb=$version")
  quietly cmake -S "$folder"/apt/onetbb-* -B "$folder/build" -G Ninja -DCMAKE_BUILD_TYPE=RelWithDebInfo \
    -DCMAKE_C_COMPILER=clang-14 -DCMAKE_CXX_COMPILER=clang++-14 -DTBB_SANITIZE=thread -DTBB_TEST=OFF -DTBBMALLOC_BUILD=OFF
  quietly cmake --build "$folder/build" --target tbb
  cp -a "$folder"/build/*/libtbb.so* "$folder"
  touch "$folder/$version"
}

preset=asan
case ${1:-} in asan | tsan)
  preset=$1
  shift
  ;;
esac

install_packages "${program_packages[@]}" "${test_packages[@]}" "${sanitize_packages[@]}"
cd "$root"
if [ "$preset" = tsan ]; then build_tbb "$root/build/tsan/tbb"; fi
say "building in $root/build/$preset (minutes the first time)"
quietly cmake --preset "$preset"
watched cmake --build --preset "$preset"

# Each line: whom it concerns, a regular expression of names, and why.
unsuited=()
while read -r whom names reason; do
  if [ "$whom" = both ] || [ "$whom" = "$preset" ]; then
    echo "not run by $preset: $names: $reason"
    # The build leaves single tests of suites out.
    if [[ $names != suite:* ]]; then unsuited+=("$names"); fi
  fi
done < <(grep --invert-match --extended-regexp '^(#|$)' tests/support/sanitizers/unsuited.txt)
excluded=$(IFS='|' && echo "${unsuited[*]}")

# Every run of the program would look at the order of initialization again, which takes longer than its start.
if [ "$preset" = asan ]; then
  say "checking the order of initialization"
  ASAN_OPTIONS=strict_init_order=1:check_initialization_order=1 quietly build/asan/vdbdither --version
fi

say "running the tests"
run_tests --preset "$preset" --exclude-regex "^(${excluded:-none})\$" "$@"
