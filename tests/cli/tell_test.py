"""Reports of info, compare and stats about files and pipes."""

import json
import math
import os
import subprocess
import unittest

import meshes
from program import MIMAKI, ProgramTest

RADIUS_MM = 0.8
CHAIN = f"mesh2sdf part.stl {' '.join(MIMAKI)} ! normals ! dither ! material-assign"


class Tell(ProgramTest):
    def setUp(self):
        super().setUp()
        meshes.write_stl(self.folder / "part.stl", meshes.sphere(RADIUS_MM, rings=60))
        self.succeed("run", f"{CHAIN} -o part.vdb")

    def test_info_reports_the_same_for_a_file_a_pipe_and_a_chain(self):
        told = self.succeed("info", "part.vdb").decode()
        self.assertEqual(told, self.succeed("info", "-i", "part.vdb").decode())
        self.assertEqual(told, self.shell(f"vdbdither {CHAIN} | vdbdither info").decode())
        self.assertEqual(told, self.succeed("run", f"{CHAIN} ! info --slab 8").decode())
        for pattern in (r"lattice +0\.042 x 0\.084 x 0\.022 mm", r"printer +mimaki-3duj-553",
                        r"surface +float, level set: \d+ voxels", r"N +vec3s, covariant normalize: ",
                        r"1 white: \d+ voxels", r"history +mesh2sdf part\.stl"):
            self.assertRegex(told, pattern)

    def test_info_reports_json(self):
        told = json.loads(self.succeed("info", "part.vdb", "--json"))
        self.assertEqual(told["lattice"]["pitch_mm"], [0.042, 0.084, 0.022])
        grids = {grid["name"]: grid for grid in told["grids"]}
        self.assertEqual(set(grids), {"N", "material", "solid", "surface"})
        self.assertEqual(grids["surface"]["class"], "level set")
        self.assertLess(grids["surface"]["least"], -0.05)
        self.assertEqual(grids["material"]["materials"][0]["name"], "white")
        self.assertEqual(grids["material"]["materials"][0]["voxels"], grids["solid"]["active_voxels"])
        self.assertEqual(len(told["history"]), 4)

    def test_text_goes_to_standard_error_if_voxels_go_to_standard_output(self):
        done = self.run_program("run", f"{CHAIN} ! info ! write")
        self.assertEqual(done.returncode, 0)
        self.assertIn(b"surface   float", done.stderr)
        self.assertEqual(done.stdout, self.succeed("run", CHAIN))

    def test_compare_finds_equal_files_pipes_and_chains_equal(self):
        self.assertEqual(self.succeed("compare", "part.vdb", "part.vdb"), b"equal\n")
        self.assertEqual(self.succeed("run", f"{CHAIN} ! compare part.vdb --slab 8"), b"equal\n")
        self.assertEqual(self.shell(f"vdbdither compare part.vdb <(vdbdither {CHAIN})"), b"equal\n")
        self.assertEqual(self.shell(f"vdbdither {CHAIN} | vdbdither compare <(vdbdither {CHAIN})"), b"equal\n")

    def test_compare_names_what_differs_and_exits_with_1(self):
        self.succeed("run", CHAIN.replace("! dither", "! dither --preset paper --mask white") + " -o other.vdb")
        done = self.run_program("compare", "part.vdb", "other.vdb", "--json")
        self.assertEqual(done.returncode, 1)
        found = {grid["name"]: grid for grid in json.loads(done.stdout)["grids"]}
        self.assertTrue(found["surface"]["equal"])
        self.assertGreater(found["solid"]["voxels"], 100)
        self.assertRegex(done.stderr.decode(), r"^vdbdither compare: not equal to 'other\.vdb': grid 'material' in \d+ voxels, "
                                               r"first at -?\d+ -?\d+ -?\d+, by at most 1; grid 'solid' in ")
        self.succeed("compare", "part.vdb", "other.vdb", "--grids", "surface,N")

    def test_compare_allows_for_a_tolerance(self):
        self.succeed("run", "read part.vdb --grids surface ! write half.vdb --half")
        self.succeed("run", "read part.vdb --grids surface ! write whole.vdb --codec none")
        self.refuse(1, "grid 'surface' in ", "compare", "whole.vdb", "half.vdb")
        self.assertEqual(self.succeed("compare", "whole.vdb", "half.vdb", "--tolerance", "0.0001"), b"equal\n")

    def test_compare_reports_missing_grids_and_other_lattices(self):
        self.succeed("run", "read part.vdb --grids surface ! write one.vdb")
        self.refuse(1, "grid 'N' is missing there; ", "compare", "part.vdb", "one.vdb")
        self.refuse(1, "grid 'N' is there alone; ", "compare", "one.vdb", "part.vdb")
        self.succeed("mesh2sdf", "part.stl", "--printer", "stratasys-j750-27um", "-o", "stratasys.vdb")
        self.refuse(1, "grid 'surface' lies on another lattice", "compare", "one.vdb", "stratasys.vdb")
        self.refuse(2, "compare: 'c.vdb' is not expected", "compare", "a.vdb", "b.vdb", "c.vdb")
        self.refuse(2, "cannot read 'one.vdb' as well", "run", f"{CHAIN} ! compare one.vdb part.vdb")

    def test_stats_measure_a_sphere(self):
        told = json.loads(self.succeed("stats", "part.vdb", "--json", "--histogram", "surface"))
        self.assertAlmostEqual(told["surface"]["area_mm2"] / (4 * math.pi * RADIUS_MM**2), 1, delta=0.005)
        self.assertAlmostEqual(told["materials"][0]["ml"] / (4 / 3 * math.pi * RADIUS_MM**3 / 1000), 1, delta=0.01)
        self.assertEqual(told["materials"][0]["voxels"], told["solid"]["voxels"])
        grids = {grid["name"]: grid for grid in json.loads(self.succeed("info", "part.vdb", "--json"))["grids"]}
        self.assertEqual(sum(bin["voxels"] for bin in told["histogram"]["bins"]), grids["surface"]["active_voxels"])
        self.assertIn("mm2 by marching tetrahedra", self.succeed("run", f"{CHAIN} ! stats").decode())

    def test_a_named_pipe_is_read_as_a_pipe(self):
        os.mkfifo(self.folder / "pipe.vdb")
        writer = subprocess.Popen(["bash", "-c", f"vdbdither {CHAIN} > pipe.vdb"], cwd=self.folder, env=self.environment())
        self.assertEqual(self.succeed("compare", "part.vdb", "pipe.vdb"), b"equal\n")
        self.assertEqual(writer.wait(), 0)

    def foreign(self, name, grids):
        """Writes a .vdb of another program from name, kind and transform of each grid."""
        try:
            import pyopenvdb
        except ImportError:
            self.skipTest("pyopenvdb is not installed")
        made = []
        for grid_name, kind, transform in grids:
            grid = getattr(pyopenvdb, kind)()
            grid.name = grid_name
            grid.transform = transform(pyopenvdb)
            grid.fill((0, 0, 0), (9, 9, 9), (1, 0, 0) if "Vec" in kind else True if "Bool" in kind else 1.5)
            made.append(grid)
        pyopenvdb.write(str(self.folder / name), made)

    @staticmethod
    def cubes(size):
        return lambda vdb: vdb.createLinearTransform(size)

    @staticmethod
    def turned(vdb):
        return vdb.createLinearTransform([[0, 0.1, 0, 0], [-0.1, 0, 0, 0], [0, 0, 0.2, 0], [5, 0, 0, 1]])

    @staticmethod
    def frustum(vdb):
        return vdb.createFrustumTransform((0, 0, 0), (9, 9, 9), 0.5, 1, 0.1)

    def test_unwanted_grids_may_have_other_lattices(self):
        self.foreign("mixed.vdb", [("coarse", "FloatGrid", self.cubes(2.0)), ("fine", "FloatGrid", self.cubes(1.0))])
        self.refuse(1, "grids 'coarse' and 'fine' lie on different lattices", "read", "mixed.vdb", "!", "info")
        self.assertIn("fine      float: 1000 voxels", self.succeed("run", "read mixed.vdb --grids fine ! info").decode())

    def test_info_describes_grids_of_different_lattices_one_by_one(self):
        self.foreign("mixed.vdb", [("coarse", "FloatGrid", self.cubes(2.0)), ("fine", "BoolGrid", self.cubes(1.0))])
        told = self.succeed("info", "mixed.vdb").decode()
        self.assertRegex(told, r"^the grids lie on no common lattice; each by itself:\n"
                               r"coarse    float: 1000 voxels from 0 0 0 to 9 9 9, values 1\.5 to 1\.5, .* leaves\n"
                               r"          voxels of 2 x 2 x 2\n"
                               r"          vdbdither resample mixed\.vdb --grid coarse --printer NAME\n"
                               r"          vdbdither read mixed\.vdb --grids coarse\n"
                               r"fine      bool: 1000 voxels")
        grids = {grid["name"]: grid for grid in json.loads(self.succeed("info", "mixed.vdb", "--json"))["grids"]}
        self.assertEqual(grids["fine"]["takers"], ["resample mixed.vdb --grid fine --printer NAME", "read mixed.vdb --grids fine"])
        self.assertEqual((grids["coarse"]["place"], grids["coarse"]["voxel_size"]), ("plain", [2, 2, 2]))

    def test_info_describes_rotated_grids_and_resample_reads_them(self):
        self.foreign("turned.vdb", [("density", "FloatGrid", self.turned), ("v", "Vec3SGrid", self.turned)])
        told = self.succeed("info", "turned.vdb").decode()
        self.assertIn("          voxels of 0.1 x 0.1 x 0.2, turned, mirrored or sheared: x y z of index i j k are\n"
                      "            0 -0.1 0 5\n", told)
        self.assertIn("only numbers and voxels are brought from a turned lattice", told)
        density = json.loads(self.succeed("info", "turned.vdb", "--json"))["grids"][0]
        self.assertEqual((density["place"], density["matrix"][0]), ("affine", [0, -0.1, 0, 5]))
        command, = density["takers"]
        self.succeed("run", command.replace("NAME", "mimaki-3duj-553") + " --kind fog -o part.vdb --overwrite")
        self.refuse(1, "is turned, mirrored or sheared; resample --grid ", "read", "turned.vdb", "!", "info")

    def test_info_reports_that_no_operator_reads_a_frustum(self):
        self.foreign("camera.vdb", [("density", "FloatGrid", self.frustum)])
        told = self.succeed("info", "camera.vdb").decode()
        self.assertRegex(told, r"^density   float: 1000 voxels from 0 0 0 to 9 9 9, .*\n"
                               r"          voxels of .* in the middle of a frustum\n"
                               r"          no operator takes a frustum; resample it in the tool that it comes from\n$")
        grid, = json.loads(self.succeed("info", "camera.vdb", "--json"))["grids"]
        self.assertEqual((grid["place"], grid["takers"]), ("frustum", []))
        self.refuse(1, "grid 'density' lies in a frustum", "read", "camera.vdb", "!", "info")


if __name__ == "__main__":
    unittest.main()
