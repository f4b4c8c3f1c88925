#!/usr/bin/python3
"""Compares ways to map colours that the inks of a printer cannot mix to colours that they can.

    samples/colour/gamut_mapping.py [--program build/release/vdbdither] [--printer NAME]... [--json FILE] [--plot FILE.png]

The colours are those of a grid of 18^3 in encoded sRGB that lie outside of the inks. What inks can mix is the convex hull of
their colours in the space of the roots R^(1/n) (optics.py). Ways:

nearest      the point of the surface of the hull with the smallest distance: in the roots, in opponent coordinates of the
             roots, in Oklab, or by CIEDE2000; the surface is sampled in steps of 1 / STEPS of the edges of its triangles
line         straight in the roots towards an aim, as far as the hull. The aim is the grey of the same lightness, on the line
             from the darkest to the lightest ink, moved by a share (pull x saturation) of the way to the mean of the inks
line, Oklab  straight in Oklab towards that grey

Reported are the means and the 95 % of CIEDE2000 and of the turn of the hue in Oklab, the mean of |dL*|, and the mean share of
the chroma in Oklab that is left. The hue counts where the chroma of both colours exceeds LEAST_CHROMA; "with hue" is the share
of these colours.

With --program, `separate` maps the colours of the grid; its coverages must mix the colours of the line with pull 0.5, the rule of
the program. The exit status is 1 if they differ. The ways are compared for `--white absolute`. By default (`--white media`) the
program scales colours to lie between the darkest and the lightest ink before, and the share that the inks mix is larger.

Oklab: Ottosson: A perceptual color space for image processing, 2020. The triangles of the hull: those of three inks with all
others on one side.
"""

import argparse
import itertools
import json
import pathlib
import subprocess
import tempfile

import numpy as np
import optics

PRINTERS = ("stratasys-j750-14um", "mimaki-3duj-553")
PROFILES = pathlib.Path(__file__).resolve().parents[1] / "printers"
GRID = 18
STEPS = 60
LEAST_CHROMA = 0.02
PULLS = (0, 0.1, 0.2, 0.3, 0.5, 0.8)
PULL = 0.5
# Coverages are of single precision.
TOLERANCE = 1e-6
SEED = 7
STYLES = ("solid", "dashed")

LMS_OF_RGB = np.array([[0.4122214708, 0.5363325363, 0.0514459929], [0.2119034982, 0.6806995451, 0.1073969566],
                       [0.0883024619, 0.2817188376, 0.6299787005]])
OKLAB_OF_LMS = np.array([[0.2104542553, 0.7936177850, -0.0040720468], [1.9779984951, -2.4285922050, 0.4505937099],
                         [0.0259040371, 0.7827717662, -0.8086757660]])
# Lightness, red-green and blue-yellow.
OPPONENT = np.array([[0.3, 0.55, 0.15], [0.5, -0.5, 0], [0.25, 0.25, -0.5]])
# Y of Rec. 709, with the digits of the program.
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])


def oklab(rgb):
    return np.cbrt(np.maximum(rgb, 0) @ LMS_OF_RGB.T) @ OKLAB_OF_LMS.T


def rgb_of_oklab(lab):
    return (lab @ np.linalg.inv(OKLAB_OF_LMS).T) ** 3 @ np.linalg.inv(LMS_OF_RGB).T


class Inks:
    """The inks of a profile that are not clear, and the convex hull of their roots.

    colours  [inks, 3], linear
    roots    [inks, 3]
    sides    [sides, 4]: a, b with a . y + b >= 0 inside
    corners  [sides, 3]: the inks of each side
    """

    def __init__(self, profile):
        materials = [entry for entry in profile["materials"] if "clear" not in entry["name"].lower()]
        self.names = [entry["name"] for entry in materials]
        self.n = optics.yule_nielsen(profile)
        self.colours = optics.material_colours(materials)
        self.roots = self.colours ** (1 / self.n)
        luminance = self.colours @ LUMINANCE
        self.dark, self.light = luminance.argmin(), luminance.argmax()
        # The program takes the root of green for lightness.
        self.lightness = luminance ** (1 / self.n[1])
        sides, corners = [], []
        for three in itertools.combinations(range(len(self.roots)), 3):
            first, second, third = self.roots[list(three)]
            normal = np.cross(second - first, third - first)
            heights = (self.roots - first) @ normal
            for sign in (1, -1):
                if (sign * heights > -1e-12).all():
                    sides.append([*(sign * normal), -sign * normal @ first])
                    corners.append(three)
        self.sides, self.corners = np.array(sides), np.array(corners)

    def heights(self, roots):
        """Returns a . y + b for points [..., 3]: [..., sides]."""
        return roots @ self.sides[:, :3].T + self.sides[:, 3]

    def between(self, rgb):
        """Returns linear colours scaled to lie between the darkest ink and the lightest."""
        return self.colours[self.dark] + rgb * (self.colours[self.light] - self.colours[self.dark])

    def can_mix(self, rgb):
        return (self.heights(np.maximum(rgb, 0) ** (1 / self.n)) >= -1e-9).all(axis=-1)

    def surface(self):
        """Returns the roots [samples, 3] of a regular grid on each side of the hull."""
        shares = np.array([(i, j, STEPS - i - j) for i in range(STEPS + 1) for j in range(STEPS + 1 - i)]) / STEPS
        return np.concatenate([shares @ self.roots[list(three)] for three in self.corners])

    def grey(self, rgb):
        """Returns the roots of the grey of the same lightness: a mixture of the darkest and the lightest ink."""
        lightness = np.maximum(rgb @ LUMINANCE, 0) ** (1 / self.n[1])
        dark, light = self.lightness[[self.dark, self.light]]
        share = np.clip((lightness - dark) / (light - dark), 0, 1)[:, None]
        return self.roots[self.dark] + share * (self.roots[self.light] - self.roots[self.dark])


def nearest(wanted, samples, distance):
    """Returns the places of the nearest samples. distance: of arrays [colours, 1, 3] and [1, samples, 3]."""
    return np.concatenate([distance(wanted[i:i + 50, None], samples[None]).argmin(axis=1) for i in range(0, len(wanted), 50)])


def squared(a, b):
    return ((a - b) ** 2).sum(axis=-1)


def by_line(inks, rgb, pull):
    """Returns linear colours [colours, 3] mapped along lines in the roots."""
    roots, grey = rgb ** (1 / inks.n), inks.grey(rgb)
    saturation = np.ptp(roots, axis=1)[:, None]
    aim = grey + pull * saturation * (inks.roots.mean(axis=0) - grey)
    here, there = np.maximum(inks.heights(aim), 0), inks.heights(roots)
    kept = np.where(there < 0, here / np.where(there < 0, here - there, 1), 1).min(axis=1)[:, None]
    return (aim + kept * (roots - aim)) ** inks.n


def by_line_in_oklab(inks, rgb):
    start, end = oklab(inks.grey(rgb) ** inks.n), oklab(rgb)
    low, high = np.zeros((len(rgb), 1)), np.ones((len(rgb), 1))
    for _ in range(40):
        middle = (low + high) / 2
        inside = inks.can_mix(rgb_of_oklab(start + middle * (end - start)))[:, None]
        low, high = np.where(inside, middle, low), np.where(inside, high, middle)
    return rgb_of_oklab(start + low * (end - start))


def ways(inks, rgb):
    """Returns the mapped linear colours of each way by its name."""
    surface = inks.surface()
    colours = surface ** inks.n
    roots = rgb ** (1 / inks.n)
    found = {"nearest, roots": colours[nearest(roots, surface, squared)],
             "nearest, opponent": colours[nearest(roots @ OPPONENT.T, surface @ OPPONENT.T, squared)],
             "nearest, Oklab": colours[nearest(oklab(rgb), oklab(colours), squared)],
             "nearest, CIEDE2000": colours[nearest(optics.lab(rgb), optics.lab(colours), optics.ciede2000)],
             "line, Oklab": by_line_in_oklab(inks, rgb)}
    return found | {f"line, pull {pull:g}": by_line(inks, rgb, pull) for pull in PULLS}


def figures(rgb, found):
    """Returns the figures of a way. rgb, found: linear colours [colours, 3]."""
    lab, mapped = optics.lab(rgb), optics.lab(found)
    before, after = (colour[:, 1] + 1j * colour[:, 2] for colour in (oklab(rgb), oklab(found)))
    coloured = np.abs(before) > LEAST_CHROMA
    hued = coloured & (np.abs(after) > LEAST_CHROMA)
    turn = np.degrees(np.abs(np.angle(after[hued] / before[hued])))
    difference = optics.ciede2000(lab, mapped)
    return {"ciede2000": difference.mean(), "ciede2000_95": np.percentile(difference, 95), "hue": turn.mean(),
            "hue_95": np.percentile(turn, 95), "with_hue": hued.mean(), "dl": np.abs(mapped[:, 0] - lab[:, 0]).mean(),
            "chroma": (np.abs(after[coloured]) / np.abs(before[coloured])).mean()}


def volume_share(inks):
    """Returns the share of the volume of sRGB in CIELAB that the inks can mix, from 400 000 random points."""
    lab = np.random.default_rng(SEED).uniform((0, -90, -110), (100, 100, 96), (400_000, 3))
    rgb = rgb_of_lab(lab)
    is_srgb = ((rgb >= 0) & (rgb <= 1)).all(axis=1)
    return inks.can_mix(rgb[is_srgb]).mean()


def rgb_of_lab(lab):
    y = (lab[..., 0] + 16) / 116
    root = np.stack([y + lab[..., 1] / 500, y, y - lab[..., 2] / 200], axis=-1)
    share = np.where(root > 6 / 29, root**3, (root - 4 / 29) * 3 * (6 / 29) ** 2)
    return share * optics.WHITE @ np.linalg.inv(optics.XYZ_OF_RGB).T


def separated(program, profile, inks, rgb, white):
    """Returns the roots [colours, 3] of what the coverages of `separate --white` mix, and their coverages."""
    import pyopenvdb

    # Values of the background are not active, and black is a colour.
    grid = pyopenvdb.Vec3SGrid((-1, -1, -1))
    grid.name = "Cd"
    rgb = rgb.astype(np.float32)
    grid.copyFromArray(rgb[:, None, None, :])
    with tempfile.TemporaryDirectory() as folder:
        path, out = pathlib.Path(folder) / "colours.vdb", pathlib.Path(folder) / "coverages.vdb"
        pyopenvdb.write(str(path), grids=[grid], metadata={"vdbdither:printer": json.dumps(profile)})
        done = subprocess.run([str(program), "separate", str(path), "--white", white, "-o", str(out), "--quiet"],
                              capture_output=True, text=True)
        if done.returncode:
            raise SystemExit(f"gamut_mapping: separate\n{done.stderr.strip()}")
        columns = []
        for name in inks.names:
            coverage = np.zeros((len(rgb), 1, 1), np.float32)
            pyopenvdb.read(str(out), "coverage_" + name).copyToArray(coverage)
            columns.append(coverage.ravel())
    coverages = np.stack(columns, axis=1).astype(float)
    return coverages @ inks.roots, coverages


def check(program, profile, inks, rgb):
    """Returns the greatest difference of roots between the program and the line with its pull, for colours [colours, 3]."""
    rgb = rgb.astype(np.float32).astype(float)
    result = {"colours": len(rgb)}
    for white, wanted in (("absolute", rgb), ("media", inks.between(rgb))):
        found, coverages = separated(program, profile, inks, rgb, white)
        expected = np.where(inks.can_mix(wanted)[:, None], wanted, by_line(inks, wanted, PULL))
        result[white] = np.abs(found - expected ** (1 / inks.n)).max()
        result["sum_of_coverages"] = max(result.get("sum_of_coverages", 0), np.abs(coverages.sum(axis=1) - 1).max())
    return result


def plot(path, sets):
    """Draws what inks can mix and sRGB, at three lightnesses of CIELAB. sets: Inks by title."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    a, b = np.meshgrid(np.linspace(-90, 100, 400), np.linspace(-110, 100, 400))
    picture, axes = plt.subplots(1, 3, figsize=(10, 3.6), sharey=True)
    for axis, lightness in zip(axes, (35, 55, 75)):
        rgb = rgb_of_lab(np.stack([np.full(a.shape, lightness), a, b], axis=-1))
        inside = ((rgb >= 0) & (rgb <= 1)).all(axis=-1)
        shown = np.where(inside[..., None], optics.encoded(rgb), 1)
        axis.imshow(shown * 0.5 + 0.5, extent=(-90, 100, -110, 100), origin="lower", aspect="equal")
        axis.contour(a, b, inside, [0.5], colors="0.5", linewidths=1)
        for n, inks in enumerate(sets.values()):
            axis.contour(a, b, inside & inks.can_mix(rgb), [0.5], colors=f"C{n}", linewidths=1.5, linestyles=STYLES[n % 2])
        axis.set(title=f"L* = {lightness}", xlabel="a*")
        axis.grid(alpha=0.2)
    axes[0].set(ylabel="b*")
    handles = [plt.Line2D([], [], color="0.5")] + [plt.Line2D([], [], color=f"C{n}", ls=STYLES[n % 2]) for n in range(len(sets))]
    axes[2].legend(handles, ["sRGB", *sets], fontsize=7, loc="lower right")
    picture.savefig(path, dpi=90, bbox_inches="tight")


def rounded(value):
    if isinstance(value, dict):
        return {key: rounded(entry) for key, entry in value.items()}
    return float(f"{value:.4g}") if isinstance(value, float) else value


def study(printer, program):
    """Returns the figures of one printer, and its inks."""
    profile = json.loads((PROFILES / f"{printer}.json").read_text())
    inks = Inks(profile)
    axis = optics.linear(np.linspace(0, 1, GRID))
    grid = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1).reshape(-1, 3)
    outside = grid[~inks.can_mix(grid)]
    result = {"mixable": 1 - len(outside) / len(grid), "mixable_of_cielab": volume_share(inks),
              "mixable_media": inks.can_mix(inks.between(grid)).mean(), "outside": len(outside),
              "ways": {name: figures(outside, found) for name, found in ways(inks, outside).items()}}
    if program:
        result["program"] = check(program, profile, inks, grid)
    return rounded(result), inks


def lines_of(result):
    lines = [f"the inks mix {result['mixable']:.1%} of the grid ({result['mixable_media']:.1%} scaled to the medium) and "
             f"{result['mixable_of_cielab']:.1%} of the volume of sRGB in CIELAB; {result['outside']} colours outside",
             f"{'':24}{'CIEDE2000':>10}{'95 %':>7}{'hue':>8}{'95 %':>7}{'with hue':>10}{'dL*':>7}{'chroma':>8}"]
    for name, way in result["ways"].items():
        lines.append(f"{name:24}{way['ciede2000']:10.1f}{way['ciede2000_95']:7.1f}{way['hue']:8.1f}{way['hue_95']:7.1f}"
                     f"{way['with_hue']:10.3f}{way['dl']:7.1f}{way['chroma']:8.2f}")
    if "program" in result:
        lines.append("`separate` and the line with pull 0.5 differ in the roots by {absolute:.1e} at most, and by {media:.1e} "
                     "with --white media, in {colours} colours".format(**result["program"]))
    return lines


def main():
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--program", type=pathlib.Path)
    parser.add_argument("--printer", action="append")
    parser.add_argument("--json", type=pathlib.Path)
    parser.add_argument("--plot", type=pathlib.Path)
    arguments = parser.parse_args()
    results, sets = {}, {}
    for printer in arguments.printer or PRINTERS:
        results[printer], sets[printer] = study(printer, arguments.program)
        print("\n".join([printer, *lines_of(results[printer])]), flush=True)
    if arguments.json:
        arguments.json.write_text(json.dumps(results, indent=1) + "\n")
    if arguments.plot:
        plot(arguments.plot, sets)
    if any(max(result["program"][white] for white in ("absolute", "media")) > TOLERANCE
           for result in results.values() if arguments.program):
        raise SystemExit("gamut_mapping: the program maps colours differently")


main()
