"""The sample part agrees with its description."""

import pathlib
import struct
import subprocess
import sys
import tempfile
import unittest
from collections import Counter

SCRIPT = pathlib.Path(__file__).parents[2] / "samples" / "make_part.py"


def make_part():
    with tempfile.TemporaryDirectory() as folder:
        path = pathlib.Path(folder) / "part.stl"
        subprocess.run([sys.executable, SCRIPT, path], check=True)
        return path.read_bytes()


class MakePart(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.stl = make_part()
        cls.triangles = [(row[3:6], row[6:9], row[9:12])
                         for row in struct.iter_unpack("<12fH", cls.stl[84:])]

    def test_has_the_same_bytes_every_time(self):
        self.assertEqual(self.stl, make_part())

    def test_states_its_number_of_triangles(self):
        self.assertEqual(struct.unpack("<I", self.stl[80:84])[0], len(self.triangles))

    def test_is_closed_manifold_and_consistently_oriented(self):
        edges = Counter()
        for a, b, c in self.triangles:
            self.assertEqual(len({a, b, c}), 3)
            edges.update([(a, b), (b, c), (c, a)])
        self.assertEqual(set(edges.values()), {1})
        for start, end in edges:
            self.assertIn((end, start), edges)

    def test_has_no_handles(self):
        vertices = {corner for triangle in self.triangles for corner in triangle}
        self.assertEqual(len(vertices) - len(self.triangles) // 2, 2)  # Euler's formula

    def test_faces_outwards(self):
        volume = sum(a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2])
                     + a[2] * (b[0] * c[1] - b[1] * c[0]) for a, b, c in self.triangles) / 6
        self.assertGreater(volume, 1000)
        self.assertLess(volume, 20 * 20 * 14)

    def test_measures_20_by_20_by_14_mm(self):
        for axis, size in enumerate((20, 20, 14)):
            values = [corner[axis] for triangle in self.triangles for corner in triangle]
            self.assertAlmostEqual(max(values) - min(values), size, delta=0.01)


if __name__ == "__main__":
    unittest.main()
