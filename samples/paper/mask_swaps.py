#!/usr/bin/python3
"""Swaps thresholds of a mask to reduce low frequencies on its facets: mask_swaps.py IN.vdb OUT.vdb NORMALS REACH ROUNDS [SEED]

NORMALS: `all` (the half sphere, 10° apart), `axes` (0.5° … 8° off the lattice axes) or `both` (half of either).
REACH:   the maximum difference of two thresholds that are swapped; 1 allows any.

The objective is the power of the grey mask on the voxel planes of those normals, below a Gaussian low-pass of 2.3 voxels, over
all positions of the plane. Two voxels at the offset d lie on a common plane along the axis z with the probability
max(0, 1 - |d_z - s·d_x - t·d_y|). The objective is therefore a sum of m(u)·m(v)·K(v - u) over all pairs, and the field m * K
gives the change by a swap. A round tries random pairs; they are few enough to hardly affect each other.
"""

import sys

import numpy as np
import pyopenvdb

SPREAD = 2.3


def normals(kind):
    near = [(tilt, turn) for tilt in (0.5, 1, 2, 3, 4, 5, 6, 7, 8) for turn in range(15, 360, 30)]
    if kind == "axes":
        return [(tilt, turn, 1 / len(near)) for tilt, turn in near]
    wide = [(tilt, turn, np.sin(np.radians(tilt))) for tilt in range(5, 60, 10) for turn in range(5, 360, 10)]
    total = sum(weight for _, _, weight in wide)
    wide = [(tilt, turn, weight / total) for tilt, turn, weight in wide]
    return wide if kind == "all" else [(a, b, w / 2) for a, b, w in wide + normals("axes")]


def kernel(size, kind):
    distance = [(np.arange(n) + n // 2) % n - n // 2 for n in size]
    d = np.meshgrid(*distance, indexing="ij")
    total = np.zeros(size)
    for axis in range(3):
        x, y, z = d[(axis + 1) % 3], d[(axis + 2) % 3], d[axis]
        for tilt, turn, weight in normals(kind):
            s, t = np.tan(np.radians(tilt)) * np.array([np.cos(np.radians(turn)), np.sin(np.radians(turn))])
            if max(abs(s), abs(t)) > 1:
                continue  # another axis is dominant
            rise = s * x + t * y
            total += weight * np.exp(-(x * x + y * y + rise * rise) / (4 * SPREAD**2)) * np.maximum(0, 1 - np.abs(z - rise))
    return total


def swapped(m, kind, reach, rounds, seed):
    draw = np.random.default_rng(seed)
    k = kernel(m.shape, kind)
    power = np.maximum(np.fft.rfftn(k).real, 0)
    power[0, 0, 0] = 0
    k = np.fft.irfftn(power, m.shape)
    flat, k_flat = m.ravel(), k.ravel()
    pairs = m.size // 64
    before = energy = np.inf
    for number in range(rounds):
        field = np.fft.irfftn(np.fft.rfftn(m) * power, m.shape).ravel()
        energy = float(flat @ field) / m.size
        if number == 0:
            before = energy
        picked = draw.choice(m.size, 2 * pairs, replace=False)
        u, v = picked[:pairs], picked[pairs:]
        change = flat[v] - flat[u]
        offset = [(a - b) % n for a, b, n in zip(np.unravel_index(v, m.shape), np.unravel_index(u, m.shape), m.shape)]
        gain = 2 * change * (field[u] - field[v]) + 2 * change**2 * (k_flat[0] - k_flat[np.ravel_multi_index(offset, m.shape)])
        good = (gain < 0) & (np.abs(change) <= reach)
        u, v = u[good], v[good]
        flat[u], flat[v] = flat[v], flat[u].copy()
    return before, energy


if __name__ == "__main__":
    source, target, kind, reach, rounds = sys.argv[1:6]
    grid = pyopenvdb.read(source, "mask")
    low, high = grid.evalActiveVoxelBoundingBox()
    values = np.empty([h - l + 1 for l, h in zip(low, high)], np.float32)
    grid.copyToArray(values)
    m = values.astype(float) - 0.5
    before, after = swapped(m, kind, float(reach), int(rounds), int(sys.argv[6]) if len(sys.argv) > 6 else 1)
    print(f"{target}: objective {before:.6f} before, {after:.6f} after")
    result = pyopenvdb.FloatGrid()
    result.name = "mask"
    result.copyFromArray((m + 0.5).astype(np.float32), tolerance=0)
    pyopenvdb.write(target, [result])
