#!/usr/bin/python3
"""Runs mesh2sdf and openvdb::tools::meshToVolume in turn, in one process, and prints the ratios as a table.

mesh2sdf.py PROGRAM SIZE_MM mesh ...     (PROGRAM is build/release/tests/mesh_distance_bench)
"""
import json
import subprocess
import sys


def main():
    program, arguments = sys.argv[1], sys.argv[2:]
    output = subprocess.run([program, "--benchmark_format=json", *arguments],
                            check=True, capture_output=True, text=True).stdout
    runs = {}
    for run in json.loads(output)["benchmarks"]:
        mesh, what = run["name"].removesuffix("/process_time").split("/", 1)
        runs.setdefault(mesh, {})[what] = run
    print("| mesh | run | active voxels | CPU ns per voxel | peak bytes per voxel | times less CPU than meshToVolume |")
    print("|---|---|---|---|---|---|")
    for mesh, by_name in runs.items():
        peer = by_name["wide/peer"]
        peer_ns = peer["cpu_time"] * 1e6 / peer["voxels"]
        for what, run in by_name.items():
            nanoseconds = run["cpu_time"] * 1e6 / run["voxels"]
            print(f"| {mesh} | {what} | {run['voxels'] / 1e6:.1f} M | {nanoseconds:.1f} "
                  f"| {run['peak_MB'] * 1e6 / run['voxels']:.1f} | {peer_ns / nanoseconds:.1f} |")


main()
