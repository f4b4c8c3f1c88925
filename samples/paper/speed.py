#!/usr/bin/python3
"""Times mesh → finished RGBA stack with every method in turn, and draws the result: figure 7 of the paper.

    samples/paper/speed.py MESH SIZE_MM [ROUNDS] [RESULT FOLDER]

A round runs every method once, in a random order, to spread other load of the machine over all methods. The cost of a method
is the median over the rounds of its quotient to the control of the same round. The program is the first `vdbdither` on the
PATH. Writes figure-7.json and figure-7.png.
"""

import json
import os
import pathlib
import random
import shutil
import statistics
import subprocess
import sys
import tempfile
import time

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt

PRINTER = "mimaki-3duj-553"
CONTROL = "control"


def methods(folder):
    """Returns, by name, the options of mesh2sdf and the stages between mesh2sdf and the slices."""
    masks = {}
    for sigma in ("1.1", "2.5"):
        masks[sigma] = folder / f"blue-{sigma}.vdb"
        subprocess.run(["vdbdither", "mask", "--size", "128", "--sigma", sigma, "-o", masks[sigma], "--quiet"], check=True)
    paper = "dither --preset paper --mask"
    return {
        CONTROL: ([], "dither --mask none"),
        "interlacing": (["--refine-y", "2"], "interlace"),
        "white noise": ([], f"{paper} white"),
        "blue noise 2.5": ([], f"{paper} {masks['2.5']}"),
        "blue noise 1.1": ([], f"{paper} {masks['1.1']}"),
        "blue noise 1.1, normals": ([], f"normals ! {paper} {masks['1.1']}"),
        "the default": ([], "dither"),
        "the default, normals": (["--normals"], "dither"),
    }


def run(mesh, size_mm, method, folder):
    """Returns elapsed seconds, CPU seconds, peak memory in bytes and voxels of the box of one run."""
    refine, step = method
    stack = folder / "stack"
    shutil.rmtree(stack, ignore_errors=True)
    os.sync()
    words = ["vdbdither", "mesh2sdf", mesh, "--fit", f"{size_mm}mm", "--printer", PRINTER, *refine, "!", *step.split(),
             "!", "material-assign", "!", "slice-export", stack, "--json", "--quiet"]
    with open(folder / "report.json", "wb") as report, open(os.devnull, "wb") as nothing:
        begin = time.monotonic()
        process = subprocess.Popen(words, stdout=report, stderr=nothing)
        _, status, usage = os.wait4(process.pid, 0)
        wall = time.monotonic() - begin
    if status != 0:
        raise SystemExit(f"failed: {' '.join(map(str, words))}")
    report = json.loads((folder / "report.json").read_text())
    return {"wall_s": wall, "cpu_s": usage.ru_utime + usage.ru_stime, "peak_bytes": usage.ru_maxrss * 1024,
            "box_voxels": report["box_voxels"]}


def summary(runs):
    """Returns medians and deviations of every method, and its quotients to the control of the same round."""
    control = runs[CONTROL]
    table = {}
    for name, of in runs.items():
        row = {"runs": len(of), "peak_mb": max(run["peak_bytes"] for run in of) / 1e6}
        for key in ("wall_s", "cpu_s"):
            values = [run[key] for run in of]
            quotients = [run[key] / other[key] for run, other in zip(of, control)]
            row[key] = statistics.median(values)
            row[f"{key}_deviation"] = statistics.stdev(values) if len(values) > 1 else 0.0
            row[f"{key}_to_control"] = statistics.median(quotients)
        row["mvoxel_per_s"] = of[0]["box_voxels"] / row["wall_s"] / 1e6
        table[name] = row
    return table


def draw(table, title, path):
    figure, axes = plt.subplots(1, 2, figsize=(10, 3.6), dpi=90, sharey=True)
    names = list(table)[::-1]
    for axis, key, label in zip(axes, ("wall_s", "cpu_s"), ("seconds, two threads", "CPU seconds")):
        axis.barh(names, [table[name][key] for name in names], xerr=[table[name][f"{key}_deviation"] for name in names],
                  color=["#b8b8b8" if name == CONTROL else "#4878a8" for name in names])
        for row, name in enumerate(names):
            axis.text(0.02 * table[CONTROL][key], row, f"× {table[name][f'{key}_to_control']:.2f}", va="center")
        axis.set_xlabel(label)
    figure.suptitle(title)
    figure.tight_layout()
    figure.savefig(path)


def main():
    if not 3 <= len(sys.argv) <= 5:
        raise SystemExit(__doc__)
    mesh, size_mm = pathlib.Path(sys.argv[1]).resolve(), sys.argv[2]
    rounds = int(sys.argv[3]) if len(sys.argv) > 3 else 10
    result = pathlib.Path(sys.argv[4] if len(sys.argv) > 4 else "docs/paper")
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        of = methods(folder)
        run(mesh, size_mm, of[CONTROL], folder)  # the first run also pays for a cold disk
        runs = {name: [] for name in of}
        for turn in range(rounds):
            for name in random.Random(turn).sample(list(of), len(of)):
                runs[name].append(run(mesh, size_mm, of[name], folder))
    table = summary(runs)
    voxels = runs[CONTROL][0]["box_voxels"]
    (result / "figure-7.json").write_text(json.dumps(
        {"mesh": mesh.name, "size_mm": float(size_mm), "printer": PRINTER, "box_voxels": voxels, "methods": table}, indent=1) + "\n")
    draw(table, f"{mesh.stem}, {size_mm} mm, {voxels / 1e9:.1f} G voxels: mesh to finished slices", result / "figure-7.png")
    for name, row in table.items():
        print(f"{name:24} {row['wall_s']:7.2f} s ({row['wall_s_deviation']:.2f})  × {row['wall_s_to_control']:.3f}   "
              f"CPU {row['cpu_s']:7.2f} s ({row['cpu_s_deviation']:.2f})  × {row['cpu_s_to_control']:.3f}   "
              f"{row['mvoxel_per_s']:6.0f} Mvoxel/s  {row['peak_mb']:.0f} MB")


if __name__ == "__main__":
    main()
