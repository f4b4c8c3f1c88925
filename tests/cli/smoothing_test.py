"""mesh-export smooths like MeshLab. Skipped if meshlabserver is not installed (Debian: meshlab, xvfb)."""

import shutil
import struct
import unittest

import meshes
from program import MIMAKI, ProgramTest

FILTER = """<!DOCTYPE FilterScript><FilterScript><filter name="Taubin Smooth">
<Param name="lambda" type="RichFloat" value="0.5"/><Param name="mu" type="RichFloat" value="-0.53"/>
<Param name="stepSmoothNum" type="RichInt" value="{}"/><Param name="Selected" type="RichBool" value="false"/>
</filter></FilterScript>
"""


def ply_vertices(path):
    """Returns the positions of a binary PLY whose vertices begin with three floats."""
    data = path.read_bytes()
    header, body = data.split(b"end_header\n", 1)
    lines = header.decode().splitlines()
    count, size, within = 0, 0, False
    sizes = {"float": 4, "double": 8, "uchar": 1, "int": 4}
    for line in lines:
        words = line.split()
        if words[0] == "element":
            within = words[1] == "vertex"
            count = int(words[2]) if within else count
        elif words[0] == "property" and within:
            size += sizes[words[1]]
    kind = "d" if "property double x" in header.decode() else "f"
    return [struct.unpack_from("<3" + kind, body, n * size) for n in range(count)]


class Smoothing(ProgramTest):
    @unittest.skipUnless(shutil.which("meshlabserver") and shutil.which("xvfb-run"), "MeshLab is not installed")
    def test_taubin_smoothing_is_within_a_hundredth_of_a_micrometre_of_meshlabs(self):
        meshes.write_stl(self.folder / "part.stl", meshes.turned(meshes.box((1, 1, 0.5), (-0.5, -0.5, -0.2)), 2, 3))
        self.succeed("mesh2sdf", "part.stl", *MIMAKI, "!", "dither", "--mask", "white", "-o", "solid.vdb")
        for iterations in (1, 160):
            self.succeed("mesh-export", "-i", "solid.vdb", "plain.ply", "--overwrite")
            self.succeed("mesh-export", "-i", "solid.vdb", "ours.ply", "--smooth", "taubin", "--iterations",
                         iterations, "--overwrite")
            (self.folder / "filter.mlx").write_text(FILTER.format(iterations))
            self.shell_quietly("xvfb-run --auto-servernum meshlabserver -i plain.ply -o theirs.ply -s filter.mlx")
            plain, ours, theirs = (ply_vertices(self.folder / f"{name}.ply") for name in ("plain", "ours", "theirs"))
            self.assertEqual(len(ours), len(theirs))
            off = max(abs(a - b) for p, q in zip(ours, theirs) for a, b in zip(p, q))
            moved = max(abs(a - b) for p, q in zip(ours, plain) for a, b in zip(p, q))
            self.assertLess(off, 1e-5)
            self.assertGreater(moved, 1e-3, "it smooths")

    def shell_quietly(self, line):
        """Runs a line of bash and ignores its output."""
        self.shell(f"{line} >log 2>&1 || {{ cat log; false; }}")


if __name__ == "__main__":
    unittest.main()
