#!/usr/bin/python3
"""Compares dithers of one bit with grey levels on the lattices of resin printers. Prints the tables of docs/resin.md.

Tilted facets are written as STL and dithered by the program, and their voxels are read back. Grey levels and error
diffusion by layers are computed from the exact plane. Each stack is then a dose per voxel, which light and resin blur; the
surface is where the dose reaches a level. It is compared with the plane.

    study.py [--program build/release/vdbdither] [--seeds 2] [--jobs 2] [--data FILE.json] [--picture FILE.png]
"""

import argparse
import collections
import concurrent.futures
import dataclasses
import itertools
import json
import pathlib
import subprocess
import sys
import tempfile

import numpy
import pyopenvdb
from scipy.sparse import csr_matrix
from scipy.special import ndtr, ndtri

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "paper"))

from parts import write_stl  # noqa: E402

LATTICES_UM = ((14, 19, 50), (19, 24, 50), (22, 22, 50), (20, 26, 30))
TILTS = (1, 2.7, 5, 11, 20, 45)
SPREADS_UM = (20, 35, 50)
# Name: axis that the facet faces, its sign, and the azimuth of the slope in degrees from the next axis.
FACETS = {
    "top, about y": (2, 1, 0), "top, about x": (2, 1, 90), "top, general": (2, 1, 37),
    "wall, about z": (0, 1, 0), "wall, about y": (0, 1, 90), "wall, general": (0, 1, 37),
}
UNDERSIDES = {"underside, about y": (2, -1, 0), "underside, about x": (2, -1, 90), "underside, general": (2, -1, 37)}
# The default of --spread is 50 µm. With "dither, known σ" it is that of the cure.
PROGRAM_METHODS = {"plain": ["--mask", "none"], "dither": [], "mask": ["--method", "mask"],
                   "dither 20 µm": ["--spread", "20um"], "dither 35 µm": ["--spread", "35um"]}
KNOWN = {"20": "dither 20 µm", "35": "dither 35 µm", "50": "dither", "curve": "dither 35 µm"}
RIVALS = ("grey", "grey, γ 3", "grey 3D", "grey 3D, γ 3", "FS 1 bit", "FS 3 bit", "FS 3D 1 bit")
METHODS = ("plain", "dither", "dither, known σ", "mask", *RIVALS)
# The working curve, and undersides, are for this one only.
CURVE_LATTICE_UM = (19, 24, 50)
# What `figures` returns.
FIGURES = ("rms_um", "flatness_um", "bias_um", "wave_um")
# Exponent between grey level and light of a panel (docs/resin.md states the source).
GAMMA = 3
# Working curve: penetration depth, and depth that one full exposure cures.
PENETRATION_MM = 0.1
CURE_DEPTH_MM = 0.075
CURE_SPREAD_MM = 0.035

# Lengths in mm.
STEP = 0.02
MARGIN = 0.3
# Light reaches this far down through layers that are cured later.
MARGIN_ABOVE = 0.8
THICKNESS = 1.0
SEARCH = 0.08
SEARCH_STEP = 0.005


def box_share(normal, extents, depth):
    """Returns the share of a box in the half-space `normal`·p ≤ `depth`, exactly.

    `extents` are the sides of the box, `depth` is measured from its centre: an array of any shape. The share is the finite
    difference of the truncated power along the axes that the normal is not orthogonal to.
    """
    sides = numpy.abs(numpy.asarray(normal, float) * extents)
    sides = sides[sides > 1e-6 * max(sides.max(), 1e-12)]
    if sides.max(initial=0) < 1e-12:
        return (numpy.asarray(depth) >= 0).astype(float)
    start = numpy.asarray(depth) + sides.sum() / 2
    total = numpy.zeros_like(start)
    for count in range(len(sides) + 1):
        for chosen in itertools.combinations(sides, count):
            total += (-1) ** count * numpy.maximum(start - sum(chosen), 0) ** len(sides)
    scale = numpy.prod(sides) * (1, 1, 2, 6)[len(sides)]
    # Far inside, differences of large powers are not exact.
    return numpy.where(start >= sides.sum(), 1, numpy.where(start <= 0, 0, numpy.clip(total / scale, 0, 1)))


def floyd_steinberg(coverage, levels):
    """Returns `coverage` [z, y, x] at the nearest of `levels`, with the errors diffused within each layer.

    The order is from left to right and from the top row down, as images are stored; the top row is the maximum of y.
    """
    levels = numpy.asarray(levels)
    middles = (levels[1:] + levels[:-1]) / 2
    layers, rows, columns = coverage.shape
    wanted = numpy.zeros((rows + 1, columns + 2, layers))
    wanted[:-1, 1:-1] = coverage[:, ::-1].transpose(1, 2, 0)
    result = numpy.zeros_like(wanted)
    # Pixels with the same x + 2y do not depend on each other.
    for front in range(columns + 2 * rows - 2):
        y = numpy.arange(max(0, (front - columns + 2) // 2), min(rows - 1, front // 2) + 1)
        x = front - 2 * y + 1
        value = wanted[y, x]
        chosen = levels[numpy.searchsorted(middles, value, side="right")]
        result[y, x] = chosen
        error = value - chosen
        wanted[y, x + 1] += error * (7 / 16)
        wanted[y + 1, x - 1] += error * (3 / 16)
        wanted[y + 1, x] += error * (5 / 16)
        wanted[y + 1, x + 1] += error * (1 / 16)
    return result[:-1, 1:-1].transpose(2, 0, 1)[:, ::-1]


def box_weights(points, voxels, pitch, sigma):
    """Returns the shares of the Gaussian around each point that fall into each voxel."""
    edges = numpy.concatenate([voxels - pitch / 2, voxels[-1:] + pitch / 2])
    return numpy.diff(ndtr((edges[None, :] - points[:, None]) / sigma), axis=1)


def light_weights(points, voxels, pitch):
    """Returns how much of the dose of each layer reaches each height. Light comes from above."""
    down = voxels[None, :] + pitch / 2 - points[:, None]
    return numpy.where(down >= 0, numpy.exp(-numpy.maximum(down, 0) / PENETRATION_MM), 0)


@dataclasses.dataclass
class Case:
    """A tilted facet at a random place: the half-space normal·p ≤ offset, in mm, over a rectangle of two axes."""

    pitch: numpy.ndarray
    axis: int
    sign: int
    azimuth: float
    tilt: float
    seed: int
    short_side: float = 0.6

    def __post_init__(self):
        tilt, azimuth = numpy.radians([self.tilt, self.azimuth])
        self.sides = [(self.axis + 1) % 3, (self.axis + 2) % 3]
        slope = numpy.sin(tilt) * numpy.array([numpy.cos(azimuth), numpy.sin(azimuth)])
        slope[numpy.abs(slope) < 1e-12] = 0
        self.normal = numpy.zeros(3)
        self.normal[self.axis] = self.sign * numpy.cos(tilt)
        self.normal[self.sides] = slope
        # Two stairs along the steeper of the sides.
        longest = numpy.argmax(numpy.abs(slope))
        size = numpy.array([self.short_side, self.short_side])
        size[longest] = max(1.2, 2 * self.pitch[self.axis] * numpy.cos(tilt) / abs(slope[longest]))
        random = numpy.random.default_rng([self.seed, self.axis, round(10 * self.tilt), round(self.azimuth)])
        low = random.uniform(0, 1, 2) * self.pitch[self.sides]
        # Mid-points of cells, so that the samples fill the rectangle evenly.
        self.grid = [low[n] + STEP * (numpy.arange(round(size[n] / STEP)) + 0.5) for n in range(2)]
        self.rectangle = numpy.stack([low, low + size])
        self.offset = random.uniform(0, 1) * self.pitch[self.axis] * abs(self.normal[self.axis])
        self.window = self.voxel_window()

    def height(self, first, second):
        """Returns where the plane is along the axis that it faces."""
        rest = self.normal[self.sides[0]] * first + self.normal[self.sides[1]] * second
        return (self.offset - rest) / self.normal[self.axis]

    def outline(self):
        """Returns the rectangle of the part: that of the samples and what affects them."""
        low, high = self.rectangle.copy()
        for n, side in enumerate(self.sides):
            low[n] -= MARGIN
            high[n] += MARGIN_ABOVE if side == 2 else MARGIN
        return low, high

    def corners(self):
        low, high = self.outline()
        return [(a, b, self.height(a, b)) for a in (low[0], high[0]) for b in (low[1], high[1])]

    def triangles(self):
        """Returns the part: a prism below the facet with sides along the axis, outward."""
        low, high = self.outline()
        ring = [(low[0], low[1]), (high[0], low[1]), (high[0], high[1]), (low[0], high[1])]
        top, bottom = [], []
        for a, b in ring:
            point = numpy.zeros(3)
            point[self.sides] = a, b
            point[self.axis] = self.height(a, b)
            top.append(point.copy())
            point[self.axis] -= self.sign * THICKNESS
            bottom.append(point)
        found = [(top[0], top[1], top[2]), (top[0], top[2], top[3]),
                 (bottom[0], bottom[2], bottom[1]), (bottom[0], bottom[3], bottom[2])]
        for n in range(4):
            m = (n + 1) % 4
            found += [(bottom[n], bottom[m], top[m]), (bottom[n], top[m], top[n])]
        return [triangle[::self.sign] for triangle in found]

    def voxel_window(self):
        """Returns the lowest index of the voxels that matter and their count, along x, y, z."""
        low, high = numpy.zeros(3), numpy.zeros(3)
        low[self.sides], high[self.sides] = self.outline()
        heights = [corner[2] for corner in self.corners()]
        above = MARGIN_ABOVE if self.axis == 2 else MARGIN
        low[self.axis], high[self.axis] = min(heights) - MARGIN, max(heights) + above
        first = numpy.floor(low / self.pitch + 0.5).astype(int)
        return first, numpy.ceil(high / self.pitch - 0.5).astype(int) - first + 1

    def centres(self, axis):
        first, count = self.window
        return (first[axis] + numpy.arange(count[axis])) * self.pitch[axis]

    def depth(self):
        """Returns how deep the centres of the voxels [x, y, z] lie below the plane."""
        x, y, z = numpy.ix_(*[self.centres(axis) for axis in range(3)])
        return self.offset - self.normal[0] * x - self.normal[1] * y - self.normal[2] * z


def program_doses(program, folder, case):
    """Returns the voxels [x, y, z] of the window that the program prints, 0 or 1, by method."""
    mesh, surface, out = folder / "part.stl", folder / "surface.vdb", folder / "solid.vdb"
    write_stl(mesh, case.triangles())
    pitch = ",".join(f"{1e3 * length:g}um" for length in case.pitch)
    subprocess.run([program, "mesh2sdf", mesh, "--pitch", pitch, "-o", surface, "--overwrite", "--quiet"], check=True)
    found = {}
    first, count = case.window
    for name, options in PROGRAM_METHODS.items():
        subprocess.run([program, "dither", surface, *options, "-o", out, "--overwrite", "--quiet"], check=True)
        voxels = numpy.zeros(count, bool)
        pyopenvdb.read(str(out), "solid").copyToArray(voxels, ijk=tuple(int(index) for index in first))
        found[name] = voxels.astype(float)
    return found


def rival_doses(case):
    """Returns the doses [x, y, z] of the window that grey levels and error diffusion by layers give, by method."""
    depth = case.depth()
    flat, extents = case.normal.copy(), case.pitch
    flat[2] = 0
    area = numpy.round(255 * box_share(flat, extents, depth)) / 255
    volume = numpy.round(255 * box_share(case.normal, extents, depth)) / 255

    def diffused(coverage, levels):
        return floyd_steinberg(coverage.transpose(2, 1, 0), levels).transpose(2, 1, 0)

    return {
        "grey": area,
        "grey, γ 3": area ** GAMMA,
        "grey 3D": volume,
        "grey 3D, γ 3": volume ** GAMMA,
        "FS 1 bit": diffused(area, [0, 1]),
        "FS 3 bit": diffused(area, (numpy.arange(8) / 7) ** GAMMA),
        "FS 3D 1 bit": diffused(volume, [0, 1]),
    }


def blurred_sides(case, doses, weights):
    """Returns the doses at the samples [dose, a, b, voxel along the facet's axis], given the weights along both sides."""
    share = numpy.stack([dose.transpose(*case.sides, case.axis) for dose in doses])
    for axis, of in zip((1, 2), weights):
        turned = numpy.moveaxis(share, axis, 0)
        # Few voxels are near a sample.
        near = csr_matrix(numpy.where(of > 1e-7, of, 0))
        share = numpy.moveaxis((near @ turned.reshape(len(turned), -1)).reshape(-1, *turned.shape[1:]), 0, axis)
    return share


def crossings(case, sides, sigma, level):
    """Returns where the doses, blurred along the facet's axis too, cross `level`: µm outward of the plane, along the axis.

    Raises ValueError where that is out of reach.
    """
    pitch, first = case.pitch[case.axis], case.window[0][case.axis]
    plane = case.height(case.grid[0][:, None], case.grid[1][None, :])
    offsets = numpy.arange(-SEARCH, SEARCH + SEARCH_STEP / 2, SEARCH_STEP)
    reach = int(numpy.ceil((SEARCH + 4.5 * sigma) / pitch))
    index = numpy.round(plane / pitch).astype(int)[..., None] + numpy.arange(-reach, reach + 1)
    # What lies beyond the window is as at its end.
    index_in_window = numpy.clip(index - first, 0, sides.shape[3] - 1)
    near = numpy.take_along_axis(sides, index_in_window[None], axis=3)
    edges = (index[..., :1] + numpy.arange(2 * reach + 2) - 0.5) * pitch
    points = plane[..., None] + case.sign * offsets
    shares = numpy.diff(ndtr((edges[..., None] - points[..., None, :]) / sigma), axis=-2)
    excess = near.transpose(1, 2, 0, 3) @ shares - level
    # The outermost step from inside to outside.
    last = excess.shape[-1] - 2 - numpy.argmax((excess[..., :-1] > 0)[..., ::-1], axis=-1)
    inside = numpy.take_along_axis(excess, last[..., None], -1)[..., 0]
    outside = numpy.take_along_axis(excess, last[..., None] + 1, -1)[..., 0]
    if (inside <= 0).any() or (outside > 0).any():
        raise ValueError(f"a surface lies more than {1e3 * SEARCH:g} µm from the plane")
    # The dose across a plane is a normal distribution, whose inverse is linear.
    full = max(sides.max(), 2 * level)
    inside, outside, target = (ndtri(numpy.clip((over + level) / full, 1e-9, 1 - 1e-9)) for over in (inside, outside, 0))
    return 1e3 * (offsets[last] + SEARCH_STEP * (inside - target) / (inside - outside)).transpose(2, 0, 1)


def linear_surfaces(case, doses, spread_mm):
    """Returns the surfaces at half the dose after a Gaussian blur along all axes: µm outward of the plane, along the normal."""
    weights = [box_weights(case.grid[n], case.centres(side), case.pitch[side], spread_mm)
               for n, side in enumerate(case.sides)]
    height = crossings(case, blurred_sides(case, doses, weights), spread_mm, 0.5)
    return height * abs(case.normal[case.axis])


def cured_surfaces(case, doses):
    """Returns the surfaces by the working curve: µm outward of the plane, along the normal.

    Light comes from above, spreads by a Gaussian sideways and fades by exp(-depth / PENETRATION_MM); doses of layers add up.
    """
    level = numpy.exp(-CURE_DEPTH_MM / PENETRATION_MM)
    weights = [light_weights(case.grid[n], case.centres(2), case.pitch[2]) if side == 2 else
               box_weights(case.grid[n], case.centres(side), case.pitch[side], CURE_SPREAD_MM)
               for n, side in enumerate(case.sides)]
    sides = blurred_sides(case, doses, weights)
    if case.axis != 2:
        return crossings(case, sides, CURE_SPREAD_MM, level) * abs(case.normal[case.axis])
    pitch, centres = case.pitch[2], case.centres(2)
    plane = case.height(case.grid[0][:, None], case.grid[1][None, :])
    cured, dose = numpy.zeros(sides.shape[:3]), numpy.zeros(sides.shape[:3])
    for layer in range(len(centres) - 1, -1, -1):
        dose = sides[..., layer] + numpy.exp(-pitch / PENETRATION_MM) * dose
        length = numpy.clip(PENETRATION_MM * numpy.log(numpy.maximum(dose / level, 1e-12)), 0, pitch)
        # The part ends somewhere below its facet; the inside counts as full.
        cured += numpy.where(case.sign * (plane - centres[layer]) > 0.25, pitch, length)
    within = plane - (centres[0] - pitch / 2) if case.sign > 0 else centres[-1] + pitch / 2 - plane
    return 1e3 * (cured - within) * abs(case.normal[2])


def strongest_wave(height):
    """Returns the amplitude of the strongest sine wave in a surface, in its unit."""
    window = numpy.outer(numpy.hanning(height.shape[0] + 2)[1:-1], numpy.hanning(height.shape[1] + 2)[1:-1])
    centred = height - (height * window).sum() / window.sum()
    return 2 * numpy.abs(numpy.fft.rfft2(centred * window)).max() / window.sum()


def figures(height):
    """Returns RMS about the plane, RMS about the mean, the mean, and the strongest wave of a surface."""
    found = numpy.sqrt((height ** 2).mean()), height.std(), height.mean(), strongest_wave(height)
    return [float(value) for value in found]


def measure(program, pitch_um, geometry, tilt, seed):
    """Returns the figures of one facet, by cure ("20", "35", "50" or "curve") and method."""
    case = Case(numpy.array(pitch_um) / 1e3, *geometry, tilt, seed)
    with tempfile.TemporaryDirectory() as folder:
        doses = {**program_doses(program, pathlib.Path(folder), case), **rival_doses(case)}
    cures = [str(spread) for spread in SPREADS_UM] if case.sign > 0 else []
    if tuple(pitch_um) == CURVE_LATTICE_UM:
        cures.append("curve")
    found = {}
    for cure in cures:
        sources = {method: KNOWN[cure] if method == "dither, known σ" else method for method in METHODS}
        names = list(dict.fromkeys(sources.values()))
        of = [doses[name] for name in names]
        heights = cured_surfaces(case, of) if cure == "curve" else linear_surfaces(case, of, int(cure) / 1e3)
        of = {name: figures(height) for name, height in zip(names, heights)}
        found.update({(cure, method): of[source] for method, source in sources.items()})
    return found


def collect(program, seeds, jobs):
    """Returns the figures of all facets: {(lattice, facing, tilt, cure, method): [figures, …]}."""
    rows = collections.defaultdict(list)
    with concurrent.futures.ProcessPoolExecutor(jobs) as pool:
        cases = []
        for pitch_um, tilt in itertools.product(LATTICES_UM, TILTS):
            facets = {**FACETS, **UNDERSIDES} if pitch_um == CURVE_LATTICE_UM else FACETS
            for (name, geometry), seed in itertools.product(facets.items(), seeds):
                key = "×".join(map(str, pitch_um)), name.split(",")[0], tilt
                cases.append((key, pool.submit(measure, program, pitch_um, geometry, tilt, seed)))
        for n, (key, case) in enumerate(cases):
            for (cure, method), values in case.result().items():
                rows[*key, cure, method].append(values)
            print(f"\r{n + 1} of {len(cases)} facets", end="", file=sys.stderr, flush=True)
    return rows


def summarized(rows):
    """Returns an entry of means and worst figures for each key of `rows`."""
    entries = []
    for (lattice, facing, tilt, cure, method), values in rows.items():
        values = numpy.abs(values)
        entry = {"lattice": lattice, "facing": facing, "tilt": tilt, "cure": cure, "method": method, "facets": len(values)}
        for name, mean, worst in zip(FIGURES, values.mean(0), values.max(0)):
            entry.update({name: round(mean, 2), "worst_" + name: round(worst, 2)})
        entries.append(entry)
    return entries


def table(title, entries, columns, measure):
    """Prints means and, in brackets, worst values of `measure` by method. `columns` are names and choices of entries."""
    print(f"\n{title}\n\n| method | " + " | ".join(name for name, _ in columns) + " |\n| --- |" + " ---: |" * len(columns))
    for method in METHODS:
        cells = []
        for _, chosen in columns:
            of = [entry for entry in entries if entry["method"] == method and chosen.items() <= entry.items()]
            mean = numpy.average([entry[measure] for entry in of], weights=[entry["facets"] for entry in of])
            cells.append(f"{mean:.2f} ({max(entry['worst_' + measure] for entry in of):.1f})")
        print(f"| {method} | " + " | ".join(cells) + " |")


def report(entries):
    """Prints the tables of docs/resin.md."""
    lattices = list(dict.fromkeys(entry["lattice"] for entry in entries))
    tilts = list(dict.fromkeys(entry["tilt"] for entry in entries))
    by_spread = [(f"{facing}, σ = {spread} µm", {"facing": facing, "cure": str(spread)})
                 for facing in ("top", "wall") for spread in SPREADS_UM]
    for measure, title in (("rms_um", "RMS error"), ("bias_um", "Mean error"), ("wave_um", "Strongest wave")):
        table(f"{title}, µm", entries, by_spread, measure)
    for facing in ("top", "wall"):
        chosen = {"facing": facing, "cure": "35"}
        table(f"RMS error of {facing}s by tilt, σ = 35 µm, µm", entries,
              [(f"{tilt:g}°", {**chosen, "tilt": tilt}) for tilt in tilts], "rms_um")
        table(f"RMS error of {facing}s by lattice, σ = 35 µm, µm", entries,
              [(lattice, {**chosen, "lattice": lattice}) for lattice in lattices], "rms_um")
    facings = ("top", "underside", "wall")
    for measure, title in (("flatness_um", "RMS about the mean"), ("wave_um", "Strongest wave"), ("bias_um", "Mean error")):
        table(f"{title} by the working curve, µm", entries,
              [(facing, {"facing": facing, "cure": "curve"}) for facing in facings], measure)


def picture(program, path):
    """Draws the linear surfaces of one facet under grazing light, as the slope along it."""
    import matplotlib
    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    from PIL import Image

    case = Case(numpy.array([0.019, 0.024, 0.05]), *FACETS["top, general"], 2.7, 1, short_side=1.2)
    with tempfile.TemporaryDirectory() as folder:
        doses = {**program_doses(program, pathlib.Path(folder), case), **rival_doses(case)}
    doses["dither, known σ"] = doses[KNOWN["35"]]
    figure, axes = plt.subplots(3, 3, figsize=(11, 6.3), dpi=90)
    shown = [method for method in METHODS if not method.endswith("γ 3")]
    for ax, method in zip(axes.ravel(), shown):
        height = linear_surfaces(case, [doses[method]], 0.035)[0]
        slope = numpy.gradient(height, 1e3 * STEP, axis=0)
        ax.imshow(-slope.T, cmap="gray", vmin=-0.08, vmax=0.08, interpolation="bicubic", origin="lower")
        ax.set_title(f"{method}: RMS {numpy.sqrt((height ** 2).mean()):.1f} µm", fontsize=9)
        ax.set_axis_off()
    figure.tight_layout()
    figure.savefig(path)
    with Image.open(path) as image:
        image.convert("L").quantize(32).save(path, optimize=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--program", default="build/release/vdbdither")
    parser.add_argument("--seeds", type=int, default=2, help="positions of every facet")
    parser.add_argument("--jobs", type=int, default=2, help="facets at a time")
    parser.add_argument("--data", type=pathlib.Path, help="file for all figures, JSON")
    parser.add_argument("--picture", type=pathlib.Path, help="file for the picture, PNG")
    arguments = parser.parse_args()
    program = str(pathlib.Path(arguments.program).resolve())
    if arguments.picture:
        picture(program, arguments.picture)
    entries = summarized(collect(program, range(1, arguments.seeds + 1), arguments.jobs))
    if arguments.data:
        arguments.data.parent.mkdir(parents=True, exist_ok=True)
        rows = [list(entry.values()) for entry in entries]
        text = json.dumps({"columns": list(entries[0]), "rows": rows}, ensure_ascii=False, separators=(",", ":"))
        arguments.data.write_text(text.replace("],[", "],\n[") + "\n")
    report(entries)


if __name__ == "__main__":
    main()
