"""Closed meshes made of triangles, in mm, for the tests of the whole program."""

import math
import struct


def box(size, corner=(0, 0, 0)):
    (x0, y0, z0), (x1, y1, z1) = corner, [c + s for c, s in zip(corner, size)]
    v = [(x, y, z) for z in (z0, z1) for y in (y0, y1) for x in (x0, x1)]
    faces = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    return [t for a, b, c, d in faces for t in ((v[a], v[b], v[c]), (v[a], v[c], v[d]))]


def lathe(profile, segments=48):
    """Returns the solid of revolution of `profile`: (radius, z) points from its bottom on the axis to its top."""
    def point(ring, segment):
        radius, z = profile[ring]
        angle = 2 * math.pi * (segment % segments) / segments
        return (radius * math.cos(angle), radius * math.sin(angle), z)

    triangles = []
    for ring in range(len(profile) - 1):
        for segment in range(segments):
            a, b = point(ring, segment), point(ring, segment + 1)
            c, d = point(ring + 1, segment + 1), point(ring + 1, segment)
            if profile[ring][0] > 0:
                triangles.append((a, b, c))
            if profile[ring + 1][0] > 0:
                triangles.append((a, c, d))
    return triangles


def sphere(radius, rings=24):
    turns = [math.pi * (ring / rings - 0.5) for ring in range(rings + 1)]
    profile = [(radius * math.cos(turn), radius * math.sin(turn)) for turn in turns]
    profile[0], profile[-1] = (0, -radius), (0, radius)
    return lathe(profile, 2 * rings)


def cylinder(radius, height):
    return lathe([(0, 0), (radius, 0), (radius, height), (0, height)])


def turned(triangles, x_degrees, y_degrees):
    """Returns the triangles rotated about x, then about y."""
    def turn(point):
        x, y, z = point
        for degrees, axis in ((x_degrees, 0), (y_degrees, 1)):
            c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
            if axis == 0:
                y, z = c * y - s * z, s * y + c * z
            else:
                x, z = c * x + s * z, c * z - s * x
        return (x, y, z)

    return [tuple(turn(corner) for corner in triangle) for triangle in triangles]


def write_stl(path, triangles):
    with open(path, "wb") as file:
        file.write(b"mm".ljust(80))
        file.write(struct.pack("<I", len(triangles)))
        for triangle in triangles:
            file.write(struct.pack("<12fH", 0, 0, 0, *sum(triangle, ()), 0))


def write_textured(path, triangles):
    """Writes an OBJ with texture coordinates that show a texture from the front, and no material."""
    corners = [corner for triangle in triangles for corner in triangle]
    low = [min(corner[axis] for corner in corners) for axis in (0, 2)]
    size = [max(corner[axis] for corner in corners) - least for axis, least in zip((0, 2), low)]
    lines = [f"v {x} {y} {z}" for x, y, z in corners]
    lines += [f"vt {(x - low[0]) / size[0]} {(z - low[1]) / size[1]}" for x, _, z in corners]
    lines += [f"f {n}/{n} {n + 1}/{n + 1} {n + 2}/{n + 2}" for n in range(1, len(corners), 3)]
    path.write_text("\n".join(lines) + "\n")


def write_coloured(path, triangles):
    """Writes a text PLY whose vertices have colours by their positions."""
    corners = [corner for triangle in triangles for corner in triangle]
    sides = [(min(side), max(side)) for side in zip(*corners)]
    lines = ["ply", "format ascii 1.0", f"element vertex {len(corners)}"]
    lines += [f"property float {axis}" for axis in "xyz"] + [f"property uchar {channel}" for channel in ("red", "green", "blue")]
    lines += [f"element face {len(triangles)}", "property list uchar int vertex_indices", "end_header"]
    for corner in corners:
        shares = [round(255 * (x - low) / max(high - low, 1e-9)) for x, (low, high) in zip(corner, sides)]
        lines.append(" ".join(map(str, (*corner, *shares))))
    lines += [f"3 {3 * n} {3 * n + 1} {3 * n + 2}" for n in range(len(triangles))]
    path.write_text("\n".join(lines) + "\n")
