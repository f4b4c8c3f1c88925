"""The history of a file says with what values it was made, and can be run again."""

import hashlib
import itertools
import json
import re
import struct
import unittest

import meshes
from program import MIMAKI, ProgramTest


class History(ProgramTest):
    def setUp(self):
        super().setUp()
        meshes.write_stl(self.folder / "part.stl", meshes.turned(meshes.box((0.9, 1.1, 0.7)), 20, 35))

    def history(self, name):
        return json.loads(self.succeed("info", name, "--json"))["history"]

    def arguments(self, name, verb):
        """The arguments of the only line of that verb, without the version."""
        lines = [line for line in self.history(name) if line.split()[0] == verb]
        self.assertEqual(len(lines), 1)
        found = re.fullmatch(rf"{verb} ?(.*?) # vdbdither \d+\.\d+\.\d+", lines[0])
        self.assertTrue(found, lines[0])
        return found[1]

    def assert_runs_again(self, name):
        """The lines of the history make the same file, in one process and in several."""
        lines = self.history(name)
        self.succeed("run", "\n! ".join([*lines, "write again.vdb --overwrite"]))
        self.assertEqual((self.folder / "again.vdb").read_bytes(), (self.folder / name).read_bytes())
        for count, line in enumerate(lines):
            self.shell(f"vdbdither {line[:line.rindex(' # ')]} -o {count}.vdb" + (f" -i {count - 1}.vdb" if count else "") +
                       " --overwrite" + line[line.rindex(" # "):])
        self.assertEqual((self.folder / f"{len(lines) - 1}.vdb").read_bytes(), (self.folder / name).read_bytes())

    def test_every_value_is_recorded_be_it_a_default_or_not(self):
        self.succeed("run", "mesh2sdf part.stl --printer mimaki-3duj-553 ! normals ! dither ! material-assign ! simulate -o x.vdb")
        self.assertEqual(self.arguments("x.vdb", "mesh2sdf"),
                         "part.stl --printer mimaki-3duj-553 --unit mm --scale 1 --rotate 0,0,0 --refine-y 1 --band 1 --overlap first")
        self.assertEqual(self.arguments("x.vdb", "normals"), "")
        self.assertEqual(self.arguments("x.vdb", "dither"),
                         "--preset best --method diffusion --guard walls --spread 0.05mm,0.05mm,0.05mm --refine 0")
        self.assertEqual(self.arguments("x.vdb", "material-assign"), "--material white")
        self.assertEqual(self.arguments("x.vdb", "simulate"), "--spread 0.05mm,0.05mm,0.05mm --translucency none")
        self.assert_runs_again("x.vdb")

    def test_a_preset_is_recorded_as_what_it_stands_for(self):
        self.succeed("mesh2sdf", "part.stl", *MIMAKI, "-o", "part.vdb")
        for words, recorded in (("--preset best --at foot", "best --method mask --guard walls --mask blue --amplitude 2 --at foot"),
                                ("--at foot --preset best", "best --method mask --guard walls --mask blue --amplitude 2 --at foot"),
                                ("--guard walls --mask white --preset paper", "paper --method mask --guard walls --mask white --amplitude 4 --at closest"),
                                ("--preset paper --mask none", "paper --method mask --guard none --mask none --amplitude 0 --at closest")):
            with self.subTest(words=words):
                self.succeed("dither", "-i", "part.vdb", *words.split(), "-o", "x.vdb", "--overwrite")
                self.assertTrue(self.arguments("x.vdb", "dither").startswith(f"--preset {recorded}"), self.history("x.vdb"))

    def test_colours_are_recorded_as_the_halftone_that_chose_their_materials(self):
        (self.folder / "part.obj").write_text("".join(f"v {x} {y} {z} 0.8 0.3 0.1\n" for x in (0, 1) for y in (0, 1) for z in (0, 1)) +
                                              "f 1 2 4 3\nf 5 7 8 6\nf 1 5 6 2\nf 3 4 8 7\nf 1 3 7 5\nf 2 6 8 4\n")
        (self.folder / "jet.json").write_text(json.dumps({
            "name": "jet", "title": "Jet", "source": "By definition", "technology": "jetting", "pitch_mm": [0.1, 0.1, 0.1],
            "materials": [{"name": name, "rgba": rgba} for name, rgba in (("white", [255, 255, 255, 255]), ("black", [0, 0, 0, 255]))]}))
        self.succeed("mesh2sdf", "part.obj", "--printer", "jet.json", "--colour", "!", "dither", "!", "material-assign", "-o", "x.vdb")
        self.assertEqual(self.arguments("x.vdb", "halftone"),
                         "--black 0.5 --white media --core white --mask blue --size 0,0,0 --seed 1")
        self.assertEqual([line.split()[0] for line in self.history("x.vdb")], ["mesh2sdf", "dither", "halftone"])
        self.assert_runs_again("x.vdb")

    def test_names_of_any_kind_run_again(self):
        name = "a part's\n\x1b[1m#1 \\x.stl"
        (self.folder / "part.stl").rename(self.folder / name)
        self.succeed("mesh2sdf", name, "--pitch", "50um,60um,40um", "--fit", "1.5mm", "--rotate=-10,20,0", "--place", "!",
                     "dither", "--preset", "paper", "--mask", "white", "--seed", 7, "--displaced", "!",
                     "material-assign", "--shell", "0.1mm:skin=#ff0000,100um:white", "--core", "clear", "-o", "x.vdb")
        self.assertEqual(len(self.history("x.vdb")), 3)
        self.assert_runs_again("x.vdb")

    def test_the_digest_of_a_mask_is_that_of_its_size_and_thresholds(self):
        self.succeed("mesh2sdf", "part.stl", *MIMAKI, "-o", "part.vdb")
        self.succeed("mask", "--size", "8,4,2", "-o", "mask.vdb")
        self.succeed("dither", "-i", "part.vdb", "--mask", "mask.vdb", "-o", "x.vdb")
        try:
            import pyopenvdb
        except ImportError:
            self.skipTest("pyopenvdb is not installed")
        mask = pyopenvdb.read(str(self.folder / "mask.vdb"), "mask").getConstAccessor()
        data = struct.pack("<3i", 8, 4, 2) + b"".join(struct.pack("<f", mask.getValue(index))
                                                      for index in itertools.product(range(8), range(4), range(2)))
        digest = hashlib.sha256(data).hexdigest()[:16]
        self.assertTrue(self.arguments("x.vdb", "dither").endswith(f" --mask-digest {digest}"))

    def test_another_mask_than_the_recorded_one_is_refused(self):
        self.succeed("mesh2sdf", "part.stl", *MIMAKI, "-o", "part.vdb")
        self.succeed("mask", "--size", 8, "-o", "mask.vdb")
        self.succeed("dither", "-i", "part.vdb", "--mask", "mask.vdb", "-o", "x.vdb")
        recorded = self.arguments("x.vdb", "dither")
        self.shell(f"vdbdither dither -i part.vdb {recorded} -o y.vdb")
        self.succeed("mask", "--size", 8, "--seed", 2, "-o", "mask.vdb", "--overwrite")
        self.refuse(1, "dither: --mask-digest: the digest of the mask is ", "dither", "-i", "part.vdb", *recorded.split(), "-o", "z.vdb")
        self.refuse(2, "dither: --mask-digest: only a mask that is a tile has it; leave it out", "dither", "-i", "part.vdb",
                    "--mask", "white", "--mask-digest", "0" * 16, "-o", "z.vdb")


if __name__ == "__main__":
    unittest.main()
