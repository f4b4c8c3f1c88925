#!/usr/bin/env python3
"""Measures what `compensate` keeps of wires and strokes. Prints the tables of docs/compensate.md.

Wires and strokes of random orientation and position are written as STL, dithered with and without `compensate`, and
printed: the voxels, full boxes, are blurred with a Gaussian, exactly, and the print is where the blur is at least ½.
The judge knows the shapes by their formulas and shares no code with the program.

Usage: study.py [--program build/release/vdbdither] [--seeds 6] [--only wires,strokes,blocks,spread]
"""

import argparse
import pathlib
import struct
import subprocess
import tempfile

import numpy
import pyopenvdb
from scipy.special import ndtr

PRINTER = "mimaki-3duj-553"
PITCH = numpy.array([0.042, 0.084, 0.022])
SIGMA = 0.05
DITHERS = {"dither": [], "--mask none": ["--mask", "none"]}
WIRES = (0.12, 0.18, 0.25)
STROKES = (0.12, 0.18, 0.28)


def random_rotation(random):
    """Returns a rotation, uniformly distributed."""
    q = random.normal(size=4)
    w, x, y, z = q / numpy.linalg.norm(q)
    return numpy.array([[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]])


def box_triangles(low, high):
    """Returns the triangles of a box, outward."""
    corners = numpy.array([[(low, high)[n >> a & 1][a] for a in range(3)] for n in range(8)])
    quads = ((0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5))
    return numpy.array([corners[list(t)] for a, b, c, d in quads for t in ((a, b, c), (a, c, d))])


class Wire:
    """A round wire along z. Judged in its middle part."""

    def __init__(self, diameter):
        self.radius = diameter / 2
        self.reach = numpy.array([self.radius + 0.15, self.radius + 0.15, 0.25])

    def triangles(self, sides=96, length=1.1):
        # A polygon of the same area as the circle.
        radius = self.radius * numpy.sqrt(2 * numpy.pi / sides / numpy.sin(2 * numpy.pi / sides))
        angles = 2 * numpy.pi * numpy.arange(sides) / sides
        ring = numpy.stack([radius * numpy.cos(angles), radius * numpy.sin(angles)], -1)
        found = []
        for n in range(sides):
            a, b = ring[n], ring[(n + 1) % sides]
            low, high = -length / 2, length / 2
            found += [[(*a, low), (*b, low), (*b, high)], [(*a, low), (*b, high), (*a, high)],
                      [(0, 0, high), (*a, high), (*b, high)], [(0, 0, low), (*b, low), (*a, low)]]
        return numpy.array(found)

    def inside(self, local):
        return local[..., 0] ** 2 + local[..., 1] ** 2 < self.radius ** 2

    def judged(self, local):
        return (numpy.abs(local) < self.reach).all(-1)

    counts_void = False


class Stroke:
    """A bar on a slab whose top is z = 0, or a groove in it."""

    length = 0.6
    height = 0.25

    def __init__(self, width, engraved):
        self.width = width
        self.counts_void = engraved
        margin = 0.1
        self.reach = numpy.array([width / 2 + margin, self.length / 2 + margin, self.height + margin])

    def triangles(self):
        w, l, h, outer = self.width / 2, self.length / 2, self.height, 0.6
        slab = ((-outer, -outer, -h - 0.4), (outer, outer, -h if self.counts_void else 0))
        if not self.counts_void:
            boxes = [slab, ((-w, -l, -0.1), (w, l, h))]
        else:
            boxes = [slab, ((-outer, -outer, -h - 0.1), (-w, outer, 0)), ((w, -outer, -h - 0.1), (outer, outer, 0)),
                     ((-w - 0.1, -outer, -h - 0.1), (w + 0.1, -l, 0)), ((-w - 0.1, l, -h - 0.1), (w + 0.1, outer, 0))]
        return numpy.concatenate([box_triangles(*box) for box in boxes])

    def inside(self, local):
        stroke = (numpy.abs(local[..., 0]) < self.width / 2) & (numpy.abs(local[..., 1]) < self.length / 2)
        if self.counts_void:
            return (local[..., 2] < 0) & ~(stroke & (local[..., 2] > -self.height))
        return (local[..., 2] < 0) | (stroke & (local[..., 2] < self.height))

    def judged(self, local):
        height = -local[..., 2] if self.counts_void else local[..., 2]
        return (numpy.abs(local[..., :2]) < self.reach[:2]).all(-1) & (height > 0) & (height < self.reach[2])


class Block:
    """A cube of 0.8 mm, judged as a whole."""

    counts_void = False
    half = 0.4
    reach = numpy.array([0.55, 0.55, 0.55])

    def triangles(self):
        return box_triangles((-self.half,) * 3, (self.half,) * 3)

    def inside(self, local):
        return (numpy.abs(local) < self.half).all(-1)

    def judged(self, local):
        return (numpy.abs(local) < self.reach).all(-1)


def write_stl(path, triangles):
    with open(path, "wb") as file:
        file.write(b" " * 80 + struct.pack("<I", len(triangles)))
        for triangle in triangles:
            file.write(struct.pack("<12f", 0, 0, 0, *triangle.ravel()) + b"\0\0")


def weights(points, voxels, pitch, sigma):
    """Returns the shares of the Gaussian around each point that fall into each voxel."""
    to = voxels[None, :] - points[:, None]
    return ndtr((to + pitch / 2) / sigma) - ndtr((to - pitch / 2) / sigma)


def printed(solid, low, axes):
    """Returns the blurred voxels on a grid of points."""
    share = solid
    for axis in range(3):
        voxels = (low[axis] + numpy.arange(solid.shape[axis])) * PITCH[axis]
        share = numpy.moveaxis(numpy.tensordot(weights(axes[axis], voxels, PITCH[axis], SIGMA), share, (1, axis)), 0, axis)
    return share


def voxels_of(path):
    grid = pyopenvdb.read(str(path), "solid")
    low, high = grid.evalActiveVoxelBoundingBox()
    low, high = numpy.array(low), numpy.array(high)
    solid = numpy.zeros(numpy.maximum(high - low + 1, 1), dtype=bool)
    if grid.activeVoxelCount():
        grid.copyToArray(solid, ijk=tuple(int(n) for n in low))
    else:
        low = numpy.zeros(3)
    return solid.astype(float), low


class Case:
    """A shape at a random place."""

    def __init__(self, shape, seed, turn=None):
        random = numpy.random.default_rng(seed)
        self.shape = shape
        self.turn = random_rotation(random) if turn is None else turn
        self.centre = random.uniform(-0.5, 0.5, 3) * PITCH
        half = numpy.abs(self.turn) @ shape.reach
        self.axes = [numpy.arange(self.centre[a] - half[a], self.centre[a] + half[a], step)
                     for a, step in enumerate((0.0105, 0.0105, 0.0105))]
        local = (numpy.stack(numpy.meshgrid(*self.axes, indexing="ij"), -1) - self.centre) @ self.turn
        self.judged = shape.judged(local)
        self.true = shape.inside(local)

    def write(self, path):
        write_stl(path, self.shape.triangles() @ self.turn.T + self.centre)

    def result(self, path):
        """Returns overlap and relative volume of the printed shape, or of its void."""
        shape = printed(*voxels_of(path), self.axes) >= 0.5
        a, b = shape[self.judged], self.true[self.judged]
        if self.shape.counts_void:
            a, b = ~a, ~b
        return (a & b).sum() / (a | b).sum(), a.sum() / b.sum()


def run(program, folder, case, before, dither):
    mesh, out = folder / "part.stl", folder / "out.vdb"
    case.write(mesh)
    subprocess.run([program, "mesh2sdf", mesh, "--printer", PRINTER, "!", *before, "dither", *dither, "!", "write",
                    out, "--overwrite", "--quiet"], check=True, stderr=subprocess.DEVNULL)
    return case.result(out)


def measured(program, folder, make_shape, seeds, before, dither):
    return numpy.array([run(program, folder, Case(make_shape(), seed), before, dither) for seed in seeds])


def row(name, values):
    mean, low, volume = values[:, 0].mean(), values[:, 0].min(), values[:, 1].mean()
    print(f"| {name} | {mean:.2f} | {low:.2f} | {volume:.2f} |", flush=True)


def table(title, program, folder, shapes, seeds, variants):
    print(f"\n### {title}\n\n| shape and chain | overlap | worst | volume |\n| --- | ---: | ---: | ---: |")
    for name, make_shape in shapes:
        for variant, before, dither in variants:
            row(f"{name}, {variant}", measured(program, folder, make_shape, seeds, before, dither))


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--program", default="build/release/vdbdither")
    parser.add_argument("--seeds", type=int, default=6)
    parser.add_argument("--only", default="wires,strokes,blocks,spread")
    parser.add_argument("--options", default="", help="of compensate")
    arguments = parser.parse_args()
    program = str(pathlib.Path(arguments.program).resolve())
    seeds = range(1, arguments.seeds + 1)
    only = arguments.only.split(",")
    own = arguments.options.split()
    wires = [(f"wire {round(1e3 * d)} µm", lambda d=d: Wire(d)) for d in WIRES]
    strokes = [(f"{'engraved' if engraved else 'embossed'} {round(1e3 * w)} µm", lambda w=w, e=engraved: Stroke(w, e))
               for engraved in (False, True) for w in STROKES]
    variants = []
    for name, dither in DITHERS.items():
        variants += [(name, [], dither), (f"compensate, {name}", ["compensate", *own, "!"], dither)]
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        if "wires" in only:
            table("Wires", program, folder, wires, seeds, variants)
        if "strokes" in only:
            table("Strokes", program, folder, strokes, seeds, variants)
        if "blocks" in only:
            table("Blocks", program, folder, [("cube 0.8 mm", Block)], seeds, variants)
        if "spread" in only:
            for factor in (0.5, 0.7, 1, 1.2, 1.4):
                assumed = ["compensate", "--spread", f"{1e3 * SIGMA * factor:g}um", "!"]
                table(f"Spread assumed {factor:g} times the true one", program, folder, wires + strokes, seeds,
                      [("compensate, --mask none", assumed, ["--mask", "none"])])


if __name__ == "__main__":
    main()
