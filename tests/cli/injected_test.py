"""Calls of the system that fail in the middle of a run, folders that vanish, clocks that jump, and limits that are reached."""

import os
import resource
import signal
import subprocess
import time
import unittest

import meshes
import preload
from PIL import Image
from program import MIMAKI, PATIENCE, ProgramTest, start_program

NO_SPACE = 28
IO_ERROR = 5

# Every kind of output by its name, and the run that writes it.
SINKS = {
    "out": ("slice-export", "-i", "part.vdb", "out"),
    "out.html": ("slice-export", "-i", "part.vdb", "stack", "--page", "out.html", "--overwrite"),
    "tiff": ("slice-export", "-i", "part.vdb", "tiff", "--format", "tiff"),
    "exr": ("slice-export", "-i", "part.vdb", "exr", "--format", "exr"),
    "out.zip": ("slice-export", "-i", "part.vdb", "out.zip"),
    "out.gcvf": ("slice-export", "-i", "part.vdb", "out.gcvf"),
    "out.3mf": ("slice-export", "-i", "part.vdb", "out.3mf", "--3mf-level-set"),
    "out.vdb": ("read", "part.vdb", "!", "write", "out.vdb"),
    "out.stl": ("mesh-export", "-i", "part.vdb", "out.stl"),
    "out.ply": ("mesh-export", "-i", "part.vdb", "out.ply"),
    "out.obj": ("mesh-export", "-i", "part.vdb", "out.obj"),
    "out.glb": ("mesh-export", "-i", "part.vdb", "out.glb"),
    "out.drc": ("mesh-export", "-i", "part.vdb", "out.drc"),
    "out.png": ("render", "part.stl", "out.png", "--samples", 1),
    "out.exr": ("render", "part.stl", "out.exr", "--samples", 1),
    "out.json": ("mask", "--size", 8, "--kind", "white", "!", "mask-spectrum", "out.json", "--step", 45, "--plane-step", 45),
    "report.json": ("measure", "part.stl", "--reference", "part.stl", "--report", "report.json"),
    "map.ply": ("measure", "part.stl", "--reference", "part.stl", "--map", "map.ply"),
    "page.html": ("preview", "stack", "page.html"),
    "maps": ("ssim", "a.png", "a.png", "--maps", "maps"),
    "jet.json": ("printers", "new", "jet.json"),
}


@unittest.skipIf(os.environ.get("VDBDITHER_SANITIZER"), "a sanitizer wants to be the first library")
class Failing(ProgramTest):
    """Each kind of output, when one of the calls that write it fails."""

    @classmethod
    def setUpClass(cls):
        cls.inputs = cls.folder_of_class()
        cls.library = preload.library(cls.inputs, preload.CHANGES)
        meshes.write_stl(cls.inputs / "part.stl", meshes.box((0.6, 0.6, 0.9)))
        Image.linear_gradient("L").resize((16, 16)).convert("RGB").save(cls.inputs / "a.png")

    def setUp(self):
        super().setUp()
        for path in self.inputs.iterdir():
            (self.folder / path.name).write_bytes(path.read_bytes())
        self.succeed("mesh2sdf", "part.stl", "--printer", "stratasys-j750-27um", "!", "dither", "!", "material-assign", "!", "write", "part.vdb",
                     "!", "slice-export", "stack")

    def environment_of(self, **variables):
        return preload.environment(self.library, **variables)

    def calls(self, arguments, target):
        """Returns the names of the calls of a run, whose output is removed again."""
        log = self.inputs / "calls"
        log.write_text("")
        self.succeed(*arguments, env=self.environment_of(CALLS=log))
        subprocess.run(["rm", "-r", self.folder / target], check=True)
        return log.read_text().split()

    def test_a_full_disk_at_any_call(self):
        for target, arguments in SINKS.items():
            calls = self.calls(arguments, target)
            taking = [n for n, call in enumerate(calls[:calls.index("flush") + 1], 1) if call not in ("remove", "rename")]
            for at in (taking[len(taking) // 2], taking[-1]):
                with self.subTest(target=target, at=at, call=calls[at - 1]):
                    self.refuse(1, ": No space left on device", *arguments, env=self.environment_of(FAIL_AT=at, FAIL_AS=NO_SPACE, FAIL_ON=1))

    def test_a_file_that_cannot_be_closed(self):
        for target, arguments in SINKS.items():
            with self.subTest(target=target):
                self.refuse(1, ": No space left on device", *arguments, env=self.environment_of(FAIL_CLOSE=1, FAIL_AS=NO_SPACE))

    def test_a_name_that_is_not_granted(self):
        for target in ("out", "out.zip", "out.vdb"):
            arguments = SINKS[target]
            at = self.calls(arguments, target).index("rename") + 1
            self.refuse(1, ": Input/output error", *arguments, env=self.environment_of(FAIL_AT=at, FAIL_AS=IO_ERROR))


class Vanished(ProgramTest):
    def test_a_folder_that_vanishes_is_reported(self):
        meshes.write_stl(self.folder / "part.stl", meshes.sphere(0.6))
        frames = self.succeed("mesh2sdf", "part.stl", *MIMAKI, "--slab", "8", "!", "dither")
        for sink in (("slice-export", "gone/out"), ("slice-export", "gone/out.zip"), ("write", "gone/out.vdb"), ("mesh-export", "gone/out.ply")):
            with self.subTest(sink=sink):
                gone = self.folder / "gone"
                gone.mkdir()
                process = self.start("read", "!", *sink, stdin=subprocess.PIPE)
                process.stdin.write(frames[:len(frames) // 2])
                process.stdin.flush()
                deadline = time.monotonic() + 60 * PATIENCE
                while not list(gone.iterdir()) and sink[0] != "write" and sink[0] != "mesh-export":
                    self.assertIsNone(process.poll())
                    self.assertLess(time.monotonic(), deadline)
                gone.rename(self.folder / "elsewhere")
                _, said = process.communicate(frames[len(frames) // 2:], timeout=60 * PATIENCE)
                self.assertEqual(process.returncode, 1, said)
                self.assertRegex(said.decode(), rf"\Avdbdither {sink[0]}: cannot [a-z]+ 'gone/out[^']*': No such file or directory\n\Z")
                self.assertFalse(gone.exists())
                subprocess.run(["rm", "-r", self.folder / "elsewhere"], check=True)


class Reached(ProgramTest):
    """Limits of the system."""

    def setUp(self):
        super().setUp()
        meshes.write_stl(self.folder / "part.stl", meshes.sphere(0.6))

    def test_a_limit_of_open_files_is_reported(self):
        self.succeed("mesh2sdf", "part.stl", *MIMAKI, "!", "write", "surface.vdb", "!", "dither", "-o", "part.vdb")
        for arguments in (("mesh2sdf", "part.stl", *MIMAKI, "!", "dither", "!", "slice-export", "out"),
                          ("slice-export", "-i", "part.vdb", "out.zip"), ("csg", "-i", "surface.vdb", "--union", "part.vdb", "-o", "out.vdb")):
            refused = 0
            for files in range(4, 40):
                done = self.run_program(*arguments, preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_NOFILE, (files, files)))
                said = done.stderr.decode()
                if done.returncode == 0:
                    break
                if done.returncode == 127:
                    continue  # The libraries cannot be opened.
                self.assertEqual(done.returncode, 1, (files, said))
                self.assertRegex(said, r"\Avdbdither[^\n]*Too many open files[^\n]*\n\Z")
                self.assertEqual([path.name for path in self.folder.iterdir() if "out" in path.name], [])
                refused += 1
            self.assertEqual((done.returncode, said), (0, ""))
            self.assertGreater(refused, 0)
            subprocess.run(["rm", "-r", *self.folder.glob("out*")], check=True)

    def test_a_limit_of_cpu_time_is_reported(self):
        before = self.listing()
        done = self.run_program("mask", "--size", 256, "-o", "out.vdb",
                                preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_CPU, (1, 20)))
        self.assertEqual((done.returncode, done.stderr.decode()), (128 + signal.SIGXCPU, "vdbdither: stopped: CPU time limit exceeded\n"))
        self.assertEqual(self.listing(), before)


class AtOnce(ProgramTest):
    """Two runs that write one output."""

    def setUp(self):
        super().setUp()
        for name, radius in (("a", 0.5), ("b", 0.6)):
            meshes.write_stl(self.folder / f"{name}.stl", meshes.sphere(radius))
        self.frames = {name: self.succeed("mesh2sdf", f"{name}.stl", *MIMAKI, "!", "dither") for name in "ab"}

    def content(self, name):
        path = self.folder / name
        if path.is_dir():
            return {str(file.relative_to(path)): file.read_bytes() for file in path.rglob("*")}
        return path.read_bytes()

    def both(self, sink, *arguments):
        """Starts two runs, which are given their last bytes one after the other. Returns what the second says."""
        runs = []
        for name in "ab":
            process = start_program(self, *sink, *arguments, stdin=subprocess.PIPE)
            process.stdin.write(self.frames[name][:-1])
            process.stdin.flush()
            runs.append(process)
        said = [process.communicate(self.frames[name][-1:], timeout=60 * PATIENCE)[1].decode() for name, process in zip("ab", runs)]
        self.assertEqual((runs[0].returncode, said[0]), (0, ""))
        return runs[1].returncode, said[1]

    def test_the_last_output_stays_or_the_first_one_and_neither_is_lost(self):
        for name in ("out", "out.zip", "out.vdb"):
            sink = ("write", name) if name.endswith("vdb") else ("slice-export", name)
            with self.subTest(name=name):
                expected = {}
                for run in "ab":
                    self.succeed(*sink, "--overwrite", input=self.frames[run])
                    expected[run] = self.content(name)
                subprocess.run(["rm", "-r", self.folder / name], check=True)
                code, said = self.both(sink)
                self.assertEqual((code, said), (1, f"vdbdither {sink[0]}: cannot replace '{name}': File exists; the new one is '{name}.new'\n"))
                self.assertEqual((self.content(name), self.content(f"{name}.new")), (expected["a"], expected["b"]))
                self.assertEqual(self.both(sink, "--overwrite"), (0, ""))
                self.assertEqual(self.content(name), expected["b"])
                self.assertEqual([path.name for path in self.folder.iterdir() if path.name.startswith(".")], [])


@unittest.skipIf(os.environ.get("VDBDITHER_SANITIZER"), "a sanitizer wants to be the first library")
class Clocks(ProgramTest):
    """Clocks that jump by a day whenever they are looked at."""

    def setUp(self):
        super().setUp()
        self.library = preload.library(self.folder, preload.CLOCK)
        meshes.write_stl(self.folder / "part.stl", meshes.sphere(0.6))
        self.chain = ("mesh2sdf", "part.stl", *MIMAKI, "!", "dither", "!", "slice-export", "out", "--overwrite")

    def test_the_output_does_not_depend_on_the_time(self):
        self.succeed(*self.chain)
        expected = {path.name: path.read_bytes() for path in (self.folder / "out").iterdir()}
        for clock in ("later", "back and forth"):
            self.succeed(*self.chain, env=preload.environment(self.library, CLOCK=clock))
            self.assertEqual({path.name: path.read_bytes() for path in (self.folder / "out").iterdir()}, expected)

    def test_a_run_can_be_stopped(self):
        before = self.listing()
        for clock in ("later", "back and forth"):
            process = start_program(self, "mask", "--size", 256, "-o", "out.vdb", env=preload.environment(self.library, CLOCK=clock))
            process.send_signal(signal.SIGTERM)
            said = process.communicate(timeout=60 * PATIENCE)[1].decode()
            self.assertEqual((process.returncode, said), (143, "vdbdither: stopped: Terminated\n"))
            self.assertEqual(self.listing(), before)


if __name__ == "__main__":
    unittest.main()
