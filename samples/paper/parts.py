#!/usr/bin/python3
"""Makes the parts of the figures. Each is a closed mesh made from formulas.

    samples/paper/parts.py FOLDER

Writes cube.stl, sphere.stl, relief.stl and figurine.stl into FOLDER. Figures 8 and 9 use the functions `cube` and `sphere` with
other sizes. Lengths are in mm.
"""

import math
import pathlib
import struct
import sys

import numpy


def cube(side):
    """A cube about the origin, turned by 2 degrees about x, then y, then z."""
    half = side / 2
    corners = [[x, y, z] for z in (-half, half) for y in (-half, half) for x in (-half, half)]
    c, s = math.cos(math.radians(2)), math.sin(math.radians(2))
    corners = [(x, c * y - s * z, s * y + c * z) for x, y, z in corners]
    corners = [(c * x + s * z, y, c * z - s * x) for x, y, z in corners]
    corners = [(c * x - s * y, s * x + c * y, z) for x, y, z in corners]
    faces = ((0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5))
    return [[corners[i] for i in half] for f in faces for half in (f[:3], (f[0], f[2], f[3]))]


def sphere(radius, steps=240):
    """A sphere about the origin, with facets too small to be visible."""
    def at(i, j):
        polar, around = math.pi * i / steps, math.pi * j / steps
        if i in (0, steps):
            return (0, 0, radius if i == 0 else -radius)
        return (radius * math.sin(polar) * math.cos(around), radius * math.sin(polar) * math.sin(around),
                radius * math.cos(polar))
    triangles = []
    for i in range(steps):
        for j in range(2 * steps):
            k = (j + 1) % (2 * steps)
            if i > 0:
                triangles.append((at(i, j), at(i + 1, j), at(i, k)))
            if i < steps - 1:
                triangles.append((at(i, k), at(i + 1, j), at(i + 1, k)))
    return triangles


def relief(side=14.0, steps=200):
    """A plate whose top has slopes of up to 8 degrees."""
    line = numpy.linspace(-side / 2, side / 2, steps + 1)
    x, y = numpy.meshgrid(line, line)
    away = numpy.hypot(x, y)
    top = (2 + 0.25 * numpy.cos(away * 2 * math.pi / 9) + 0.2 * numpy.exp(-((x - 3.2) ** 2 + (y + 2.6) ** 2) / 3)
           - 0.2 * numpy.exp(-((x + 2.8) ** 2 + (y - 3.4) ** 2) / 4) + 0.012 * x)
    height = numpy.stack([numpy.zeros_like(top), top])
    def at(level, j, i):
        return (line[i], line[j], float(height[level, j, i]))
    triangles = []
    def quad(a, b, c, d):
        triangles.extend(((a, b, c), (a, c, d)))
    for j in range(steps):
        for i in range(steps):
            quad(at(1, j, i), at(1, j, i + 1), at(1, j + 1, i + 1), at(1, j + 1, i))
            quad(at(0, j, i), at(0, j + 1, i), at(0, j + 1, i + 1), at(0, j, i + 1))
    for i in range(steps):
        for a, b in (((0, i), (0, i + 1)), ((steps, i + 1), (steps, i)), ((i + 1, 0), (i, 0)), ((i, steps), (i + 1, steps))):
            quad(at(0, *a), at(0, *b), at(1, *b), at(1, *a))
    return triangles


def figurine():
    """A sitting cat of 16 mm, made of blended ellipsoids and limbs."""
    import pyopenvdb  # Debian's python3-openvdb, needed only for this part

    spacing = 0.08
    low, high = numpy.array([-5.2, -6.0, -0.4]), numpy.array([5.2, 6.0, 16.4])
    count = numpy.ceil((high - low) / spacing).astype(int)
    x, y, z = numpy.ogrid[tuple(slice(0, n) for n in count)]
    x, y, z = (start + spacing * line.astype(numpy.float32) for start, line in zip(low, (x, y, z)))

    def ball(centre, radii):
        scaled = numpy.sqrt(sum(((p - c) / r) ** 2 for p, c, r in zip((x, y, z), centre, radii)))
        return (scaled - 1) * min(radii)

    def limb(a, b, radius_a, radius_b):
        a, b = numpy.array(a), numpy.array(b)
        along = b - a
        share = numpy.clip(sum((p - q) * d for p, q, d in zip((x, y, z), a, along)) / along.dot(along), 0, 1)
        away = numpy.sqrt(sum((p - q - share * d) ** 2 for p, q, d in zip((x, y, z), a, along)))
        return away - radius_a - share * (radius_b - radius_a)

    def blend(a, b, width):
        near = numpy.maximum(width - numpy.abs(a - b), 0) / width
        return numpy.minimum(a, b) - near * near * width / 4

    body = ball((0, 0.6, 3.8), (3.5, 4.0, 3.9))
    body = blend(body, ball((0, -0.9, 6.8), (2.5, 2.4, 3.4)), 1.6)
    body = blend(body, ball((0, -1.7, 11.4), (2.9, 2.6, 2.5)), 0.9)
    body = blend(body, ball((0, -3.9, 10.7), (1.2, 0.9, 0.8)), 0.8)
    tail = [(2.8 * math.cos(t), 1.4 - 3.4 * math.sin(t) * (1 - 0.15 * t), 0.9) for t in numpy.linspace(-1.6, 1.5, 9)]
    for a, b in zip(tail, tail[1:]):
        body = blend(body, limb((a[0] + 0.9, a[1], a[2]), (b[0] + 0.9, b[1], b[2]), 0.7, 0.7), 0.35)
    for side in (-1, 1):
        body = blend(body, limb((side * 1.6, -1.9, 12.6), (side * 2.1, -1.6, 15.2), 1.1, 0.3), 0.5)
        body = blend(body, limb((side * 1.2, -2.2, 6.4), (side * 1.3, -3.2, 0.9), 0.9, 0.85), 0.7)
        body = blend(body, ball((side * 1.3, -3.8, 0.7), (0.95, 1.3, 0.75)), 0.4)
        body = blend(body, ball((side * 2.6, -0.9, 1.6), (1.5, 2.4, 1.7)), 0.6)
    body = numpy.maximum(body, 0 - z)
    grid = pyopenvdb.FloatGrid(background=1.0)
    grid.copyFromArray(numpy.clip(body, -1, 1).astype(numpy.float32))
    points, quads = grid.convertToQuads(isovalue=0)
    corners = (points * spacing + low)[quads]
    if signed_volume(corners) < 0:
        corners = corners[:, ::-1]
    return [half for q in corners.tolist() for half in ((q[0], q[1], q[2]), (q[0], q[2], q[3]))]


def signed_volume(quads):
    return float(sum(numpy.einsum("ij,ij->i", quads[:, 0], numpy.cross(quads[:, i], quads[:, i + 1])).sum() for i in (1, 2)))


def write_stl(path, triangles):
    with open(path, "wb") as stream:
        stream.write(bytes(80) + struct.pack("<I", len(triangles)))
        for triangle in triangles:
            stream.write(struct.pack("<12fH", 0, 0, 0, *(value for corner in triangle for value in corner), 0))


PARTS = {"cube": lambda: cube(10.0), "sphere": lambda: sphere(4.0), "relief": relief, "figurine": figurine}

if __name__ == "__main__":
    if len(sys.argv) != 2:
        raise SystemExit("usage: samples/paper/parts.py FOLDER")
    folder = pathlib.Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    for name, make in PARTS.items():
        write_stl(folder / f"{name}.stl", make())
