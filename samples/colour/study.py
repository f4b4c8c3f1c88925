#!/usr/bin/python3
"""Studies the colour prints of the program: flat plates of one colour, made, sliced, and judged from their slices.

    samples/colour/study.py --program build/release/vdbdither [--part grain|accuracy|dither|oracles]... [--printer NAME]...
        [--normals N] [--recipes N] [--colours N] [--steps "dither ! halftone --white absolute"] [--json FILE]

grain     the grain of facets as a share of the grain of random choice (judge.py): 20 normals x 24 recipes
accuracy  CIEDE2000 between the wanted colour and the one that the counted coverages predict: the ColorChecker, and random
          mixtures of the inks; in a colour that inks can mix, the law of mixtures itself has no error
dither    coverages and colours with the shape dither, without it, and interlaced
oracles   the grain beside that of other ways to choose materials, with the same coverages on the same voxels (oracles.py)

A plate is a box with a colour at its vertices, as OBJ. Its facet has the normal of the case; each normal has its own place on
the lattice. Recipes are the colours of the ColorChecker in sRGB, as published for D65 and 8 bits.
"""

import argparse
import itertools
import json
import pathlib
import shutil
import subprocess
import sys
import tempfile
import time

import numpy as np
import optics
import oracles
from judge import LENGTHS_MM, judge
from printed_stack import read_stack

PARTS = ("grain", "accuracy", "dither", "oracles")
PRINTERS = ("stratasys-j750-14um", "mimaki-3duj-553")
STEPS = "dither ! halftone --white absolute"

COLOURCHECKER = {
    "dark skin": (115, 82, 68), "light skin": (194, 150, 130), "blue sky": (98, 122, 157), "foliage": (87, 108, 67),
    "blue flower": (133, 128, 177), "bluish green": (103, 189, 170), "orange": (214, 126, 44), "purplish blue": (80, 91, 166),
    "moderate red": (193, 90, 99), "purple": (94, 60, 108), "yellow green": (157, 188, 64), "orange yellow": (224, 163, 46),
    "blue": (56, 61, 150), "green": (70, 148, 73), "red": (175, 54, 60), "yellow": (231, 199, 31), "magenta": (187, 86, 149),
    "cyan": (8, 133, 161), "white": (243, 243, 242), "neutral 8": (200, 200, 200), "neutral 6.5": (160, 160, 160),
    "neutral 5": (122, 122, 121), "neutral 3.5": (85, 85, 85), "black": (52, 52, 52),
}
# A few recipes in this order cover light, middle, dark and saturated colours.
RECIPES = ["neutral 6.5", "light skin", "blue sky", "dark skin", "yellow green", "moderate red"]
RECIPES += [name for name in COLOURCHECKER if name not in RECIPES]

# Facets along the axes, half way between two, a little off them, and spread evenly.
NORMALS = [(0, 0, 1), (0.36, 0.48, 0.8), (1, 0, 0), (0.1, 0.03, 1), (-0.5, 0.7, -0.5), (0, 1, 0), (1, 0, 1), (0, 0, -1),
           (0.02, -0.05, 1), (-0.8, 0.25, 0.55), (0, 1, 1), (1, 1, 0), (1, 0.06, 0.1), (0.2, -0.9, 0.4), (1, 1, 1),
           (-0.3, -0.35, 0.9), (0.05, -1, 0.12), (-0.65, -0.7, 0.3), (0.9, 0.15, -0.4), (-0.1, 0.45, 0.9)]

PLATE_MM = (4.6, 4.6, 1.8)
SMALL_PLATE_MM = (3, 3, 1.8)
SEED = 7
# Inks with less coverage are left out of the worst share: a few hundred dots say little.
LEAST_COVERAGE = 0.01


def write_plate(path, normal, size_mm, centre_mm, rgb):
    """Writes a box of `size_mm` as OBJ, whose third axis is the normal. rgb: linear, at every vertex."""
    axes = np.array(optics.frame(normal))
    colour = " ".join(f"{value:.7f}" for value in optics.encoded(np.asarray(rgb, float)))
    lines = []
    for corner in itertools.product((-0.5, 0.5), repeat=3):
        place = np.asarray(centre_mm) + (np.array(corner) * size_mm) @ axes
        lines.append("v " + " ".join(f"{value:.6f}" for value in place) + " " + colour)
    lines += ["f 1 2 4 3", "f 5 7 8 6", "f 1 5 6 2", "f 3 4 8 7", "f 1 3 7 5", "f 2 6 8 4"]
    path.write_text("\n".join(lines) + "\n")


def place_of(number):
    """Returns a place in mm for the plate of the normal with this number: not the same voxels, not the same tile of a mask."""
    return np.random.default_rng((SEED, number)).uniform(20, 40, 3)


class Program:
    """Prints plates with the program in a folder that is emptied before each."""

    def __init__(self, path, folder, steps):
        self.path, self.folder, self.steps = str(pathlib.Path(path).resolve()), pathlib.Path(folder), steps

    def stack(self, printer, normal, size_mm, centre_mm, rgb, steps=None):
        """Returns the Stack of a plate. Raises SystemExit with the words of the program if it fails."""
        write_plate(self.folder / "plate.obj", normal, size_mm, centre_mm, rgb)
        out = self.folder / "out"
        shutil.rmtree(out, ignore_errors=True)
        command = [self.path, "mesh2sdf", "plate.obj", "--printer", printer, "--colour", "!",
                   *(steps or self.steps).split(), "!", "slice-export", "out", "--quiet"]
        done = subprocess.run(command, cwd=self.folder, capture_output=True, text=True)
        if done.returncode:
            raise SystemExit(f"study: {' '.join(command[1:])}\n{done.stderr.strip()}")
        return read_stack(out)


def inks_of(materials):
    """Returns the places of the materials that mix colours: all that are not clear."""
    return [m for m, entry in enumerate(materials) if "clear" not in entry["name"].lower()]


def random_mixtures(count, colours, n):
    """Returns linear colours [count, 3] of random mixtures of the inks `colours`, uniform over coverages."""
    coverages = np.random.default_rng(SEED).dirichlet(np.ones(len(colours)), count)
    return optics.mixed(coverages, colours, n)


def is_mixable(rgb, colours, n):
    """Returns whether a mixture of the inks has this colour: whether it lies in a tetrahedron of four of them under the law."""
    points, wanted = colours ** (1 / n), np.asarray(rgb) ** (1 / n)
    for four in itertools.combinations(range(len(points)), 4):
        sides = np.vstack([points[list(four)].T, np.ones(4)])
        if abs(np.linalg.det(sides)) > 1e-9 and np.linalg.solve(sides, [*wanted, 1]).min() >= -1e-9:
            return True
    return False


def differences(wanted, found):
    return optics.ciede2000(optics.lab(wanted), optics.lab(found))


def predicted(stack, coverages=None):
    """Returns the linear colour of coverages, by default those of the whole stack."""
    if coverages is None:
        counts = np.bincount(stack.voxels.ravel(), minlength=len(stack.materials) + 1)[1:]
        coverages = counts / counts.sum()
    return optics.mixed(coverages, optics.material_colours(stack.materials), optics.yule_nielsen(stack.profile))


def study_grain(program, printer, normals, recipes, seeds):
    cases = []
    for number, normal in enumerate(normals):
        start = time.monotonic()
        for name in recipes:
            rgb = optics.linear(np.array(COLOURCHECKER[name]) / 255)
            stack = program.stack(printer, normal, PLATE_MM, place_of(number), rgb)
            result = judge(stack, normal, seeds)
            case = {"normal": list(normal), "recipe": name, "wanted": rgb.tolist(), **result}
            case["de"] = float(differences(rgb, np.array(result["predicted"]["linear_rgb"])))
            cases.append(case)
        note(f"{printer}: normal {number + 1} of {len(normals)}, {time.monotonic() - start:.0f} s")
    return cases


def table_of_grain(cases):
    """Returns the lines of a table: mean and worst share of the grain of random choice, for each length."""
    head = f"{'':16}{'cases':>6}" + "".join(f"{'l = %d um' % round(1000 * length):>19}" for length in LENGTHS_MM)
    lines = [head, f"{'share of random':22}" + f"{'mean':>11}{'worst':>8}" * len(LENGTHS_MM)]
    rows = {"recipe": [[entry["share"] for entry in case["grain"]] for case in cases if case["grain"][0]["share"] is not None]}
    # A stack names the materials that it has.
    for name in sorted({name for case in cases for name in case["coverage"]}):
        rows[name] = [[entry["inks"][name]["share"] for entry in case["grain"]] for case in cases
                      if LEAST_COVERAGE < case["coverage"].get(name, 0) < 1 - LEAST_COVERAGE]
    for name, shares in rows.items():
        if shares:
            cells = zip(np.mean(shares, axis=0), np.max(shares, axis=0))
            lines.append(f"{name:16}{len(shares):6}" + "".join(f"{mean:11.3f}{worst:8.3f}" for mean, worst in cells))
    return lines


def lines_of_grain(cases):
    lines = table_of_grain(cases)
    worst = sorted((case for case in cases if case["grain"][0]["share"] is not None),
                   key=lambda case: -max(entry["share"] for entry in case["grain"]))[:5]
    lines.append("the worst recipes:")
    for case in worst:
        lines.append(f"  {case['recipe']:14} normal " + " ".join(f"{part:6.2f}" for part in case["normal"]) + "  shares "
                     + " ".join(f"{entry['share']:.3f}" for entry in case["grain"]) + "  dL* "
                     + " ".join(f"{entry['dl']:.3f}" for entry in case["grain"]))
    rms = [value for case in cases for value in case["coverage_rms"].values()]
    lines.append(f"coverage of an ink in windows of 1 mm: rms {np.mean(rms):.6f} mean, {np.max(rms):.6f} worst")
    return lines


def study_accuracy(program, printer, recipes, count):
    first = program.stack(printer, (0, 0, 1), SMALL_PLATE_MM, place_of(0), (0.5, 0.5, 0.5))
    inks = inks_of(first.profile["materials"])
    colours, n = optics.material_colours(first.profile["materials"])[inks], optics.yule_nielsen(first.profile)
    wanted = [(name, optics.linear(np.array(COLOURCHECKER[name]) / 255)) for name in recipes]
    wanted += [(f"mixture {k}", rgb) for k, rgb in enumerate(random_mixtures(count, colours, n))]
    cases = []
    for number, (name, rgb) in enumerate(wanted):
        normal = NORMALS[number % len(NORMALS)]
        stack = program.stack(printer, normal, SMALL_PLATE_MM, place_of(number), rgb)
        found = predicted(stack)
        cases.append({"colour": name, "wanted": rgb.tolist(), "predicted": found.tolist(), "normal": list(normal),
                      "mixable": is_mixable(rgb, colours, n), "de": float(differences(rgb, found))})
        if number % 50 == 49:
            note(f"{printer}: colour {number + 1} of {len(wanted)}")
    return cases


def lines_of_accuracy(cases):
    lines = [f"{'CIEDE2000':32}{'cases':>6}{'median':>10}{'95 %':>10}{'worst':>10}"]
    checker = [case for case in cases if case["colour"] in COLOURCHECKER]
    for title, rows in (("ColorChecker, in gamut", [case for case in checker if case["mixable"]]),
                        ("ColorChecker, out of gamut", [case for case in checker if not case["mixable"]]),
                        ("random mixtures", [case for case in cases if case["colour"] not in COLOURCHECKER])):
        if rows:
            de = [case["de"] for case in rows]
            lines.append(f"{title:32}{len(de):6}{np.median(de):10.4f}{np.percentile(de, 95):10.4f}{np.max(de):10.4f}")
    return lines


DITHERS = {"dither": "dither", "no dither": "dither --mask none", "interlaced": "interlace"}


def study_dither(program, printer, normals, recipes):
    rest = program.steps.partition("!")[2].strip()
    cases = []
    for number, normal in enumerate(normals):
        for name in recipes:
            rgb = optics.linear(np.array(COLOURCHECKER[name]) / 255)
            for title, step in DITHERS.items():
                stack = program.stack(printer, normal, PLATE_MM, place_of(number), rgb, f"{step} ! {rest}")
                result = judge(stack, normal, grain=False)
                result["de"] = float(differences(rgb, np.array(result["predicted"]["linear_rgb"])))
                cases.append({"dither": title, "normal": list(normal), "recipe": name, **result})
        note(f"{printer}: normal {number + 1} of {len(normals)}")
    return cases


def lines_of_dither(cases):
    lines = [f"{'':22}{'':6}{'coverage off no dither':>24}{'rms, 1 mm':>12}{'CIEDE2000 to no dither':>24}{'to wanted':>12}",
             f"{'':18}{'cases':>10}{'mean':>12}{'worst':>12}{'mean':>12}{'mean':>12}{'worst':>12}{'mean':>12}"]
    plain = {(tuple(case["normal"]), case["recipe"]): case for case in cases if case["dither"] == "no dither"}
    for title in DITHERS:
        rows = [case for case in cases if case["dither"] == title]
        pairs = [(case, plain[tuple(case["normal"]), case["recipe"]]) for case in rows]
        off = [abs(case["coverage"].get(name, 0) - other["coverage"].get(name, 0)) for case, other in pairs
               for name in {**case["coverage"], **other["coverage"]}]
        rms = [value for case in rows for value in case["coverage_rms"].values()]
        de = [differences(*(np.array(side["predicted"]["linear_rgb"]) for side in pair)) for pair in pairs]
        lines.append(f"{title:22}{len(rows):6}{np.mean(off):12.6f}{np.max(off):12.6f}{np.mean(rms):12.6f}"
                     f"{np.mean(de):12.4f}{np.max(de):12.4f}{np.mean([case['de'] for case in rows]):12.3f}")
    return lines


def study_oracles(program, printer, normals, recipes):
    cases = []
    for number, normal in enumerate(normals):
        for name in recipes:
            rgb = optics.linear(np.array(COLOURCHECKER[name]) / 255)
            stack = program.stack(printer, normal, PLATE_MM, place_of(number), rgb)
            cases.append({"normal": list(normal), "recipe": name, "methods": oracles.compared(stack, normal)})
        note(f"{printer}: normal {number + 1} of {len(normals)}")
    return cases


def lines_of_oracles(cases):
    lines = ["share of the grain of random choice: mean of the recipes, their worst, and the worst ink alone",
             f"{'':18}{'cases':>6}" + "".join(f"{'l = %d um' % round(1000 * length):>27}" for length in LENGTHS_MM)
             + f"{'rms, 1 mm':>12}{'CIEDE2000':>11}"]
    for method in cases[0]["methods"]:
        results = [case["methods"][method] for case in cases]
        shares = [oracles.figures(result) for result in results if result["grain"][0]["share"] is not None]
        cells = "        -        -        -" * len(LENGTHS_MM)
        if shares:
            recipes, inks = np.array(shares, float).swapaxes(0, 1)
            columns = recipes.mean(axis=0), recipes.max(axis=0), inks.max(axis=0)
            cells = "".join("".join(f"{value:9.3f}" for value in values) for values in zip(*columns))
        rms = np.mean([max(result["coverage_rms"].values()) for result in results])
        lines.append(f"{method:18}{len(shares):6}{cells}{rms:12.6f}"
                     f"{np.mean([result['de_to_stack'] for result in results]):11.3f}")
    return lines


def note(text):
    print(text, file=sys.stderr, flush=True)


def run(part, program, printer, arguments):
    """Returns the cases of a part, and the lines that sum them up."""
    normals, recipes = NORMALS[:arguments.normals], RECIPES[:arguments.recipes]
    if part == "grain":
        cases = study_grain(program, printer, normals, recipes, range(1, arguments.seeds + 1))
        return cases, lines_of_grain(cases)
    if part == "accuracy":
        cases = study_accuracy(program, printer, recipes, arguments.colours)
        return cases, lines_of_accuracy(cases)
    if part == "dither":
        cases = study_dither(program, printer, normals, recipes)
        return cases, lines_of_dither(cases)
    cases = study_oracles(program, printer, normals, recipes)
    return cases, lines_of_oracles(cases)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--program", required=True, help="path of vdbdither")
    parser.add_argument("--part", action="append", choices=PARTS, help="by default grain, accuracy")
    parser.add_argument("--printer", action="append", help="by default " + " and ".join(PRINTERS))
    parser.add_argument("--normals", type=int, default=len(NORMALS), help="the first N of 20")
    parser.add_argument("--recipes", type=int, default=len(RECIPES), help="the first N of 24")
    parser.add_argument("--colours", type=int, default=200, help="random mixtures for the accuracy")
    parser.add_argument("--seeds", type=int, default=2, help="random choices to compare with")
    parser.add_argument("--steps", default=STEPS, help="stages between mesh2sdf and slice-export; the first is the dither")
    parser.add_argument("--json", metavar="FILE", help="writes all cases")
    arguments = parser.parse_args()
    everything = {}
    with tempfile.TemporaryDirectory(prefix="vdbdither-study-") as folder:
        program = Program(arguments.program, folder, arguments.steps)
        for printer in arguments.printer or PRINTERS:
            printer = str(pathlib.Path(printer).resolve()) if printer.endswith(".json") else printer
            for part in arguments.part or ("grain", "accuracy"):
                cases, lines = run(part, program, printer, arguments)
                print(f"{part}, {printer}", *lines, "", sep="\n", flush=True)
                everything.setdefault(printer, {})[part] = cases
    if arguments.json:
        pathlib.Path(arguments.json).write_text(json.dumps(everything, indent=1) + "\n")


if __name__ == "__main__":
    main()
