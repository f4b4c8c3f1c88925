#!/usr/bin/python3
"""Measures the height error of flat facets dithered by masks, after a Gaussian spread.

mask_facets.py RESULT.json MASK.vdb...

A plane, tilted against each lattice axis or with a normal anywhere on the sphere, is dithered as by `dither --at foot` (a voxel is
printed where d + amplitude · k_D · (M(foot voxel) - ½) < 0). Its height along the axis is compared with the plane, and a Gaussian
spreads the difference over the facet. The result is the root mean square of the spread difference, µm along the normal. Every
mask is applied to the same facets: POSITIONS of them per axis and tilt, with random azimuth and offset.
"""

import json
import pathlib
import sys

import numpy as np
import pyopenvdb

LATTICES_MM = {"cubic": (0.042, 0.042, 0.042), "mimaki-3duj-553": (0.042, 0.084, 0.022)}
TILTS = (0.5, 1, 2, 5, 10, 30)
AMPLITUDES = (2, 4)
SPREADS_MM = (0.05, 0.1)
POSITIONS = 8
EDGE_MM = 5
MARGIN_MM = 0.4  # four times the wider spread: the reach of the Gaussian over the border of the patch


def tile(path):
    grid = pyopenvdb.read(path, "mask")
    low, high = grid.evalActiveVoxelBoundingBox()
    values = np.empty([h - l + 1 for l, h in zip(low, high)], np.float32)
    grid.copyToArray(values)
    return values


def tilted(axis, tilt, azimuth):
    """Returns the unit normal `tilt` degrees off an axis."""
    normal = np.empty(3)
    normal[axis] = np.cos(np.radians(tilt))
    normal[(axis + 1) % 3] = np.sin(np.radians(tilt)) * np.cos(azimuth)
    normal[(axis + 2) % 3] = np.sin(np.radians(tilt)) * np.sin(azimuth)
    return normal


def facet(pitch, axis, normal, phase):
    """Returns the plane of a patch: the axes and indices of its columns, and their heights in voxels."""
    others = [a for a in range(3) if a != axis]
    u, v = np.meshgrid(*(np.arange(int(EDGE_MM / pitch[a])) for a in others), indexing="ij")
    slopes = [-normal[a] * pitch[a] / (normal[axis] * pitch[axis]) for a in others]
    return others, u, v, phase + slopes[0] * u + slopes[1] * v


def residual_mm(mask, pitch, axis, others, u, v, height, normal, amplitude, shift):
    """Returns the printed height minus that of the plane, along the normal."""
    k_d = 0.5 / np.max(np.abs(normal) / pitch)
    base = np.round(height).astype(int)
    reach = 2 + int(np.ceil(amplitude / 2 * k_d / (abs(normal[axis]) * pitch[axis])))
    printed = np.full(height.shape, -reach - 0.5)
    for offset in range(-reach, reach + 1):
        d = (base + offset - height) * pitch[axis] * normal[axis]
        foot = [None] * 3
        for a, index in ((others[0], u), (others[1], v), (axis, base + offset)):
            foot[a] = (np.floor(index - d * normal[a] / pitch[a] + 0.5).astype(int) + shift[a]) % mask.shape[a]
        printed += d + amplitude * k_d * (mask[tuple(foot)] - 0.5) < 0
    return (base + printed - height) * pitch[axis] * normal[axis]


def rms_um(residual, pitch, axis, others, normal, spread):
    """Returns the root mean square after the spread. Its distances are measured on the facet."""
    slope = [-normal[a] / normal[axis] for a in others]
    metric = np.linalg.inv(np.eye(2) + np.outer(slope, slope))
    f, g = np.meshgrid(*(np.fft.fftfreq(n, pitch[a]) for n, a in zip(residual.shape, others)), indexing="ij")
    square = metric[0, 0] * f * f + 2 * metric[0, 1] * f * g + metric[1, 1] * g * g
    blurred = np.fft.ifft2(np.fft.fft2(residual) * np.exp(-2 * np.pi**2 * spread**2 * square)).real
    inner = [slice(int(MARGIN_MM / pitch[a]), -int(MARGIN_MM / pitch[a])) for a in others]
    return 1e3 * float(np.sqrt(np.mean(blurred[tuple(inner)] ** 2)))


def facets(pitch):
    """Yields (name, axis of the columns, unit normal, phase, origin of the tile), the same in every run."""
    draw = np.random.default_rng(1)
    for tilt in TILTS:
        for axis in range(3):
            for _ in range(POSITIONS):
                normal = tilted(axis, tilt, draw.uniform(0, 2 * np.pi))
                yield f"tilt {tilt}", axis, normal, draw.uniform(0, 1), draw.integers(0, 2**16, 3)
    for _ in range(12 * POSITIONS):
        normal = draw.normal(size=3)
        normal /= np.linalg.norm(normal)
        axis = int(np.argmax(np.abs(normal) * pitch))
        yield "sphere", axis, normal * np.sign(normal[axis]), draw.uniform(0, 1), draw.integers(0, 2**16, 3)


def measured(mask):
    result = {}
    for lattice, pitch in LATTICES_MM.items():
        pitch = np.array(pitch)
        for amplitude in AMPLITUDES:
            for name, axis, normal, phase, shift in facets(pitch):
                others, u, v, height = facet(pitch, axis, normal, phase)
                residual = residual_mm(mask, pitch, axis, others, u, v, height, normal, amplitude, shift)
                for spread in SPREADS_MM:
                    key = f"{lattice} amplitude {amplitude} spread {round(spread * 1e3)} {name}"
                    value = rms_um(residual, pitch, axis, others, normal, spread)
                    result.setdefault(key, []).append(round(value, 4))
    return result


if __name__ == "__main__":
    target = pathlib.Path(sys.argv[1])
    table = json.loads(target.read_text()) if target.exists() else {}
    for path in sys.argv[2:]:
        name = pathlib.Path(path).stem
        if name in table:
            continue
        table[name] = measured(tile(path))
        target.write_text(json.dumps(table, indent=0) + "\n")
