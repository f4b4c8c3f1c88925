"""Tiles of dither masks: made by the program, read from their files."""

import pathlib
import subprocess

import numpy as np
import pyopenvdb

LATTICES_MM = {"stratasys-j750-14um": (25.4 / 600, 25.4 / 300, 0.014), "mimaki-3duj-553": (0.042, 0.084, 0.022)}
SHAPE_SIZE = (64, 64, 64)


def read_tile(path):
    """Returns the thresholds [x, y, z] of a mask."""
    grid = pyopenvdb.read(str(path), "mask")
    low, high = grid.evalActiveVoxelBoundingBox()
    tile = np.empty([last - first + 1 for first, last in zip(low, high)], np.float32)
    grid.copyToArray(tile, ijk=low)
    return tile


def make_tile(program, folder, size, seed, kernel, sigma, weight=2):
    """Returns the thresholds [x, y, z] of a new mask. sigma: voxels [3]. Raises SystemExit with the words of the program."""
    path = pathlib.Path(folder) / "tile.vdb"
    command = [str(program), "mask", "--size", ",".join(map(str, size)), "--seed", str(seed), "--kernel", kernel, "--sigma",
               ",".join(repr(float(length)) for length in sigma), "-o", str(path), "--overwrite", "--quiet"]
    if kernel in ("axis-mix", "exponential"):
        command += ["--space-weight", f"{weight:g}"]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode:
        raise SystemExit(f"tiles: {' '.join(command[1:])}\n{done.stderr.strip()}")
    return read_tile(path)


def halftone_size(pitch_mm):
    """Returns the period [3] of the mask of `halftone`: powers of two, at least 1.75 mm long, 16 ... 256."""
    return tuple(int(np.clip(2 ** np.ceil(np.log2(1.75 / pitch)), 16, 256)) for pitch in pitch_mm)


def halftone_tile(program, folder, pitch_mm, seed):
    """Returns the mask of `halftone` on a lattice: exponential, 70 um, space weight 3."""
    return make_tile(program, folder, halftone_size(pitch_mm), seed, "exponential", 0.07 / np.array(pitch_mm), 3)


def shape_tile(program, folder, seed):
    """Returns the mask of `dither`: axis-mix, sigma 0.8 voxels."""
    return make_tile(program, folder, SHAPE_SIZE, seed, "axis-mix", (0.8, 0.8, 0.8))
