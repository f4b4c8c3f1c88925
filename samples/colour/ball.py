#!/usr/bin/python3
"""Draws the grain of a grey ball, with thresholds that follow its surface and without: side by side in a PNG.

    samples/colour/ball.py OUT.png [--program build/release/vdbdither] [--printer NAME] [--length-mm 0.05]

Two views, from above and from between x and z, where the columns of `halftone` change their axis. Left: thresholds by the place
of a voxel on the lattice alone, as of grids without `surface`. Right: those that follow the surface. The lightness is what the
eye sees from 30 cm (optics.py) of light that reaches to a depth; its differences from the mean are drawn five times as large.
"""

import argparse
import pathlib
import subprocess
import tempfile

import numpy as np
import optics
import pyopenvdb
from PIL import Image
from printed_stack import read_stack

RADIUS_MM = 5.0
RINGS = 80
GREY = 0.55
VIEWS = ((0, 0, 1), (1, 0, 1))
SPACING_MM = 0.02
COUNT = 2 * int((RADIUS_MM + 0.3) / SPACING_MM)
STEP_MM = 0.007
CONTRAST = 5


def write_ball(path):
    """Writes a grey ball around (30, 30, 30) mm as OBJ."""
    angles = np.pi * np.arange(RINGS + 1) / RINGS, np.pi * np.arange(2 * RINGS) / RINGS
    places = [30 + RADIUS_MM * np.array([np.sin(a) * np.cos(b), np.sin(a) * np.sin(b), np.cos(a)]) for a in angles[0] for b in angles[1]]
    lines = ["v " + " ".join(f"{value:.6f}" for value in [*place, GREY, GREY, GREY]) for place in places]
    for ring in range(RINGS):
        for n in range(2 * RINGS):
            a, b = (2 * RINGS * ring + side + 1 for side in (n, (n + 1) % (2 * RINGS)))
            c, d = a + 2 * RINGS, b + 2 * RINGS
            lines += [f"f {a} {c} {b}"] if ring > 0 else []
            lines += [f"f {b} {c} {d}"] if ring < RINGS - 1 else []
    path.write_text("\n".join(lines) + "\n")


def seen(stack, direction, length_mm):
    """Returns the lightness, and whether the ball is there, both [COUNT, COUNT], from a direction."""
    u, v, n = optics.frame(direction)
    if v[2] < 0 or (v[2] == 0 and v[1] < 0):
        u, v = -u, -v
    side = (np.arange(COUNT) - (COUNT - 1) / 2) * SPACING_MM
    rays = 30 + RADIUS_MM * n + side[:, None] * u - side[:, None, None] * v
    first = stack.centre_mm(0, 0, 0)
    weights = optics.depth_weights(length_mm, STEP_MM, int(6 * length_mm / STEP_MM) or 1)
    shares = np.zeros((len(stack.materials), COUNT, COUNT))
    passed = np.zeros((COUNT, COUNT), int)  # steps in printed matter
    size = np.array(stack.voxels.shape[::-1])
    for _ in range(int(2 * RADIUS_MM / STEP_MM)):
        index = np.rint((rays - first) / stack.pitch_mm).astype(int)
        rays -= STEP_MM * n
        left = np.nonzero((passed < len(weights)) & ((index >= 0) & (index < size)).all(axis=-1))
        x, y, z = index[left].T
        material = stack.voxels[z, y, x].astype(int)
        printed = material > 0
        left = tuple(axis[printed] for axis in left)
        np.add.at(shares, (material[printed] - 1, *left), weights[passed[left]])
        passed[left] += 1
    held = shares.sum(axis=0)
    # The eye mixes the rim with what is around it: the mean of the ball.
    inside = held > 0.5
    mean = np.array([plane[inside].mean() for plane in shares])
    shares[:, ~inside] = mean[:, None] / mean.sum()
    eye = optics.Eye(COUNT, SPACING_MM)
    return eye.lightness_of(eye.spectra(shares.reshape(len(shares), -1)), optics.material_colours(stack.materials)), inside


def main():
    def run(*words):
        subprocess.run([arguments.program, *words, "--quiet"], check=True)

    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("out", metavar="OUT.png")
    parser.add_argument("--program", default="build/release/vdbdither")
    parser.add_argument("--printer", default="stratasys-j750-14um")
    parser.add_argument("--length-mm", type=float, default=0.05, help="depth that the light reaches (%(default)s)")
    arguments = parser.parse_args()
    rows = [[], []]
    with tempfile.TemporaryDirectory(prefix="vdbdither-ball-") as folder:
        folder = pathlib.Path(folder)
        write_ball(folder / "ball.obj")
        run("mesh2sdf", folder / "ball.obj", "--printer", arguments.printer, "--colour", "!", "dither", "-o", folder / "follows.vdb")
        grids, metadata = pyopenvdb.readAll(str(folder / "follows.vdb"))
        pyopenvdb.write(str(folder / "place.vdb"), [grid for grid in grids if grid.name != "surface"], metadata)
        for way in ("place", "follows"):
            run("halftone", folder / f"{way}.vdb", "!", "slice-export", folder / way)
            stack = read_stack(folder / way)
            for row, view in zip(rows, VIEWS):
                lightness, inside = seen(stack, view, arguments.length_mm)
                mean = lightness[inside].mean()
                print(f"{way:8} from {view}: standard deviation of L* {lightness[inside].std():.3f} around {mean:.2f}")
                drawn = np.clip(0.5 + CONTRAST * (lightness - mean) / 100, 0, 1)
                row.append(np.where(inside, 255 * drawn, 255).astype(np.uint8))
    Image.fromarray(np.vstack([np.hstack(row) for row in rows])).save(arguments.out)


if __name__ == "__main__":
    main()
