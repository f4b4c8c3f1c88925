"""Hostile VDB archives: whatever the bytes of a file of another program are, they are read or refused in one line, in little
memory and time."""

import os
import random
import resource
import struct
import sys
import unittest

import meshes
from program import MIMAKI, PATIENCE, ROOT, ProgramTest

sys.path.insert(0, str(ROOT / "tests/bench"))
from vdb_archive import Archive

SECONDS = 10
BYTES = 1 << 30


def written_elsewhere(path):
    """Writes a sphere and a fog of it as pyopenvdb does, packed by Blosc, and returns the bytes."""
    import pyopenvdb as vdb
    surface = vdb.createLevelSetSphere(radius=0.6, voxelSize=0.1)
    surface.name = "surface"
    solid = vdb.BoolGrid(False)
    solid.name, solid.transform = "solid", surface.transform
    solid.fill((-3, -3, -3), (4, 4, 4), True)
    vdb.write(str(path), grids=[surface, solid], metadata={"of": "elsewhere"})
    return path.read_bytes()


class Places:
    """Where the parts of the first tree of an archive begin."""

    def __init__(self, data):
        offsets, self.map = Archive(data).transforms[0]
        self.ends, self.compression = offsets + 16, offsets + 24
        name, = struct.unpack_from("<I", data, self.map)
        numbers = {b"UniformScaleMap": 120, b"ScaleMap": 120}[data[self.map + 4:self.map + 4 + name]]
        self.counts = self.map + 4 + name + numbers + 8  # behind the number of buffers and the background
        self.origin = self.counts + 8
        self.children = self.origin + 12
        self.active = self.children + 4096
        self.kind = self.active + 4096
        self.chunk = self.kind + 1
        self.blosc = self.chunk + 8


def hostile(data):
    """Returns archives by what is wrong with them: where their bytes are changed, and into what."""
    at = Places(data)
    sizes = {f"a packed size of {size}": (at.chunk, struct.pack("<q", size))
             for size in (-1 << 20, -(1 << 63), (1 << 63) - 1, 1 << 40, 20, -8)}
    return {
        **sizes,
        "4 G tiles": (at.counts, b"\xff\xff\xff\xff"),
        "4 G branches": (at.counts + 4, b"\xff\xff\xff\xff"),
        "the same branch in many places": (at.counts + 4, b"\x10\0\0\0"),
        "a branch out of place": (at.origin, struct.pack("<i", 8)),
        "a node full of children": (at.children, b"\xff" * 4096),
        "a tile that is a child": (at.active, b"\xff" * 4096),
        "values packed by nobody": (at.kind, b"\x09"),
        "a chunk that unpacks to 2 GiB": (at.blosc + 4, struct.pack("<I", 0x7fffffff)),
        "a chunk of Blosc of 2 GiB": (at.blosc + 12, struct.pack("<I", 0x7fffffff)),
        "values that are not packed": (at.compression, struct.pack("<I", 0)),
        "values packed by zlib": (at.compression, struct.pack("<I", 3)),
        "a transform with a name of 4 GiB": (at.map, b"\xff\xff\xff\xff"),
        "an unknown transform": (at.map + 4, b"X"),
    }


class Hostile(ProgramTest):
    @classmethod
    def setUpClass(cls):
        cls.inputs = cls.folder_of_class()
        try:
            cls.data = written_elsewhere(cls.inputs / "sound.vdb")
        except ImportError:
            raise unittest.SkipTest("pyopenvdb is not installed")

    def setUp(self):
        super().setUp()
        (self.folder / "sound.vdb").write_bytes(self.data)

    def limit(self):
        if not os.environ.get("VDBDITHER_SANITIZER"):
            # The shadow memory of a sanitizer needs terabytes of addresses.
            resource.setrlimit(resource.RLIMIT_AS, (BYTES, BYTES))

    def limited(self):
        return {"timeout": SECONDS * PATIENCE, "preexec_fn": self.limit}

    def spoil(self, at, content):
        (self.folder / "bad.vdb").write_bytes(self.data[:at] + content + self.data[at + len(content):])

    def test_the_archive_is_read_as_it_is(self):
        said = self.succeed("info", "sound.vdb", **self.limited()).decode()
        self.assertIn("surface   float, level set: ", said)
        self.assertIn("solid     bool: ", said)

    def test_hostile_bytes_are_refused(self):
        for fault, change in hostile(self.data).items():
            with self.subTest(fault=fault):
                self.spoil(*change)
                self.refuse(1, "'bad.vdb'", "info", "bad.vdb", **self.limited())

    def test_where_a_grid_is_said_to_end_does_not_matter(self):
        expected = self.succeed("info", "sound.vdb")
        for end in (-1, 0, 1 << 62):
            self.spoil(Places(self.data).ends, struct.pack("<q", end))
            self.assertEqual(self.succeed("info", "bad.vdb", **self.limited()), expected)

    def test_every_verb_refuses_them(self):
        meshes.write_stl(self.folder / "part.stl", meshes.box((0.4, 0.4, 0.4)))
        self.succeed("mesh2sdf", "part.stl", *MIMAKI, "!", "dither", "!", "material-assign", "!", "write", "solid.vdb",
                     "!", "slice-export", "stack")
        self.spoil(*hostile(self.data)[f"a packed size of {-1 << 20}"])
        bad = (self.folder / "bad.vdb").read_bytes()
        part = ("mesh2sdf", "part.stl", *MIMAKI, "!")
        fault = "is damaged at byte "
        for arguments in (("read", "bad.vdb", "-o", "x.vdb"), ("normals", "-i", "bad.vdb", "-o", "x.vdb"), ("info", "bad.vdb"),
                          ("compare", "bad.vdb", "solid.vdb"), ("compare", "solid.vdb", "bad.vdb"), ("resample", "bad.vdb", *MIMAKI, "-o", "x.vdb"),
                          ("csg", "-i", "solid.vdb", "--union", "bad.vdb", "-o", "x.vdb"), (*part, "dither", "--mask", "bad.vdb", "-o", "x.vdb"),
                          ("verify", "stack", "--against", "bad.vdb")):
            with self.subTest(arguments=arguments):
                said = self.refuse(1, "'bad.vdb'", *arguments, **self.limited()).stderr.decode()
                self.assertIn(fault, said)
        for arguments in (("info",), ("normals", "-o", "x.vdb"), ("resample", *MIMAKI, "-o", "x.vdb"), ("compare", "solid.vdb")):
            with self.subTest(arguments=arguments):
                self.refuse(1, fault, *arguments, input=bad, **self.limited())

    def test_an_archive_cut_anywhere_is_refused(self):
        for part in range(1, 8):
            (self.folder / "bad.vdb").write_bytes(self.data[:len(self.data) * part // 8])
            self.refuse(1, "'bad.vdb' is not a readable VDB archive: it ends too early", "info", "bad.vdb", **self.limited())

    def test_spoilt_bytes_are_read_or_refused(self):
        seed = int(os.environ.get("VDBDITHER_SEED", "1"))
        chance = random.Random(seed)
        refused = 0
        for number in range(40):
            # Half of them in the head and the first nodes, where the sizes are.
            at = chance.randrange(21, Places(self.data).blosc if number % 2 else len(self.data))
            with self.subTest(seed=seed, number=number, at=at):
                self.spoil(at, bytes([chance.randrange(256)]))
                done = self.run_program("info", "bad.vdb", **self.limited())
                said = done.stderr.decode()
                refused += done.returncode
                self.assertIn(done.returncode, (0, 1), said)
                self.assertRegex(said, r"\A(vdbdither info: [^\n]*\n)?\Z")
        self.assertGreater(refused, 5)


if __name__ == "__main__":
    unittest.main()
