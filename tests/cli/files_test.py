"""Other programs read intermediate files correctly."""

import json
import math
import re
import shutil
import subprocess
import unittest

import meshes
from program import MIMAKI, ProgramTest

RADIUS_MM = 1.2
PITCH_MM = (0.042, 0.084, 0.022)


class Files(ProgramTest):
    """Reads one file that contains every stage of a sphere away from the origin."""

    def setUp(self):
        super().setUp()
        corner = (0.7, -0.4, 2.1)
        sphere = [tuple(tuple(p + c for p, c in zip(point, corner)) for point in triangle)
                  for triangle in meshes.sphere(RADIUS_MM, rings=60)]
        meshes.write_stl(self.folder / "part.stl", sphere)
        self.centre = corner
        self.succeed("mesh2sdf", "part.stl", *MIMAKI, "!", "normals", "!", "dither", "!", "material-assign",
                     "-o", "stage.vdb")

    def said_by(self, tool, *arguments):
        if not shutil.which(tool):
            self.skipTest(f"{tool} is not installed")
        return subprocess.run([tool, *arguments], cwd=self.folder, check=True, stdout=subprocess.PIPE,
                              stderr=subprocess.STDOUT, text=True, timeout=120).stdout

    def pyopenvdb(self):
        try:
            import pyopenvdb
        except ImportError:
            self.skipTest("pyopenvdb is not installed")
        return pyopenvdb

    def read(self, name):
        return self.pyopenvdb().read(str(self.folder / "stage.vdb"), name)

    def distance_mm(self, point):
        return math.dist(point, self.centre) - RADIUS_MM

    def test_vdb_print_shows_names_types_and_the_lattice(self):
        said = self.said_by("vdb_print", "stage.vdb")
        lines = {line.split()[0]: line for line in said.splitlines() if re.match(r"(N|material|solid|surface) ", line)}
        for name, kind in {"N": "vec3s", "material": "int32", "solid": "bool", "surface": "float"}.items():
            self.assertRegex(lines[name], rf"^{name} +{kind} ")
        details = self.said_by("vdb_print", "-l", "stage.vdb")
        self.assertEqual(details.count("voxel dimensions: [0.042, 0.084, 0.022]"), 4)
        self.assertIn("class: level set", details)
        self.assertIn("vector_type: covariant normalize", details)
        self.assertIn("creator: vdbdither", details)

    def test_vdb_tool_reads_every_grid(self):
        said = self.said_by("vdb_tool", "-read", "stage.vdb", "-print")
        for name, kind in {"N": "vec3s", "material": "int32", "solid": "bool", "surface": "float"}.items():
            self.assertRegex(said, rf'name = "{name}", type = "{kind}"')

    def test_pyopenvdb_finds_distances_at_their_world_positions(self):
        surface = self.read("surface")
        self.assertEqual(surface.gridClass, "level set")
        self.assertEqual(surface.transform.voxelSize(), PITCH_MM)
        seen = 0
        for item in surface.iterOnValues():
            if seen % 97 == 0:
                position = surface.transform.indexToWorld(item.min)
                self.assertEqual(position, tuple(i * p for i, p in zip(item.min, PITCH_MM)))
                self.assertAlmostEqual(item.value, self.distance_mm(position), delta=0.003)
            seen += 1
        self.assertGreater(seen, 10000)
        inside = surface.transform.worldToIndexCellCentered(self.centre)
        self.assertEqual(surface.getConstAccessor().getValue(inside), -surface.background)

    def test_pyopenvdb_finds_normals_that_point_outwards(self):
        normals = self.read("N")
        seen = 0
        for item in normals.iterOnValues():
            seen += 1
            if seen % 97:
                continue
            position = normals.transform.indexToWorld(item.min)
            outwards = [p - c for p, c in zip(position, self.centre)]
            self.assertAlmostEqual(math.hypot(*item.value), 1, places=5)
            self.assertGreater(sum(a * b for a, b in zip(item.value, outwards)), 0.98 * math.hypot(*outwards))
        self.assertGreater(seen, 10000)

    def test_pyopenvdb_finds_the_printed_voxels_within_a_voxel_of_the_part(self):
        solid = self.read("solid")
        surface = self.read("surface").getConstAccessor()
        self.assertEqual(solid.transform.voxelSize(), PITCH_MM)
        self.assertIs(solid.background, False)
        diagonal = math.hypot(*PITCH_MM)
        volume = 0
        for item in solid.iterOnValues():
            self.assertIs(item.value, True)
            volume += math.prod(b - a + 1 for a, b in zip(item.min, item.max))
            self.assertLess(surface.getValue(item.min), diagonal)
        volume *= math.prod(PITCH_MM)
        self.assertAlmostEqual(volume / (4 / 3 * math.pi * RADIUS_MM ** 3), 1, delta=0.01)

    def test_pyopenvdb_finds_the_printer_the_materials_and_the_history(self):
        metadata = self.pyopenvdb().readMetadata(str(self.folder / "stage.vdb"))
        self.assertEqual(metadata["creator"], "vdbdither")
        self.assertEqual(json.loads(metadata["vdbdither:printer"])["pitch_mm"], list(PITCH_MM))
        self.assertEqual(json.loads(metadata["vdbdither:materials"])[0]["name"], "white")
        self.assertEqual([line.split()[0] for line in metadata["vdbdither:history"].splitlines()],
                         ["mesh2sdf", "normals", "dither", "material-assign"])


if __name__ == "__main__":
    unittest.main()
