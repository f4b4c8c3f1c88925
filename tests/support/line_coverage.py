#!/usr/bin/python3
"""Prints the share of the lines of each layer and folder that tests have run, and the files with the most lines left.

    line_coverage.py coverage.json      what `llvm-cov export --summary-only` wrote
"""

import collections
import json
import pathlib
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]


def layer_of(path):
    """Returns the layer of a source, and its folder."""
    folder = str(path.parent)
    for layer, head in (("kernels", "ops/kernels"), ("ops", "ops"), ("io", "io"), ("engine", "vdbdither")):
        if folder == head or folder.startswith(head + "/"):
            return layer, folder
    return None


def main():
    data, = json.loads(pathlib.Path(sys.argv[1]).read_text())["data"]
    lines, files = collections.defaultdict(lambda: [0, 0]), []
    for entry in data["files"]:
        path = pathlib.Path(entry["filename"]).resolve()
        if ROOT not in path.parents or not (place := layer_of(path.relative_to(ROOT))):
            continue
        count, covered = (entry["summary"]["lines"][key] for key in ("count", "covered"))
        files.append((count - covered, count, str(path.relative_to(ROOT))))
        for key in ((place[0], ""), place, ("all", "")):
            lines[key][0] += covered
            lines[key][1] += count
    for (layer, folder), (covered, count) in sorted(lines.items()):
        print(f"{'    ' + folder if folder else layer:32} {100 * covered / count:6.2f} %  {covered:6} of {count:6} lines")
    print("\nfiles with the most lines that no test runs:")
    for left, count, name in sorted(files, reverse=True)[:25]:
        print(f"  {left:4} of {count:5}  {name}")


if __name__ == "__main__":
    main()
