"""The file that begins a chain, named behind its first operator."""

import os
import subprocess
import unittest

import meshes
from program import MIMAKI, ProgramTest

SOURCE = f"mesh2sdf part.stl {' '.join(MIMAKI)}"


class Inputs(ProgramTest):
    def setUp(self):
        super().setUp()
        meshes.write_stl(self.folder / "part.stl", meshes.sphere(0.6))
        self.succeed("run", f"{SOURCE} -o a.vdb")

    def bytes_of(self, name):
        return (self.folder / name).read_bytes()

    def test_a_vdb_behind_a_filter_is_what_input_names(self):
        self.succeed("normals", "-i", "a.vdb", "-o", "by_option.vdb")
        self.succeed("normals", "a.vdb", "-o", "by_word.vdb")
        self.succeed("normals", "-o", "behind.vdb", "a.vdb")
        self.assertEqual(self.bytes_of("by_word.vdb"), self.bytes_of("by_option.vdb"))
        self.assertEqual(self.bytes_of("behind.vdb"), self.bytes_of("by_option.vdb"))

    def test_a_chain_begins_with_it(self):
        self.succeed("dither", "a.vdb", "!", "slice-export", "by_word")
        self.succeed("dither", "-i", "a.vdb", "!", "slice-export", "by_option")
        names = [sorted(path.name for path in (self.folder / folder).iterdir()) for folder in ("by_word", "by_option")]
        self.assertEqual(*names)
        for name in names[0]:
            self.assertEqual(self.bytes_of(f"by_word/{name}"), self.bytes_of(f"by_option/{name}"))
        self.succeed("info", "a.vdb", "!", "dither", "-o", "solid.vdb", "--quiet")
        self.succeed("stats", "--json", "solid.vdb")

    def test_it_stands_before_the_words_of_a_sink(self):
        self.succeed("dither", "a.vdb", "-o", "solid.vdb")
        self.succeed("slice-export", "solid.vdb", "out")
        self.succeed("mesh-export", "solid.vdb", "out.stl")
        self.succeed("render", "solid.vdb", "out.png", "--samples", "1")
        self.succeed("write", "solid.vdb", "copy.vdb")
        self.assertEqual(self.succeed("compare", "solid.vdb", "copy.vdb"), b"equal\n")
        self.assertIn(b"by area", self.succeed("measure", "solid.vdb", "--reference", "part.stl"))

    def test_a_sink_that_names_a_vdb_itself_takes_one_word_as_its_own(self):
        self.shell("vdbdither read a.vdb | vdbdither write b.vdb")
        self.assertEqual(self.shell("vdbdither read a.vdb | vdbdither compare b.vdb"), b"equal\n")
        self.succeed("write", "c.vdb", "-i", "a.vdb")
        self.assertEqual(self.succeed("compare", "b.vdb", "-i", "c.vdb"), b"equal\n")

    def test_a_named_pipe_does_as_well(self):
        os.mkfifo(self.folder / "pipe")
        writer = subprocess.Popen(["bash", "-c", "vdbdither read a.vdb > pipe"], cwd=self.folder, env=self.environment())
        self.succeed("normals", "pipe", "-o", "piped.vdb")
        self.assertEqual(writer.wait(), 0)
        self.succeed("normals", "a.vdb", "-o", "filed.vdb")
        self.assertEqual(self.bytes_of("piped.vdb"), self.bytes_of("filed.vdb"))

    def test_what_cannot_be_the_input_is_refused(self):
        self.refuse(1, "read: no such file 'gone.vdb'", "normals", "gone.vdb", "-o", "x.vdb")
        self.refuse(1, "read: 'part.stl'", "normals", "part.stl", "-o", "x.vdb")
        self.refuse(2, "normals: 'typo' is not expected", "normals", "typo", "-o", "x.vdb")
        self.refuse(2, "normals: 'b.vdb' is not expected", "normals", "a.vdb", "b.vdb")
        self.refuse(2, "slice-export: 'folder' is missing", "slice-export", "a.vdb")
        self.refuse(2, "--input: normals reads 'a.vdb'", "normals", "a.vdb", "-i", "a.vdb", "-o", "x.vdb")
        self.refuse(2, "normals: takes the slabs of the stage before it and cannot read 'a.vdb' as well",
                    "run", f"{SOURCE} ! normals a.vdb -o x.vdb")
        self.refuse(2, "slice-export: takes the slabs of the stage before it and cannot read 'a.vdb' as well",
                    "run", f"{SOURCE} ! dither ! slice-export a.vdb out")


if __name__ == "__main__":
    unittest.main()
