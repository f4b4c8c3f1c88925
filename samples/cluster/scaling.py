#!/usr/bin/env python3
"""Measures what it costs to cut a job into pieces: CPU time and peak memory of one run, of the pieces, and of the merge.

    samples/cluster/scaling.py MESH [--fit LENGTH] [--pieces 1,2,4,8,16] [--repeats N] [--json FILE]

Every run has one thread, so that its CPU time is its elapsed time on a core of its own. Figures are medians.
"""

import argparse
import json
import os
import pathlib
import shutil
import statistics
import subprocess
import tempfile

ROOT = pathlib.Path(__file__).resolve().parents[2]
PROGRAM = pathlib.Path(os.environ.get("VDBDITHER_PROGRAM", ROOT / "build/release/vdbdither")).resolve()


def run(folder, *words):
    """Returns the CPU seconds and the peak memory in bytes of a run."""
    process = subprocess.Popen([PROGRAM, *words], cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    said = process.stderr.read()
    _, status, used = os.wait4(process.pid, 0)
    if status != 0:
        raise SystemExit(said.decode())
    return used.ru_utime + used.ru_stime, used.ru_maxrss * 1024


def measure(chain, counts, repeats, mesh):
    with tempfile.TemporaryDirectory(prefix="vdbdither-scaling-") as name:
        folder = pathlib.Path(name)
        shutil.copy(mesh, folder / mesh.name)
        one = []
        for _ in range(repeats):
            shutil.rmtree(folder / "out", ignore_errors=True)
            one.append(run(folder, "run", chain))
        rows = []
        bytes_of_stack = sum(file.stat().st_size for file in (folder / "out").rglob("*"))
        (folder / "out").rename(folder / "one")
        for count in counts:
            pieces, merges, planning = [], [], []
            for _ in range(repeats):
                shutil.rmtree(folder / "job", ignore_errors=True)
                shutil.rmtree(folder / "out", ignore_errors=True)
                planning.append(run(folder, "plan", chain, "job", "--pieces", str(count)))
                made = json.loads((folder / "job/job.json").read_text())["pieces"]
                pieces.append([run(folder, "piece", "job", str(number), "--threads", "1") for number in range(len(made))])
                merges.append(run(folder, "merge", "job", "--threads", "1"))
                subprocess.run(["diff", "--recursive", "--brief", "one", "out"], cwd=folder, check=True)
            rows.append({
                "pieces": len(pieces[0]),
                "plan_seconds": statistics.median(seconds for seconds, _ in planning),
                "all_pieces_seconds": statistics.median(sum(seconds for seconds, _ in made) for made in pieces),
                "longest_piece_seconds": statistics.median(max(seconds for seconds, _ in made) for made in pieces),
                "peak_memory_bytes": max(peak for made in pieces for _, peak in made),
                "merge_seconds": statistics.median(seconds for seconds, _ in merges),
                "merge_memory_bytes": max(peak for _, peak in merges),
            })
            print(json.dumps(rows[-1]), flush=True)
        return {"chain": chain, "seconds": statistics.median(seconds for seconds, _ in one),
                "peak_memory_bytes": max(peak for _, peak in one), "stack_bytes": bytes_of_stack, "cut": rows}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("mesh", type=pathlib.Path)
    parser.add_argument("--fit", default="100mm")
    parser.add_argument("--pieces", default="1,2,4,8,16")
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--json", type=pathlib.Path)
    parser.add_argument("--chain", default="mesh2sdf {mesh} --fit {fit} --printer mimaki-3duj-553 --threads 1 ! dither ! material-assign ! "
                                           "slice-export out", help="with {mesh} and {fit} in it; writes the stack `out`")
    arguments = parser.parse_args()
    chain = arguments.chain.format(mesh=arguments.mesh.name, fit=arguments.fit)
    result = measure(chain, [int(count) for count in arguments.pieces.split(",")], arguments.repeats, arguments.mesh)
    text = json.dumps(result, indent=1) + "\n"
    if arguments.json:
        arguments.json.write_text(text)
    print(text)


if __name__ == "__main__":
    main()
