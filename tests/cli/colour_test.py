"""Colours from a textured mesh to grids, meshes and pictures."""

import unittest

import numpy
import pyopenvdb
from PIL import Image

import meshes
from program import ProgramTest

PITCH = ("--pitch", "0.1mm,0.1mm,0.1mm")

# The letter F, as a picture of 8 x 8 squares. Its mirror images and turns are all different.
LETTER = [
    "........",
    ".#####..",
    ".#......",
    ".#......",
    ".####...",
    ".#......",
    ".#......",
    "........",
]
RED, WHITE = (200, 30, 40), (240, 240, 235)


def linear(byte):
    share = byte / 255
    return share / 12.92 if share <= 0.04045 else ((share + 0.055) / 1.055) ** 2.4


def write_letter(path, mode="RGB"):
    image = Image.new("RGB", (64, 64))
    for y in range(64):
        for x in range(64):
            image.putpixel((x, y), RED if LETTER[y // 8][x // 8] == "#" else WHITE)
    image.convert(mode).save(path)


def write_box(path, material="lettered", library="part.mtl"):
    """A box of 4 x 4 x 1 mm whose top shows a texture upright, seen with x to the right and y upwards."""
    lines = [f"mtllib {library}"] if library else []
    lines += [f"v {x} {y} {z}" for z in (0, 1) for y in (0, 4) for x in (0, 4)]
    lines += ["vt 0 0", "vt 1 0", "vt 1 1", "vt 0 1"]
    if material:
        lines += [f"usemtl {material}"]
    lines += ["f 5/1 6/2 8/3 7/4"]
    if material:
        lines += ["usemtl plain"]
    lines += ["f 1 3 4 2", "f 1 2 6 5", "f 3 7 8 4", "f 1 5 7 3", "f 2 4 8 6"]
    path.write_text("\n".join(lines) + "\n")


class Colours(ProgramTest):
    def setUp(self):
        super().setUp()
        write_letter(self.folder / "letter.png")
        write_box(self.folder / "part.obj")
        (self.folder / "part.mtl").write_text("newmtl lettered\nmap_Kd letter.png\nnewmtl plain\nKd 0.2 0.4 0.8\n")

    def colour_at(self, file, voxel, grid="Cd"):
        return pyopenvdb.read(str(self.folder / file), grid).getConstAccessor().probeValue(voxel)

    def assert_letter(self, file, z=10):
        """Looks for the letter in a layer: squares of 5 x 5 voxels, read from the top row down."""
        accessor = pyopenvdb.read(str(self.folder / file), "Cd").getConstAccessor()
        for row, line in enumerate(LETTER):
            for column, square in enumerate(line):
                voxel = (5 * column + 2, 40 - (5 * row + 3), z)
                value, active = accessor.probeValue(voxel)
                self.assertTrue(active, voxel)
                expected = [linear(c) for c in (RED if square == "#" else WHITE)]
                self.assertLess(numpy.abs(numpy.subtract(value, expected)).max(), 0.01, (row, column))

    def test_a_letter_is_upright(self):
        self.succeed("mesh2sdf", "part.obj", *PITCH, "--colour", "-o", "colour.vdb")
        self.assert_letter("colour.vdb")
        value, active = self.colour_at("colour.vdb", (0, 20, 5))
        self.assertTrue(active)
        for got, encoded in zip(value, (0.2, 0.4, 0.8)):
            self.assertAlmostEqual(got, linear(255 * encoded), places=5)

    def test_the_same_bytes_for_threads_slabs_and_pipes(self):
        chain = ["mesh2sdf", "part.obj", *PITCH, "--colour"]
        self.succeed(*chain, "-o", "whole.vdb")
        whole = (self.folder / "whole.vdb").read_bytes()
        self.succeed(*chain, "-o", "slabs.vdb", "--slab", "8", "--threads", "1")
        self.assertEqual((self.folder / "slabs.vdb").read_bytes(), whole)
        self.shell(f"vdbdither {' '.join(chain)} | vdbdither write piped.vdb")
        self.assertEqual((self.folder / "piped.vdb").read_bytes(), whole)

    def test_the_distance_does_not_depend_on_colours(self):
        self.succeed("mesh2sdf", "part.obj", *PITCH, "-o", "plain.vdb")
        self.succeed("mesh2sdf", "part.obj", *PITCH, "--colour", "-o", "colour.vdb")
        grids = [pyopenvdb.read(str(self.folder / name), "surface") for name in ("plain.vdb", "colour.vdb")]
        self.assertEqual(grids[0].activeVoxelCount(), grids[1].activeVoxelCount())
        values = [[(item.min, item.value) for item in grid.iterOnValues()] for grid in grids]
        self.assertEqual(values[0], values[1])

    def test_the_depth_is_that_of_the_option(self):
        for depth, deepest in (("0.25mm", 0.25), ("0.45mm", 0.45)):
            self.succeed("mesh2sdf", "part.obj", *PITCH, "--colour", "--colour-depth", depth, "-o", "colour.vdb", "--overwrite")
            coloured = [self.colour_at("colour.vdb", (20, 20, z))[1] for z in range(11)]
            expected = [min(z, 10 - z) * 0.1 < deepest for z in range(11)]
            self.assertEqual(coloured, expected)

    def test_a_depth_beyond_the_part_needs_no_more_memory(self):
        said = [self.succeed("mesh2sdf", "part.obj", *PITCH, "--colour", "--colour-depth", depth, "-o", "out.vdb", "--explain")
                for depth in ("0.5mm", "1000mm")]
        memory = [next(line for line in text.splitlines() if line.startswith(b"memory")) for text in said]
        self.assertEqual(memory[0], memory[1])

    def test_a_ply_takes_a_texture_that_it_does_not_name(self):
        vertices = "".join(f"{x} {y} {z} {x / 4} {y / 4}\n" for z in (0, 1) for y in (0, 4) for x in (0, 4))
        (self.folder / "part.ply").write_text(
            "ply\nformat ascii 1.0\nelement vertex 8\nproperty float x\nproperty float y\nproperty float z\nproperty float s\n"
            "property float t\nelement face 6\nproperty list uchar int vertex_indices\nend_header\n" + vertices
            + "4 4 5 7 6\n4 0 2 3 1\n4 0 1 5 4\n4 2 6 7 3\n4 0 4 6 2\n4 1 3 7 5\n")
        self.succeed("mesh2sdf", "part.ply", *PITCH, "--colour", "--texture", "letter.png", "-o", "colour.vdb")
        self.assert_letter("colour.vdb")

    def test_colours_pass_through_other_operators(self):
        self.succeed("mesh2sdf", "part.obj", *PITCH, "--colour", "!", "normals", "!", "dither", "-o", "solid.vdb")
        self.assert_letter("solid.vdb")
        self.succeed("read", "solid.vdb", "!", "write", "half.vdb", "--half")
        self.assert_letter("half.vdb")

    def test_csg_takes_the_colours_of_both(self):
        (self.folder / "red.ply").write_text(
            "ply\nformat ascii 1.0\nelement vertex 8\nproperty float x\nproperty float y\nproperty float z\n"
            "property uchar red\nproperty uchar green\nproperty uchar blue\nelement face 6\n"
            "property list uchar int vertex_indices\nend_header\n"
            + "".join(f"{x} {y} {z} 255 0 0\n" for z in (0, 1) for y in (0, 4) for x in (6, 8))
            + "4 4 5 7 6\n4 0 2 3 1\n4 0 1 5 4\n4 2 6 7 3\n4 0 4 6 2\n4 1 3 7 5\n")
        self.succeed("mesh2sdf", "red.ply", *PITCH, "--colour", "-o", "red.vdb")
        self.succeed("mesh2sdf", "part.obj", *PITCH, "--colour", "!", "csg", "--union", "red.vdb", "-o", "both.vdb")
        self.assert_letter("both.vdb")
        self.assertEqual(self.colour_at("both.vdb", (70, 20, 10)), ((1, 0, 0), True))

    def test_meshes_and_pictures_show_colours(self):
        self.succeed("mesh2sdf", "part.obj", *PITCH, "--colour", "!", "mesh-export", "out.ply", "!", "mesh-export", "out.glb",
                     "!", "mesh-export", "out.drc", "!", "render", "grid.png", "--elevation", "90", "--azimuth", "0",
                     "--projection", "orthographic", "--pixel", "0.1mm", "--samples", "4")
        for name in ("out.ply", "out.glb", "out.drc"):
            self.succeed("mesh2sdf", name, *PITCH, "--colour", "-o", "again.vdb", "--overwrite")
            self.assert_letter("again.vdb")
        self.succeed("render", "part.obj", "mesh.png", "--elevation", "90", "--azimuth", "0", "--projection",
                     "orthographic", "--pixel", "0.1mm", "--samples", "4")
        for name in ("grid.png", "mesh.png"):
            picture = numpy.asarray(Image.open(self.folder / name).convert("RGB"), dtype=int)
            margin = (picture.shape[0] - 40) // 2
            for row, line in enumerate(LETTER):
                for column, square in enumerate(line):
                    red, green, _ = picture[margin + 5 * row + 2, margin + 5 * column + 2]
                    self.assertEqual(red > 2 * green, square == "#", (name, row, column))

    def test_a_texture_for_a_mesh_that_names_none(self):
        write_box(self.folder / "bare.obj", material="", library="")
        self.succeed("mesh2sdf", "bare.obj", *PITCH, "--colour", "--texture", "letter.png", "-o", "colour.vdb")
        self.assert_letter("colour.vdb")
        self.refuse(2, "--texture needs --colour", "mesh2sdf", "bare.obj", *PITCH, "--texture", "letter.png", "-o", "a.vdb")
        meshes.write_stl(self.folder / "box.stl", meshes.box((1, 1, 1)))
        self.refuse(2, "--texture: no mesh has texture coordinates", "mesh2sdf", "box.stl", *PITCH, "--colour",
                    "--texture", "letter.png", "-o", "a.vdb")

    def test_a_mesh_without_colours_is_white(self):
        meshes.write_stl(self.folder / "box.stl", meshes.box((1, 1, 1)))
        done = self.run_program("mesh2sdf", "box.stl", *PITCH, "--colour", "-o", "white.vdb")
        self.assertEqual(done.returncode, 0)
        self.assertIn(b"no mesh has colours; all voxels become white", done.stderr)
        self.assertEqual(self.colour_at("white.vdb", (5, 5, 10)), ((1, 1, 1), True))

    def test_a_missing_texture_matters_only_with_colours(self):
        (self.folder / "letter.png").unlink()
        self.succeed("mesh2sdf", "part.obj", *PITCH, "-o", "plain.vdb")
        self.refuse(1, "letter.png", "mesh2sdf", "part.obj", *PITCH, "--colour", "-o", "a.vdb")

    def test_textures_outside_of_the_folder_are_refused(self):
        (self.folder / "inner").mkdir()
        write_box(self.folder / "inner/part.obj")
        (self.folder / "inner/part.mtl").write_text("newmtl lettered\nmap_Kd ../letter.png\nnewmtl plain\n")
        self.refuse(1, "lies outside of the folder of the mesh", "mesh2sdf", "inner/part.obj", *PITCH, "--colour", "-o", "a.vdb")
        (self.folder / "inner/letter.png").symlink_to("../letter.png")
        self.refuse(1, "leads outside of the folder of the mesh", "mesh2sdf", "inner/part.obj", *PITCH, "--colour", "-o", "a.vdb")

    def test_opacity_is_a_grid_of_its_own(self):
        (self.folder / "part.mtl").write_text("newmtl lettered\nKd 1 1 1\nd 0.25\nnewmtl plain\n")
        self.succeed("mesh2sdf", "part.obj", *PITCH, "--colour", "-o", "clear.vdb")
        self.assertEqual(self.colour_at("clear.vdb", (20, 20, 10), "Alpha"), (0.25, True))
        self.assertEqual(self.colour_at("clear.vdb", (20, 20, 0), "Alpha"), (1.0, True))


if __name__ == "__main__":
    unittest.main()
