#!/usr/bin/env bash
# Renders four stages of a chain with Blender, without a display: out/blender.png.
#
#     samples/blender/run.sh [MESH]
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/../../cmake/setup.sh"

if [ $# -gt 1 ] || [[ ${1:-} = -* ]]; then
  echo "usage: samples/blender/run.sh [MESH]" >&2
  exit 2
fi

install_packages "${program_packages[@]}" blender
build_release default_mask

mesh=${1:-$root/build/token.stl}
if [ $# = 0 ]; then /usr/bin/python3 "$root/samples/make_part.py" "$mesh"; fi

# The part is small; single voxels are visible.
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
"$root/build/release/vdbdither" mesh2sdf "$mesh" --printer mimaki-3duj-553 --fit 5mm ! dither ! simulate ! \
  write "$work/chain.vdb" ! mesh-export "$work/voxels.ply" --grid solid

mkdir -p "$root/out"
say "rendering (takes minutes without a GPU)"
quietly blender --background --factory-startup --python-exit-code 1 --python "$root/samples/blender/view.py" -- \
  --output "$root/out/blender.png" --surface "$work/chain.vdb:surface" --volume "$work/chain.vdb:solid" \
  --mesh "$work/voxels.ply" --surface "$work/chain.vdb:printed@0.5" \
  --labels "surface,solid,its voxels,printed"

echo "picture   $root/out/blender.png"
