#!/usr/bin/python3
"""Compares kernels of void and cluster for the mask of `halftone`, on flat facets.

    samples/colour/mask_kernels.py --program build/release/vdbdither [--printer NAME]... [--json FILE]

A material takes the voxels whose threshold lies in an interval. A facet shows it through LENGTHS_MM of ink to an eye at 30 cm
(optics.py). The rms of that luminance is given as a share of the rms of random choice on the same voxels: the mean over
NORMALS and INTERVALS, and the worst normal. Each facet is cut at PLACES, with masks of MASK_SEEDS in turn; power is the mean over
the places, and for random choice over REPEATS random tiles at each of them. The error is the standard deviation of the mean
share between the places, divided by the root of their number.

Facets are cut without and with the dither of the shape: M of the default mask of `dither` at the voxel, with the constant
amplitude 2, prints where d + 2 k_D (M - 1/2) < 0. There the printed voxels and the thresholds come from two masks.
"""

import argparse
import json
import pathlib
import tempfile
import time

import numpy as np
import optics
from tiles import LATTICES_MM, halftone_size, make_tile, shape_tile

NORMALS = [(0, 0, 1), (0.36, 0.48, 0.8), (1, 0, 0), (0.1, 0.03, 1), (-0.5, 0.7, -0.5), (0, 1, 0), (1, 0, 1), (0.02, -0.05, 1),
           (-0.8, 0.25, 0.55), (0, 1, 1), (1, 1, 0), (1, 0.06, 0.1), (1, 1, 1), (0.05, -1, 0.12)]
INTERVALS = [(0, 0.06), (0, 0.2), (0, 0.45), (0.1, 0.25), (0.3, 0.7)]
PLACES = 4
MASK_SEEDS = (2, 3)
REPEATS = 3
LENGTHS_MM = (0, 0.05, 0.15)
# Title: kernel, sigma, whether sigma is in mm or in voxels, the weight of space.
NO_PLANES = 1e6
KERNELS = {
    "gauss, 60 um": ("gauss", 0.06, "mm", 2),
    "gauss, 1.1 voxels": ("gauss", 1.1, "voxels", 2),
    "axis-mix, 0.8 voxels": ("axis-mix", 0.8, "voxels", 2),
    "exponential, 50 um, no planes": ("exponential", 0.05, "mm", NO_PLANES),
    "exponential, 70 um, no planes": ("exponential", 0.07, "mm", NO_PLANES),
    "exponential, 40 um, weight 3": ("exponential", 0.04, "mm", 3),
    "exponential, 70 um, weight 3": ("exponential", 0.07, "mm", 3),
    "exponential, 100 um, weight 3": ("exponential", 0.1, "mm", 3),
    "exponential, 70 um, weight 1": ("exponential", 0.07, "mm", 1),
}

COUNT, SPACING_MM = 120, 0.025
STEP_MM, STEPS = 0.007, 130
RIM = 12
RANDOM_SIZE = (128, 128, 256)


def printed(index, pitch, normal, plane_mm, shape):
    """Returns whether voxels [..., 3] below the plane n . p = plane_mm are printed. shape: the mask of the dither, or None."""
    distance = (index * pitch) @ normal - plane_mm
    if shape is not None:
        k_d = 0.5 / np.abs(normal / pitch).max()
        distance += 2 * k_d * (shape[tuple(np.moveaxis(index % shape.shape, -1, 0))] - 0.5)
    return distance < 0


def rays(pitch, normal, origin, shape):
    """Returns the voxels [STEPS, COUNT^2, 3] that rays into a facet through `origin` (mm) pass in printed matter."""
    u, v, n = optics.frame(normal)
    place = (np.arange(COUNT) - COUNT / 2) * SPACING_MM
    points = (origin + place[:, None, None] * u + place[None, :, None] * v).reshape(-1, 3)
    plane_mm = origin @ n
    top_mm = 2 * np.abs(n * pitch).sum()
    everyone, seen = np.arange(len(points)), np.zeros(len(points), int)
    found = np.zeros((STEPS, len(points), 3), np.int16)
    for k in range(int(2 * top_mm / STEP_MM) + STEPS):
        index = np.rint((points + (top_mm - (k + 0.5) * STEP_MM) * n) / pitch).astype(int)
        here = everyone[printed(index, pitch, n, plane_mm, shape) & (seen < STEPS)]
        found[seen[here], here] = index[here]
        seen[here] += 1
        if seen.min() == STEPS:
            return found
    raise ValueError("rays end above the facet")


def powers(tile, index, weights, eye):
    """Returns the variance of the seen luminance [intervals, lengths] of the parts of a mask."""
    thresholds = tile[tuple(np.moveaxis(index % np.array(tile.shape, np.int16), -1, 0))]
    inner = slice(RIM, COUNT - RIM)
    result = []
    for low, high in INTERVALS:
        shares = weights @ ((thresholds >= low) & (thresholds < high)).astype(np.float32)
        seen = np.fft.irfft2(eye.spectra(shares) * eye.grey, (COUNT, COUNT))
        result.append(seen[:, inner, inner].var(axis=(1, 2)))
    return np.array(result)


def study(pitch, tiles, shape):
    """Returns the powers [places, masks, normals, intervals, lengths] and those of random choice [places, 1, ...].

    tiles  for each mask one per seed
    """
    eye = optics.Eye(COUNT, SPACING_MM)
    weights = np.array([optics.depth_weights(length, STEP_MM, STEPS) for length in LENGTHS_MM], np.float32)
    found = np.zeros((PLACES, len(tiles) + 1, len(NORMALS), len(INTERVALS), len(LENGTHS_MM)))
    for number, normal in enumerate(NORMALS):
        for place in range(PLACES):
            rng = np.random.default_rng((place, number))
            index = rays(pitch, normal, rng.uniform(0, 5, 3), shape)
            for m, of_seeds in enumerate(tiles):
                found[place, m, number] = powers(of_seeds[place % len(of_seeds)], index, weights, eye)
            for _ in range(REPEATS):
                found[place, -1, number] += powers(rng.random(RANDOM_SIZE, np.float32), index, weights, eye) / REPEATS
    return found[:, :-1], found[:, -1:]


def figures(found, of_random):
    """Returns the entries of KERNELS for the powers of `study`."""
    shares = np.sqrt(found.mean(axis=0) / of_random.mean(axis=0))
    by_normal = shares.mean(axis=2)
    errors = np.sqrt(found / of_random.mean(axis=0)).mean(axis=(2, 3)).std(axis=0, ddof=1) / np.sqrt(PLACES)
    rows = {"mean": by_normal.mean(axis=1), "error": errors, "worst": by_normal.max(axis=1), "by_normal": by_normal,
            "by_interval": shares.mean(axis=1)}
    return {name: {key: row[m].round(3).tolist() for key, row in rows.items()} for m, name in enumerate(KERNELS)}


def lines_of(result):
    lines = [f"{'':32}" + "".join(f"{'l = %d um' % round(1000 * length):>22}" for length in LENGTHS_MM)]
    for name, entry in result.items():
        cells = zip(entry["mean"], entry["error"], entry["worst"])
        lines.append(f"{name:32}" + "".join(f"{mean:10.2f} {error:.3f} {worst:5.2f}" for mean, error, worst in cells))
    return lines


def parser_of(text):
    """Returns a parser for a study of lattices that `text` describes in its first line."""
    parser = argparse.ArgumentParser(description=text.partition("\n")[0])
    parser.add_argument("--program", type=pathlib.Path, required=True)
    parser.add_argument("--printer", action="append", choices=LATTICES_MM)
    parser.add_argument("--json", type=pathlib.Path)
    return parser


def main():
    arguments = parser_of(__doc__).parse_args()
    results = {}
    with tempfile.TemporaryDirectory() as folder:
        shape_mask = shape_tile(arguments.program, folder, 1)
        for printer in arguments.printer or LATTICES_MM:
            pitch = np.array(LATTICES_MM[printer])
            tiles = [[make_tile(arguments.program, folder, halftone_size(pitch), seed, kernel,
                                sigma / pitch if unit == "mm" else np.full(3, sigma), weight) for seed in MASK_SEEDS]
                     for kernel, sigma, unit, weight in KERNELS.values()]
            results[printer] = {}
            for title, shape in (("without shape dither", None), ("with shape dither", shape_mask)):
                start = time.monotonic()
                results[printer][title] = figures(*study(pitch, tiles, shape))
                print("\n".join([f"{printer}, {title}, {time.monotonic() - start:.0f} s: mean, error, worst normal",
                                 *lines_of(results[printer][title])]), flush=True)
    if arguments.json:
        arguments.json.write_text(json.dumps({"normals": NORMALS, "intervals": INTERVALS, "lengths_mm": LENGTHS_MM,
                                              "printers": results}) + "\n")


if __name__ == "__main__":
    main()
