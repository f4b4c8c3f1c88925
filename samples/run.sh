#!/usr/bin/env bash
# Makes a dithered slice stack in out/ from the sample part, or from a mesh (OBJ, OFF, PLY or STL).
#
#     samples/run.sh [MESH]
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/../cmake/setup.sh"

if [ $# -gt 1 ] || [[ ${1:-} = -* ]]; then
  echo "usage: samples/run.sh [MESH]" >&2
  exit 2
fi

install_packages "${program_packages[@]}"
build_release default_mask

mesh=${1:-$root/build/token.stl}
if [ $# = 0 ]; then /usr/bin/python3 "$root/samples/make_part.py" "$mesh"; fi

"$root/build/release/vdbdither" mesh2sdf "$mesh" --printer mimaki-3duj-553 ! normals ! dither ! \
  material-assign ! slice-export "$root/out" --overwrite

cat <<END
slices    $root/out/slice_*.png
manifest  $root/out/manifest.json
preview   $root/out/preview.png
END
