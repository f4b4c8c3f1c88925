#!/usr/bin/python3
"""Compares two layouts of the inks of a colour: mixed at every depth, and layered with the dark inks first.

    samples/colour/layouts.py PROFILE.json --program build/release/vdbdither [--recipes N] [--photons N] [--json FILE]

mixed     as `halftone` prints
layered   down to a depth every column of voxels takes the inks by rising luminance, each over its share of the depth; a layer of
          the mask decides where an ink ends within a voxel. Below the depth the inks are mixed

Plates face up. Figures: the grain, as a share of that of random choice (judge.py); how far the colour of each layout is from
what the mixture shows if light reaches 0, 50 and 150 um deep, and how far it moves between 50 and 150 um; and the walk of light
through both (monte_carlo.cpp): lightness, chroma, and how far the colour moves if every coefficient of the inks is 0.8 or 1.2
times as large.
"""

import argparse
import dataclasses
import json
import pathlib
import tempfile

import characterize
import numpy as np
import optics
import study
from judge import LENGTHS_MM, judge
from tiles import halftone_tile

DEPTHS_MM = (0.05, 0.15, 0.3)
CHANGES = (1, 2, 3, 4)
UP = (0, 0, 1)


def depths(voxels):
    """Returns how many printed voxels lie above each one, int [z, y, x]."""
    return np.cumsum(voxels[::-1] > 0, axis=0)[::-1] - 1


def layered(voxels, depth_mm, pitch_mm, colours, tile):
    """Returns voxels, uint8 [z, y, x], with the layered layout down to `depth_mm` from the top of every column.

    colours  linear, of the materials from 1
    tile     thresholds [x, y, z] of the mask
    """
    shares = np.bincount(voxels.ravel(), minlength=len(colours) + 1)[1:] / np.count_nonzero(voxels)
    order = np.argsort(optics.lab(colours)[:, 0])
    limits = np.cumsum(shares[order])[:-1]
    layer = tile[:, :, 0].T
    ranks = (layer.ravel().argsort().argsort().reshape(layer.shape) + 0.5) / layer.size
    _, rows, columns = voxels.shape
    end = ranks[np.arange(rows)[:, None] % layer.shape[0], np.arange(columns)[None] % layer.shape[1]]
    count = round(depth_mm / pitch_mm[2])
    below = depths(voxels)
    chosen = 1 + order[np.searchsorted(limits, (below + end) / count, side="right").clip(0, len(order) - 1)]
    return np.where((voxels > 0) & (below < count), chosen, voxels).astype(np.uint8)


def seen(voxels, pitch_mm, colours):
    """Returns the linear colours [lengths, 3] that a plate shows if light reaches each of LENGTHS_MM deep."""
    below = depths(voxels)
    printed = voxels > 0
    count = int(below.max()) + 1
    table = np.bincount(below[printed] * (len(colours) + 1) + voxels[printed], minlength=count * (len(colours) + 1))
    table = table.reshape(count, -1)[:, 1:]
    mean = table / table.sum(axis=1, keepdims=True) @ colours
    return np.array([optics.depth_weights(length, pitch_mm[2], count) @ mean for length in LENGTHS_MM])


def layouts_of(voxels, pitch_mm, colours, tile):
    yield "mixed", voxels
    for depth in DEPTHS_MM:
        yield f"layered, {round(1000 * depth)} um", layered(voxels, depth, pitch_mm, colours, tile)


def by_judge(program, profile_path, tile, recipes):
    """Returns rows {layout: [recipe]} of shares of the grain [lengths], and of differences to the mixture [lengths] and within."""
    rows = {}
    for number, name in enumerate(recipes):
        rgb = optics.linear(np.array(study.COLOURCHECKER[name]) / 255)
        stack = program.stack(profile_path, UP, study.PLATE_MM, study.place_of(number), rgb)
        colours = optics.material_colours(stack.materials)
        wanted = None
        for title, voxels in layouts_of(stack.voxels, stack.pitch_mm, colours, tile):
            shown = seen(voxels, stack.pitch_mm, colours)
            wanted = shown if wanted is None else wanted
            grain = [entry["share"] for entry in judge(dataclasses.replace(stack, voxels=voxels), UP)["grain"]]
            rows.setdefault(title, []).append({
                "recipe": name, "grain": grain, "off": study.differences(wanted, shown).tolist(),
                "moved": float(study.differences(shown[1], shown[2]))})
        study.note(f"recipe {number + 1} of {len(recipes)}")
    return rows


def by_walk(profile, profile_path, program, steps, tile, photons, recipes):
    """Returns rows {layout: [recipe]} of L* and chroma, and of the mean difference over changes of the coefficients."""
    rows = {}
    with tempfile.TemporaryDirectory(prefix="vdbdither-layouts-") as folder:
        walker = characterize.Walker(folder, photons)
        press = characterize.Press(profile, folder, program, steps, profile_path)
        white = characterize.white_of(press.materials) + 1
        colours = optics.material_colours(press.materials)
        coefficients = [characterize.coefficients_of(press.materials, change) for change in (0, *CHANGES)]
        for mixture in recipes(len(press.inks)):
            block = press.block(mixture)
            for title, voxels in layouts_of(block, press.pitch_mm, colours, tile):
                on_core = characterize.on_core(voxels, press.pitch_mm, white)
                found = optics.lab([walker.reflectances(on_core, press.pitch_mm, each)[:, 0] for each in coefficients])
                rows.setdefault(title, []).append({
                    "mixture": np.round(mixture, 4).tolist(), "lightness": float(found[0, 0]),
                    "chroma": float(np.hypot(*found[0, 1:])),
                    "moved": float(optics.ciede2000(found[0], found[1:]).mean())})
    return rows


def mixtures(inks):
    """Returns coverages [count, inks]: halves and quarters of two inks, and a few mixtures of all."""
    one = np.eye(inks)
    rows = [share * one[a] + (1 - share) * one[b] for a in range(inks) for b in range(a) for share in (0.25, 0.5)]
    rows += list(np.random.default_rng(study.SEED).dirichlet(np.ones(inks), 6))
    return rows


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("profile", metavar="PROFILE.json", type=pathlib.Path)
    parser.add_argument("--program", required=True)
    parser.add_argument("--recipes", type=int, default=12)
    parser.add_argument("--photons", type=int, default=20000, help="for each patch and channel")
    parser.add_argument("--json", type=pathlib.Path)
    arguments = parser.parse_args()
    profile, path = json.loads(arguments.profile.read_text()), str(arguments.profile.resolve())
    pitch_mm = np.array([characterize.length_mm(text) for text in profile["pitch_mm"]])
    with tempfile.TemporaryDirectory(prefix="vdbdither-layouts-") as folder:
        tile = halftone_tile(arguments.program, folder, pitch_mm, 1)
        program = study.Program(arguments.program, folder, study.STEPS)
        judged = by_judge(program, path, tile, study.RECIPES[:arguments.recipes])
    walked = by_walk(profile, path, arguments.program, study.STEPS, tile, arguments.photons, mixtures)
    print(f"{'':20}{'grain, l = 0':>14}{'50':>7}{'150 um':>8}{'off, l = 0':>12}{'50':>7}{'150 um':>8}{'50 to 150':>11}"
          f"{'walk: L*':>10}{'chroma':>8}{'moved':>7}")
    for title, rows in judged.items():
        grain = np.mean([row["grain"] for row in rows], axis=0)
        off = np.mean([row["off"] for row in rows], axis=0)
        walks = walked[title]
        print(f"{title:20}{grain[0]:14.2f}{grain[1]:7.2f}{grain[2]:8.2f}{off[0]:12.1f}{off[1]:7.1f}{off[2]:8.1f}"
              f"{np.mean([row['moved'] for row in rows]):11.1f}" + "".join(
                  f"{np.mean([row[key] for row in walks]):{width}.1f}" for key, width in (("lightness", 10), ("chroma", 8), ("moved", 7))))
    if arguments.json:
        arguments.json.write_text(json.dumps({"depths_mm": DEPTHS_MM, "lengths_mm": LENGTHS_MM, "judged": judged, "walked": walked}) + "\n")


if __name__ == "__main__":
    main()
