#!/bin/sh
# Repeats the figures and tables of docs/paper: section 5 of "Shape Dithering for 3D Printing" (Morsy, Brunton, Urban 2022).
#
#   samples/paper/reproduce.sh              # every step but masks
#   samples/paper/reproduce.sh STEP ...     # some of: figure8 figure9 readings pictures speed masks
#   samples/paper/reproduce.sh default      # figure8, figure9 and pictures, only for the default of `dither`
#
# Finished measurements stay in out/ ($WORK) and are not repeated; a run can be interrupted and continued. To repeat a whole
# step, remove its folder there. Results are written to docs/paper ($RESULT), and the picture of the README to images/ beside
# it. Times are meaningful only on a machine without other work; $SPEED_MESH, $SPEED_SIZE (mm) and $ROUNDS select the job. The
# program is that of build/release, or the first `vdbdither` on the PATH. Needs python3-numpy, -pil, -matplotlib, -openvdb.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
root=$(cd "$here/../.." && pwd)
work=${WORK:-$root/out}
result=${RESULT:-$root/docs/paper}
PATH=$root/build/release:$PATH
export PATH
python=/usr/bin/python3

figure8() { "$python" "$here/figure8.py" "$work/paper-figure-8" "$result" "$@"; }
figure9() { "$python" "$here/figure9.py" "$work/paper-figure-9" "$result" "$@"; }
readings() { "$python" "$here/readings.py" "$work/paper-readings" "$result"; }
pictures() { "$python" "$here/pictures.py" "$work/paper-pictures" "$result" all "$@"; }
masks() { "$here/masks.sh" "$work/paper-masks" "$result"; }

speed() {
  mesh=${SPEED_MESH:-$work/token.stl}
  [ -e "$mesh" ] || "$python" "$here/../make_part.py" "$mesh"
  "$python" "$here/speed.py" "$mesh" "${SPEED_SIZE:-40}" "${ROUNDS:-10}" "$result"
}

of_default() {
  figure8 "the default"
  figure9 "the default"
  pictures "the default"
}

[ $# -gt 0 ] || set -- figure8 figure9 readings pictures speed
for step in "$@"; do
  case $step in
    figure8 | figure9 | readings | pictures | speed | masks | default) ;;
    *) echo "reproduce.sh: unknown step '$step'; use figure8 figure9 readings pictures speed masks default" >&2; exit 2 ;;
  esac
done
command -v vdbdither > /dev/null || { echo "reproduce.sh: vdbdither not found; build it first, see README.md" >&2; exit 1; }
mkdir -p "$work" "$result"
for step in "$@"; do
  began=$(date +%s)
  case $step in
    default) of_default ;;
    *) "$step" ;;
  esac
  echo "$step: $(($(date +%s) - began)) s"
done
