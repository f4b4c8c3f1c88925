#!/usr/bin/python3
"""Renders simulated prints and the part, and compares the pictures by SSIM, SSIM of what the eye sees, and FLIP: figure 9 of
the paper.

    samples/paper/figure9.py [WORK FOLDER] [RESULT FOLDER] [METHOD]

The parts are a cube of 10 mm turned by 2 degrees about each axis and a sphere of 8 mm. They are printed with every method,
simulated by both models (the smoothing of the mesh from the paper, and droplets that spread), and rendered from two sides under
three lights from 50 cm. Finished measurements in the work folder are not repeated, except for METHOD; the script can be
interrupted and continued. The program is the first `vdbdither` on the PATH. Writes figure-9.json, figure-9.md and figure-9.png.
"""

import json
import pathlib
import statistics
import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt

import parts
from methods import METHODS, RESULT, chain, file_name, program

LOOKS = ("area", "sky", "staircase")
VIEWS = {"front": ("30", "35"), "back": ("215", "60")}
PROCESSES = {"droplets": "! simulate ! mesh-export {}", "smoothed": "! mesh-export {} --smooth taubin"}
FIGURES = {"ssim": "SSIM", "ssim_seen": "SSIM of what the eye sees", "flip": "FLIP"}

work = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else "out/paper-figure-9").resolve()
result = pathlib.Path(sys.argv[2]).resolve() if len(sys.argv) > 2 else RESULT
anew = sys.argv[3] if len(sys.argv) > 3 else None
work.mkdir(parents=True, exist_ok=True)
result.mkdir(parents=True, exist_ok=True)


# The same methods with other random numbers, to estimate the scatter.
# Error diffusion has no seed.
SECOND_SEEDS = {name: (METHODS[name][0], METHODS[name][1] + " --seed 2") for name in ("blue noise 1.1",)}


def render(mesh, name, shape, view, look, *more):
    picture = f"{name}-{view}-{look}.png"
    if mesh.endswith(".ply") or not (work / picture).exists():
        azimuth, elevation = VIEWS[view]
        program(work, "render", mesh, picture, "--frame", f"{shape}.stl", "--azimuth", azimuth, "--elevation", elevation, "--look",
                look, "--quiet", "--overwrite", *more)
    return picture


def scores(reference, picture):
    said = json.loads(program(work, "ssim", reference, picture, "--json"))
    return {key: said[key] for key in FIGURES}


def of_method(shape, process, method, name):
    """Returns the scores of a method, by view and light."""
    again = anew is not None and name.startswith(anew)
    name = file_name(f"{shape}-{process}-{name}")
    finished = work / f"{name}.json"
    if again or not finished.exists():
        mesh = f"{name}.ply"
        chain(work, f"{shape}.stl", method, PROCESSES[process].format(mesh), "--overwrite")
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
    """Draws the pictures and, below them, the scores."""
    figure = plt.figure(figsize=(2.1 * (len(names) + 1), 7.6))
    grid = figure.add_gridspec(3, len(names) + 1, height_ratios=(1, 1, 1.1), hspace=0.16, wspace=0.04)
    for row, look in enumerate(("area", "staircase")):
        for column, name in enumerate(["the part", *names]):
            file = f"{shape}-front-{look}.png" if column == 0 else \
                file_name(f"{shape}-{process}-{name}-front-{look}.png")
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
        axis.set_title(title + (" (smaller is better)" if key == "flip" else ""), fontsize=9)
        axis.tick_params(axis="y", labelsize=7)
        axis.grid(alpha=0.3)
    axis.legend(fontsize=7)
    figure.savefig(result / "figure-9.png", dpi=110, bbox_inches="tight")


parts.write_stl(work / "cube.stl", parts.cube(10.0))
parts.write_stl(work / "sphere.stl", parts.sphere(4.0))
tables, summary = {}, {"about": "means over the object's pixels, seen from 50 cm at 50 cycles per degree; mean: over two views "
                                "and three lights; chance: greatest change by a second seed of the thresholds, after droplets; "
                                "rays: the part beside itself with a second pattern of rays", "shapes": {}}
for shape in ("cube", "sphere"):
    tables[shape], out = {}, {}
    for process in PROCESSES:
        tables[shape][process] = {name: of_method(shape, process, method, name) for name, method in METHODS.items()}
        out[process] = {name: {"mean": mean(table), **rounded(table)} for name, table in tables[shape][process].items()}
    others = {name: of_method(shape, "droplets", method, f"{name} again") for name, method in SECOND_SEEDS.items()}
    out["chance"] = {key: round(max(abs(table[place][key] - tables[shape]["droplets"][name][place][key])
                                    for name, table in others.items() for place in table), 5) for key in FIGURES}
    out["rays"] = mean({f"{view} {look}": scores(render(f"{shape}.stl", shape, shape, view, look),
                                                 render(f"{shape}.stl", f"{shape}-rays", shape, view, look, "--seed", "1"))
                        for view in VIEWS for look in LOOKS})
    summary["shapes"][shape] = out
    print(f"figure 9: {shape}", flush=True)
(result / "figure-9.json").write_text(json.dumps(summary, indent=1) + "\n")
draw("cube", "droplets", list(METHODS))
rows = ["| | " + " | ".join(f"{shape}, {process}" for shape in tables for process in PROCESSES) + " |", "| --- " * 5 + "|"]
for name in METHODS:
    rows.append(f"| {name} | " + " | ".join(" / ".join(f"{mean(tables[shape][process][name])[key]:.3f}" for key in FIGURES)
                                            for shape in tables for process in PROCESSES) + " |")
chance = {key: max(of["chance"][key] for of in summary["shapes"].values()) for key in FIGURES}
rows.append("\nTwo seeds of the thresholds differ in any one picture by at most "
            + ", ".join(f"{value:.3f} ({FIGURES[key]})" for key, value in chance.items())
            + ".\nThe part compared with itself under another pattern of rays: "
            + "; ".join(f"{shape} " + " / ".join(f"{of['rays'][key]:.3f}" for key in FIGURES)
                        for shape, of in summary["shapes"].items()) + ".")
page = result / "figure-9.md"
text = page.read_text() if page.exists() else "# Figure 9 of the paper: the appearance of prints\n\n<!-- tables -->\n"
page.write_text(text.split("<!-- tables -->")[0] + "<!-- tables -->\n\n" + "\n".join(rows) + "\n")
