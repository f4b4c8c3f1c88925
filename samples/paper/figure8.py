#!/usr/bin/python3
"""Measures the error of prints of a tilted cube, before and after the low-pass of the print: figure 8 of the paper, its table
of roughness, and both readings of its equation (11).

    samples/paper/figure8.py [WORK FOLDER] [RESULT FOLDER] [METHOD]

The part is a cube of 20 mm turned by 2 degrees about each axis. It is printed with every method on voxels of 42 x 84 x 22 µm,
and with plain voxelization on cubes of 84 µm. Its surface by marching cubes is measured as it is, after 160 iterations of
Taubin's smoothing, and after droplets have spread. Finished measurements in the work folder are not repeated, except for
METHOD. The program is the first `vdbdither` on the PATH. Writes figure-8.json, figure-8.md, figure-8.png and
figure-8-curves.png.
"""

import json
import pathlib
import sys
import time

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy
from PIL import Image

import parts
from methods import METHODS, RESULT, chain, file_name, program

SIDE_MM = 20.0
STATES = {"before": "before", "smoothed": "after 160 iterations", "droplets": "after droplets of 50 µm"}
AS_PRINTED = "interlacing as printed"
CUBES = "control, cubes of 84 µm"
NAMES = [*list(METHODS)[:2], AS_PRINTED, *list(METHODS)[2:], CUBES]
CROP_MM, CROP_PIXELS = 6.0, 100
MAPS = (("y", "before"), ("y", "smoothed"), ("z", "smoothed"), ("x", "smoothed"))
RANGE_UM = 30

work = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else "out/paper-figure-8").resolve()
result = pathlib.Path(sys.argv[2]).resolve() if len(sys.argv) > 2 else RESULT
anew = sys.argv[3] if len(sys.argv) > 3 else None
work.mkdir(parents=True, exist_ok=True)
result.mkdir(parents=True, exist_ok=True)


def interlaced_as_printed(file):
    """Writes voxels by equation (11) as printed: even slices are shifted by a quarter voxel, odd slices are not."""
    import pyopenvdb

    def solid(name):
        chain(work, "cube.stl", METHODS[name], f"! write {name}.vdb --overwrite")
        grid = pyopenvdb.read(str(work / f"{name}.vdb"), "solid")
        (work / f"{name}.vdb").unlink()
        return grid

    plain, shifted = solid("control"), solid("interlacing")
    (low, high), (other_low, other_high) = plain.evalActiveVoxelBoundingBox(), shifted.evalActiveVoxelBoundingBox()
    low, high = numpy.minimum(low, other_low), numpy.maximum(high, other_high)
    values = [numpy.zeros(high - low + 1, dtype=bool) for _ in range(2)]
    for grid, array in zip((plain, shifted), values):
        grid.copyToArray(array, ijk=tuple(int(i) for i in low))
    even = (numpy.arange(low[2], high[2] + 1) & 1) == 0
    values[0][:, :, even] = values[1][:, :, even]
    mixed = pyopenvdb.BoolGrid()
    mixed.copyFromArray(values[0], ijk=tuple(int(i) for i in low))
    mixed.name, mixed.transform = "solid", plain.transform
    pyopenvdb.write(str(work / file), mixed)


def crops(mesh):
    """Returns pictures of the error in mm on the middle of three faces of the cube, from a map of `measure`."""
    with open(work / mesh, "rb") as stream:
        kinds, vertices = [], 0
        for line in iter(lambda: stream.readline().decode().split(), ["end_header"]):
            if line[:2] == ["element", "vertex"]:
                vertices = int(line[2])
            if line[0] == "element":
                inside = line[1] == "vertex"
            if line[0] == "property" and inside:
                kinds.append((line[2], {"float": "<f4", "uchar": "u1", "double": "<f8"}[line[1]]))
        points = numpy.fromfile(stream, numpy.dtype(kinds), vertices)
    corners = numpy.array(parts.cube(2.0))
    place = numpy.stack([points[axis] for axis in "xyz"], axis=1).astype(float)
    axes = {}
    for axis, triangle in zip("xyz", (10, 6, 2)):
        a, b, c = corners[triangle]
        normal = numpy.cross(b - a, c - a)
        axes[axis] = normal / numpy.linalg.norm(normal)
    pictures = {}
    for axis, (u, v) in {"x": "yz", "y": "xz", "z": "xy"}.items():
        across, up = place @ axes[u] + CROP_MM / 2, place @ axes[v] + CROP_MM / 2
        i, j = (numpy.floor(p * CROP_PIXELS / CROP_MM).astype(int) for p in (across, up))
        near = (place @ axes[axis] > SIDE_MM / 2 - 1) & (i >= 0) & (j >= 0) & (i < CROP_PIXELS) & (j < CROP_PIXELS)
        pixel = (CROP_PIXELS - 1 - j[near]) * CROP_PIXELS + i[near]
        sums, counts = (numpy.bincount(pixel, weights, CROP_PIXELS ** 2) for weights in (points["quality"][near], None))
        mean = numpy.where(counts > 0, sums / numpy.maximum(counts, 1), numpy.nan)
        pictures[axis] = filled(mean.reshape(CROP_PIXELS, CROP_PIXELS))
    return pictures


def filled(picture):
    """Fills pixels without a vertex from the nearest pixel of the row, or of the column."""
    for turned in (picture, picture.T):
        for row in turned:
            there = numpy.flatnonzero(~numpy.isnan(row))
            if there.size:
                row[:] = row[there[numpy.abs(numpy.arange(row.size)[:, None] - there).argmin(axis=1)]]
    return picture


def measured(name):
    """Returns the reports of the three states and the elapsed seconds. Saves the pictures of the faces."""
    finished = work / f"{file_name(name)}.json"
    if finished.exists() and name != anew:
        return json.loads(finished.read_text())
    began = time.monotonic()
    def measure(state, more=""):
        return f"! measure --reference cube.stl --report {file_name(name)}-{state}.part {more} --overwrite"
    rest = (measure("before", "--map before.ply"), measure("smoothed", "--smooth taubin --map smoothed.ply"), "! simulate",
            measure("droplets"))
    if name == AS_PRINTED:
        interlaced_as_printed("as-printed.vdb")
        program(work, "read", "as-printed.vdb", *" ".join(rest).split(), "--quiet")
        (work / "as-printed.vdb").unlink()
    elif name == CUBES:
        chain(work, "cube.stl", METHODS["control"], *rest, pitch="84um,84um,84um")
    else:
        chain(work, "cube.stl", METHODS[name], *rest)
    reports = {state: json.loads((work / f"{file_name(name)}-{state}.part").read_text()) for state in STATES}
    reports["seconds"] = time.monotonic() - began
    pictures = {state: crops(f"{state}.ply") for state in ("before", "smoothed")}
    numpy.savez_compressed(work / f"{file_name(name)}.npz",
                           **{f"{axis} {state}": pictures[state][axis].astype(numpy.float32) for axis, state in MAPS})
    for state in STATES:
        (work / f"{file_name(name)}-{state}.part").unlink()
        (work / f"{state}.ply").unlink(missing_ok=True)
    finished.write_text(json.dumps(reports))
    return reports


def facets(report, axis):
    """Returns the mean of Sa, Sq and band-limited Sq over the two faces towards an axis, in µm."""
    faces = [face for face in report["facets"] if abs(face["normal"]["xyz".index(axis)]) > 0.9]
    return {key: 1000 * sum(face[key] for face in faces) / len(faces) for key in ("sa_mm", "sq_mm", "sq_band_mm")}


def draw_maps():
    figure, axes = plt.subplots(len(MAPS), len(NAMES), figsize=(1.62 * len(NAMES), 1.68 * len(MAPS)), layout="constrained")
    for column, name in enumerate(NAMES):
        with numpy.load(work / f"{file_name(name)}.npz") as pictures:
            for row, (face, state) in enumerate(MAPS):
                axis = axes[row, column]
                shown = axis.imshow(1000 * pictures[f"{face} {state}"], cmap="RdBu_r", vmin=-RANGE_UM, vmax=RANGE_UM,
                                    interpolation="nearest")
                axis.set(xticks=[], yticks=[])
                if row == 0:
                    axis.set_title(name.replace(", ", ",\n").replace("as printed", "\nas printed"), fontsize=8)
                if column == 0:
                    axis.set_ylabel(f"{face} face, {state}", fontsize=8)
    figure.colorbar(shown, ax=axes, shrink=0.5, label="error, µm", aspect=30)
    save(figure, "figure-8.png")


def draw_curves(table):
    figure, axes = plt.subplots(1, 3, figsize=(12, 3.6), layout="constrained")
    for axis, (state, title) in zip(axes, STATES.items()):
        for n, name in enumerate(NAMES):
            axis.plot([1000 * value for value in table[name][state]["vertices"]["cumulative_mm"]], range(101), label=name,
                      linestyle="--" if name in (CUBES, AS_PRINTED) else "-", linewidth=1.2, color=f"C{n}")
        axis.set(xlabel="error not exceeded, µm", ylim=(0, 100), xlim=(0, 60 if state == "before" else 35), title=title)
        axis.grid(alpha=0.3)
    axes[0].set_ylabel("% of the vertices")
    axes[2].legend(fontsize=7, loc="lower right")
    save(figure, "figure-8-curves.png")


def save(figure, name):
    figure.savefig(result / name, dpi=100)
    with Image.open(result / name) as picture:
        small = picture.convert("RGB").quantize(128, dither=Image.Dither.NONE)
    small.save(result / name, optimize=True)


def lines(heads, rows):
    yield "| " + " | ".join(heads) + " |"
    yield "| " + " | ".join("---" for _ in heads) + " |"
    for row in rows:
        yield "| " + " | ".join(row) + " |"


def page(table):
    """Yields the tables in Markdown."""
    def errors(name, by):
        return [name, *(f"{1000 * table[name][state][by]['mean_mm']:.2f} / {1000 * table[name][state][by]['rms_mm']:.2f} / "
                        f"{1000 * table[name][state][by]['p95_mm']:.1f}" for state in STATES)]

    def by_axis(name, state):
        axes = table[name][state]["axes"]
        return [f"{1000 * axes[axis]['mean_mm']:.2f} ({100 * axes[axis]['staircase_share']:.0f} %)" for axis in "xyz"]

    def rough(name, state):
        return [" / ".join(f"{value:.2f}" for value in facets(table[name][state], axis).values()) for axis in "xyz"]

    def pieces(name):
        report = table[name]["before"]
        return [name, str(report["components"]["count"]), str(report["cavities"]["count"]),
                f"{table[name]['before']['volume_error_percent']:+.4f}", f"{table[name]['smoothed']['volume_error_percent']:+.4f}"]

    yield "Mean / RMS / 95th percentile of the error in µm, with equal weights for all vertices, as the paper plots:\n"
    yield from lines(["", *STATES.values()], (errors(name, "vertices") for name in NAMES))
    yield "\nBy area:\n"
    yield from lines(["", *STATES.values()], (errors(name, "area") for name in NAMES))
    for state in ("smoothed", "droplets"):
        yield f"\nMean error in µm by face, {STATES[state]}. In brackets: the share of its variance that follows the steps:\n"
        yield from lines(["", "x", "y", "z"], ([name, *by_axis(name, state)] for name in NAMES))
    for state in STATES:
        yield f"\nRoughness by face, {STATES[state]}: Sa / Sq / Sq of waves longer than 0.25 mm, µm:\n"
        yield from lines(["", "x", "y", "z"], ([name, *rough(name, state)] for name in NAMES))
    yield "\nComponents and cavities of the printed voxels, and the volume error in %:\n"
    yield from lines(["", "components", "cavities", "volume before", "volume smoothed"], (pieces(name) for name in NAMES))


def rounded(value):
    if isinstance(value, dict):
        return {key: rounded(part) for key, part in value.items()}
    if isinstance(value, list):
        return [rounded(part) for part in value]
    return round(value, 6) if isinstance(value, float) else value


parts.write_stl(work / "cube.stl", parts.cube(SIDE_MM))
reports = {}
for name in NAMES:
    reports[name] = measured(name)
    print(f"figure 8: {name}: {reports[name]['seconds']:.0f} s", flush=True)
kept = ("area", "vertices", "axes", "facets", "components", "cavities", "volume_error_percent")
(result / "figure-8.json").write_text(json.dumps(rounded(
    {name: {state: {key: of[state][key] for key in kept} for state in STATES} for name, of in reports.items()})) + "\n")
draw_maps()
draw_curves(reports)
text = (result / "figure-8.md").read_text() if (result / "figure-8.md").exists() else "# Figure 8 of the paper and its table of roughness\n\n<!-- tables -->\n"
(result / "figure-8.md").write_text(text.split("<!-- tables -->")[0] + "<!-- tables -->\n\n" + "\n".join(page(reports)) + "\n")
