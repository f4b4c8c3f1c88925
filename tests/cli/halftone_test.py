"""From colours to slices of materials."""

import json
import unittest

import numpy
import pyopenvdb
from PIL import Image

import meshes
from colour_test import write_box, write_letter
from program import ProgramTest

PRINTER = ("--printer", "mimaki-3duj-553")
SMALL_MASK = ("--size", "16")


class Halftones(ProgramTest):
    def setUp(self):
        super().setUp()
        write_letter(self.folder / "letter.png")
        write_box(self.folder / "part.obj")
        (self.folder / "part.mtl").write_text("newmtl lettered\nmap_Kd letter.png\nnewmtl plain\nKd 0.2 0.4 0.8\n")

    def slices(self, name):
        """Returns what the stack holds besides its history: the digests of the slices, and the voxels of each material."""
        manifest = json.loads((self.folder / name / "manifest.json").read_text())
        return ([entry["sha256"] for entry in manifest["slices"]],
                {entry["name"]: entry["voxels"] for entry in manifest["materials"]})

    def test_every_way_to_run_gives_the_same_slices(self):
        source = ("mesh2sdf", "part.obj", *PRINTER, "--colour")
        self.succeed(*source, "!", "dither", "!", "halftone", *SMALL_MASK, "!", "slice-export", "whole")
        expected = self.slices("whole")
        self.assertGreater(len(expected[0]), 30)
        for ink in ("white", "cyan", "magenta", "yellow"):
            self.assertGreater(expected[1][ink], 100, ink)
        self.assertEqual(expected[1]["clear"], 0)
        self.succeed(*source, "!", "dither", "!", "halftone", *SMALL_MASK, "!", "slice-export", "slabs", "--slab", "8", "--threads", "3")
        self.assertEqual(self.slices("slabs"), expected)
        self.succeed(*source, "!", "separate", "!", "dither", "!", "halftone", *SMALL_MASK, "!", "slice-export", "separated")
        self.assertEqual(self.slices("separated"), expected)
        self.succeed(*source, "!", "dither", "-o", "solid.vdb")
        self.succeed("halftone", "solid.vdb", *SMALL_MASK, "!", "slice-export", "file")
        self.assertEqual(self.slices("file"), expected)
        self.shell("mesh2sdf part.obj --printer mimaki-3duj-553 --colour | dither | halftone --size 16 | slice-export piped")
        self.assertEqual(self.slices("piped"), expected)

    def test_the_letter_is_printed_in_its_colours(self):
        self.succeed("mesh2sdf", "part.obj", *PRINTER, "--colour", "!", "dither", "--mask", "none", "!", "halftone", *SMALL_MASK,
                     "--black", "0", "--white", "absolute", "!", "slice-export", "out")
        manifest = json.loads((self.folder / "out/manifest.json").read_text())
        names = [entry["name"] for entry in manifest["materials"]]
        colours = {tuple(entry["rgba"][:3]): index for index, entry in enumerate(manifest["materials"])}
        top = max(entry["layer"] for entry in manifest["slices"] if "layer" in entry)
        files = {entry["layer"]: entry["file"] for entry in manifest["slices"]}
        counts = {"letter": numpy.zeros(len(names)), "ground": numpy.zeros(len(names))}
        for layer in range(top - 14, top - 2):
            picture = numpy.array(Image.open(self.folder / "out" / files[layer]).convert("RGBA"))
            height, width = picture.shape[:2]
            # The stem of the F, and the ground to its right, in shares of the box of 4 mm.
            for place, (x, y) in {"letter": (0.19, 0.5), "ground": (0.75, 0.75)}.items():
                window = picture[int(height * (y - 0.05)):int(height * (y + 0.05)), int(width * (x - 0.04)):int(width * (x + 0.04))]
                for pixel in window.reshape(-1, 4):
                    if pixel[3]:
                        counts[place][colours[tuple(pixel[:3])]] += 1
        shares = {place: dict(zip(names, found / found.sum())) for place, found in counts.items()}
        self.assertGreater(shares["letter"]["magenta"], 0.4, shares)
        self.assertGreater(shares["letter"]["yellow"], 0.05, shares)
        self.assertGreater(shares["ground"]["white"], 0.9, shares)

    def test_a_density_of_another_program_becomes_two_materials(self):
        meshes.write_stl(self.folder / "box.stl", meshes.box((1, 1, 1)))
        self.succeed("mesh2sdf", "box.stl", "--pitch", "0.05mm,0.05mm,0.05mm", "!", "dither", "--mask", "none", "-o", "solid.vdb")
        density = pyopenvdb.FloatGrid()
        density.name = "density"
        density.transform = pyopenvdb.createLinearTransform(0.05)
        density.fill((-5, -5, -5), (40, 40, 40), 0.25)
        grids = [density] + list(pyopenvdb.readAll(str(self.folder / "solid.vdb"))[0])
        pyopenvdb.write(str(self.folder / "field.vdb"), grids)
        self.succeed("halftone", "field.vdb", "--inks", "white,black", "--coverages", "density=black", "--rest", "white", *SMALL_MASK,
                     "!", "slice-export", "out")
        _, voxels = self.slices("out")
        self.assertAlmostEqual(voxels["black"] / sum(voxels.values()), 0.25, delta=0.01)

    def test_what_is_no_coverage_is_refused_in_a_line(self):
        meshes.write_stl(self.folder / "box.stl", meshes.box((1, 1, 1)))
        self.succeed("mesh2sdf", "box.stl", "--pitch", "0.05mm,0.05mm,0.05mm", "!", "dither", "--mask", "none", "-o", "solid.vdb")
        for value, message in ((-1, "coverages must be finite and not negative"), (0, "the coverages are all 0 at voxel [0, 0, 0]")):
            density = pyopenvdb.FloatGrid()
            density.name = "density"
            density.transform = pyopenvdb.createLinearTransform(0.05)
            density.fill((0, 0, 0), (7, 7, 7), value)
            pyopenvdb.write(str(self.folder / "field.vdb"), [density] + list(pyopenvdb.readAll(str(self.folder / "solid.vdb"))[0]))
            self.refuse(1, message, "halftone", "field.vdb", "--inks", "white,black",
                        "--coverages", "density=black", *SMALL_MASK, "!", "slice-export", "out")


if __name__ == "__main__":
    unittest.main()
