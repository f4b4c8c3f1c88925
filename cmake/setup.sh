# What samples/run.sh and the scripts of tests/ share: Debian's packages, quiet steps, the build. To be sourced.

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
jobs=$(nproc)

# To build the program, and to make and slice the sample.
program_packages=(build-essential cmake ninja-build libopenvdb-dev libboost-iostreams-dev libtbb-dev
  zlib1g-dev libopenexr-dev libpng-dev libtiff-dev libminizip-dev libembree-dev libssl-dev nlohmann-json3-dev
  libturbojpeg0-dev libwebp-dev liblcms2-dev libdraco-dev libmeshoptimizer-dev libexpat1-dev python3)
# To build and run the tests.
test_packages=(libgtest-dev libgmock-dev libbenchmark-dev libspng-dev libopenvdb-tools
  python3-openvdb python3-numpy python3-scipy python3-pil python3-skimage python3-matplotlib python3-jsonschema
  chromium chromium-driver python3-selenium)
sanitize_packages=(clang-14 libclang-rt-14-dev llvm-14)
lint_packages=(clang-14 clang-format-14 clang-tidy-14 libclang-14-dev llvm-14-dev)

# Names a step that can take minutes.
say() {
  echo "$*" >&2
}

# Runs a command without output; shows its output if it fails.
quietly() {
  local log
  log=$(mktemp)
  if "$@" >"$log" 2>&1 </dev/null; then
    rm "$log"
  else
    local code=$?
    cat "$log" >&2
    rm "$log"
    echo "failed: $*" >&2
    return "$code"
  fi
}

# Runs a build. Its progress is shown on a terminal, elsewhere only the output of a build that fails.
watched() {
  if [ -t 2 ]; then "$@" >&2 </dev/null; else quietly "$@"; fi
}

# Runs ctest with the arguments and shows the tests that did not pass; on a terminal also how many have run. One test more than
# there are cores runs at a time, because many tests wait.
run_tests() {
  local terminal=0
  if [ -t 2 ]; then terminal=1; fi
  ctest --parallel "$((jobs + 1))" "$@" </dev/null | awk -v terminal="$terminal" '
    $1 == "Start" { next }
    / Passed / { if (terminal) printf "\r[%s] ", $1 >"/dev/stderr"; next }
    { print }'
}

as_root() {
  if [ "$(id -u)" = 0 ]; then "$@"; else sudo "$@"; fi
}

# Installs those of the packages that are missing.
install_packages() {
  local package missing=()
  for package in "$@"; do
    dpkg-query --show --showformat='${db:Status-Status}\n' "$package" 2>/dev/null | grep --quiet --line-regexp installed ||
      missing+=("$package")
  done
  if [ ${#missing[@]} = 0 ]; then return; fi
  say "installing ${missing[*]}"
  quietly as_root apt-get update
  quietly as_root env DEBIAN_FRONTEND=noninteractive apt-get install --yes --no-install-recommends "${missing[@]}"
}

# Builds Release: the given targets, or everything with the tests.
build_release() {
  say "building in $root/build/release (minutes the first time)"
  cd "$root"
  if [ $# = 0 ]; then
    quietly cmake --preset release -DBUILD_TESTING=ON
    watched cmake --build --preset release
  else
    if [ ! -f build/release/build.ninja ]; then quietly cmake --preset release; fi
    watched cmake --build --preset release --target "$@"
  fi
}
