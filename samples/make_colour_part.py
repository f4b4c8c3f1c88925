#!/usr/bin/env python3
"""Make the coloured sample part: a pebble with five lobes, 16 mm wide, as an OBJ with a material and a texture.

The surface is closed: its vertices are shared, and only the texture has a seam. The texture has smooth hues around the
part, rings that fade to white, and dark dots, so that a print shows gradients, pale tones and edges. The script writes
the same bytes every time.

    python3 make_colour_part.py pebble.obj      writes pebble.obj, pebble.mtl and pebble.png
"""

import argparse
import colorsys
import math
import pathlib
import struct
import zlib

SEGMENTS, RINGS = 180, 90
RADIUS_MM, HEIGHT_MM = 8.0, 5.0
LOBES, LOBE_DEPTH = 5, 0.12
WIDTH, HEIGHT = 1024, 512


def position(u, v):
    """Returns the point of the surface at the texture's coordinates, 0 … 1; v = 0 is the lowest point."""
    around, up = 2 * math.pi * u, math.pi * (v - 0.5)
    radius = RADIUS_MM * math.cos(up) * (1 - LOBE_DEPTH * math.cos(up) ** 2 * (1 - math.cos(LOBES * around)) / 2)
    return radius * math.cos(around), radius * math.sin(around), HEIGHT_MM * math.sin(up)


def colour(u, v):
    """Returns red, green and blue, 0 … 1, in the encoding of sRGB."""
    hue = u + 0.15 * math.sin(4 * math.pi * v)
    saturation = 0.75 * (0.5 - 0.5 * math.cos(6 * math.pi * v)) ** 0.7
    value = 0.95 - 0.25 * v
    # Dots of one size on the part, in rows that alternate.
    row = math.floor(v * 12)
    across = (u * 24 + 0.5 * (row % 2)) % 1 - 0.5
    along = v * 12 - row - 0.5
    stretch = max(math.sin(math.pi * v), 0.15)
    if math.hypot(across * 2.1 * stretch, along * 1.3) < 0.28:
        return 0.1, 0.1, 0.12
    return colorsys.hsv_to_rgb(hue % 1, saturation, value)


def write_texture(path):
    """Writes the texture as a PNG, the top row first."""
    rows = bytearray()
    for y in range(HEIGHT):
        rows.append(0)
        for x in range(WIDTH):
            rows += bytes(round(255 * channel) for channel in colour((x + 0.5) / WIDTH, 1 - (y + 0.5) / HEIGHT))

    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    header = struct.pack(">IIBBBBB", WIDTH, HEIGHT, 8, 2, 0, 0, 0)
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"sRGB", b"\0") + chunk(b"IDAT", zlib.compress(bytes(rows), 9)) +
                     chunk(b"IEND", b""))


def write_mesh(path):
    """Writes the mesh and its material."""
    lines = [f"mtllib {path.with_suffix('.mtl').name}", "usemtl pebble"]
    points = [position(0, 0)] + [position(s / SEGMENTS, r / RINGS) for r in range(1, RINGS) for s in range(SEGMENTS)] + [position(0, 1)]
    lines += [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in points]
    lines += [f"vt {s / SEGMENTS:.6f} {r / RINGS:.6f}" for r in range(RINGS + 1) for s in range(SEGMENTS + 1)]

    def corner(r, s):
        vertex = 1 if r == 0 else len(points) if r == RINGS else 2 + (r - 1) * SEGMENTS + s % SEGMENTS
        return f"{vertex}/{r * (SEGMENTS + 1) + s + 1}"

    for r in range(RINGS):
        for s in range(SEGMENTS):
            low, high = (corner(r, s), corner(r, s + 1)), (corner(r + 1, s), corner(r + 1, s + 1))
            if r > 0:
                lines.append(f"f {low[0]} {low[1]} {high[1]}")
            if r < RINGS - 1:
                lines.append(f"f {low[0]} {high[1]} {high[0]}")
    path.write_text("\n".join(lines) + "\n")
    path.with_suffix(".mtl").write_text(f"newmtl pebble\nKd 1 1 1\nmap_Kd {path.with_suffix('.png').name}\n")


def main():
    parser = argparse.ArgumentParser(description="Makes a coloured part, with its material and texture beside it.")
    parser.add_argument("file", type=pathlib.Path, help="the OBJ to write")
    path = parser.parse_args().file
    write_mesh(path)
    write_texture(path.with_suffix(".png"))


if __name__ == "__main__":
    main()
