"""What info, compare and stats tell of files and pipes."""

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

    def test_info_tells_the_same_of_a_file_a_pipe_and_a_chain(self):
        told = self.succeed("info", "part.vdb").decode()
        self.assertEqual(told, self.succeed("info", "-i", "part.vdb").decode())
        self.assertEqual(told, self.shell(f"vdbdither {CHAIN} | vdbdither info").decode())
        self.assertEqual(told, self.succeed("run", f"{CHAIN} ! info --slab 8").decode())
        for pattern in (r"lattice +0\.042 x 0\.084 x 0\.022 mm", r"printer +mimaki-3duj-553",
                        r"surface +float, level set: \d+ voxels", r"N +vec3s, covariant normalize: ",
                        r"1 white: \d+ voxels", r"history +mesh2sdf part\.stl"):
            self.assertRegex(told, pattern)

    def test_info_tells_it_as_json(self):
        told = json.loads(self.succeed("info", "part.vdb", "--json"))
        self.assertEqual(told["lattice"]["pitch_mm"], [0.042, 0.084, 0.022])
        grids = {grid["name"]: grid for grid in told["grids"]}
        self.assertEqual(set(grids), {"N", "material", "solid", "surface"})
        self.assertEqual(grids["surface"]["class"], "level set")
        self.assertLess(grids["surface"]["least"], -0.05)
        self.assertEqual(grids["material"]["materials"][0]["name"], "white")
        self.assertEqual(grids["material"]["materials"][0]["voxels"], grids["solid"]["active_voxels"])
        self.assertEqual(len(told["history"]), 4)

    def test_words_go_to_standard_error_where_voxels_go_to_standard_output(self):
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

    def test_compare_tells_missing_grids_and_other_lattices(self):
        self.succeed("run", "read part.vdb --grids surface ! write one.vdb")
        self.refuse(1, "grid 'N' is missing there; ", "compare", "part.vdb", "one.vdb")
        self.refuse(1, "grid 'N' is there alone; ", "compare", "one.vdb", "part.vdb")
        self.succeed("mesh2sdf", "part.stl", "--printer", "stratasys-j750-27um", "-o", "stratasys.vdb")
        self.refuse(1, "grid 'surface' lies on another lattice", "compare", "one.vdb", "stratasys.vdb")
        self.refuse(2, "two can be compared, not 3", "compare", "a.vdb", "b.vdb", "c.vdb")
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

    def test_grids_of_other_lattices_are_no_hindrance_when_they_are_not_wanted(self):
        try:
            import pyopenvdb
        except ImportError:
            self.skipTest("pyopenvdb is not installed")
        grids = []
        for name, size in (("coarse", 2.0), ("fine", 1.0)):
            grid = pyopenvdb.FloatGrid()
            grid.name = name
            grid.transform = pyopenvdb.createLinearTransform(size)
            grid.fill((0, 0, 0), (9, 9, 9), 1.5)
            grids.append(grid)
        pyopenvdb.write(str(self.folder / "mixed.vdb"), grids)
        self.refuse(1, "grids 'coarse' and 'fine' lie on different lattices", "info", "mixed.vdb")
        self.assertIn("fine      float: 1000 voxels", self.succeed("run", "read mixed.vdb --grids fine ! info").decode())


if __name__ == "__main__":
    unittest.main()
