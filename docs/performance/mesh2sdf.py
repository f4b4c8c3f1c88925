#!/usr/bin/python3
"""Measures the growth of the cost of the distance field, and draws it with fitted exponents.

mesh2sdf.py measure PROGRAM part.obj mesh2sdf.json     (PROGRAM is build/release/tests/mesh_distance_bench)
mesh2sdf.py draw mesh2sdf.json mesh2sdf.png

Against resolution: the part at 50, 100 and 200 mm on one lattice, which equals a pitch of ×1, ×½ and ×¼.
Against triangles: a bumpy ball of 60 mm with increasing numbers of triangles. The cost is the CPU time on one
thread in slabs of 64 layers, the minimum of three runs.
"""

import json
import subprocess
import sys
import tempfile

import matplotlib
import numpy

matplotlib.use("Agg")
import matplotlib.pyplot as plt


def cpu_seconds(program, size_mm, mesh):
    """Returns the minimum CPU time of the default band in slabs, and the active voxels."""
    output = subprocess.run([program, "--benchmark_format=json", "--benchmark_repetitions=3",
                             "--benchmark_filter=default/slabs/process_time", str(size_mm), mesh],
                            check=True, capture_output=True, text=True).stdout
    runs = [run for run in json.loads(output)["benchmarks"] if run["run_type"] == "iteration"]
    return {"cpu_s": min(run["cpu_time"] for run in runs) / 1e3, "voxels": runs[0]["voxels"]}


def write_ball(path, rings):
    """Writes a ball with bumps as a binary PLY. Returns the number of its triangles."""
    around = 2 * rings
    polar = numpy.linspace(0, numpy.pi, rings + 1)[1:-1, None]
    turn = numpy.linspace(0, 2 * numpy.pi, around, endpoint=False)[None, :]
    radius = 1 + 0.05 * numpy.sin(5 * turn) * numpy.sin(polar) ** 2 * numpy.cos(4 * polar)
    points = numpy.stack([radius * numpy.sin(polar) * numpy.cos(turn),
                          radius * numpy.sin(polar) * numpy.sin(turn), radius * numpy.cos(polar)], -1)
    vertices = numpy.concatenate([points.reshape(-1, 3), [[0, 0, 1], [0, 0, -1]]]).astype("<f4")
    top, bottom = len(vertices) - 2, len(vertices) - 1
    at = numpy.arange((rings - 1) * around).reshape(rings - 1, around)
    right = numpy.roll(at, -1, 1)
    one = numpy.stack([at[:-1], at[1:], right[1:]], -1).reshape(-1, 3)
    two = numpy.stack([at[:-1], right[1:], right[:-1]], -1).reshape(-1, 3)
    first = numpy.stack([numpy.full(around, top), at[0], right[0]], -1)
    last = numpy.stack([numpy.full(around, bottom), right[-1], at[-1]], -1)
    triangles = numpy.concatenate([one, two, first, last])
    faces = numpy.empty(len(triangles), dtype=[("n", "u1"), ("v", "<i4", 3)])
    faces["n"], faces["v"] = 3, triangles
    with open(path, "wb") as file:
        file.write(("ply\nformat binary_little_endian 1.0\n"
                    f"element vertex {len(vertices)}\nproperty float x\nproperty float y\nproperty float z\n"
                    f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n").encode())
        file.write(vertices.tobytes() + faces.tobytes())
    return len(triangles)


def measure(program, part):
    resolution, triangles = [], []
    for size_mm in (50, 100, 200):
        resolution.append({"pitch": 50 / size_mm, **cpu_seconds(program, size_mm, part)})
    with tempfile.TemporaryDirectory() as folder:
        for rings in (23, 45, 90, 180, 360, 720):
            path = f"{folder}/ball.ply"
            count = write_ball(path, rings)
            triangles.append({"triangles": count, **cpu_seconds(program, 60, path)})
    return {"resolution": resolution, "triangles": triangles}


def exponent(points):
    """Returns the exponent of the power law that fits the points best."""
    x, y = numpy.log(numpy.array(points, dtype=float)).T
    return numpy.polyfit(x, y, 1)[0]


def draw(data, picture_path):
    figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.6), dpi=90)
    cost = [(1 / row["pitch"], row["cpu_s"]) for row in data["resolution"]]
    voxels = [(1 / row["pitch"], row["voxels"] / 1e8) for row in data["resolution"]]
    left.plot(*zip(*cost), marker="o", label=f"CPU s, exponent {exponent(cost):.2f}")
    left.plot(*zip(*voxels), marker="s", label=f"10⁸ voxels, exponent {exponent(voxels):.2f}")
    left.set(xscale="log", yscale="log", xlabel="resolution (1 / pitch)")
    cost = [(row["triangles"], row["cpu_s"]) for row in data["triangles"]]
    few, many = ([point for point in cost if (point[0] > 1e5) == above] for above in (False, True))
    right.plot(*zip(*cost), marker="o",
               label=f"exponent {exponent(few):.2f} below 100 k, {exponent(many):.2f} above")
    right.set(xscale="log", yscale="log", ylabel="CPU s",
              xlabel="triangles (15 M voxels)")
    for axis in (left, right):
        axis.margins(y=0.2)
        axis.grid(alpha=0.3, which="both")
        axis.legend(loc="upper left")
    figure.tight_layout()
    figure.savefig(picture_path)


def main():
    if sys.argv[1] == "measure":
        program, part, data_path = sys.argv[2:]
        with open(data_path, "w", encoding="utf-8") as file:
            json.dump(measure(program, part), file, indent=1)
            file.write("\n")
    else:
        data_path, picture_path = sys.argv[2:]
        with open(data_path, encoding="utf-8") as file:
            draw(json.load(file), picture_path)


main()
