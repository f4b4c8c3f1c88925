"""measure and mesh-export: alone, at the end of a chain, and at the end of a pipe."""

import json
import unittest

import meshes
from program import MIMAKI, ProgramTest


class MeasureTest(ProgramTest):
    def setUp(self):
        super().setUp()
        meshes.write_stl(self.folder / "part.stl", meshes.turned(meshes.box((2, 2, 1)), 2, 3))

    def test_a_mesh_file_is_measured_without_a_chain(self):
        meshes.write_stl(self.folder / "result.stl",
                         meshes.turned(meshes.box((2.02, 2.02, 1.02), (-0.01, -0.01, -0.01)), 2, 3))
        figures = json.loads(self.succeed("measure", "result.stl", "--reference", "part.stl", "--json"))
        self.assertAlmostEqual(figures["area"]["p50_mm"], 0.01, 5)
        words = self.succeed("measure", "result.stl", "--reference", "part.stl").decode()
        self.assertIn("by area", words)

    def test_a_mesh_file_is_no_part_of_a_chain(self):
        message = "measure: works on 'part.stl' only if it is the whole command line, not in a chain"
        alone = ("measure", "part.stl", "--reference", "part.stl")
        self.refuse(2, message, "mesh2sdf", "part.stl", *MIMAKI, "!", *alone)
        self.refuse(2, message, *alone, "!", "write", "a.vdb")
        for option in (("-i", "a.vdb"), ("-o", "a.vdb"), ("--layers", "0:8"), ("--explain",)):
            self.refuse(2, ": only for chains, not with a file to work on", *alone, *option)

    def test_a_mesh_file_takes_the_options_of_every_operator(self):
        alone = ("measure", "part.stl", "--reference", "part.stl", "--report", "report.json")
        self.assertEqual(self.succeed(*alone, "--threads", "1", "--quiet", "--slab", "8"), b"")
        done = self.run_program(*alone, "--overwrite", "--verbose")
        self.assertEqual((done.returncode, done.stdout), (0, b""))
        self.assertRegex(done.stderr.decode(), r"(?m)^measure +[\d.]+ s +0 voxels .* rms_mm ")
        report = json.loads(self.succeed("render", "part.stl", "part.png", "--json"))
        self.assertEqual([stage["name"] for stage in report["stages"]], ["render"])
        self.assertEqual(report["stages"][0]["counts"]["triangles"], 12)

    def test_a_chain_fused_or_piped_gives_the_same_figures_and_mesh(self):
        self.shell("vdbdither mesh2sdf part.stl --printer mimaki-3duj-553 ! dither --mask white ! simulate ! "
                   "mesh-export fused.ply ! measure --reference part.stl --report fused.json")
        self.shell("mesh2sdf part.stl --printer mimaki-3duj-553 | dither --mask white | simulate | "
                   "mesh-export piped.ply")
        self.shell("mesh2sdf part.stl --printer mimaki-3duj-553 | dither --mask white | simulate | "
                   "measure --reference part.stl --report piped.json")
        for kind in ("ply", "json"):
            self.assertEqual((self.folder / f"fused.{kind}").read_bytes(), (self.folder / f"piped.{kind}").read_bytes())

    def test_dithering_leaves_less_of_the_steps_than_plain_voxels_after_the_print(self):
        # The part is large; its edges, which the print rounds, hardly count.
        meshes.write_stl(self.folder / "large.stl", meshes.turned(meshes.box((5, 5, 5)), 2, 3))
        staircase = {}
        for mask in ("none", "white"):
            figures = json.loads(self.succeed(
                "mesh2sdf", "large.stl", *MIMAKI, "!", "dither", "--mask", mask, "!", "simulate", "!", "measure",
                "--reference", "large.stl", "--json"))
            self.assertEqual(figures["components"]["count"], 1)
            staircase[mask] = figures["axes"]["y"]["staircase_mm"]
        self.assertLess(staircase["white"], 0.3 * staircase["none"])

    def test_a_chain_needs_a_surface_and_a_reference(self):
        chain = ("mesh2sdf", "part.stl", *MIMAKI, "!", "dither", "--mask", "white", "!")
        self.refuse(2, "measure: '--reference' is missing", *chain, "measure")
        self.refuse(1, "mesh-export: no grid 'printed'; there is 'solid' 'surface'", *chain, "mesh-export", "a.stl",
                    "--grid", "printed")


if __name__ == "__main__":
    unittest.main()
