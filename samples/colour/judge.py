#!/usr/bin/python3
"""Judges the stack of a flat patch of one colour: coverages, grain, and the colour that the coverages predict.

    samples/colour/judge.py STACK [--normal X,Y,Z] [--json FILE]

Grain is the rms of L* on the facet with this normal, as the eye sees it from 30 cm (see optics.py), for light that reaches
0, 50 and 150 um deep: of the whole recipe, and of each material alone, in black on white. Beside each stands its share of
the grain of random choice: the same printed voxels, where each takes its material at random with the same coverages.
"""

import argparse
import hashlib
import json

import numpy as np
import optics
from printed_stack import read_stack

LENGTHS_MM = (0, 0.05, 0.15)
SHELL_MM = 1.0
WINDOW_MM = 1.0
SPACING_MM = 0.02
STEP_MM = 0.007
DEPTH_MM = 6 * max(LENGTHS_MM)
LEAST_DEPTH_MM = 3 * max(LENGTHS_MM)
# Width of the rim of the sampled square that is not judged: the filters mix it with the opposite side.
RIM_MM = 0.35
# Distance of the sampled square from the edges of the facet.
EDGE_MM = 0.2
LEAST_SIDE_MM = 3.0
MOST_SIDE_MM = 8.0
SEEDS = (1, 2, 3)
# Materials with less coverage have no grain worth a figure.
LEAST_COVERAGE = 0.001


class Facet:
    """Where the rays through a flat facet pass, for every stack with the same printed voxels.

    samples  int32 [steps, points]: index in the flat array of voxels of the k-th step of STEP_MM in printed matter
    eye      the filters for the points, which form a square
    judged   the inner square of points that is judged, as a slice
    shell    int64 [voxels]: flat indices of the printed voxels under the judged square down to SHELL_MM
    window   int64 [voxels]: the window of WINDOW_MM that each of them lies in, or -1 outside of whole windows
    """

    def __init__(self, stack, normal):
        self.stack, self.printed = stack, stack.voxels > 0
        z, y, x = np.nonzero(self.printed)
        if not len(z):
            raise ValueError("nothing is printed")
        self.u, self.v, self.n = optics.frame(normal)
        centres = stack.centre_mm(x, y, z)
        heights = centres @ self.n
        self.top_mm = heights.max() + np.abs(self.n * stack.pitch_mm).sum()
        upper = centres[heights > heights.max() - 0.3].mean(axis=0)
        self.centre = upper + (self.top_mm - upper @ self.n) * self.n
        side = self._square()
        self.count = 2 * int(side / SPACING_MM / 2)
        self.eye = optics.Eye(self.count, SPACING_MM)
        rim = int(np.ceil(RIM_MM / SPACING_MM))
        self.judged = (slice(rim, self.count - rim),) * 2
        self.side_mm = (self.count - 2 * rim) * SPACING_MM
        if self.side_mm < LEAST_SIDE_MM - 1e-9:
            raise ValueError(f"the facet shows {self.side_mm:.2f} mm away from its edges; {LEAST_SIDE_MM} mm are needed")
        self.samples = self._rays()
        self._count_in(np.ravel_multi_index((z, y, x), self.printed.shape), centres, heights)

    def _flat(self, points_mm):
        """Returns the flat indices of the voxels at these points, and whether they are printed."""
        shape = np.array(self.printed.shape[::-1])
        index = np.rint((points_mm - self.stack.origin_mm) / self.stack.pitch_mm).astype(np.int32)
        index -= np.asarray(self.stack.first, np.int32)
        inside = ((index >= 0) & (index < shape)).all(axis=-1)
        index = np.where(inside[..., None], index, 0)
        flat = (index[..., 2] * shape[1] + index[..., 1]) * shape[0] + index[..., 0]
        return flat, inside & self.printed.ravel()[flat]

    def _square(self):
        """Turns u and v, and returns the side in mm of the largest square of rays, around the centre, that meet the facet."""
        half, coarse = MOST_SIDE_MM / 2 + 1, 0.1
        along = np.arange(-half, half + coarse / 2, coarse)
        a, b = (grid.ravel() for grid in np.meshgrid(along, along))
        thickness = np.abs(self.n * self.stack.pitch_mm).sum()
        steps = np.arange(0, 0.5 + 4 * thickness, min(self.stack.pitch_mm) / 2)
        points = self.centre + a[:, None] * self.u + b[:, None] * self.v
        _, printed = self._flat(points[None] - steps[:, None, None] * self.n)
        depth = np.where(printed.any(axis=0), steps[printed.argmax(axis=0)], np.inf)
        self.plane_mm = self.top_mm - np.median(depth[np.maximum(np.abs(a), np.abs(b)) < 1])
        missed = np.abs(depth - (self.top_mm - self.plane_mm)) > 1.5 * thickness
        missed |= np.maximum(np.abs(a), np.abs(b)) > half - coarse
        best = 0
        for angle in np.radians(np.arange(0, 90, 7.5)):
            c, s = np.cos(angle), np.sin(angle)
            free = np.maximum(np.abs(c * a + s * b), np.abs(c * b - s * a))[missed].min()
            if free > best + coarse / 2:
                best, turned = free, (c * self.u + s * self.v, c * self.v - s * self.u)
        self.u, self.v = turned
        return min(2 * (best - EDGE_MM), MOST_SIDE_MM)

    def _rays(self):
        place = (np.arange(self.count) - (self.count - 1) / 2) * SPACING_MM
        points = (self.centre + place[:, None, None] * self.u + place[None, :, None] * self.v).reshape(-1, 3)
        step = min(STEP_MM, min(self.stack.pitch_mm) / 2)
        self.step_mm = step
        wanted = int(np.ceil(DEPTH_MM / step))
        samples = np.zeros((wanted, len(points)), np.int32)
        seen = np.zeros(len(points), np.int32)
        everyone = np.arange(len(points))
        last = int(np.ceil((self.top_mm - self.plane_mm + 2 * DEPTH_MM) / step))
        for k in range(last):
            flat, printed = self._flat(points - (k + 0.5) * step * self.n)
            here = everyone[printed & (seen < wanted)]
            samples[seen[here], here] = flat[here]
            seen[here] += 1
            if seen.min() == wanted:
                break
        deep = seen.min()
        if deep * step < LEAST_DEPTH_MM:
            raise ValueError(f"there is {deep * step:.2f} mm of printed matter under the facet; {LEAST_DEPTH_MM} mm are needed")
        return samples[:deep]

    def _count_in(self, flat, centres, heights):
        side = self.side_mm
        a, b = (centres - self.centre) @ self.u, (centres - self.centre) @ self.v
        under = (np.maximum(np.abs(a), np.abs(b)) < side / 2) & (heights > self.plane_mm - SHELL_MM)
        windows = int(side / WINDOW_MM + 1e-9)
        row, column = (np.floor((p[under] + windows * WINDOW_MM / 2) / WINDOW_MM).astype(int) for p in (a, b))
        whole = (np.minimum(row, column) >= 0) & (np.maximum(row, column) < windows)
        self.shell = flat[under]
        self.window = np.where(whole, row * windows + column, -1)
        self.windows = windows**2

    def shares(self, voxels, count):
        """Returns what each point shows of each of `count` materials, float32 [lengths, count, points]."""
        weights = np.array([optics.depth_weights(length, self.step_mm, len(self.samples)) for length in LENGTHS_MM], np.float32)
        shown = voxels.ravel()[self.samples]
        return np.stack([weights @ (shown == material).astype(np.float32) for material in range(1, count + 1)], axis=1)

    def grain(self, voxels, colours):
        """Returns the rms of L* for each length: of the recipe [lengths], and of each material alone [lengths, materials]."""
        recipe, alone = [], []
        for shares in self.shares(voxels, len(colours)):
            spectra = self.eye.spectra(shares)
            recipe.append(self.eye.lightness_of(spectra, colours)[self.judged].std())
            alone.append([self.eye.lightness_alone(spectrum)[self.judged].std() for spectrum in spectra])
        return np.array(recipe), np.array(alone)

    def coverages(self, voxels, count):
        """Returns the coverages of the materials in the shell [count], and the rms of their deviations over windows [count]."""
        found = voxels.ravel()[self.shell].astype(int)
        total = np.bincount(found, minlength=count + 1)[1:] / len(found)
        whole = self.window >= 0
        table = np.bincount(self.window[whole] * (count + 1) + found[whole], minlength=self.windows * (count + 1))
        table = table.reshape(self.windows, count + 1)[:, 1:]
        table = table / table.sum(axis=1, keepdims=True)
        return total, np.sqrt(((table - table.mean(axis=0)) ** 2).mean(axis=0))


def random_choice(printed, coverages, seed):
    """Returns voxels, uint8, where each printed voxel takes a material at random with these coverages."""
    limits = np.cumsum(coverages)[:-1].astype(np.float32)
    drawn = np.random.default_rng(seed).random(int(printed.sum()), np.float32)
    voxels = np.zeros(printed.shape, np.uint8)
    voxels[printed] = 1 + np.searchsorted(limits, drawn, side="right")
    return voxels


_facets = {}


def facet_of(stack, normal):
    """Returns the Facet. Keeps the last one, because plates of a study differ in their materials alone."""
    digest = hashlib.sha256(np.packbits(stack.voxels > 0))
    digest.update(repr((stack.voxels.shape, stack.first, stack.pitch_mm.tolist(), list(normal))).encode())
    if digest.digest() not in _facets:
        _facets.clear()
        _facets[digest.digest()] = Facet(stack, normal)
    return _facets[digest.digest()]


def judge(stack, normal=(0, 0, 1), seeds=SEEDS, grain=True):
    """Returns the figures of a stack as a dictionary for JSON.

    normal  outward normal of the facet to judge; it need not have unit length
    seeds   of the random choices that the grain is compared with
    grain   False leaves the grain out

    Raises ValueError if the stack has no such facet of 3 x 3 mm away from its edges, or too little matter under it.
    """
    facet = facet_of(stack, normal)
    names = [entry["name"] for entry in stack.materials]
    colours = optics.material_colours(stack.materials)
    coverages, rms = facet.coverages(stack.voxels, len(names))
    everywhere = np.bincount(stack.voxels.ravel(), minlength=len(names) + 1)[1:]
    predicted = optics.mixed(coverages, colours, optics.yule_nielsen(stack.profile))
    result = {
        "normal": facet.n.tolist(), "judged_mm": facet.side_mm, "depth_mm": len(facet.samples) * facet.step_mm,
        "coverage": dict(zip(names, coverages.tolist())),
        "coverage_rms": dict(zip(names, rms.tolist())),
        "coverage_whole": dict(zip(names, (everywhere / everywhere.sum()).tolist())),
        "predicted": {"linear_rgb": predicted.tolist(), "srgb": (255 * optics.encoded(predicted)).tolist(),
                      "lab": optics.lab(predicted).tolist()},
    }
    if grain:
        result["grain"] = _grain(facet, stack.voxels, names, coverages, colours, seeds)
    return result


def _grain(facet, voxels, names, coverages, colours, seeds):
    def mean(runs):
        return np.sqrt(np.mean(np.square(runs), axis=0))

    recipe, alone = facet.grain(voxels, colours)
    recipes, alones = zip(*(facet.grain(random_choice(facet.printed, coverages, seed), colours) for seed in seeds))
    random_recipe, random_alone = mean(recipes), mean(alones)
    mixed = coverages.max() < 1 - LEAST_COVERAGE
    result = []
    for i, length in enumerate(LENGTHS_MM):
        def entry(found, at_random, seen):
            return {"dl": float(found), "random_dl": float(at_random), "share": float(found / at_random) if seen else None}

        result.append({"length_mm": length, **entry(recipe[i], random_recipe[i], mixed), "inks": {
            name: entry(alone[i, m], random_alone[i, m], LEAST_COVERAGE < coverages[m] < 1 - LEAST_COVERAGE)
            for m, name in enumerate(names)}})
    return result


def report(result):
    """Returns the figures as a text of lines."""
    lines = [f"judged {result['judged_mm']:.2f} x {result['judged_mm']:.2f} mm, {result['depth_mm']:.2f} mm deep; normal "
             + " ".join(f"{part:.3f}" for part in result["normal"]),
             f"{'material':24}{'coverage':>10}{'whole':>10}{'rms, 1 mm':>12}" + "".join(
                 f"{'l = %d um' % round(1000 * entry['length_mm']):>16}" for entry in result.get("grain", []))]

    def cells(entries):
        return "".join(f"{entry['dl']:8.3f}" + (f"{entry['share']:8.3f}" if entry["share"] is not None else "       -")
                       for entry in entries)

    for name, coverage in result["coverage"].items():
        lines.append(f"{name:24}{coverage:10.5f}{result['coverage_whole'][name]:10.5f}{result['coverage_rms'][name]:12.6f}"
                     + cells(entry["inks"][name] for entry in result.get("grain", [])))
    if "grain" in result:
        lines.append(f"{'recipe':56}" + cells(result["grain"]))
        lines.append("grain: rms of L*, and its share of the grain of random choice")
    lines.append("predicted: sRGB " + " ".join(f"{value:.1f}" for value in result["predicted"]["srgb"])
                 + ", L* a* b* " + " ".join(f"{value:.2f}" for value in result["predicted"]["lab"]))
    return "\n".join(lines)


def normal_of(text):
    normal = [float(part) for part in text.split(",")]
    if len(normal) != 3 or not any(normal):
        raise argparse.ArgumentTypeError("a normal is three numbers, not all zero")
    return normal


def print_figures(name, description, figures_of, report_of):
    """Runs a script on the stack and the facet of its command line.

    figures_of  function from a Stack and a normal to figures for JSON; ValueError or OSError end the script with `name`
    report_of   function from the figures to a text
    """
    parser = argparse.ArgumentParser(description=description.split("\n")[0])
    parser.add_argument("stack", metavar="STACK", help="folder with manifest.json")
    parser.add_argument("--normal", type=normal_of, default=[0, 0, 1], help="outward normal of the facet, X,Y,Z")
    parser.add_argument("--json", metavar="FILE", help="also writes the figures as JSON")
    arguments = parser.parse_args()
    try:
        figures = figures_of(read_stack(arguments.stack), arguments.normal)
    except (ValueError, OSError) as problem:
        raise SystemExit(f"{name}: {problem}")
    print(report_of(figures))
    if arguments.json:
        with open(arguments.json, "w") as file:
            json.dump(figures, file, indent=1)


if __name__ == "__main__":
    print_figures("judge", __doc__, judge, report)
