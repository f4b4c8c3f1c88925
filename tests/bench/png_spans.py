#!/usr/bin/python3
"""Compares the run encoder with general PNG encoders and prints Markdown tables.

usage: png_spans.py BENCH_PROGRAM [STACK_FOLDER]

BENCH_PROGRAM is png_spans_bench. STACK_FOLDER, a stack that slice-export wrote with --format png, is read and written
again by Pillow (libpng's zlib without filters of its own choice) for size and time.
"""
import glob
import io
import json
import os
import subprocess
import sys
import time


def synthetic(program):
    run = subprocess.run([program, "--benchmark_format=json", "--benchmark_min_time=0.2"],
                         check=True, capture_output=True, text=True)
    slices = {}
    for result in json.loads(run.stdout)["benchmarks"]:
        name = result["name"].replace("/iterations:1", "").split("/")
        encoder = " ".join([name[0]] + name[2:])
        slices.setdefault(result["label"], {})[encoder] = result
    print("| slice | runs | Mvoxel/s | KB | libpng 1: times slower | larger | libpng 6: times slower | larger "
          "| spng 1: times slower | larger |")
    print("|---|" + "---:|" * 9)
    for label, by in slices.items():
        ours = by["fromRuns"]
        cells = [label, f"{ours['runs']:.0f}", f"{ours['items_per_second'] / 1e6:.0f}", f"{ours['bytes'] / 1e3:.0f}"]
        for other in ("byLibpng 1", "byLibpng 6", "bySpng 1"):
            cells.append(f"{by[other]['cpu_time'] / ours['cpu_time']:.1f}")
            cells.append(f"{by[other]['bytes'] / ours['bytes']:.2f}")
        print("| " + " | ".join(cells) + " |")


def real(folder):
    from PIL import Image
    names = sorted(glob.glob(os.path.join(folder, "*.png")))
    names = [name for name in names if os.path.basename(name) != "preview.png"]
    names = names[:: max(1, len(names) // 40)]
    ours = voxels = 0
    again = {1: [0, 0.0], 6: [0, 0.0]}
    for name in names:
        ours += os.path.getsize(name)
        image = Image.open(name)
        image.load()
        voxels += image.width * image.height
        for level, total in again.items():
            start = time.process_time()
            buffer = io.BytesIO()
            image.save(buffer, "PNG", compress_level=level)
            total[1] += time.process_time() - start
            total[0] += buffer.tell()
    print(f"\n{len(names)} slices of {folder}: {ours / len(names) / 1e3:.1f} KB each")
    for level, (size, seconds) in again.items():
        print(f"Pillow level {level}: {size / ours:.2f} times the size, {voxels / seconds / 1e6:.0f} Mvoxel/s")


if len(sys.argv) not in (2, 3):
    sys.exit(__doc__)
synthetic(sys.argv[1])
if len(sys.argv) == 3:
    real(sys.argv[2])
