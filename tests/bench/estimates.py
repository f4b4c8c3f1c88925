#!/usr/bin/env python3
"""Compares the time that --explain expects with the time of runs.

    tests/bench/estimates.py MESH ... [--sizes 20,60,120]

A line for each mesh, size and chain: total CPU time, the expected time, and their quotient; then the same for every stage.
"""

import argparse
import json
import pathlib
import subprocess
import tempfile

ROOT = pathlib.Path(__file__).resolve().parents[2]
CHAINS = ("dither ! slice-export out", "normals ! dither ! material-assign ! write out.vdb")


def run(mesh, size, chain):
    with tempfile.TemporaryDirectory() as folder:
        words = f"mesh2sdf '{mesh}' --printer mimaki-3duj-553 --fit {size}mm --json --quiet ! {chain}"
        done = subprocess.run([ROOT / "build/release/vdbdither", "run", words], cwd=folder, capture_output=True, check=True)
    return json.loads(done.stdout)["stages"]


parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
parser.add_argument("meshes", nargs="+", type=pathlib.Path)
parser.add_argument("--sizes", default="20,60,120", help="of the longest axis, mm")
given = parser.parse_args()
for mesh in given.meshes:
    for size in given.sizes.split(","):
        for chain in CHAINS:
            stages = run(mesh.resolve(), size, chain)
            took, expected = (sum(stage[key] for stage in stages) for key in ("cpu_seconds", "expected_cpu_seconds"))
            print(f"{mesh.stem} {size} mm, {chain}: {took:.2f} s, expected {expected:.2f} s, {expected / took:.2f}")
            for stage in stages:
                print(f"    {stage['name']:16} {stage['cpu_seconds']:8.2f} {stage['expected_cpu_seconds']:8.2f}")
