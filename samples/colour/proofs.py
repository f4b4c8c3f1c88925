#!/usr/bin/python3
"""Draws meshes as they are meant, as the halftone prints them, and as random choice would: side by side in a PNG.

    samples/colour/proofs.py OUT.png MESH... [--program build/release/vdbdither] [--printer NAME] [--fit 12mm] [--pixel 40um]
        [--translucency 60um] [--texture FILE] [--rotate X,Y,Z]

Each row is a mesh: its colours on the lattice; a soft proof of the halftone; the same with a white-noise mask, which is
random choice. A soft proof shows the mean of the materials around each point of the surface, as light that wanders through
them does (simulate --translucency).
"""

import argparse
import pathlib
import subprocess
import tempfile

from PIL import Image

COLUMNS = (("simulate",), ("halftone", "!", "simulate"), ("halftone", "--mask", "white", "!", "simulate"))


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("out", metavar="OUT.png")
    parser.add_argument("meshes", nargs="+", metavar="MESH")
    parser.add_argument("--program", default="build/release/vdbdither")
    parser.add_argument("--printer", default="stratasys-j750-14um")
    parser.add_argument("--fit", default="12mm", help="longest side of each part")
    parser.add_argument("--pixel", default="40um", help="side of a pixel at the part")
    parser.add_argument("--translucency", default="60um")
    parser.add_argument("--texture", default="", help="of the meshes that name none")
    parser.add_argument("--rotate", default="0,0,0")
    parser.add_argument("--azimuth", default="30")
    parser.add_argument("--elevation", default="20")
    arguments = parser.parse_args()
    pictures = []
    with tempfile.TemporaryDirectory(prefix="vdbdither-proofs-") as folder:
        picture = pathlib.Path(folder) / "picture.png"
        view = ["render", picture, "--overwrite", "--quiet", "--look", "sky", "--pixel", arguments.pixel,
                "--azimuth", arguments.azimuth, "--elevation", arguments.elevation]
        for mesh in arguments.meshes:
            source = ["mesh2sdf", mesh, "--printer", arguments.printer, "--fit", arguments.fit, "--rotate", arguments.rotate,
                      "--colour", "--colour-depth", "0.4mm", *(["--texture", arguments.texture] if arguments.texture else [])]
            for steps in COLUMNS:
                light = [] if steps == ("simulate",) else ["--translucency", arguments.translucency]
                subprocess.run([arguments.program, *source, "!", "dither", "!", *steps, *light, "!", *view], check=True)
                pictures.append(Image.open(picture).convert("RGBA"))
    width, height = max(p.width for p in pictures), max(p.height for p in pictures)
    sheet = Image.new("RGB", (width * len(COLUMNS), height * len(arguments.meshes)), "white")
    for n, drawn in enumerate(pictures):
        column, row = n % len(COLUMNS), n // len(COLUMNS)
        sheet.paste(drawn, (column * width + (width - drawn.width) // 2, row * height + (height - drawn.height) // 2), drawn)
    sheet.save(arguments.out)


if __name__ == "__main__":
    main()
