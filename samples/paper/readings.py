#!/usr/bin/python3
"""Varies the choices that the paper leaves open, and measures their effect: the voxels of ∂V, the place where f is read, the
width of the band, and the source of the normals.

    samples/paper/readings.py [WORK FOLDER] [RESULT FOLDER]

A small reference in numpy, which shares only the mask with the program, dithers facets tilted by 2, 10 and 30 degrees off each
axis, and a sphere, with the constant 4 on voxels of 42 x 84 x 22 µm. Their distances are known exactly. The error is that of the
half level after a Gaussian of 50 µm. Then `measure` compares the options of the program itself on a cube at 2 degrees and a
sphere. The program is the first `vdbdither` on the PATH. Writes readings.json and the tables of readings.md.
"""

import itertools
import json
import math
import pathlib
import statistics
import sys

import numpy
import pyopenvdb

import parts
from methods import RESULT, chain, file_name, program

PITCH = numpy.array([0.042, 0.084, 0.022])
SPREAD_MM = 0.05
RADIUS_MM = 0.25
SPHERE_MM = 1.2

work = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else "out/paper-readings").resolve()
result = pathlib.Path(sys.argv[2]).resolve() if len(sys.argv) > 2 else RESULT
work.mkdir(parents=True, exist_ok=True)
result.mkdir(parents=True, exist_ok=True)

normal_quantile = numpy.vectorize(statistics.NormalDist().inv_cdf, otypes=[float])

SIX = [o for o in itertools.product((-1, 0, 1), repeat=3) if sum(map(abs, o)) == 1]
ALL_26 = [o for o in itertools.product((-1, 0, 1), repeat=3) if any(o)]


def moved(array, offset, outside):
    """Returns array[index + offset], with `outside` beyond the ends."""
    out = numpy.full_like(array, outside)
    to, of = [], []
    for o, n in zip(offset, array.shape):
        to.append(slice(max(-o, 0), n - max(o, 0)))
        of.append(slice(max(o, 0), n + min(o, 0)))
    out[tuple(to)] = array[tuple(of)]
    return out


def beside(inside, neighbours):
    """Returns where a neighbour is true."""
    return numpy.logical_or.reduce([moved(inside, o, False) for o in neighbours])


class Shape:
    """Distances in mm and outward normals at voxel centres; points of the true surface, and the shift by its curvature."""

    def __init__(self, low, high, distance, normal, surface, shift_mm=0.0):
        self.first = numpy.floor(numpy.array(low) / PITCH).astype(int)
        last = numpy.ceil(numpy.array(high) / PITCH).astype(int)
        lines = [numpy.arange(a, b + 1) * p for a, b, p in zip(self.first, last, PITCH)]
        centre = numpy.stack(numpy.meshgrid(*lines, indexing="ij"), axis=-1)
        self.distance, self.normal = distance(centre), normal(centre)
        self.surface, self.shift_mm = surface, shift_mm


def facet(axis, tilt, position, seed):
    """A plane through a box of 2.6 mm. The error is measured in the middle of the box."""
    azimuth = math.radians(40)
    direction = numpy.zeros(3)
    direction[axis] = math.cos(math.radians(tilt))
    direction[(axis + 1) % 3] = math.sin(math.radians(tilt)) * math.cos(azimuth)
    direction[(axis + 2) % 3] = math.sin(math.radians(tilt)) * math.sin(azimuth)
    offset = position * PITCH[axis]
    half = numpy.full(3, 1.3)
    half[axis] = 0.45 + 1.3 * math.tan(math.radians(tilt)) * 1.42
    random = numpy.random.default_rng(seed)
    surface = random.uniform(-1.0, 1.0, (2000, 3))
    surface[:, axis] = 0
    surface -= ((surface @ direction - offset) / direction[axis])[:, None] * numpy.eye(3)[axis]
    return Shape(-half, half, lambda c: c @ direction - offset,
                 lambda c: numpy.broadcast_to(direction, c.shape), surface)


def ball(seed):
    centre = numpy.random.default_rng(seed).uniform(-0.5, 0.5, 3) * PITCH
    points = numpy.random.default_rng(seed + 1).normal(size=(2000, 3))
    points /= numpy.linalg.norm(points, axis=1)[:, None]
    half = numpy.full(3, SPHERE_MM + 0.35)
    away = lambda c: numpy.linalg.norm(c - centre, axis=-1)
    return Shape(-half, half, lambda c: away(c) - SPHERE_MM, lambda c: (c - centre) / numpy.maximum(away(c), 1e-9)[..., None],
                 centre + SPHERE_MM * points, -SPREAD_MM ** 2 / SPHERE_MM)


def by_differences(distance):
    """Unit normals from central differences of the distance over the pitch."""
    gradient = numpy.stack(numpy.gradient(distance, *PITCH), axis=-1)
    return gradient / numpy.maximum(numpy.linalg.norm(gradient, axis=-1), 1e-12)[..., None]


def boundary(inside, kind):
    """Returns ∂V by a reading: its side and its neighbours."""
    side, neighbours = kind.split()
    near = SIX if neighbours == "6" else ALL_26
    inner, outer = inside & beside(~inside, near), ~inside & beside(inside, near)
    return {"inner": inner, "outer": outer, "both": inner | outer}[side]


def read_at_closest(values, surface, wanted):
    """Returns, for each index of `wanted`, the value at the nearest voxel of `surface`; ties go to the smallest (k, j, i). The
    value is zero if there is none within the radius."""
    reach = numpy.array([int(RADIUS_MM / p) for p in PITCH])
    offsets = sorted((sum((o * p) ** 2 for o, p in zip((i, j, k), PITCH)), k, j, i)
                     for k in range(-reach[2], reach[2] + 1) for j in range(-reach[1], reach[1] + 1)
                     for i in range(-reach[0], reach[0] + 1))
    padded = numpy.pad(surface, [(r, r) for r in reach])
    out, left = numpy.zeros(len(wanted)), numpy.arange(len(wanted))
    for squared, k, j, i in offsets:
        if squared > RADIUS_MM ** 2 or left.size == 0:
            break
        place = wanted[left] + (i, j, k)
        found = padded[tuple((place + reach).T)]
        out[left[found]] = values[tuple(place[found].T)]
        left = left[~found]
    return out


def dithered(shape, tile, where="closest", kind="inner 6", diameters=None, normals="exact", own_diameter=False, constant=4):
    d = shape.distance
    normal = shape.normal if normals == "exact" else by_differences(d)
    half_diameter = 1 / (2 * numpy.max(numpy.abs(normal) / PITCH, axis=-1))
    index = numpy.ix_(*((numpy.arange(n) + f) % tile.shape[a] for a, (n, f) in enumerate(zip(d.shape, shape.first))))
    noise = (tile[index] - 0.5).astype(float)
    near = numpy.abs(d) < numpy.linalg.norm(PITCH)  # |f| is smaller elsewhere
    wanted = numpy.argwhere(near)
    f = constant * half_diameter * noise
    if where == "closest":
        surface = boundary(d < 0, kind)
        f[near] = constant * half_diameter[near] * read_at_closest(noise, surface, wanted) if own_diameter else \
            read_at_closest(f, surface, wanted)
    elif where == "foot":
        own = wanted + numpy.rint(-d[near][:, None] * normal[near] / PITCH).astype(int)
        f[near] = f[tuple(numpy.clip(own, 0, numpy.array(d.shape) - 1).T)]
    if diameters is not None:
        f = numpy.where(numpy.abs(d) < 2 * diameters * half_diameter, f, 0)
    return d + f < 0


def blurred(solid):
    """Returns the share of material after the Gaussian. Voxels are boxes; values beyond the ends repeat."""
    out = solid.astype(float)
    for axis, pitch in enumerate(PITCH):
        reach = math.ceil(4 * SPREAD_MM / pitch)
        edge = [0.5 * (1 + math.erf((o - 0.5) * pitch / SPREAD_MM / math.sqrt(2))) for o in range(-reach, reach + 2)]
        line = numpy.pad(out, [(reach, reach) if a == axis else (0, 0) for a in range(3)], mode="edge")
        out = sum((edge[o + 1] - edge[o]) * line.take(range(o, o + solid.shape[axis]), axis) for o in range(2 * reach + 1))
    return out


def errors(shape, solid):
    """Returns the distance of the half level outside the true surface at its points, mm: the spread times the quantile of the
    share of material there. This is exact for planes."""
    share_of_material = numpy.clip(blurred(solid), 1e-6, 1 - 1e-6)
    place = shape.surface / PITCH - shape.first
    low = numpy.floor(place).astype(int)
    share = place - low
    value = 0
    for corner in itertools.product((0, 1), repeat=3):
        weight = numpy.prod([share[:, a] if c else 1 - share[:, a] for a, c in enumerate(corner)], axis=0)
        value = value + weight * normal_quantile(share_of_material[tuple(low[:, a] + c for a, c in enumerate(corner))])
    return SPREAD_MM * value - shape.shift_mm


def pieces(inside, neighbours):
    """Returns labels of connected pieces, and their number."""
    label = numpy.where(inside, numpy.arange(1, inside.size + 1).reshape(inside.shape), 0)
    while True:
        best = label
        for o in neighbours:
            best = numpy.maximum(best, moved(label, o, 0))
        best = numpy.where(inside, best, 0)
        flat = numpy.concatenate([[0], best.ravel()])
        best = flat[best]
        if (best == label).all():
            return label, len(numpy.unique(label[inside]))
        label = best


VARIANTS = {
    "∂V inner, 6 neighbours (vdbdither)": {}, "∂V inner, 26": {"kind": "inner 26"}, "∂V outer, 6": {"kind": "outer 6"},
    "∂V outer, 26": {"kind": "outer 26"}, "∂V both, 6": {"kind": "both 6"},
    "M at v̄, k_D at v": {"own_diameter": True}, "f at the foot": {"where": "foot"}, "f at v": {"where": "voxel"},
    "band of half a diameter": {"diameters": 0.5}, "band of one diameter": {"diameters": 1.0},
    "normals by differences": {"normals": "differences"}, "the constant 2, f at v": {"where": "voxel", "constant": 2},
}


def reference():
    """Returns, by variant, the mean error on facets and on the sphere, µm, and the numbers of components and cavities."""
    program(work, "mask", "--size", "64", "--sigma", "1.1", "-o", "paper.vdb", "--overwrite", "--quiet")
    tile = numpy.zeros((64, 64, 64), dtype=numpy.float32)
    pyopenvdb.read(str(work / "paper.vdb"), "mask").copyToArray(tile)
    facets = {tilt: [facet(axis, tilt, position, 7) for axis in range(3) for position in (0.0, 0.37, 0.71)] for tilt in (2, 10, 30)}
    balls = [ball(seed) for seed in (1, 5, 9)]
    table = {}
    for name, options in VARIANTS.items():
        row = {}
        for tilt, shapes in facets.items():
            row[f"{tilt} degrees"] = 1000 * statistics.mean(float(numpy.abs(errors(s, dithered(s, tile, **options))).mean())
                                                           for s in shapes)
        solids = [(s, dithered(s, tile, **options)) for s in balls]
        all_errors = [errors(*pair) for pair in solids]
        row["sphere"] = 1000 * statistics.mean(float(numpy.abs(e).mean()) for e in all_errors)
        row["sphere, bias"] = 1000 * statistics.mean(float(e.mean()) for e in all_errors)
        row["components"] = [pieces(solid, ALL_26)[1] for _, solid in solids]
        row["by faces"] = [pieces(solid, SIX)[1] for _, solid in solids]
        row["cavities"] = [pieces(~solid, SIX)[1] - 1 for _, solid in solids]
        table[name] = row
        print(f"readings: {name}: {row}", flush=True)
    return table


PROGRAM = {
    "closest, exact normals (mesh2sdf --normals)": (["--normals"], "dither --preset paper"),
    "closest, normals of the distance (normals)": ([], "normals ! dither --preset paper"),
    "closest, normals of dither itself": ([], "dither --preset paper"),
    "foot, exact normals": (["--normals"], "dither --preset paper --at foot"),
    "voxel, exact normals": (["--normals"], "dither --preset paper --at voxel"),
}


def by_program():
    """Returns the effect of options of the program, on a cube of 8 mm and a sphere of 5 mm."""
    parts.write_stl(work / "cube.stl", parts.cube(8.0))
    parts.write_stl(work / "sphere.stl", parts.sphere(2.5))
    table = {}
    for name, method in PROGRAM.items():
        table[name] = {}
        for shape in ("cube", "sphere"):
            def measure(state):
                return f"! measure --reference {shape}.stl --report {file_name(name)}-{shape}-{state}.json --overwrite"
            files = [work / f"{file_name(name)}-{shape}-{state}.json" for state in ("before", "after")]
            if not all(file.exists() for file in files):
                chain(work, f"{shape}.stl", method, measure("before"), "! simulate", measure("after"))
            before, after = (json.loads(file.read_text()) for file in files)
            table[name][shape] = {"mean": 1000 * after["area"]["mean_mm"], "p99": 1000 * after["area"]["p99_mm"],
                                  "bias": 1000 * after["area"]["bias_mm"], "components": before["components"]["count"],
                                  "cavities": before["cavities"]["count"]}
    return table


def page(reference_table, program_table):
    yield "| reading | 2° | 10° | 30° | sphere | bias | components | by faces | cavities |"
    yield "| --- " * 9 + "|"
    for name, row in reference_table.items():
        figures = [f"{row[key]:.2f}" for key in ("2 degrees", "10 degrees", "30 degrees", "sphere")]
        lists = [", ".join(map(str, row[key])) for key in ("components", "by faces", "cavities")]
        yield f"| {name} | " + " | ".join([*figures, f"{row['sphere, bias']:+.2f}", *lists]) + " |"
    yield "\nWith the program: mean error / 99th percentile / bias in µm, components / cavities:\n"
    yield "| `dither --preset paper` | cube of 8 mm, 2° | sphere of 5 mm |\n| --- | --- | --- |"
    for name, row in program_table.items():
        yield f"| {name} | " + " | ".join(f"{of['mean']:.2f} / {of['p99']:.1f} / {of['bias']:+.2f}, "
                                          f"{of['components']} / {of['cavities']}" for of in row.values()) + " |"


tables = reference(), by_program()
(result / "readings.json").write_text(json.dumps({"reference": tables[0], "program": tables[1]}, indent=1,
                                          ensure_ascii=False) + "\n")
path = result / "readings.md"
text = path.read_text() if path.exists() else "# Ambiguities in the paper\n\n<!-- tables -->\n"
path.write_text(text.split("<!-- tables -->")[0] + "<!-- tables -->\n\n" + "\n".join(page(*tables)) + "\n")
