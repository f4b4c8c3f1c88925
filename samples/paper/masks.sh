#!/bin/sh
# Makes masks of 32³ for σ = 0.5 … 3.1 and measures their slices, as section 4 of the paper does. masks.py draws the
# figures and writes their numbers. Finished measurements are not repeated; the script can be interrupted and continued.
#   samples/paper/masks.sh [WORK FOLDER] [RESULT FOLDER] [STEP IN DEGREES] [SEEDS] [KERNELS]
set -eu
here=$(cd "$(dirname "$0")" && pwd)
work=${1:-out/paper-masks}
result=${2:-$here/../../docs/paper}
step=${3:-1}
seeds=${4:-1 2 3}
kernels=${5:-peters gauss}
mkdir -p "$work" "$result"
for kernel in $kernels; do
  for seed in $seeds; do
    for tenths in $(seq 5 31); do
      sigma=$((tenths / 10)).$((tenths % 10))
      name=$work/$kernel-$sigma-$seed
      [ -e "$name.json" ] && continue
      vdbdither mask --size 32 --kernel "$kernel" --sigma "$sigma" --seed "$seed" -o "$name.vdb" --overwrite --quiet
      vdbdither read "$name.vdb" ! mask-spectrum --step "$step" --plane-step 30 "$name.json" --quiet
    done
  done
done
/usr/bin/python3 "$here/masks.py" "$work" "$result"
