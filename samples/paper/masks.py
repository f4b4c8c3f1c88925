#!/usr/bin/python3
"""Draws the figures on masks and writes their numbers: masks.py WORK_FOLDER RESULT_FOLDER (see masks.sh)."""

import json
import pathlib
import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
import pyopenvdb
from PIL import Image

work, result = map(pathlib.Path, sys.argv[1:3])
plt.rcParams.update({"font.size": 8, "figure.dpi": 90, "axes.grid": True, "grid.alpha": 0.3})


def measurements():
    """{kernel: {sigma: [spectrum of every seed]}}"""
    found = {}
    for path in sorted(work.glob("*-*-*.json")):
        kernel, sigma, _ = path.stem.split("-")
        found.setdefault(kernel, {}).setdefault(float(sigma), []).append(json.loads(path.read_text()))
    return found


def tile(kernel, sigma):
    grid = pyopenvdb.read(str(work / f"{kernel}-{sigma:.1f}-1.vdb"), "mask")
    values = np.empty((32, 32, 32), np.float32)
    grid.copyToArray(values)
    return values


def save(figure, name):
    figure.tight_layout()
    figure.savefig(result / name)
    plt.close(figure)
    with Image.open(result / name) as image:
        image.convert("RGB").quantize(64).save(result / name, optimize=True)


def low(bands, spectrum):
    """Power below an eighth of a cycle, the bands weighted by their area."""
    count = spectrum["low_bands"]
    return float(np.average(bands[:count], weights=2 * np.arange(count) + 1))


def thresholded(spectrum, key, over):
    return over([level["projection"][key] for level in spectrum["thresholded"]], axis=0)


def figures_of(spectrum):
    """The low-frequency power of one mask, white noise = 1."""
    levels = [level["projection"] for level in spectrum["thresholded"]]
    return {
        "grey_mean": spectrum["grey"]["projection"]["low_mean"],
        "grey_greatest": low(spectrum["grey"]["projection"]["greatest"], spectrum),
        "thresholded_mean": float(np.mean([level["low_mean"] for level in levels])),
        "thresholded_greatest": max(low(level["greatest"], spectrum) for level in levels),
        "by_threshold": [level["low_mean"] for level in levels],
        "voxel_plane_near_axes": spectrum["grey"]["voxel_plane_near_axes"]["low_mean"],
        "voxel_plane_thresholded_near_axes": float(
            np.mean([level["voxel_plane_near_axes"]["low_mean"] for level in spectrum["thresholded"]])),
    }


def mean_and_spread(seeds):
    table = {}
    for key in seeds[0]:
        values = np.array([seed[key] for seed in seeds])
        table[key] = {"mean": np.round(values.mean(axis=0), 4).tolist(),
                      "spread": np.round(values.max(axis=0) - values.min(axis=0), 4).tolist()}
    return table


def figure_2():
    figure, axes = plt.subplots(2, 2, figsize=(5, 5))
    for row, sigma in zip(axes, (1.9, 1.1)):
        values = tile("peters", sigma)
        power = np.abs(np.fft.fftshift(np.fft.fftn(values - values.mean()))) ** 2 / (values.size * values.var())
        for axis, image, title in ((row[0], power[:, :, 16], "slice through the spectrum"),
                                   (row[1], power.mean(axis=2), "projection along z")):
            axis.imshow(image, cmap="gray", vmin=0, vmax=3, extent=(-0.5, 0.5, -0.5, 0.5))
            axis.set_title(f"σ = {sigma}: {title}")
            axis.grid(False)
    save(figure, "figure-2.png")


def figure_4(masks):
    figure, axes = plt.subplots(2, 3, figsize=(10, 6))
    shown = [s for s in (0.5, 0.8, 1.1, 1.5, 1.9, 2.5, 3.1) if s in masks]
    panels = ((axes[0, 0], "a  grey, mean", lambda s: s["grey"]["projection"]["mean"]),
              (axes[0, 1], "b  grey, greatest", lambda s: s["grey"]["projection"]["greatest"]),
              (axes[0, 2], "c  thresholded, mean", lambda s: thresholded(s, "mean", np.mean)),
              (axes[1, 0], "d  thresholded, greatest", lambda s: thresholded(s, "greatest", np.max)))
    for axis, title, curve in panels:
        for sigma in shown:
            spectrum = masks[sigma][0]
            frequency = (np.arange(spectrum["bands"]) + 0.5) / (2 * spectrum["bands"])
            axis.plot(frequency, curve(spectrum), label=f"σ = {sigma}", linewidth=1)
        top = 2 if "mean" in title else 4  # the maximum of σ = 0.5 is far above
        axis.set(title=title, xlabel="cycles per voxel", ylabel="power, white noise = 1", ylim=(0, top))
    axes[0, 0].legend(ncol=2)
    table = {sigma: mean_and_spread([figures_of(s) for s in seeds]) for sigma, seeds in masks.items()}
    sigmas = sorted(table)
    for key in ("grey_mean", "grey_greatest", "thresholded_mean", "thresholded_greatest"):
        axes[1, 1].errorbar(sigmas, [table[s][key]["mean"] for s in sigmas],
                            [table[s][key]["spread"] / 2 for s in sigmas], label=key.replace("_", ", "), linewidth=1)
    axes[1, 1].set(title="e  power below 1/8 cycle per voxel", xlabel="σ", ylim=(0, 3))
    axes[1, 1].legend()
    kappa = [level["kappa"] for level in masks[sigmas[0]][0]["thresholded"]]
    for sigma in shown:
        axes[1, 2].plot(kappa, table[sigma]["by_threshold"]["mean"], label=f"σ = {sigma}", linewidth=1)
    axes[1, 2].set(title="f  the same by threshold, mean", xlabel="κ", ylim=(0, None))
    save(figure, "figure-4.png")


def figure_5():
    sigmas = (0.5, 0.8, 1.1, 1.9, 2.5)
    figure, axes = plt.subplots(3, len(sigmas), figsize=(2 * len(sigmas), 6.2))
    x, y = np.meshgrid(np.arange(96), np.arange(96), indexing="ij")
    for column, sigma in enumerate(sigmas):
        values = tile("peters", sigma)
        for row, (slope, kappa) in enumerate((((0.31, 0.17), 0.1), ((0.31, 0.17), 0.5), ((0.0, 0.0), 0.5))):
            z = np.floor(slope[0] * x + slope[1] * y + 0.5).astype(int)
            axis = axes[row, column]
            axis.imshow(values[x % 32, y % 32, z % 32] > kappa, cmap="gray", interpolation="nearest")
            axis.set(xticks=[], yticks=[], title=f"σ = {sigma}, κ = {kappa}, " + ("tilted" if slope[0] else "z = 0"))
            axis.title.set_fontsize(7)
    save(figure, "figure-5.png")


found = measurements()
figure_2()
figure_4(found["peters"])
figure_5()
first = found["peters"][1.1][0]
summary = {"about": "32³ masks; power of the slices below 1/8 cycle per voxel, white noise = 1; spread = range over seeds",
           "step_degrees": first["step_degrees"], "thresholds": [t["kappa"] for t in first["thresholded"]], "kernels": {}}
for kernel, masks in found.items():
    summary["kernels"][kernel] = {
        str(sigma): {"seeds": len(seeds), **mean_and_spread([figures_of(s) for s in seeds])} for sigma, seeds in masks.items()}
(result / "masks.json").write_text(json.dumps(summary, indent=1, ensure_ascii=False) + "\n")
