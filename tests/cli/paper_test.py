"""Tests samples/paper: parts are closed meshes, and every method runs."""

import importlib.util
import json
import struct
import subprocess
import sys
import unittest
from collections import Counter

import meshes
from program import ROOT, ProgramTest

PAPER = ROOT / "samples/paper"
sys.path.insert(0, str(PAPER))


@unittest.skipUnless(importlib.util.find_spec("matplotlib"), "matplotlib is not installed")
class Paper(ProgramTest):
    def test_parts_are_closed_and_face_outwards(self):
        subprocess.run(["/usr/bin/python3", PAPER / "parts.py", self.folder / "parts"], check=True, timeout=300)
        volumes = {"cube": (999.9, 1000.1), "sphere": (267.8, 268.1), "relief": (350, 480), "figurine": (200, 800)}
        self.assertEqual({path.stem for path in (self.folder / "parts").iterdir()}, set(volumes))
        for name, (low, high) in volumes.items():
            rows = struct.iter_unpack("<12fH", (self.folder / f"parts/{name}.stl").read_bytes()[84:])
            edges, volume = Counter(), 0.0
            for row in rows:
                a, b, c = row[3:6], row[6:9], row[9:12]
                edges.update([(a, b), (b, c), (c, a)])
                volume += (a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2])
                           + a[2] * (b[0] * c[1] - b[1] * c[0])) / 6
            self.assertTrue(all(edges[end, start] == count for (start, end), count in edges.items()), name)
            self.assertTrue(low < volume < high, f"{name}: {volume}")

    def test_every_method_prints(self):
        from methods import METHODS, PRINTER
        meshes.write_stl(self.folder / "part.stl", meshes.box((1, 1, 1)))
        prints = set()
        for name, (refine, step) in METHODS.items():
            step = step.replace("--size 64", "--size 16")
            self.succeed("mesh2sdf", "part.stl", "--printer", PRINTER, *refine, "!", *step.split(), "-o", "solid.vdb",
                         "--overwrite", "-q")
            counts = json.loads(self.succeed("stats", "-i", "solid.vdb", "--json"))["solid"]
            self.assertAlmostEqual(1000 * counts["ml"], 1, delta=0.05, msg=name)
            prints.add((counts["voxels"], counts["faces_mm2"]))
        self.assertEqual(len(prints), len(METHODS), "every method makes its own voxels")

    def test_an_unknown_step_is_refused(self):
        done = subprocess.run([PAPER / "reproduce.sh", "figure"], capture_output=True, text=True, cwd=self.folder,
                              env={"PATH": "/usr/bin:/bin", "WORK": str(self.folder), "RESULT": str(self.folder)}, timeout=60)
        self.assertEqual(done.returncode, 2)
        self.assertEqual(done.stderr, "reproduce.sh: unknown step 'figure'; use figure8 figure9 readings "
                         "pictures speed masks default\n")


if __name__ == "__main__":
    unittest.main()
