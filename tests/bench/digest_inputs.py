"""The inputs of digests.py: meshes, pictures and printer profiles, the same bytes on every machine."""

import json
import math
import struct
import zlib

import make_part
import meshes


def indexed(triangles):
    """Vertices without repetition, and triangles of their numbers."""
    numbers = {}
    faces = [[numbers.setdefault(corner, len(numbers)) for corner in triangle] for triangle in triangles]
    return list(numbers), faces


def ascii_stl(triangles):
    lines = ["solid part"]
    for triangle in triangles:
        lines += ["facet normal 0 0 0", "outer loop", *("vertex %.9g %.9g %.9g" % c for c in triangle), "endloop", "endfacet"]
    return "\n".join([*lines, "endsolid part", ""]).encode()


def obj(triangles, relative=False):
    vertices, faces = indexed(triangles)
    first = -len(vertices) if relative else 1
    lines = ["# a part", "o part", *("v %.9g %.9g %.9g" % v for v in vertices), "vn 0 0 1", "vt 0 0"]
    lines += ["f " + " ".join(f"{v + first}" if relative else f"{v + first}/1/1" for v in face) for face in faces]
    return "\n".join([*lines, ""]).encode()


def ply(triangles, encoding):
    """With a property and an element that are no part of the shape; binary coordinates are doubles."""
    vertices, faces = indexed(triangles)
    number = "float" if encoding == "ascii" else "double"
    head = ["ply", f"format {encoding} 1.0", "comment a part", f"element vertex {len(vertices)}",
            *(f"property {number} {axis}" for axis in "xyz"), "property uchar red", f"element face {len(faces)}",
            "property list uchar int vertex_indices", "element edge 1", "property int vertex1", "end_header", ""]
    if encoding == "ascii":
        lines = ["%.9g %.9g %.9g 255" % v for v in vertices] + ["3 %d %d %d" % tuple(f) for f in faces] + ["0", ""]
        return "\n".join(head + lines).replace("end_header\n\n", "end_header\n").encode()
    order = "<" if "little" in encoding else ">"
    body = [struct.pack(order + "3dB", *v, 255) for v in vertices]
    body += [struct.pack(order + "B3i", 3, *f) for f in faces] + [struct.pack(order + "i", 0)]
    return "\n".join(head).encode() + b"".join(body)


def binary_stl(triangles):
    body = [struct.pack("<12fH", 0, 0, 0, *sum(triangle, ()), 0) for triangle in triangles]
    return b"mm".ljust(80) + struct.pack("<I", len(triangles)) + b"".join(body)


def flipped(triangles):
    return [(a, c, b) for a, b, c in triangles]


def shifted(triangles, by):
    return [tuple(tuple(x + d for x, d in zip(corner, by)) for corner in triangle) for triangle in triangles]


def chance():
    """Pseudorandom numbers from -1 to 1 (Knuth's MMIX generator)."""
    state = 1
    while True:
        state = (state * 6364136223846793005 + 1442695040888963407) % 2**64
        yield (state >> 33) / 2**30 - 1


def soup(triangles):
    """The triangles shrunk and moved a little, so that no two share an edge."""
    noise = chance()
    loose = []
    for triangle in triangles:
        middle = [sum(corner[axis] for corner in triangle) / 3 for axis in range(3)]
        off = [0.004 * next(noise) for _ in range(3)]
        loose.append(tuple(tuple(m + 0.93 * (x - m) + o for x, m, o in zip(corner, middle, off)) for corner in triangle))
    return loose


def split_edges(triangles):
    """Every third triangle cut in two, so that a vertex lies on the edge of its neighbour."""
    result = []
    for number, (a, b, c) in enumerate(triangles):
        middle = tuple((p + q) / 2 for p, q in zip(a, b))
        result += [(a, b, c)] if number % 3 else [(a, middle, c), (middle, b, c)]
    return result


def jittered(triangles):
    noise = chance()
    return [tuple(tuple(x + 1e-8 * next(noise) for x in corner) for corner in triangle) for triangle in triangles]


def png(width, height, bits, value):
    """A grey image; `value(x, y)` is 0 to 1."""
    most = 2**bits - 1
    rows = b"".join(b"\0" + b"".join(round(most * value(x, y)).to_bytes(bits // 8, "big") for x in range(width))
                    for y in range(height))

    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    return (b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, bits, 0, 0, 0, 0))
            + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b""))


def l_prism():
    """An OBJ with two concave caps of six corners and six quads."""
    outline = [(0, 0), (1.6, 0), (1.6, 0.6), (0.7, 0.6), (0.7, 1.4), (0, 1.4)]
    lines = [f"v {x} {y} {z}" for z in (0, 0.8) for x, y in outline]
    lines += ["f 6 5 4 3 2 1", "f 7 8 9 10 11 12"]
    lines += ["f %d %d %d %d" % (i + 1, (i + 1) % 6 + 1, (i + 1) % 6 + 7, i + 7) for i in range(6)]
    return "\n".join([*lines, ""]).encode()


PART = meshes.turned(meshes.box((2.4, 2, 1.4), (-1.1, -0.9, -0.6)), 7, 12)
SLOPE = meshes.turned(meshes.box((2.2, 2.2, 1.1)), 2, 3)
BALL = meshes.sphere(0.9, 16)
BOX = meshes.box((1.2, 1.1, 0.9))


def whole_meshes():
    """Meshes that need no repair, as bytes for each file name."""
    return {
        "part.stl": binary_stl(PART), "slope.stl": binary_stl(SLOPE), "ball.stl": binary_stl(BALL), "box.stl": binary_stl(BOX),
        "ascii.stl": ascii_stl(PART), "indices.obj": obj(PART), "relative.obj": obj(BALL, relative=True),
        "polygons.obj": l_prism(),
        "ascii.ply": ply(PART, "ascii"), "little.ply": ply(PART, "binary_little_endian"),
        "big.ply": ply(PART, "binary_big_endian"), "cylinder.stl": binary_stl(meshes.cylinder(0.7, 1.1)),
        "cavity.stl": binary_stl(meshes.box((1.8, 1.8, 1.8), (-0.9, -0.9, -0.9)) + flipped(meshes.sphere(0.6, 10))),
        "apart.stl": binary_stl(BOX + shifted(BOX, (1.5, 0, 0.4))),
        "walls.stl": binary_stl(meshes.turned(meshes.box((1.5, 0.12, 1)) + meshes.box((1.5, 0.06, 1), (0, 0.25, 0)) +
                                              meshes.box((1.5, 0.3, 1), (0, 0.4, 0)), 3, 4)),
        "thin.stl": binary_stl(meshes.box((1.5, 1.5, 0.004))),
        "lower.stl": binary_stl(meshes.box((1.6, 1.6, 0.7))), "upper.stl": binary_stl(meshes.box((1, 1, 1), (0.3, 0.3, 0.7))),
    }


def broken_meshes():
    """Meshes that need repair or are refused."""
    ball = meshes.sphere(0.9, 12)
    top = max(z for triangle in BOX for *_, z in triangle)
    sheet = [((0, 0, 0.5), (1.2, 0, 0.5), (1.2, 1.1, 0.5)), ((0, 0, 0.5), (1.2, 1.1, 0.5), (0, 1.1, 0.5))]
    point = BOX[0][0]
    return {
        "holed.stl": binary_stl([t for n, t in enumerate(ball) if n % 61 not in (20, 21, 22)]),
        "lidless.stl": binary_stl([t for t in BOX if not all(z == top for *_, z in t)]),
        "bowl.stl": binary_stl([t for t in ball if sum(z for *_, z in t) < 0.6]),
        "flipped.stl": binary_stl(flipped(BOX)),
        "mixed.stl": binary_stl([t if n % 4 else flipped([t])[0] for n, t in enumerate(ball)]),
        "overlap.stl": binary_stl(BOX + shifted(ball, (0.9, 0.6, 0.5))),
        "overlap-boxes.obj": obj(BOX + shifted(BOX, (0.5, 0.25, 0.375))),
        "flush.stl": binary_stl(BOX + shifted(BOX, (1.2, 0.3, 0))),
        "nested.stl": binary_stl(meshes.box((2, 2, 2), (-1, -1, -1)) + ball),
        "doubled.stl": binary_stl(BOX + BOX),
        "back-to-back.stl": binary_stl(BOX + flipped(sheet) + sheet),
        "membrane.stl": binary_stl(BOX + sheet),
        "edges.stl": binary_stl(split_edges(ball)),
        "unwelded.ply": ply(jittered(BOX), "binary_little_endian"),
        "degenerate.stl": binary_stl(BOX + [(point, point, BOX[0][1]), (BOX[0][0], BOX[0][1], BOX[0][1])]),
        "soup.stl": binary_stl(soup(meshes.sphere(0.4, 3))),
        "soup-inwards.obj": obj(shifted(soup(flipped(meshes.turned(meshes.box((0.5, 0.4, 0.3)), 4, 5))), (0.3, 0.3, 0.9))),
        "sheet.stl": binary_stl(sheet),
        "cut.stl": binary_stl(BOX)[:-30],
        "nan.stl": binary_stl(BOX[:-1] + [((math.nan, 0, 0), *BOX[-1][1:])]),
        "huge.stl": binary_stl(shifted(BOX, (1e30, 0, 0))),
        "words.stl": b"this is no mesh\n" * 9,
        "indices-beyond.obj": b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n",
        "cut.ply": ply(BOX, "ascii")[:-40],
    }


def other_inputs():
    profile = {"name": "own", "title": "Of a user", "pitch_mm": ["63.5um", "400dpi", "30um"], "build_mm": [100, 100, 50],
               "point_spread_mm": [0.04, 0.06, 0.02],
               "materials": [{"name": "grey", "rgba": [120, 121, 122, 255]}, {"name": "red", "rgba": [200, 10, 20, 255]}]}
    return {
        "own.json": json.dumps(profile).encode(),
        "wrong.json": json.dumps({**profile, "pitch_mm": [1, 2], "colour": 1}).encode(),
        "waves8.png": png(24, 16, 8, lambda x, y: 0.5 + 0.5 * math.sin(0.7 * x) * math.cos(0.9 * y)),
        "waves16.png": png(20, 20, 16, lambda x, y: (x * x + 3 * y) % 41 / 40),
    }


def write_inputs(folder):
    for name, data in {**whole_meshes(), **broken_meshes(), **other_inputs()}.items():
        (folder / name).write_bytes(data)
    make_part.write_stl(folder / "token.stl", *make_part.make_mesh())
