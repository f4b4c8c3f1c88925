"""Stacks of slices as arrays: reads and writes the folders that docs/manifest.md describes.

Slices are of the formats png, tiff, png1 or tiff1, in folders. The index of a material is its place in the table of the
manifest, from 1; 0 is an empty voxel.
"""

import dataclasses
import hashlib
import json
import pathlib

import numpy as np
from PIL import Image


@dataclasses.dataclass
class Stack:
    """The materials of a box of voxels.

    voxels     uint8 [z, y, x]: index of the material, 0 where nothing is printed
    first      index (x, y, z) of voxels[0, 0, 0] on the lattice
    pitch_mm   pitch of the lattice along x, y, z
    origin_mm  where the centre of the voxel with index (0, 0, 0) lies
    materials  a dictionary with "name", "rgba" and, if known, "linear_rgb" for each material, the first has index 1
    profile    the printer profile as a dictionary; empty if there is none
    """

    voxels: np.ndarray
    first: tuple
    pitch_mm: np.ndarray
    origin_mm: np.ndarray
    materials: list
    profile: dict

    def centre_mm(self, x, y, z):
        """Returns the centres, [..., 3] in mm, of the voxels with these indices in the array."""
        index = np.stack(np.broadcast_arrays(x, y, z), axis=-1) + np.asarray(self.first)
        return index * self.pitch_mm + self.origin_mm


def read_stack(folder):
    """Returns the Stack in `folder`. Raises ValueError if its slices do not suit its manifest."""
    folder = pathlib.Path(folder)
    manifest = json.loads((folder / "manifest.json").read_text())
    kind = manifest["format"]
    if kind not in ("png", "tiff", "png1", "tiff1"):
        raise ValueError(f"{folder}: slices of the format {kind} name no materials")
    low, high = (np.array(manifest["box"][end]) for end in ("min", "max"))
    width, height, layers = manifest["size"]
    padding = manifest["padding"]
    if (width, height) != tuple(high[:2] - low[:2] + 1 + 2 * padding):
        raise ValueError(f"{folder}: the size of the slices is not that of the box and its padding")
    voxels = np.zeros((layers, height, width), np.uint8)
    indices = {entry["name"]: entry["index"] for entry in manifest["materials"]}
    of_colour = _index_of_colour(manifest)
    for entry in manifest["slices"]:
        with Image.open(folder / entry["file"]) as image:
            if image.size != (width, height):
                raise ValueError(f"{folder}: {entry['file']} has another size than the manifest says")
            layer = voxels[entry["layer"] - manifest["first_layer"]]
            if "material" in entry:
                layer[np.asarray(image.convert("1"))] = indices[entry["material"]]
            else:
                layer[...] = of_colour(np.asarray(image.convert("RGBA")), entry["file"])
    return Stack(_upright(voxels, manifest), (low[0], low[1], manifest["first_layer"]), np.array(manifest["pitch_mm"], float),
                 np.array(manifest["origin_mm"], float), _with_profile(manifest), manifest["printer"] or {})


def _upright(voxels, manifest):
    """Returns the voxels with x and y in rising order, without padding. By default the top row of a slice is the maximum of y."""
    if not manifest["flip_y"]:
        voxels = voxels[:, ::-1]
    if manifest["flip_x"]:
        voxels = voxels[:, :, ::-1]
    padding = manifest["padding"]
    inner = slice(padding, -padding or None)
    return np.ascontiguousarray(voxels[:, inner, inner])


def _index_of_colour(manifest):
    """Returns a function from pixels, uint8 [..., 4], and the name of their file to indices of materials."""
    colours = {tuple(manifest["background"]): 0}
    for entry in manifest["materials"]:
        if tuple(entry["rgba"]) in colours and manifest["format"] in ("png", "tiff"):
            raise ValueError(f"the colour of {entry['name']} is that of another material or of the background")
        colours[tuple(entry["rgba"])] = entry["index"]
    keys = np.array([np.array(colour, np.uint8).view(np.uint32)[0] for colour in colours])
    order = np.argsort(keys)
    keys, values = keys[order], np.array(list(colours.values()), np.uint8)[order]

    def look_up(pixels, name):
        packed = np.ascontiguousarray(pixels).view(np.uint32)[..., 0]
        place = np.minimum(np.searchsorted(keys, packed), len(keys) - 1)
        if not np.array_equal(keys[place], packed):
            raise ValueError(f"{name} has a colour of no material")
        return values[place]

    return look_up


def _with_profile(manifest):
    """Returns the materials, with what the printer profile knows about those of the same name."""
    known = {entry["name"]: entry for entry in (manifest["printer"] or {}).get("materials", [])}
    return [{**known.get(entry["name"], {}), "name": entry["name"], "rgba": entry["rgba"]} for entry in manifest["materials"]]


def write_stack(folder, stack):
    """Writes a Stack as a folder of PNG slices with a manifest that has no digest."""
    folder = pathlib.Path(folder)
    folder.mkdir(parents=True)
    palette = np.array([(0, 0, 0, 255)] + [entry["rgba"] for entry in stack.materials], np.uint8)
    layers, height, width = stack.voxels.shape
    slices = []
    for number, layer in enumerate(stack.voxels):
        name = f"slice_{number:05}.png"
        Image.fromarray(palette[layer[::-1]], "RGBA").save(folder / name, compress_level=1)
        slices.append({"layer": int(stack.first[2]) + number, "file": name,
                       "sha256": hashlib.sha256((folder / name).read_bytes()).hexdigest()})
    counts = np.bincount(stack.voxels.ravel(), minlength=len(palette))[1:].tolist()
    low = [int(index) for index in stack.first]
    manifest = {
        "creator": "samples/colour", "printer": stack.profile or None, "format": "png", "grid": "material",
        "pitch_mm": [float(pitch) for pitch in stack.pitch_mm], "origin_mm": [float(place) for place in stack.origin_mm],
        "size": [width, height, layers], "first_layer": low[2], "cropped": {"below": 0, "above": 0},
        "box": {"min": low, "max": [low[0] + width - 1, low[1] + height - 1, low[2] + layers - 1]},
        "padding": 0, "flip_x": False, "flip_y": False, "background": [0, 0, 0, 255],
        "materials": [{"index": number + 1, "name": entry["name"], "rgba": list(entry["rgba"]), "voxels": counts[number],
                       "ml": counts[number] * float(np.prod(stack.pitch_mm)) / 1000}
                      for number, entry in enumerate(stack.materials)],
        "history": [], "slices": slices,
    }
    (folder / "manifest.json").write_text(json.dumps(manifest, indent=1) + "\n")
