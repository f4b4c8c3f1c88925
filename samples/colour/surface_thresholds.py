#!/usr/bin/python3
"""Compares two ways to read a mask near the surface, on flat facets.

    samples/colour/surface_thresholds.py --program build/release/vdbdither [--printer NAME]... [--places N] [--json FILE]

by place   the threshold of a voxel depends on its place on the lattice
by depth   a column of voxels along the axis that the normal is closest to counts its voxels from the printed surface: within
           DEPTH_MM the count takes the place of the index along that axis, as in `halftone`

By place, what the eye sees first of a facet is a cut through the mask, or, after the dither of the shape, voxels that another
mask chose out of two layers. By depth it is one layer of the mask. Figures are those of mask_kernels.py.
"""

import json
import tempfile

import numpy as np
import optics
from mask_kernels import COUNT, INTERVALS, LENGTHS_MM, MASK_SEEDS, NORMALS, RANDOM_SIZE, REPEATS, SPACING_MM, STEP_MM, STEPS
from mask_kernels import parser_of, powers, printed, rays
from tiles import LATTICES_MM, halftone_tile, shape_tile

DEPTH_MM = 0.15
WAYS = ("by place", "by depth")


def by_depth(index, pitch, normal, plane_mm, shape):
    """Returns the places [..., 3] in the mask for printed voxels [..., 3] below the plane n . p = plane_mm."""
    axis = int(np.argmax(np.abs(normal)))
    outward = 1 if normal[axis] > 0 else -1
    most = int(np.ceil(DEPTH_MM / pitch[axis]))
    count = np.zeros(index.shape[:-1], int)
    is_column = np.ones(index.shape[:-1], bool)
    above = index.astype(int)
    for _ in range(most):
        above[..., axis] += outward
        is_column &= printed(above, pitch, normal, plane_mm, shape)
        count += is_column
    places = index.astype(int)
    places[..., axis] = np.where(count < most, -outward * count, index[..., axis])
    return places


def study(pitch, tiles, shape, place_count):
    """Returns shares of the noise of random choice [ways, normals, lengths]."""
    eye = optics.Eye(COUNT, SPACING_MM)
    weights = np.array([optics.depth_weights(length, STEP_MM, STEPS) for length in LENGTHS_MM], np.float32)
    shares = np.zeros((len(WAYS), len(NORMALS), len(LENGTHS_MM)))
    for number, given in enumerate(NORMALS):
        normal = optics.frame(given)[2]
        found, of_random = np.zeros((2, len(WAYS), len(INTERVALS), len(LENGTHS_MM)))
        for place in range(place_count):
            rng = np.random.default_rng((place, number))
            origin = rng.uniform(0, 5, 3)
            index = rays(pitch, given, origin, shape)
            tile = tiles[place % len(tiles)]
            found[0] += powers(tile, index, weights, eye)
            found[1] += powers(tile, by_depth(index, pitch, normal, origin @ normal, shape), weights, eye)
            for _ in range(REPEATS):
                of_random += powers(rng.random(RANDOM_SIZE, np.float32), index, weights, eye) / REPEATS
        shares[:, number] = np.sqrt(found / of_random).mean(axis=1)
    return shares


def main():
    parser = parser_of(__doc__)
    parser.add_argument("--places", type=int, default=4, help="places of each facet (%(default)s)")
    arguments = parser.parse_args()
    results = {}
    with tempfile.TemporaryDirectory() as folder:
        shape_mask = shape_tile(arguments.program, folder, 1)
        for printer in arguments.printer or LATTICES_MM:
            pitch = np.array(LATTICES_MM[printer])
            tiles = [halftone_tile(arguments.program, folder, pitch, seed) for seed in MASK_SEEDS]
            for dither, shape in (("without the dither", None), ("with the dither", shape_mask)):
                shares = study(pitch, tiles, shape, arguments.places)
                for way, rows in zip(WAYS, shares):
                    cells = zip(rows.mean(axis=0), rows.max(axis=0))
                    print(f"{printer:22}{dither:20}{way:10}" + "".join(f"{mean:8.2f}{worst:6.2f}" for mean, worst in cells),
                          flush=True)
                    results.setdefault(printer, {}).setdefault(dither, {})[way] = rows.round(3).tolist()
    if arguments.json:
        arguments.json.write_text(json.dumps({"normals": NORMALS, "lengths_mm": LENGTHS_MM, "depth_mm": DEPTH_MM,
                                              "places": arguments.places, "printers": results}) + "\n")


if __name__ == "__main__":
    main()
