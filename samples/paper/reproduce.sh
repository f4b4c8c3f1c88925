#!/bin/sh
# Makes the figures and tables of docs/paper again: section 5 of "Shape Dithering for 3D Printing" (Morsy, Brunton, Urban 2022).
#
#   samples/paper/reproduce.sh              # every step but masks
#   samples/paper/reproduce.sh STEP ...     # some of: figure8 figure9 readings pictures speed masks
#   samples/paper/reproduce.sh default      # figure8, figure9 and pictures, measuring anew only what `dither` does by default
#
# A finished measurement is kept in out/ ($WORK) and used again: a run can be stopped and taken up. To measure all of a step
# anew, remove its folder there. Results go to docs/paper ($RESULT), the README's picture to images/ beside that. Times are
# worth something only on a machine that does nothing else; $SPEED_MESH, $SPEED_SIZE (mm) and $ROUNDS set what is timed. The
# program is that of build/release, or else the first `vdbdither` on the PATH. Needs python3-numpy, -pil, -matplotlib, -openvdb.
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
    *) echo "reproduce.sh: there is no step '$step'; there are figure8 figure9 readings pictures speed masks default" >&2; exit 2 ;;
  esac
done
command -v vdbdither > /dev/null || { echo "reproduce.sh: there is no vdbdither; build it first, see README.md" >&2; exit 1; }
mkdir -p "$work" "$result"
for step in "$@"; do
  began=$(date +%s)
  case $step in
    default) of_default ;;
    *) "$step" ;;
  esac
  echo "$step: $(($(date +%s) - began)) s"
done
