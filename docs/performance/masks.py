#!/usr/bin/python3
"""Draws docs/performance/masks.png from the benchmark: void_and_cluster_bench --benchmark_format=json | masks.py masks.png"""

import json
import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt

runs = json.load(sys.stdin)["benchmarks"]
figure, (by_size, by_support) = plt.subplots(1, 2, figsize=(9, 3.6), dpi=90)
for series in sorted({run["name"].split("/")[1] for run in runs}):
    of = [run for run in runs if run["name"].split("/")[1] == series]
    points = sorted((run["ranks"], 1e6 * run["per_rank"]) for run in of if "sigma_tenths:11" in run["name"])
    by_size.plot(*zip(*points), marker="o", label=series)
    points = sorted((run["support"], 1e6 * run["per_rank"]) for run in of if "size:64" in run["name"])
    by_support.plot(*zip(*points), marker="o", label=series)
by_size.set(xscale="log", yscale="log", xlabel="voxels of the tile (σ = 1.1)", ylabel="µs per rank")
by_support.set(xscale="log", yscale="log", xlabel="weights of the kernel (64³, σ = 0.5 … 3.1)", ylabel="µs per rank")
for axis in (by_size, by_support):
    axis.grid(alpha=0.3)
    axis.legend()
figure.tight_layout()
figure.savefig(sys.argv[1])
