#!/usr/bin/python3
"""Renders simulated prints beside the part, and tells by SSIM, SSIM of what the eye sees, and FLIP how alike they look: the
paper's figure 9.

    samples/paper/figure9.py [WORK FOLDER] [RESULT FOLDER]

A cube of 10 mm turned by 2 degrees about each axis and a sphere of 8 mm; printed with every method, simulated by both models
(the paper's smoothing of the mesh, and droplets that spread), and seen from two sides under four lights from 50 cm. What is
finished in the work folder is kept: the script can be stopped and started again. The program is the first `vdbdither` on the
PATH. Writes figure-9.json and figure-9.png.
"""

import json
import math
import pathlib
import statistics
import struct
import subprocess
import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt

PRINTER = "mimaki-3duj-553"
LOOKS = ("area", "large", "sky", "staircase")
VIEWS = {"front": ("30", "35"), "back": ("215", "60")}
PROCESSES = {"smoothed": "mesh-export {} --smooth taubin --iterations 160", "droplets": "simulate ! mesh-export {}"}
FIGURES = {"ssim": "SSIM", "ssim_seen": "SSIM of what the eye sees", "flip": "FLIP"}

here = pathlib.Path(__file__).resolve().parent
work = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else "out/paper-figure-9").resolve()
result = pathlib.Path(sys.argv[2]) if len(sys.argv) > 2 else here.parents[1] / "docs/paper"
work.mkdir(parents=True, exist_ok=True)
result.mkdir(parents=True, exist_ok=True)


def program(*words):
    return subprocess.run(["vdbdither", *map(str, words)], cwd=work, check=True, stdout=subprocess.PIPE).stdout


def mask(sigma, seed=1):
    name = f"blue-{sigma}-{seed}.vdb"
    if not (work / name).exists():
        program("mask", "--size", "64", "--sigma", sigma, "--seed", seed, "-o", name, "--quiet")
    return name


def methods():
    """Options of mesh2sdf, and the step after it."""
    paper = "dither --amplitude 4 --at closest --mask"
    return {
        "control": ([], "dither --mask none"),
        "interlacing": (["--refine-y", "2"], "interlace"),
        "white noise": ([], f"{paper} white"),
        "blue noise 2.5": ([], f"{paper} {mask('2.5')}"),
        "blue noise 1.1": ([], f"{paper} {mask('1.1')}"),
        "blue 1.1, one step, at the foot": ([], f"dither --amplitude 2 --at foot --mask {mask('1.1')}"),
        "the default": ([], "dither"),
    }


def second_seeds():
    """The same methods with other random numbers: how much of a figure is chance."""
    paper = "dither --amplitude 4 --at closest --mask"
    return {
        "white noise": ([], f"{paper} white --seed 2"),
        "blue noise 1.1": ([], f"{paper} {mask('1.1', 2)}"),
    }


def cube():
    """Ten mm about the origin, turned by 2 degrees about x, then y, then z."""
    corners = [[x - 5.0, y - 5.0, z - 5.0] for z in (0, 10) for y in (0, 10) for x in (0, 10)]
    c, s = math.cos(math.radians(2)), math.sin(math.radians(2))
    corners = [(x, c * y - s * z, s * y + c * z) for x, y, z in corners]
    corners = [(c * x + s * z, y, c * z - s * x) for x, y, z in corners]
    corners = [(c * x - s * y, s * x + c * y, z) for x, y, z in corners]
    faces = ((0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5))
    return [[corners[i] for i in half] for f in faces for half in (f[:3], (f[0], f[2], f[3]))]


def sphere(steps=240):
    """Eight mm, so fine that its facets do not show."""
    def at(i, j):
        polar, around = math.pi * i / steps, math.pi * j / steps
        if i in (0, steps):
            return (0, 0, 4 if i == 0 else -4)
        return (4 * math.sin(polar) * math.cos(around), 4 * math.sin(polar) * math.sin(around), 4 * math.cos(polar))
    triangles = []
    for i in range(steps):
        for j in range(2 * steps):
            k = (j + 1) % (2 * steps)
            if i > 0:
                triangles.append((at(i, j), at(i + 1, j), at(i, k)))
            if i < steps - 1:
                triangles.append((at(i, k), at(i + 1, j), at(i + 1, k)))
    return triangles


def write_stl(path, triangles):
    with open(path, "wb") as stream:
        stream.write(bytes(80) + struct.pack("<I", len(triangles)))
        for triangle in triangles:
            stream.write(struct.pack("<12fH", 0, 0, 0, *(value for corner in triangle for value in corner), 0))


def render(mesh, name, shape, view, look, *more):
    picture = f"{name}-{view}-{look}.png"
    if not (work / picture).exists():
        azimuth, elevation = VIEWS[view]
        program("render", mesh, picture, "--frame", f"{shape}.stl", "--azimuth", azimuth, "--elevation", elevation, "--look",
                look, "--quiet", *more)
    return picture


def scores(reference, picture):
    said = json.loads(program("ssim", reference, picture, "--json"))
    return {key: said[key] for key in FIGURES}


def of_method(shape, process, method, name):
    """Every score of a method, by view and light."""
    name = f"{shape}-{process}-{name}".replace(" ", "-").replace(",", "")
    finished = work / f"{name}.json"
    if not finished.exists():
        refine, step = method
        mesh = f"{name}.ply"
        program("mesh2sdf", f"{shape}.stl", "--printer", PRINTER, *refine, "!", *step.split(), "!",
                *PROCESSES[process].format(mesh).split(), "--overwrite", "--quiet")
        table = {f"{view} {look}": scores(render(f"{shape}.stl", shape, shape, view, look),
                                          render(mesh, name, shape, view, look))
                 for view in VIEWS for look in LOOKS}
        finished.write_text(json.dumps(table))
        (work / mesh).unlink()
    return json.loads(finished.read_text())


def mean(table):
    return {key: round(statistics.mean(row[key] for row in table.values()), 5) for key in FIGURES}


def rounded(table):
    return {place: {key: round(value, 5) for key, value in row.items()} for place, row in table.items()}


def draw(shape, process, names):
    """Above what is seen, below the scores."""
    figure = plt.figure(figsize=(2.1 * (len(names) + 1), 7.6))
    grid = figure.add_gridspec(3, len(names) + 1, height_ratios=(1, 1, 1.1), hspace=0.16, wspace=0.04)
    for row, look in enumerate(("area", "staircase")):
        for column, name in enumerate(["the part", *names]):
            file = f"{shape}-front-{look}.png" if column == 0 else \
                f"{shape}-{process}-{name}-front-{look}.png".replace(" ", "-").replace(",", "")
            axis = figure.add_subplot(grid[row, column])
            axis.imshow(plt.imread(work / file), interpolation="nearest")
            axis.set(xticks=[], yticks=[], facecolor="0.5")
            if row == 0:
                axis.set_title(name, fontsize=8)
            if column == 0:
                axis.set_ylabel(f"light: {look}", fontsize=8)
    below = grid[2, :].subgridspec(1, 3, wspace=0.15)
    for column, (key, title) in enumerate(FIGURES.items()):
        axis = figure.add_subplot(below[0, column])
        for n, look in enumerate(LOOKS):
            values = [statistics.mean(tables[shape][process][name][f"{view} {look}"][key] for view in VIEWS) for name in names]
            axis.plot(range(len(names)), values, "o-", markersize=4, linewidth=0.8, label=look, color=f"C{n}")
        axis.set_xticks(range(len(names)), [name.replace(", ", ",\n") for name in names], rotation=35, ha="right", fontsize=7)
        axis.set_title(title + (" (less is better)" if key == "flip" else ""), fontsize=9)
        axis.tick_params(axis="y", labelsize=7)
        axis.grid(alpha=0.3)
    axis.legend(fontsize=7)
    figure.savefig(result / "figure-9.png", dpi=110, bbox_inches="tight")


write_stl(work / "cube.stl", cube())
write_stl(work / "sphere.stl", sphere())
all_methods, again = methods(), second_seeds()
tables, summary = {}, {"about": "means over the object's pixels, seen from 50 cm at 50 cycles per degree; mean: over two views "
                                "and four lights; chance: greatest change by a second seed of the thresholds; rays: the part "
                                "beside itself with a second pattern of rays", "shapes": {}}
for shape in ("cube", "sphere"):
    tables[shape], out = {}, {}
    for process in PROCESSES:
        tables[shape][process] = {name: of_method(shape, process, method, name) for name, method in all_methods.items()}
        others = {name: of_method(shape, process, method, f"{name} again") for name, method in again.items()}
        out[process] = {name: {"mean": mean(table), **rounded(table)} for name, table in tables[shape][process].items()}
        out[process]["chance"] = {key: round(max(abs(table[place][key] - tables[shape][process][name][place][key])
                                                 for name, table in others.items() for place in table), 5) for key in FIGURES}
    out["rays"] = mean({f"{view} {look}": scores(render(f"{shape}.stl", shape, shape, view, look),
                                                 render(f"{shape}.stl", f"{shape}-rays", shape, view, look, "--seed", "1"))
                        for view in VIEWS for look in LOOKS})
    summary["shapes"][shape] = out
(result / "figure-9.json").write_text(json.dumps(summary, indent=1) + "\n")
draw("cube", "droplets", list(all_methods))
