#!/usr/bin/python3
"""Makes the tables and figures of docs/evaluation.md from the output of dither_quality_bench.

    quality.py RESULT_FOLDER FILE.jsonl …

Writes quality.json (all figures, averaged over positions and directions), the PNGs, and the tables to stdout.
"""

import collections
import json
import pathlib
import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from PIL import Image

result = pathlib.Path(sys.argv[1])
rows = []
for path in sys.argv[2:]:
    for line in open(path):
        if line.endswith("}\n"):
            rows.append(json.loads(line))
result.mkdir(parents=True, exist_ok=True)
plt.rcParams.update({"font.size": 8, "figure.dpi": 90, "axes.grid": True, "grid.alpha": 0.3})

SHOWN = ["control", "interlacing", "paper", "best"]
MEASURES = ["mean", "rms", "stairs", "modulation", "bias"]


def save(figure, name):
    figure.savefig(result / name, bbox_inches="tight")
    plt.close(figure)
    with Image.open(result / name) as image:
        image.convert("RGB").quantize(64).save(result / name, optimize=True)


def table(head, lines):
    print("| " + " | ".join(head) + " |")
    print("| " + " | ".join("---" for _ in head) + " |")
    for line in lines:
        print("| " + " | ".join(str(cell) for cell in line) + " |")
    print()


facets = collections.defaultdict(lambda: collections.defaultdict(list))
every = collections.defaultdict(lambda: collections.defaultdict(list))
for row in rows:
    if row["set"] in ("facets", "sweep"):
        of = facets if row["set"] == "facets" else every
        of[row["lattice"], row["spread"], row["tilt"]][row["method"]].append(row)
tilts = sorted({key[2] for key in facets})
lattices = [name for name in ("mimaki", "j750", "cubic") if any(key[0] == name for key in facets)]


def average(key, method, measure="mean", of=facets):
    of = of[key].get(method)
    return float(np.mean([abs(row[measure]) for row in of])) if of else float("nan")


summary = {"facets": [], "sweep": [], "smooth": [], "detail": []}
for name, of in (("facets", facets), ("sweep", every)):
    for key in sorted(of):
        for method in of[key]:
            entry = {"lattice": key[0], "spread_um": key[1], "tilt": key[2], "method": method}
            for measure in MEASURES:
                entry[measure + "_um"] = round(average(key, method, measure, of), 3)
            entry["greatest_mean_um"] = round(max(row["mean"] for row in of[key][method]), 3)
            summary[name].append(entry)

for lattice in lattices:
    for spread in (50, 100):
        print(f"### {lattice}, σ = {spread} µm: mean error, µm\n")
        table(["tilt"] + SHOWN + ["best / paper"],
              [[f"{t:g}°"] + [f"{average((lattice, spread, t), m):.2f}" for m in SHOWN] +
               [f"{average((lattice, spread, t), 'best') / average((lattice, spread, t), 'paper'):.2f}"] for t in tilts])

worse = []
for key, methods in facets.items():
    by_direction = collections.defaultdict(dict)
    for method in SHOWN:
        for row in methods.get(method, []):
            by_direction[row["axis"], row["azimuth"]][method] = row["mean"]
    for direction, of in by_direction.items():
        if len(of) == len(SHOWN):
            worse.append((of["best"] - min(of["control"], of["interlacing"]), key, direction, of))
if worse:
    worse.sort(key=lambda item: -item[0])
    print(f"single directions: best is worse than the better of control and interlacing in "
          f"{sum(item[0] > 0 for item in worse)} of {len(worse)}, by more than 0.3 µm in "
          f"{sum(item[0] > 0.3 for item in worse)}, by {worse[0][0]:.2f} µm at most: {worse[0][1:]}\n")
for method in SHOWN:
    of = [abs(row["bias"]) / row["diameter"] for key in facets for row in facets[key].get(method, [])]
    if of:
        print(f"bias of {method}: {100 * np.mean(of):.2f} % of a voxel diameter on average, at most {100 * max(of):.1f} %")
print()

if facets:
    figure, axes = plt.subplots(len(lattices), 2, figsize=(8, 2.4 * len(lattices)), sharex=True, squeeze=False)
    for i, lattice in enumerate(lattices):
        for j, spread in enumerate((50, 100)):
            for method in SHOWN:
                axes[i, j].plot(tilts, [average((lattice, spread, t), method) for t in tilts], "o-", ms=3, lw=1, label=method)
            axes[i, j].set_xscale("log")
            axes[i, j].set_yscale("log")
            axes[i, j].set_title(f"{lattice}, blur of {spread} µm")
            axes[i, j].set_ylabel("mean error, µm")
            axes[i, j].set_yticks([0.5, 1, 2, 5, 10], ["0.5", "1", "2", "5", "10"])
            axes[i, j].minorticks_off()
            axes[i, j].set_xticks([0.5, 1, 2, 5, 10, 20, 45], ["0.5°", "1°", "2°", "5°", "10°", "20°", "45°"])
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="upper center", ncols=4)
    figure.tight_layout(rect=(0, 0, 1, 0.96))
    save(figure, "tilts.png")

for method in SHOWN:
    of = [row["mean"] for methods in facets.values() for row in methods.get(method, [])]
    if of:
        print(f"{method}: {np.mean(of):.2f} µm on average over {len(of)} combinations")
print()

constants = ["control", "0.5 voxel", "1 voxel", "1.5 voxel", "2 voxel", "2.5 foot", "3 foot", "4 foot", "5 foot", "6 foot",
             "triangular 2", "coverage", "4 closest", "4 voxel", "2 closest", "2 voxel, paper's mask", "paper",
             "best 25", "best", "best 100"]
if every:
    shown = sorted({key[2] for key in every})
    for spread in (50, 100):
        print(f"### mimaki, σ = {spread} µm, by rule: mean error, µm\n")
        table(["rule"] + [f"{t:g}°" for t in shown],
              [[m] + [f"{average(('mimaki', spread, t), m, of=every):.2f}" for t in shown] for m in constants])
    for measure, title in (("stairs", "residual staircase"), ("modulation", "noise modulation")):
        print(f"### mimaki, σ = 50 µm: {title}, µm\n")
        table(["rule"] + [f"{t:g}°" for t in shown],
              [[m] + [f"{average(('mimaki', 50, t), m, measure, every):.2f}" for t in shown]
               for m in ["control", "interlacing", "1 voxel", "2 voxel", "triangular 2", "3 foot", "4 foot", "paper", "best"]])

smooth = [row for row in rows if row["set"] == "smooth"]
if smooth:
    print("### sphere of 1.5 mm radius and relief\n")
    lines = []
    for row in smooth:
        summary["smooth"].append({k: v for k, v in row.items() if k != "set"})
    for lattice in lattices or ["mimaki", "j750", "cubic"]:
        for shape in ("sphere", "relief"):
            for spread in (50, 100):
                of = {row["method"]: row for row in smooth
                      if (row["lattice"], row["shape"], row["spread"]) == (lattice, shape, spread)}
                lines.append([lattice, shape, spread] + [f"{of[m]['mean']:.2f} ({of[m]['bias']:+.2f})" for m in SHOWN])
    table(["lattice", "shape", "σ, µm"] + [m + ": mean (bias)" for m in SHOWN], lines)
    table(["sphere on"] + SHOWN,
          [[lattice] + [next(f"{row['volume_error_percent']:+.3f} %" for row in smooth if row["shape"] == "sphere"
                             and row["lattice"] == lattice and row["method"] == m) for m in SHOWN]
           for lattice in ("mimaki", "j750", "cubic")])

details = collections.defaultdict(lambda: collections.defaultdict(list))
for row in rows:
    if row["set"] == "detail":
        details[row["lattice"], row["piece"], row["size"]][row["method"]].append(row)
        summary["detail"].append({k: v for k, v in row.items() if k != "set"})
METHODS = SHOWN + ["best unguarded", "2 voxel", "coverage"]
for piece, what in (("plate", "volume_error_percent"), ("wires", "volume_error_percent"),
                    ("wires", "stroke_volume_error_percent"), ("wires", "stroke_overlap"),
                    ("comb", "components"), ("plate", "components"), ("wires", "components"), ("plate", "tunnels"),
                    ("embossed", "stroke_volume_error_percent"), ("embossed", "stroke_overlap"),
                    ("engraved", "stroke_volume_error_percent"), ("engraved", "stroke_overlap")):
    keys = sorted(key for key in details if key[1] == piece)
    if not keys:
        continue
    print(f"### {piece}: {what}\n")
    lines = []
    for key in keys:
        cells = []
        for method in METHODS:
            values = [row[what] for row in details[key].get(method, [])]
            if what in ("components", "tunnels"):
                cells.append(", ".join(str(v) for v in values))
            elif what.endswith("percent"):
                cells.append(", ".join(f"{v:+.1f}" for v in values))
            else:
                cells.append(", ".join(f"{v:.2f}" for v in values))
        lines.append([key[0], f"{key[2]:g}"] + cells)
    table(["lattice", "size"] + METHODS, lines)

heights = [row for row in rows if row["set"] == "heights"]
if heights:
    methods = list(dict.fromkeys(SHOWN + [row["method"] for row in heights]))
    figure, axes = plt.subplots(len(methods), 2, figsize=(8, 1.9 * len(methods)))
    for row in heights:
        ax = axes[methods.index(row["method"]), 0 if row["axis"] == 2 else 1]
        # Under grazing light from the left the eye sees the slope.
        um = np.array(row["um"]).reshape(row["rows"], -1)
        ax.imshow(-np.gradient(um, 40, axis=1), cmap="gray", vmin=-0.12, vmax=0.12, interpolation="bilinear")
        ax.set_axis_off()
        ax.set_title(f"{row['method']}, 2° off {'z' if row['axis'] == 2 else 'y'}: mean error {np.mean(np.abs(um)):.1f} µm")
    figure.tight_layout()
    save(figure, "steps.png")

(result / "quality.json").write_text(json.dumps(summary, indent=None, separators=(",", ":")).replace("},{", "},\n{") + "\n")
