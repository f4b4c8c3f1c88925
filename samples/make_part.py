#!/usr/bin/env python3
"""Make the sample part: a game token of 20 x 20 x 14 mm, as a binary STL.

The part has the shapes on which voxels leave visible steps: twelve petals with slopes from 0.5 to 5
degrees, a wall with two degrees of draft, a dome that blends into a face tilted by 1.5 degrees, and on
this face a star with sharp edges and ten facets of four degrees. The mesh is closed and manifold. The
script writes the same bytes every time.

    python3 make_part.py token.stl
"""

import argparse
import math
import struct

SEGMENTS = 240  # around the axis: a multiple of the star's ten corners and of the petals
PETALS = 12

TILT = math.tan(math.radians(1.5))
FACE_HEIGHT = 13.43
BLEND = 0.4

STAR_TIP, STAR_NOTCH = 4.7, 2.0
STAR_HEIGHT = 0.45
STAR_RIDGE = 0.12  # from the outline to the centre


def face(x, y):
    """Returns the height of the tilted face."""
    return FACE_HEIGHT + TILT * (0.6 * x - 0.8 * y)


def smooth_minimum(a, b):
    """Returns the smaller value, rounded off where the two differ by less than BLEND."""
    near = max(BLEND - abs(a - b), 0.0) / BLEND
    return min(a, b) - near * near * BLEND / 4


def star(angle):
    """Returns the distance from the axis to the outline of a five-pointed star with a tip at +y."""
    step = math.pi / 5
    corner = math.floor((angle - math.pi / 2) / step + 1e-9)
    one, other = (STAR_TIP, STAR_NOTCH) if corner % 2 == 0 else (STAR_NOTCH, STAR_TIP)
    within = angle - math.pi / 2 - corner * step
    # The ray meets the straight edge between the two corners here.
    return (one * other * math.sin(step)
            / (one * math.sin(within) + other * math.sin(step - within)))


def crest(angle):
    """Returns 1 along the middle of a petal and 0 between two petals."""
    return (1 + math.cos(PETALS * angle)) / 2


def rings():
    """Returns functions of the angle that give (radius, height), from the rim of the bottom to that of the star."""
    result = []

    def foot(radius, height):
        result.append(lambda angle: (radius - 0.5 * (1 - crest(angle)), height))

    # The foot: a flat bottom, a chamfer, a wall with draft, a rounded edge.
    foot(9.7, 0.0)
    foot(10.0, 0.3)
    draft, bend = math.radians(2), 0.5
    edge = 10.0 - (1.7 + bend * math.sin(draft)) * math.tan(draft) - bend * math.cos(draft)
    for step in range(9):
        turn = draft + (math.pi / 2 - draft) * step / 8
        foot(edge + bend * math.cos(turn), 2.0 + bend * math.sin(turn))

    # The petals rise inwards, less steeply along their middles, and end in the fillet of the neck.
    def petal(radius, height, share):
        def ring(angle):
            slope = math.tan(math.radians(5.0 - 4.5 * crest(angle)))
            return (radius - 0.5 * (1 - crest(angle)) * share,
                    height + slope * (edge - max(radius, 7.4)) * share)
        result.append(ring)

    for step in range(1, 13):
        petal(edge - (edge - 7.4) * step / 12, 2.5, 1.0)
    for step in range(1, 15):
        turn = math.pi / 2 * step / 14
        petal(7.4 - 2.0 * math.sin(turn), 2.5 + 2.0 * (1 - math.cos(turn)), math.cos(turn) ** 2)

    # The head: an ellipsoid that blends into the tilted face.
    def head(turn):
        radius, height = 8.2 * math.cos(turn), 9.4 + 6.2 * math.sin(turn)
        result.append(lambda angle: (radius, smooth_minimum(
            height, face(radius * math.cos(angle), radius * math.sin(angle)))))

    lowest, highest = -math.acos(5.4 / 8.2), math.acos(5.2 / 8.2)
    for step in range(61):
        head(lowest + (highest - lowest) * step / 60)

    # The wall of the star is vertical.
    def outline(height):
        def ring(angle):
            radius = star(angle)
            return radius, height + face(radius * math.cos(angle), radius * math.sin(angle))
        result.append(ring)

    outline(0.0)
    outline(STAR_HEIGHT)
    return result


def make_mesh():
    """Returns vertices in mm, rounded to a hundredth of a micrometre, and triangles that face outwards."""
    profile = rings()
    vertices = [(0.0, 0.0, 0.0)]
    for ring in profile:
        for segment in range(SEGMENTS):
            angle = 2 * math.pi * segment / SEGMENTS
            radius, height = ring(angle)
            vertices.append((round(radius * math.cos(angle), 5), round(radius * math.sin(angle), 5),
                             round(height, 5)))
    vertices.append((0.0, 0.0, round(FACE_HEIGHT + STAR_HEIGHT + STAR_RIDGE, 5)))

    def index(ring, segment):
        return 1 + ring * SEGMENTS + segment % SEGMENTS

    triangles = []
    top = len(vertices) - 1
    for segment in range(SEGMENTS):
        triangles.append((0, index(0, segment + 1), index(0, segment)))
        for ring in range(len(profile) - 1):
            a, b = index(ring, segment), index(ring, segment + 1)
            c, d = index(ring + 1, segment + 1), index(ring + 1, segment)
            triangles += [(a, b, c), (a, c, d)]
        last = len(profile) - 1
        triangles.append((index(last, segment), index(last, segment + 1), top))
    return vertices, triangles


def normal(a, b, c):
    u, v = [q - p for p, q in zip(a, b)], [q - p for p, q in zip(a, c)]
    cross = (u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0])
    length = math.sqrt(sum(part * part for part in cross))
    return [round(part / length, 6) if length else 0.0 for part in cross]


def write_stl(path, vertices, triangles):
    with open(path, "wb") as file:
        file.write(b"vdbdither sample token, mm".ljust(80))
        file.write(struct.pack("<I", len(triangles)))
        for triangle in triangles:
            corners = [vertices[vertex] for vertex in triangle]
            file.write(struct.pack("<12fH", *normal(*corners), *sum(corners, ()), 0))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("output", help="the STL file to write")
    write_stl(parser.parse_args().output, *make_mesh())
