#!/usr/bin/python3
"""Other ways to choose the material of each voxel, judged on the printed voxels and with the coverages of a stack.

    samples/colour/oracles.py STACK [--normal X,Y,Z] [--json FILE]

nearest ink              every voxel takes the material whose colour is nearest to the mixture in CIELAB
random choice            every voxel takes its material by itself, with the coverages as probabilities
Floyd-Steinberg          error diffusion in each slice: Floyd, Steinberg: An Adaptive Algorithm for Spatial Greyscale, Proc.
                         Society for Information Display 17(2), 1976, pp. 75-77
serial 3D                error diffusion in index order, x before y before z: half of the error stays in the slice with the
                         weights of Floyd and Steinberg, half goes to the next slice: 1/4 to the voxel above, 1/16 to each of
                         its four neighbours
along the surface        error diffusion in shells: Brunton, Arikan, Urban: Pushing the Limits of 3D Color Printing, ACM TOG
                         35(1), 2015. Simplified: a shell is what one erosion by 6 neighbours takes off; all shells run in one
                         fixed order in place of a front on the surface; the error goes to those of the 26 neighbours in the
                         same shell that come later, in inverse proportion to their distance in mm, or without such to those
                         of any shell; materials do not depend on their translucency

Error diffusion of several materials: a voxel takes the material whose coverage and error together are largest, and the rest of
every material is passed on. Weights of neighbours that are not printed are shared by the others.
"""

import dataclasses
import itertools

import numpy as np
import optics
from judge import LENGTHS_MM, facet_of, judge, print_figures, random_choice

FLOYD_STEINBERG = {(1, 0, 0): 7 / 16, (-1, 1, 0): 3 / 16, (0, 1, 0): 5 / 16, (1, 1, 0): 1 / 16}
SERIAL = {**{offset: weight / 2 for offset, weight in FLOYD_STEINBERG.items()}, (0, 0, 1): 1 / 4, (1, 0, 1): 1 / 16,
          (-1, 0, 1): 1 / 16, (0, 1, 1): 1 / 16, (0, -1, 1): 1 / 16}


def wanted_coverages(printed, coverages):
    """Returns float32 [materials, voxels + rim] for coverages [materials], or [z, y, x, materials], of a padded `printed`."""
    coverages = np.asarray(coverages, np.float32)
    if coverages.ndim == 1:
        return np.repeat(coverages[:, None], printed.size, axis=1)
    return np.pad(coverages, [(1, 1)] * 3 + [(0, 0)]).reshape(-1, coverages.shape[-1]).T.copy()


def diffused(printed, coverages, weights, group=None):
    """Returns voxels, uint8 [z, y, x], of error diffusion.

    printed    bool [z, y, x]
    coverages  of the materials: [materials], or [z, y, x, materials]
    weights    of the neighbours (x, y, z) that take the error; all of them come later in the order x + 2 y + 4 z
    group      int [z, y, x], or None: the error stays in the group of a voxel as long as that has a neighbour to take it
    """
    padded = np.pad(printed, 1)
    flat = padded.ravel()
    groups = None if group is None else np.pad(group, 1).ravel()
    wanted = wanted_coverages(padded, coverages)
    found = np.zeros(flat.size, np.uint8)
    strides = (1, padded.shape[2], padded.shape[1] * padded.shape[2])
    steps = [(int(np.dot(offset, strides)), weight) for offset, weight in weights.items()]
    places = np.flatnonzero(flat)
    z, y, x = np.unravel_index(places, padded.shape)
    # Voxels of one time do not depend on each other, and every voxel comes after all that pass errors to it.
    time = x + 2 * y + 4 * z
    order = np.argsort(time, kind="stable")
    bounds = np.flatnonzero(np.diff(time[order])) + 1
    for here in np.split(places[order], bounds):
        with_error = wanted[:, here]
        chosen = with_error.argmax(axis=0)
        found[here] = chosen + 1
        with_error[chosen, np.arange(len(here))] -= 1
        shares = np.array([weight * flat[here + step] for step, weight in steps])
        if groups is not None:
            same = shares * np.array([groups[here + step] == groups[here] for step, _ in steps])
            shares = np.where(same.any(axis=0), same, shares)
        total = shares.sum(axis=0)
        shares /= np.where(total > 0, total, 1)
        for (step, _), share in zip(steps, shares):
            taking = share > 0
            wanted[:, here[taking] + step] += with_error[:, taking] * share[taking]
    return found.reshape(padded.shape)[1:-1, 1:-1, 1:-1].copy()


def shells(printed):
    """Returns how many erosions by 6 neighbours each printed voxel survives, int16 [z, y, x]."""
    count = np.zeros(printed.shape, np.int16)
    left = np.pad(printed, 1)
    while True:
        inner = left.copy()
        for axis, way in itertools.product(range(3), (-1, 1)):
            inner &= np.roll(left, way, axis)
        if not inner.any():
            return count
        count += inner[1:-1, 1:-1, 1:-1]
        left = inner


def along_surface(printed, coverages, pitch_mm):
    later = [offset for offset in itertools.product((-1, 0, 1), repeat=3) if np.dot(offset, (1, 2, 4)) > 0]
    weights = {offset: 1 / float(np.linalg.norm(np.multiply(offset, pitch_mm))) for offset in later}
    return diffused(printed, coverages, weights, shells(printed))


def nearest_ink(printed, coverages, colours, n):
    """Returns voxels of the material nearest to the mixture; coverages [materials] or [z, y, x, materials]."""
    mixture = optics.lab(optics.mixed(coverages, colours, n))
    distance = np.linalg.norm(mixture[..., None, :] - optics.lab(colours), axis=-1)
    return np.where(printed, distance.argmin(axis=-1) + 1, 0).astype(np.uint8)


def alternatives(stack, coverages, seed=11):
    """Yields the name of every method and its voxels, for coverages [materials] of the stack."""
    printed = stack.voxels > 0
    colours = optics.material_colours(stack.materials)
    yield "nearest ink", nearest_ink(printed, coverages, colours, optics.yule_nielsen(stack.profile))
    yield "random choice", random_choice(printed, coverages, seed)
    yield "Floyd-Steinberg", diffused(printed, coverages, FLOYD_STEINBERG)
    yield "serial 3D", diffused(printed, coverages, SERIAL)
    yield "along the surface", along_surface(printed, coverages, stack.pitch_mm)


def compared(stack, normal):
    """Returns the figures of `judge` by method; "the stack" is the stack itself."""
    coverages, _ = facet_of(stack, normal).coverages(stack.voxels, len(stack.materials))
    results = {"the stack": judge(stack, normal)}
    for name, voxels in alternatives(stack, coverages):
        results[name] = judge(dataclasses.replace(stack, voxels=voxels), normal)
    wanted = np.array(results["the stack"]["predicted"]["lab"])
    for result in results.values():
        result["de_to_stack"] = float(optics.ciede2000(wanted, np.array(result["predicted"]["lab"])))
    return results


def figures(result):
    """Returns the shares of random for each length, of the recipe and of the worst ink, or None where there is no mixture."""
    recipe = [entry["share"] for entry in result["grain"]]
    inks = [[ink["share"] for ink in entry["inks"].values() if ink["share"] is not None] for entry in result["grain"]]
    return recipe, [max(shares) if shares else None for shares in inks]


def report(results):
    lines = ["share of the grain of random choice: of the recipe, and of the worst ink alone",
             f"{'':20}" + "".join(f"{'l = %d um' % round(1000 * length):>18}" for length in LENGTHS_MM)
             + f"{'rms, 1 mm':>12}{'CIEDE2000':>11}"]
    for name, result in results.items():
        cells = "".join("         -        -" if share is None else f"{share:10.3f}{worst:8.3f}"
                        for share, worst in zip(*figures(result)))
        lines.append(f"{name:20}{cells}{max(result['coverage_rms'].values()):12.6f}{result['de_to_stack']:11.3f}")
    return "\n".join(lines)


if __name__ == "__main__":
    print_figures("oracles", __doc__, compared, report)
