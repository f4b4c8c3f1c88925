#!/usr/bin/env bash
# From a coloured part to what printers and people take: slices for a colour printer, the shape for a resin printer, a 3MF
# volume, a page to look through them, and a check of each.
#
#     samples/colour.sh [MESH]      a mesh with colours, in mm; by default the coloured sample part
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/../cmake/setup.sh"

if [ $# -gt 1 ] || [[ ${1:-} = -* ]]; then
  echo "usage: samples/colour.sh [MESH]" >&2
  exit 2
fi

install_packages "${program_packages[@]}"
build_release default_mask

folder=$root/out-colour
mkdir -p "$folder"
mesh=${1:-$root/build/pebble.obj}
if [ $# = 0 ]; then /usr/bin/python3 "$root/samples/make_colour_part.py" "$mesh"; fi
vdbdither() { "$root/build/release/vdbdither" "$@"; }

# The colours of the mesh, halftoned with the inks of the printer.
vdbdither mesh2sdf "$mesh" --colour --printer stratasys-j750-27um ! dither ! material-assign -o "$folder/inks.vdb" --overwrite
vdbdither slice-export -i "$folder/inks.vdb" "$folder/part.gcvf" --overwrite
vdbdither verify "$folder/part.gcvf" --against "$folder/inks.vdb"

# The same voxels as a volume within the mesh.
vdbdither slice-export -i "$folder/inks.vdb" "$folder/part.3mf" --3mf-mesh "$mesh" --overwrite
vdbdither verify "$folder/part.3mf" --against "$folder/inks.vdb"

# The shape alone, on a display with pixels of 14 x 19 µm.
vdbdither mesh2sdf "$mesh" --printer elegoo-saturn-4-ultra-16k ! dither -o "$folder/resin.vdb" --overwrite
vdbdither slice-export -i "$folder/resin.vdb" "$folder/part.sl1" --overwrite
vdbdither verify "$folder/part.sl1" --against "$folder/resin.vdb"

vdbdither preview "$folder/part.gcvf" "$folder/part.html" --overwrite

cat <<END
colour    $folder/part.gcvf
volume    $folder/part.3mf
resin     $folder/part.sl1
page      $folder/part.html
END
