"""The program needs the memory of a few slabs, for any height of the part."""

import json
import os
import unittest
from random import Random

import meshes
from PIL import Image
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

    def peak_of_verify(self, layers):
        """Returns the peak memory in KiB of verifying that many slices of noise."""
        stack = self.folder / f"stack{layers}"
        stack.mkdir()
        for layer in range(layers):
            os.link(self.folder / f"{layer % 3}.png", stack / f"s{layer}.png")
        process = self.start("verify", stack, "--pitch", "0.1,0.1,0.1")
        process.stdout.read()
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
        self.assertEqual(process.returncode, 0)
        return usage.ru_maxrss

    def test_verify_holds_few_layers(self):
        random = Random(1)
        for name in range(3):
            Image.frombytes("L", (240, 240), bytes(random.choices((0, 255), k=240 * 240))).save(self.folder / f"{name}.png")
        low, high = self.peak_of_verify(32), self.peak_of_verify(480)
        self.assertLess(high, 1.25 * low, (low, high))


if __name__ == "__main__":
    unittest.main()
