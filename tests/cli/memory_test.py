"""The program needs the memory of a few slabs, for any height of the part."""

import json
import unittest

import meshes
from program import MIMAKI, ProgramTest


class Memory(ProgramTest):
    def peak(self, height_mm, *arguments):
        """Returns the peak memory in bytes of the main chain for a cylinder."""
        meshes.write_stl(self.folder / "part.stl", meshes.cylinder(5, height_mm))
        report = self.succeed("mesh2sdf", "part.stl", *MIMAKI, "!", "normals", "!", "dither", "!", "material-assign", "!",
                              "slice-export", "out", "--overwrite", "--json", "--threads", "2", *arguments)
        return json.loads(report)["peak_memory_bytes"]

    def test_peak_memory_does_not_grow_with_the_height(self):
        low, high = self.peak(7, "--slab", "8"), self.peak(28, "--slab", "8")
        self.assertLess(high, 1.25 * low, (low, high))

    def test_peak_memory_grows_where_the_whole_volume_is_one_slab(self):
        low, high = self.peak(7, "--slab", "all"), self.peak(14, "--slab", "all")
        self.assertGreater(high, 1.25 * low, (low, high))


if __name__ == "__main__":
    unittest.main()
