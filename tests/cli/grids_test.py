"""Grids and names that come from files and pipes: what is not printable, not finite, too large, or of another run."""

import json
import os
import re
import resource
import struct
import unittest

import meshes
from program import MIMAKI, PATIENCE, ProgramTest

# Whatever a terminal would obey: control characters but line breaks and tabs.
CONTROL = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069]")


def patched(archive, *changes):
    """Returns an archive with texts replaced by others of the same length, as if another tool had written it."""
    content = bytearray(archive)
    content[21 + 14] = ord("4")  # The version of the UUID: no digest.
    content = bytes(content)
    for old, new in changes:
        assert len(old) == len(new) and old in content, (old, new)
        content = content.replace(old, new)
    return content


def sized(text):
    return struct.pack("<I", len(text)) + text


HEADER = b" BDV\0\0\0\0" + struct.pack("<III", 224, 10, 0) + b"\0" + b"0856ea5b-a483-4314-a8bd-a286b9e7daa0"


# The first entry of the table of materials.
WHITE = b'{"index":1,"name":"white"'


class Names(ProgramTest):
    def setUp(self):
        super().setUp()
        meshes.write_stl(self.folder / "part.stl", meshes.box((0.6, 0.7, 0.4)))
        self.succeed("mesh2sdf", "part.stl", *MIMAKI, "!", "dither", "!", "material-assign", "!", "write", "part.vdb", "--codec", "none")

    def say(self, *arguments):
        """Returns what a run prints, after a check that no terminal obeys it and that messages have one line."""
        done = self.run_program(*arguments)
        printed, said = done.stdout.decode(), done.stderr.decode()
        self.assertNotRegex(printed + said, CONTROL)
        for line in said.splitlines():
            self.assertRegex(line, r"^vdbdither[ :]")
        return done.returncode, printed, said

    def test_names_in_a_file_are_printed_without_effect(self):
        content = (self.folder / "part.vdb").read_bytes()
        name = b"\x1b[31\xff\x07m"  # As long as `surface`.
        history = b"mesh2sdf \x1b[2J.\xe9\x9b"
        (self.folder / "bad.vdb").write_bytes(patched(content, (b"surface", name), (b"mesh2sdf part.st", history)))
        shown = r"\x1b[31\xff\x07m"
        code, printed, said = self.say("info", "bad.vdb")
        self.assertEqual((code, said), (0, ""))
        self.assertIn(f"\n{shown} float", printed)
        self.assertIn(r"mesh2sdf \x1b[2J.\xe9\x9bl", printed)
        described = json.loads(self.say("info", "bad.vdb", "--json")[1])
        self.assertIn(shown, [grid["name"] for grid in described["grids"]])
        # Control characters are escapes of JSON; only what is not UTF-8 is spelt.
        self.assertTrue(described["history"][0].startswith("mesh2sdf \x1b[2J.\\xe9\\x9bl "), described["history"])
        for arguments in (("read", "bad.vdb", "--grids", "x", "-o", "x.vdb"), ("csg", "-i", "bad.vdb", "--union", "bad.vdb", "-o", "x.vdb"),
                          ("resample", "bad.vdb", *MIMAKI, "--grid", "x", "-o", "x.vdb"), ("compare", "part.vdb", "bad.vdb"),
                          ("dither", "-i", "bad.vdb", "-o", "x.vdb"), ("stats", "-i", "bad.vdb", "--histogram", "x"),
                          ("read", "bad.vdb", "-o", "x.vdb", "--explain"), ("read", "bad.vdb", "-o", "x.vdb", "--explain", "--json")):
            with self.subTest(arguments=arguments):
                code, printed, said = self.say(*arguments)
                self.assertIn(shown.replace("\\", "\\\\") if "--json" in arguments else shown, printed + said)
        # A grid is called by what is shown.
        self.succeed("read", "bad.vdb", "--grids", shown, "-o", "one.vdb")

    def test_materials_are_printed_without_effect(self):
        content = (self.folder / "part.vdb").read_bytes()
        (self.folder / "bad.vdb").write_bytes(patched(content, (WHITE, WHITE.replace(b"white", b"\\u001"))))
        code, printed, said = self.say("info", "bad.vdb")
        self.assertEqual(code, 1)
        self.assertRegex(said, r"\Avdbdither info: the metadata vdbdither:materials is not a table of materials: line 1, column 26: "
                               r"this is not JSON: [ -~]+; assign the materials again\n\Z")
        (self.folder / "bad.vdb").write_bytes(patched(content, (WHITE, WHITE.replace(b"white", b"a\\n\\r"))))
        code, printed, said = self.say("info", "bad.vdb")
        self.assertEqual((code, said), (0, ""))
        self.assertIn(r" a\n\r: ", printed)
        self.say("stats", "-i", "bad.vdb")
        self.succeed("slice-export", "-i", "bad.vdb", "out")
        self.assertEqual(json.loads((self.folder / "out/manifest.json").read_text())["materials"][0]["name"], r"a\n\r")

    def test_file_names_of_any_bytes_come_to_an_end_and_run_again(self):
        for name in (b"caf\xe9.stl", b"a\n\x1b[31m\xff.stl", "\u202egnp\u009b.stl".encode()):
            with self.subTest(name=name):
                path = os.fsdecode(name)
                (self.folder / path).write_bytes((self.folder / "part.stl").read_bytes())
                self.succeed("mesh2sdf", path, *MIMAKI, "!", "dither", "!", "material-assign", "-o", "x.vdb", "--overwrite")
                self.succeed("slice-export", "-i", "x.vdb", "out", "--overwrite")
                lines = json.loads((self.folder / "out/manifest.json").read_bytes().decode())["history"]
                self.assertEqual(len(lines), 3)
                self.assertNotRegex("".join(lines), CONTROL)
                self.assertEqual(lines, json.loads(self.say("info", "x.vdb", "--json")[1])["history"])
                self.succeed("run", "\n! ".join([*lines, "write again.vdb --overwrite"]))
                self.assertEqual((self.folder / "again.vdb").read_bytes(), (self.folder / "x.vdb").read_bytes())
                for end in ("", "--json", "--explain", "--explain --json"):
                    code, _, said = self.say("mesh2sdf", path, *MIMAKI, "-o", "y.vdb", "--overwrite", *end.split())
                    self.assertEqual((code, said), (0, ""))
                for arguments in (("measure", path, "--reference", path), ("measure", path, "--reference", path, "--json")):
                    self.assertEqual(self.say(*arguments)[0], 0)
                self.assertEqual(self.say("mesh2sdf", "no-" + path, *MIMAKI, "-o", "y.vdb")[0], 1)
                self.assertNotEqual(self.say("info", "no-" + path)[0], 0)
                self.assertEqual(self.say("mesh2sdf", "part.stl", *MIMAKI, "-o", f"no/{path}")[0], 2)

    def test_words_of_the_command_line_are_printed_without_effect(self):
        for arguments in (("\x1b[31m",), ("mesh2sdf", "--\x1b[31m\nx"), ("dither", "--preset", "\x9b\n"), ("help", "\x1b]0;x\x07"),
                          ("run", "mesh2sdf '\x1b"), ("printers", "show", "\x1b"), ("read", "part.vdb", "!", "\n\x1b")):
            with self.subTest(arguments=arguments):
                code, _, said = self.say(*arguments)
                self.assertEqual(code, 2, said)
                self.assertEqual(said.count("\n"), 1, said)

    def test_a_history_that_is_not_utf8_reaches_the_manifest(self):
        content = (self.folder / "part.vdb").read_bytes()
        (self.folder / "bad.vdb").write_bytes(patched(content, (b"mesh2sdf part.st", b"mesh2sdf caf\xff\xfe[J")))
        self.succeed("slice-export", "-i", "bad.vdb", "out")
        manifest = (self.folder / "out/manifest.json").read_bytes().decode()
        self.assertTrue(json.loads(manifest)["history"][0].startswith(r"mesh2sdf caf\xff\xfe[Jl "))


class HeldLayers(ProgramTest):
    def test_layers_that_are_no_range_are_refused(self):
        meshes.write_stl(self.folder / "part.stl", meshes.box((0.6, 0.7, 0.4)))
        self.succeed("mesh2sdf", "part.stl", *MIMAKI, "--layers", "0:8", "!", "write", "some.vdb", "--codec", "none")
        stated = sized(b"vdbdither:layers") + sized(b"string")
        content = patched((self.folder / "some.vdb").read_bytes(), (stated + sized(b"-5 3"), stated + sized(b"3 -5")))
        (self.folder / "bad.vdb").write_bytes(content)
        for chain in (("info", "bad.vdb"), ("read", "bad.vdb", "!", "stats")):
            self.refuse(1, "its metadata vdbdither:layers is '3 -5'; it must be two whole numbers", *chain)

    def test_resample_refuses_a_file_without_grids(self):
        self.folder.joinpath("none.vdb").write_bytes(HEADER + struct.pack("<II", 0, 0))
        self.refuse(1, "holds no grids", "resample", "none.vdb", *MIMAKI, "-o", "x.vdb")


class Pipes(ProgramTest):
    def setUp(self):
        super().setUp()
        for number, size in enumerate((0.4, 0.6)):
            meshes.write_stl(self.folder / f"{number}.stl", meshes.box((size, size, size)))
        self.runs = [self.succeed("mesh2sdf", f"{number}.stl", *MIMAKI, "--slab", "8") for number in (0, 1)]

    def refuse_pipe(self, message, content):
        for chain in (("dither", "-o", "x.vdb"), ("resample", *MIMAKI, "-o", "x.vdb"), ("mesh-export", "x.stl"), ("info",),
                      ("dither", "--layers", "0:8", "-o", "x.vdb")):
            with self.subTest(chain=chain):
                self.refuse(1, message, *chain, input=content)

    def test_frames_of_two_runs_are_refused(self):
        magic = self.runs[0][:8]
        a, b = ([magic + frame for frame in run.split(magic)[1:]] for run in self.runs)
        mixed = [frame for pair in zip(a, b) for frame in pair]
        self.refuse_pipe("mixes the frames of two runs", b"".join(mixed))
        self.refuse_pipe("mixes the frames of two runs", b"".join([a[0], a[1], *b, *a[2:]]))

    def test_what_follows_is_refused(self):
        for content, message in ((self.runs[0] + self.runs[1], "goes on behind its closing frame: another archive follows"),
                                 (self.runs[0] + b"\n", "goes on behind its closing frame: 1 byte follows")):
            self.refuse_pipe(message, content)

    def test_two_runs_on_one_pipe_never_pass(self):
        line = "(vdbdither mesh2sdf 0.stl --printer mimaki-3duj-553 & vdbdither mesh2sdf 1.stl --printer mimaki-3duj-553) | cat"
        for _ in range(3):
            self.refuse(1, "standard input", "dither", "-o", "x.vdb", input=self.shell(line))

    def test_a_file_of_frames_says_how_to_read_it(self):
        (self.folder / "frames.vdb").write_bytes(self.runs[0])
        self.refuse(1, "'frames.vdb' goes on behind its archive: another archive follows", "dither", "-i", "frames.vdb", "-o", "x.vdb")


class Sizes(ProgramTest):
    def limit(self):
        if not os.environ.get("VDBDITHER_SANITIZER"):
            # The shadow memory of a sanitizer needs terabytes of addresses.
            resource.setrlimit(resource.RLIMIT_AS, (1500 << 20, 1500 << 20))

    def test_counts_and_sizes_of_a_file_are_refused_before_they_are_read(self):
        name = b"n" * (100 << 20)
        grid = sized(b"Tree_float_5_4_3") + sized(b"") + bytes(24) + bytes(4)
        entries = b"".join(sized(b"%d" % number) + sized(b"string") + sized(b"") for number in range(1000000))
        for what, content in (("1000000 entries of metadata", HEADER + struct.pack("<I", 1000000) + entries),
                              ("a name of 100 MiB", HEADER + bytes(4) + struct.pack("<I", 1) + sized(name) + grid),
                              ("a key of metadata of 100 MiB", HEADER + struct.pack("<I", 1) + sized(name) + sized(b"string")),
                              ("of metadata or more", HEADER + struct.pack("<I", 1) + sized(b"key") + sized(b"string") + sized(name))):
            (self.folder / "large.vdb").write_bytes(content)
            for verb in (("info", "large.vdb"), ("read", "large.vdb", "-o", "x.vdb"), ("resample", "large.vdb", *MIMAKI, "-o", "x.vdb")):
                with self.subTest(what=what, verb=verb):
                    self.refuse(1, what, *verb, preexec_fn=self.limit, timeout=20 * PATIENCE)
            with self.subTest(what=what):
                self.refuse(1, what, "dither", "-o", "x.vdb", input=content, preexec_fn=self.limit, timeout=20 * PATIENCE)


if __name__ == "__main__":
    unittest.main()
