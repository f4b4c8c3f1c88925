#!/usr/bin/python3
"""Checks a stack of slices against its manifest.

    stack.py FOLDER
"""

import hashlib
import json
import pathlib
import sys
from collections import Counter

from PIL import Image


def sums(folder):
    """Returns the SHA-256 of every slice in order of their layers. Checks them against the files."""
    folder = pathlib.Path(folder)
    manifest = json.loads((folder / "manifest.json").read_text())
    found = []
    for entry in manifest["slices"]:
        found.append(hashlib.sha256((folder / entry["file"]).read_bytes()).hexdigest())
        assert found[-1] == entry["sha256"], f"{entry['file']}: its SHA-256 differs from the manifest"
    return found


def check(folder):
    """Raises AssertionError if a stack of RGBA slices does not agree with its manifest. Returns the manifest."""
    folder = pathlib.Path(folder)
    manifest = json.loads((folder / "manifest.json").read_text())
    width, height, layers = manifest["size"]
    names = [entry["file"] for entry in manifest["slices"]]
    assert layers > 0 and len(names) == layers, f"{len(names)} slices for {layers} layers"
    there = {path.name for path in folder.iterdir()}
    assert there == {*names, "manifest.json", "preview.png"}, f"unexpected: {sorted(there - set(names))}"
    sums(folder)

    pixels = Counter()
    for name in names:
        with Image.open(folder / name) as image:
            assert image.mode == "RGBA", f"{name}: its mode is {image.mode}"
            assert image.size == (width, height), f"{name}: its size is {image.size}"
            pixels.update({colour: count for count, colour in image.getcolors(256)})
    background = tuple(manifest["background"])
    assert all(alpha == 255 for *_, alpha in pixels), "a pixel is not opaque"
    by_colour = Counter()
    for material in manifest["materials"]:
        by_colour[tuple(material["rgba"])] += material["voxels"]
    assert sum(by_colour.values()) > 0, "nothing is printed"
    del pixels[background]
    assert +pixels == +by_colour, f"pixels {dict(pixels)}, voxels of the manifest {dict(by_colour)}"

    with Image.open(folder / "preview.png") as preview:
        preview.load()
        assert min(preview.size) > 16, f"preview.png has {preview.size} pixels"
        assert len(set(preview.convert("RGB").getdata())) > 2, "preview.png shows nothing"
    return manifest


if __name__ == "__main__":
    check(sys.argv[1])
