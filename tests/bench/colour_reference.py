#!/usr/bin/python3
"""Compares `mesh2sdf --colour` with an independent reference in double precision.

    tests/bench/colour_reference.py build/release/vdbdither MESH… [--texture FILE] [--voxels N]

Meshes are OBJ, glTF with separate buffers, or 3MF. For random voxels the reference finds the nearest point of the mesh
among all triangles, and averages the colour over the box of the voxel, seen on the plane of the triangle, from 12 x 12 x 12
samples. Prints the mean and the 99th percentile of the differences in linear RGB, for all voxels and for those where the
reference itself is almost constant over two voxels (away from edges of the texture).
"""
import argparse
import json
import pathlib
import subprocess
import tempfile
import xml.etree.ElementTree
import zipfile

import numpy as np
import pyopenvdb
from PIL import Image

pitches_mm = {"cubes of 0.1 mm": (0.1, 0.1, 0.1), "Mimaki": (0.042, 0.084, 0.022), "J750": (0.0423333, 0.0846667, 0.014)}
samples = 12


def linear(encoded):
    encoded = np.asarray(encoded, dtype=float)
    return np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)


def texture_of(path):
    image = np.asarray(Image.open(path).convert("RGB"), dtype=float) / 255
    return linear(image)


class Surface:
    """Triangles with a colour at every point: of corners, of a texture, or both."""

    def __init__(self, corners, colours, coordinates=None, texture=None):
        self.corners = np.asarray(corners, dtype=float)
        self.colours = np.asarray(colours, dtype=float)
        self.coordinates = coordinates  # v from top to bottom
        self.texture = texture

    def nearest(self, p):
        """The nearest triangle to p, and the shares of its corners in the nearest point."""
        a, b, c = self.corners[:, 0], self.corners[:, 1], self.corners[:, 2]
        best = np.full(len(a), np.inf)
        shares = np.zeros((len(a), 3))

        def consider(weights, valid):
            point = np.einsum("tc,tcx->tx", weights, self.corners)
            distance = np.where(valid, np.linalg.norm(point - p, axis=1), np.inf)
            better = distance < best
            best[better] = distance[better]
            shares[better] = weights[better]

        for i in range(3):
            start, end = self.corners[:, i], self.corners[:, (i + 1) % 3]
            side = end - start
            length = np.maximum((side * side).sum(axis=1), 1e-300)
            along = np.clip(((p - start) * side).sum(axis=1) / length, 0, 1)
            weights = np.zeros_like(shares)
            weights[:, i] = 1 - along
            weights[:, (i + 1) % 3] = along
            consider(weights, np.ones(len(a), dtype=bool))
        normal = np.cross(b - a, c - a)
        whole = (normal * normal).sum(axis=1)
        weights = np.stack([(np.cross(e - d, p - d) * normal).sum(axis=1) for d, e in ((b, c), (c, a), (a, b))], axis=1)
        weights /= np.maximum(whole, 1e-300)[:, None]
        consider(weights, (weights.min(axis=1) >= 0) & (whole > 0))
        triangle = int(best.argmin())
        return triangle, shares[triangle]

    def mean_around(self, triangle, shares, box):
        colour = shares @ self.colours[triangle]
        if self.texture is None or self.coordinates is None:
            return colour
        a, b, c = self.corners[triangle]
        steps = (np.arange(samples) + 0.5) / samples - 0.5
        offsets = np.stack(np.meshgrid(steps, steps, steps), axis=-1).reshape(-1, 3) * box
        plane = np.stack([b - a, c - a], axis=1)
        within = offsets @ np.linalg.pinv(plane).T  # least squares: the projection on the plane
        uv = self.coordinates[triangle]
        middle = shares @ uv
        at = middle + within @ np.stack([uv[1] - uv[0], uv[2] - uv[0]])
        return colour * self.texture_at(at).mean(axis=0)

    def texture_at(self, uv):
        height, width = self.texture.shape[:2]
        x, y = uv[:, 0] * width - 0.5, uv[:, 1] * height - 0.5
        left, top = np.floor(x).astype(int), np.floor(y).astype(int)
        u, v = (x - left)[:, None], (y - top)[:, None]

        def texel(column, row):
            return self.texture[row % height, column % width]

        return (texel(left, top) * (1 - u) + texel(left + 1, top) * u) * (1 - v) + (
            texel(left, top + 1) * (1 - u) + texel(left + 1, top + 1) * u
        ) * v


def read_obj(path, texture):
    vertices, colours, coordinates, faces, faces_uv = [], [], [], [], []
    for line in open(path):
        words = line.split()
        if not words:
            continue
        if words[0] == "v":
            vertices.append([float(w) for w in words[1:4]])
            colours.append(linear([float(w) for w in words[4:7]]) if len(words) > 6 else [1, 1, 1])
        elif words[0] == "vt":
            coordinates.append([float(words[1]), 1 - float(words[2])])
        elif words[0] == "f":
            corners = [w.split("/") for w in words[1:]]
            for i in range(1, len(corners) - 1):
                faces.append([int(corners[n][0]) - 1 for n in (0, i, i + 1)])
                if coordinates:
                    faces_uv.append([int(corners[n][1]) - 1 for n in (0, i, i + 1)])
    vertices, colours = np.array(vertices), np.array(colours)
    uv = np.array(coordinates)[faces_uv] if coordinates and texture else None
    return Surface(vertices[faces], colours[faces], uv, texture_of(texture) if texture else None)


def read_gltf(path, _):
    gltf = json.load(open(path))
    folder = pathlib.Path(path).parent
    buffers = [(folder / b["uri"]).read_bytes() for b in gltf["buffers"]]
    kinds = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
    sizes = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}

    def values(index):
        accessor = gltf["accessors"][index]
        view = gltf["bufferViews"][accessor["bufferView"]]
        kind = np.dtype(kinds[accessor["componentType"]])
        count, size = accessor["count"], sizes[accessor["type"]]
        stride = view.get("byteStride", kind.itemsize * size)
        begin = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
        data = buffers[view["buffer"]]
        rows = [np.frombuffer(data, kind, size, begin + n * stride) for n in range(count)]
        array = np.array(rows, dtype=float)
        return array / np.iinfo(kind).max if accessor.get("normalized") else array

    surfaces = []

    def visit(index, parent):
        node = gltf["nodes"][index]
        local = np.eye(4)
        if "matrix" in node:
            local = np.array(node["matrix"]).reshape(4, 4).T
        else:
            x, y, z, w = node.get("rotation", (0, 0, 0, 1))
            local[:3, :3] = np.array(
                [
                    [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                    [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                    [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
                ]
            ) @ np.diag(node.get("scale", (1, 1, 1)))
            local[:3, 3] = node.get("translation", (0, 0, 0))
        world = parent @ local
        if "mesh" in node:
            for primitive in gltf["meshes"][node["mesh"]]["primitives"]:
                attributes = primitive["attributes"]
                position = values(attributes["POSITION"]) @ world[:3, :3].T + world[:3, 3]
                faces = values(primitive["indices"]).astype(int).reshape(-1, 3)
                material = gltf["materials"][primitive["material"]] if "material" in primitive else {}
                rough = material.get("pbrMetallicRoughness", {})
                colour = np.ones_like(position) * rough.get("baseColorFactor", [1, 1, 1, 1])[:3]
                if "COLOR_0" in attributes:
                    colour = colour * values(attributes["COLOR_0"])[:, :3]
                texture = uv = None
                if "baseColorTexture" in rough:
                    image = gltf["images"][gltf["textures"][rough["baseColorTexture"]["index"]]["source"]]
                    texture = texture_of(folder / image["uri"])
                    uv = values(attributes["TEXCOORD_0"])[faces]
                surfaces.append(Surface(position[faces], colour[faces], uv, texture))
        for child in node.get("children", ()):
            visit(child, world)

    for root in gltf["scenes"][gltf.get("scene", 0)]["nodes"]:
        visit(root, np.eye(4))
    return surfaces


def read_3mf(path, _):
    archive = zipfile.ZipFile(path)
    name = [n for n in archive.namelist() if n.endswith(".model")][0]
    root = xml.etree.ElementTree.fromstring(archive.read(name))
    core = "{http://schemas.microsoft.com/3dmanufacturing/core/2015/02}"
    materials = "{http://schemas.microsoft.com/3dmanufacturing/material/2015/02}"
    groups = {}
    for group in root.iter(materials + "colorgroup"):
        groups[group.get("id")] = [c.get("color") for c in group.iter(materials + "color")]
    for group in root.iter(core + "basematerials"):
        groups[group.get("id")] = [c.get("displaycolor") for c in group.iter(core + "base")]

    def colour(group, index):
        text = groups[group][int(index)]
        return linear([int(text[n : n + 2], 16) / 255 for n in (1, 3, 5)])

    objects = {}
    for entry in root.iter(core + "object"):
        vertices = [[float(v.get(k)) for k in "xyz"] for v in entry.iter(core + "vertex")]
        corners, colours = [], []
        for t in entry.iter(core + "triangle"):
            corners.append([vertices[int(t.get(k))] for k in ("v1", "v2", "v3")])
            group = t.get("pid", entry.get("pid"))
            if group is None or group not in groups:
                colours.append(np.ones((3, 3)))
                continue
            first = t.get("p1", entry.get("pindex", "0"))
            colours.append([colour(group, t.get(k, first)) for k in ("p1", "p2", "p3")])
        objects[entry.get("id")] = (np.array(corners), np.array(colours))
    corners, colours = [], []
    for item in root.iter(core + "item"):
        matrix = np.array([float(w) for w in item.get("transform", "1 0 0 0 1 0 0 0 1 0 0 0").split()]).reshape(4, 3)
        mesh, paint = objects[item.get("objectid")]
        if len(mesh):
            corners.append(mesh @ matrix[:3] + matrix[3])
            colours.append(paint)
    return Surface(np.concatenate(corners), np.concatenate(colours))


def joined(surfaces, length):
    """One list of triangles; textures stay with theirs."""
    if isinstance(surfaces, Surface):
        surfaces = [surfaces]
    low = np.min([s.corners.min(axis=(0, 1)) for s in surfaces], axis=0)
    high = np.max([s.corners.max(axis=(0, 1)) for s in surfaces], axis=0)
    for surface in surfaces:
        surface.corners *= length / (high - low).max()
    return surfaces


def reference(surfaces, p, box):
    found = []
    for surface in surfaces:
        triangle, shares = surface.nearest(p)
        point = shares @ surface.corners[triangle]
        found.append((np.linalg.norm(point - p), surface, triangle, shares))
    _, surface, triangle, shares = min(found, key=lambda f: f[0])
    mean = surface.mean_around(triangle, shares, box)
    wide = surface.mean_around(triangle, shares, 3 * box)
    return mean, wide


def compare(program, path, texture, length, count):
    reader = {".obj": read_obj, ".gltf": read_gltf, ".3mf": read_3mf}[pathlib.Path(path).suffix]
    surfaces = joined(reader(path, texture), length)
    for name, pitch in pitches_mm.items():
        with tempfile.TemporaryDirectory() as folder:
            out = f"{folder}/colour.vdb"
            command = [program, "mesh2sdf", path, "--fit", f"{length}mm", "--pitch", ",".join(f"{p}mm" for p in pitch)]
            command += ["--colour", "--colour-depth", "0", "-o", out, "--quiet"]
            if texture:
                command += ["--texture", texture]
            subprocess.run(command, check=True, stderr=subprocess.DEVNULL)
            grid = pyopenvdb.read(out, "Cd")
        voxels = []
        random = np.random.default_rng(1)
        for n, item in enumerate(grid.iterOnValues()):
            if item.count == 1:
                voxels.append((item.min, item.value))
        chosen = random.choice(len(voxels), min(count, len(voxels)), replace=False)
        errors, calm = [], []
        for n in chosen:
            index, value = voxels[n]
            mean, wide = reference(surfaces, np.array(index) * pitch, np.array(pitch))
            errors.append(np.abs(mean - value).max())
            calm.append(np.abs(mean - wide).max() < 0.02)
        errors, calm = np.array(errors), np.array(calm)
        print(
            f"{pathlib.Path(path).name} | {name} | {len(voxels)} | {errors.mean():.4f} | {np.percentile(errors, 99):.4f} | "
            f"{calm.mean():.2f} | {errors[calm].mean():.4f} | {np.percentile(errors[calm], 99):.4f}"
        )


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program")
    parser.add_argument("meshes", nargs="+")
    parser.add_argument("--texture")
    parser.add_argument("--fit", type=float, default=10, help="longest side in mm")
    parser.add_argument("--voxels", type=int, default=600)
    given = parser.parse_args()
    print("mesh | lattice | voxels | mean | 99 % | calm | mean of calm | 99 % of calm")
    for mesh in given.meshes:
        compare(given.program, mesh, given.texture, given.fit, given.voxels)


if __name__ == "__main__":
    main()
