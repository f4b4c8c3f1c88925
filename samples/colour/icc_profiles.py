#!/usr/bin/python3
"""Coverages that `separate --icc` takes from a real profile of a printer, beside those of Argyll's xicclu, another engine.

Colours are mixtures of a grid in encoded sRGB. xicclu is given their CIELAB (D50) and returns the inks of the profile, with
the relative colorimetric intent and black kept. Compared are the colours whose inks sum to at most 1: beyond, `separate`
divides by the sum, as docs/halftone.md says.

    apt-get install argyll libgs9-common
    samples/colour/icc_profiles.py --program build/release/vdbdither --json docs/colour/icc_profiles.json
"""

import argparse
import itertools
import json
import pathlib
import subprocess
import tempfile

import numpy as np
import pyopenvdb

import optics

PROFILE = "/usr/share/color/icc/ghostscript/default_cmyk.icc"
INKS = {"cyan": "#00a0d0", "magenta": "#d01080", "yellow": "#f0e000", "black": "#101010", "white": "#f0f0f0"}
STEPS = 18
# Bradford's adaptation from D65 to D50, times the primaries of Rec. 709 (IEC 61966-2-1, ICC.1:2022 annex E).
XYZ_D50_OF_RGB = np.array([[0.4360747, 0.3850649, 0.1430804], [0.2225045, 0.7168786, 0.0606169], [0.0139322, 0.0971045, 0.7141733]])
WHITE_D50 = np.array([0.9642, 1.0, 0.8249])


def colours():
    """Returns linear colours [count, 3]: a grid of STEPS per axis in encoded sRGB."""
    levels = np.linspace(0, 1, STEPS)
    return optics.linear(np.array(list(itertools.product(levels, repeat=3))))


def lab_d50(rgb):
    return optics.lab_of_xyz(rgb @ XYZ_D50_OF_RGB.T, WHITE_D50)


def separated(program, folder, profile, rgb):
    """Returns the coverages [count, inks] that the program takes from the profile."""
    grids = []
    # Values of the background would be inactive, so it is no colour.
    for name, values, grid in (("solid", np.ones(len(rgb), bool), pyopenvdb.BoolGrid()),
                               ("Cd", rgb.astype(np.float32), pyopenvdb.Vec3SGrid((-1, -1, -1)))):
        grid.name = name
        grid.copyFromArray(values.reshape((len(rgb), 1, 1, *values.shape[1:])))
        grid.transform = pyopenvdb.createLinearTransform(0.1)
        grids.append(grid)
    pyopenvdb.write(str(folder / "colours.vdb"), grids)
    command = [program, "separate", "-i", "colours.vdb", "--inks", ",".join(f"{name}={colour}" for name, colour in INKS.items()),
               "--icc", profile, "--intent", "relative", "--black-point", "kept", "-o", "coverages.vdb", "--overwrite", "--quiet"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    if done.returncode:
        raise SystemExit(f"icc_profiles: {' '.join(command[1:])}\n{done.stderr.strip()}")
    found = np.zeros((len(rgb), len(INKS)))
    for ink, name in enumerate(INKS):
        array = np.zeros((len(rgb), 1, 1), np.float32)
        pyopenvdb.read(str(folder / "coverages.vdb"), f"coverage_{name}").copyToArray(array)
        found[:, ink] = array[:, 0, 0]
    return found


def looked_up(profile, lab):
    """Returns the inks [count, 4] of xicclu, 0 ... 1."""
    text = "\n".join(" ".join(f"{value:.6f}" for value in row) for row in lab)
    done = subprocess.run(["xicclu", "-v0", "-fb", "-ir", "-pl", profile], input=text, capture_output=True, text=True, check=True)
    return np.array([[float(word) for word in line.split()] for line in done.stdout.splitlines() if line.strip()])


def compared(program, folder, profile):
    rgb = colours()
    ours, theirs = separated(program, folder, profile, rgb), looked_up(profile, lab_d50(rgb))
    fits = theirs.sum(axis=1) <= 1
    off = np.abs(ours[fits, :4] - theirs[fits]).max(axis=1)
    divided = np.abs(ours[~fits, :4] - theirs[~fits] / theirs[~fits].sum(axis=1, keepdims=True)).max(axis=1)
    spread = lambda values: {"mean": float(values.mean()), "99 %": float(np.percentile(values, 99)), "worst": float(values.max())}
    return {"profile": pathlib.Path(profile).name, "colours": len(rgb), "with inks of at most 1": int(fits.sum()),
            "off": spread(off), "off where divided": spread(divided), "sum off 1": float(np.abs(ours.sum(axis=1) - 1).max())}


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--program", required=True)
    parser.add_argument("--profile", default=PROFILE)
    parser.add_argument("--json", type=pathlib.Path)
    arguments = parser.parse_args()
    program = str(pathlib.Path(arguments.program).resolve())
    with tempfile.TemporaryDirectory() as folder:
        figures = compared(program, pathlib.Path(folder), arguments.profile)
    print(json.dumps(figures, indent=2))
    if arguments.json:
        arguments.json.write_text(json.dumps(figures, indent=2) + "\n")


if __name__ == "__main__":
    main()
