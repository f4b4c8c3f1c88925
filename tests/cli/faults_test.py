"""Full disks, folders without permission to write, and paths that are of the wrong kind."""

import os
import re
import signal
import subprocess
import time
import unittest

import meshes
from program import MIMAKI, PATIENCE, PROGRAM, ProgramTest


class FullDisk(ProgramTest):
    """An output that fills the disk fails with one line at any time, and the old output stays."""

    @classmethod
    def setUpClass(cls):
        cls.inputs = cls.folder_of_class()
        meshes.write_stl(cls.inputs / "part.stl", meshes.sphere(0.6))
        for line in (("mesh2sdf", "part.stl", *MIMAKI, "!", "normals", "!", "dither", "!", "material-assign", "-o", "part.vdb"),
                     ("mesh-export", "-i", "part.vdb", "print.ply")):
            subprocess.run([PROGRAM, *line], cwd=cls.inputs, check=True, timeout=120 * PATIENCE)
        # The size of piped data is unknown, so the runs start.
        cls.frames = subprocess.run([PROGRAM, "read", "part.vdb"], cwd=cls.inputs, check=True, timeout=120 * PATIENCE,
                                    stdout=subprocess.PIPE).stdout

    def setUp(self):
        super().setUp()
        self.disk = self.folder / "disk"
        self.disk.mkdir()
        mounted = subprocess.run(["mount", "-t", "tmpfs", "tmpfs", self.disk], capture_output=True)
        if mounted.returncode != 0:
            self.skipTest("a small disk can be mounted only by root")
        self.addCleanup(subprocess.run, ["umount", self.disk], check=True)

    def resize(self, kilobytes, inodes=1000):
        subprocess.run(["mount", "-o", f"remount,size={kilobytes}k,nr_inodes={inodes}", self.disk], check=True)

    def fill(self, target, *arguments, sizes=(8, 16, 32, 64, 96), inodes=1000, **keywords):
        """Runs with disks of some KiB and an existing `target`. Every run must fail, at least one because its disk is full."""
        old = self.disk / target
        if "." in target:
            old.write_bytes(b"old")
        else:
            old.mkdir()
            (old / "manifest.json").write_bytes(b'{"slices": []}')
        before = self.listing()
        filled = 0
        for size in sizes:
            self.resize(size, inodes)
            done = self.run_program(*arguments, "--overwrite", **keywords)
            said = done.stderr.decode()
            self.assertEqual(done.returncode, 1, (arguments, size, said))
            self.assertRegex(said, r"\Avdbdither[^\n]*(No space left on device|needs about [^\n]* left; )[^\n]*\n\Z")
            filled += "No space left on device" in said
            self.assertEqual(self.listing(), before, (arguments, size))
        self.assertGreater(filled, 0, arguments)
        subprocess.run(["rm", "-r", old], check=True)

    def export(self, target, *options, **keywords):
        self.fill(target, "slice-export", f"disk/{target}", *options, input=self.frames, **keywords)

    def test_a_stack_of_png(self):
        self.export("stack", sizes=(16, 64, 4000), inodes=40)

    def test_a_stack_of_one_bit_png(self):
        self.export("stack", "--format", "png1", sizes=(16, 64, 4000), inodes=40)

    def test_a_stack_of_tiff(self):
        self.export("stack", "--format", "tiff", sizes=(16, 64, 4000), inodes=40)

    def test_a_stack_of_exr(self):
        self.export("stack", "--format", "exr", "--exr-packing", "none", sizes=(16, 64, 4000), inodes=40)

    def test_the_preview_and_the_manifest_of_a_stack(self):
        stack = self.folder / "stack"
        self.succeed("slice-export", "-i", self.inputs / "part.vdb", stack, "--format", "tiff")
        files = sum(1 for _ in stack.iterdir())
        # Inodes: the disk, the old folder and its contents, the new folder; then all files except one or two.
        for missing in (1, 2):
            self.export("stack", "--format", "tiff", sizes=(4000,), inodes=4 + files - missing)

    def test_a_zip_of_slices(self):
        self.export("stack.zip", "--format", "exr", "--exr-packing", "none", sizes=(8, 32, 64))

    def test_a_vdb(self):
        self.fill("a.vdb", "write", "disk/a.vdb", sizes=(8, 32, 128, 256, 400), input=self.frames)

    def test_a_vdb_in_mid_chain(self):
        self.fill("a.vdb", "write", "disk/a.vdb", "--overwrite", "!", "normals", "!", "write", "outside.vdb",
                  sizes=(8, 128, 400), input=self.frames)

    def test_meshes(self):
        for name in ("a.stl", "a.ply", "a.obj"):
            self.fill(name, "mesh-export", f"disk/{name}", "--grid", "solid", sizes=(8, 64, 256), input=self.frames)

    def test_a_picture(self):
        for name in ("a.png", "a.exr"):
            self.fill(name, "render", self.inputs / "part.stl", f"disk/{name}", "--pixel", "0.01mm", "--samples", 4, sizes=(8,))

    def test_a_mask(self):
        frames = subprocess.run([PROGRAM, "mask", "--size", "32"], check=True, timeout=120 * PATIENCE, stdout=subprocess.PIPE).stdout
        self.fill("a.vdb", "write", "disk/a.vdb", input=frames, sizes=(8, 64))

    def test_a_measurement(self):
        measure = ("measure", self.inputs / "print.ply", "--reference", self.inputs / "part.stl")
        self.fill("map.ply", *measure, "--map", "disk/map.ply", sizes=(8, 64))
        (self.disk / "filler").write_bytes(bytes(8192))
        self.fill("report.json", *measure, "--report", "disk/report.json", sizes=(12,))

    def test_a_mask_that_cannot_be_kept_is_a_warning(self):
        self.resize(16)
        done = self.run_program("read", self.inputs / "part.vdb", "--grids", "surface", "!", "dither", "--size", 32,
                                env={**os.environ, "XDG_CACHE_HOME": str(self.disk)})
        self.assertEqual(done.returncode, 0)
        self.assertRegex(done.stderr.decode(), r"\A[^\n]*warning: the mask is not kept for the next run: "
                                               r"cannot write [^\n]*: No space left on device\n\Z")
        self.assertEqual([path for path in self.disk.rglob("*") if path.is_file()], [])


class InTheWay(ProgramTest):
    def setUp(self):
        super().setUp()
        meshes.write_stl(self.folder / "part.stl", meshes.sphere(0.6))
        self.succeed("mesh2sdf", "part.stl", *MIMAKI, "!", "dither", "-o", "part.vdb")

    def sinks(self, place):
        """Returns arguments that write every kind of output, named `place`/out…."""
        read = ("-i", "part.vdb")
        return (("slice-export", *read, f"{place}/out"), ("slice-export", *read, f"{place}/out.zip"),
                ("mesh-export", *read, f"{place}/out.stl"), ("read", "part.vdb", "!", "write", f"{place}/out.vdb"),
                ("render", "part.stl", f"{place}/out.png", "--samples", 1), ("mask", "--size", 8, "-o", f"{place}/out.vdb"),
                ("measure", "part.stl", "--reference", "part.stl", "--report", f"{place}/out.json"),
                ("measure", "part.stl", "--reference", "part.stl", "--map", f"{place}/out.ply"))

    def test_a_read_only_folder_is_reported(self):
        place = self.folder / "locked"
        place.mkdir()
        place.chmod(0o555)
        keywords = {}
        if os.geteuid() == 0:
            # root may write everywhere.
            for path in (self.folder, self.folder / "part.stl", self.folder / "part.vdb"):
                path.chmod(0o755)
            keywords = self.as_nobody()
        for arguments in self.sinks("locked"):
            self.refuse(1, "Permission denied", *arguments, **keywords)

    def test_a_read_only_stack_is_not_replaced(self):
        self.succeed("slice-export", "-i", "part.vdb", "out")
        (self.folder / "out").chmod(0o555)
        self.addCleanup((self.folder / "out").chmod, 0o755)
        keywords = {}
        if os.geteuid() == 0:
            self.folder.chmod(0o777)
            (self.folder / "part.vdb").chmod(0o644)
            keywords = self.as_nobody()
        self.refuse(1, "slice-export: cannot replace 'out': Permission denied", "slice-export", "-i", "part.vdb", "out", "--overwrite",
                    **keywords)

    def test_an_unreadable_file_is_reported(self):
        keywords = {}
        for name in ("part.stl", "part.vdb"):
            (self.folder / name).chmod(0)
        if os.geteuid() == 0:
            self.folder.chmod(0o755)
            keywords = self.as_nobody()
        self.refuse(1, "'part.stl': cannot be opened: Permission denied", "mesh2sdf", "part.stl", *MIMAKI, "-o", "x.vdb", **keywords)
        self.refuse(1, "cannot read 'part.vdb': Permission denied", "normals", "-i", "part.vdb", "-o", "x.vdb", **keywords)

    def test_a_folder_in_place_of_a_file_is_reported(self):
        for name in ("d", "d.vdb", "d.png", "d.json"):
            (self.folder / name).mkdir()
        chain = ("mesh2sdf", "part.stl", *MIMAKI, "!", "dither")
        for code, arguments in (
                (1, ("mesh2sdf", "d", *MIMAKI)), (1, ("normals", "-i", "d.vdb")), (1, ("csg", "-i", "part.vdb", "--union", "d.vdb")),
                (1, ("resample", "d.vdb", *MIMAKI)), (1, ("compare", "part.vdb", "d.vdb")), (1, (*chain, "--mask", "d.vdb")),
                (2, ("offset", "-i", "part.vdb", "--map", "d.png", "--height", "0.1mm")), (1, ("ssim", "d.png", "d.png")),
                (1, ("render", "d", "x.png")), (1, ("slice-import", "d")), (2, ("printers", "check", "d.json"))):
            with self.subTest(arguments=arguments):
                self.refuse(code, "'d", *arguments)
        for arguments in self.sinks("."):
            target = next(word for word in map(str, arguments) if word.startswith("./out"))
            if target == "./out":
                continue
            (self.folder / target).mkdir()
            with self.subTest(arguments=arguments):
                self.refuse(2, "is a folder; name a file in it", *arguments)
            (self.folder / target).rmdir()

    def test_a_file_in_place_of_a_folder_is_reported(self):
        (self.folder / "file").write_text("in the way")
        self.refuse(2, "'file' exists and is not a folder", "slice-export", "-i", "part.vdb", "file", "--overwrite")
        for arguments in self.sinks("file"):
            self.refuse(2, "there is no folder 'file'", *arguments)

    def test_a_device_or_a_pipe_in_place_of_a_file_is_reported(self):
        os.mkfifo(self.folder / "out")
        self.refuse(2, "'/dev/full' is not an ordinary file", "read", "part.vdb", "!", "write", "/dev/full", "--overwrite")
        self.refuse(2, "'out' exists and is not a folder", "slice-export", "-i", "part.vdb", "out", "--overwrite")
        (self.folder / "out").rename(self.folder / "out.stl")
        self.refuse(2, "'out.stl' is not an ordinary file", "mesh-export", "-i", "part.vdb", "out.stl", "--overwrite")
        self.refuse(1, "a pipe or device; mesh input needs a regular file", "mesh2sdf", "out.stl", *MIMAKI, "-o", "x.vdb")
        self.refuse(1, "'/dev/null'", "mesh2sdf", "/dev/null", *MIMAKI, "-o", "x.vdb")
        self.refuse(1, "'/dev/null'", "normals", "-i", "/dev/null", "-o", "x.vdb")


class Killed(ProgramTest):
    """kill -9 during any output leaves the old output complete, and the next run cleans up."""

    def setUp(self):
        super().setUp()
        meshes.write_stl(self.folder / "part.stl", meshes.sphere(0.6))
        meshes.write_stl(self.folder / "large.stl", meshes.sphere(4, rings=40))
        self.succeed("mesh2sdf", "large.stl", *MIMAKI, "!", "dither", "-o", "large.vdb")
        self.succeed("mesh2sdf", "part.stl", *MIMAKI, "!", "dither", "-o", "part.vdb")

    def hidden(self):
        return [path.name for path in self.folder.iterdir() if path.name.startswith(".")]

    def test_a_killed_run_leaves_the_old_output_and_the_next_one_cleans_up(self):
        for target, sink in (("out", ("slice-export", "out")), ("out.zip", ("slice-export", "out.zip")),
                             ("out.stl", ("mesh-export", "out.stl")), ("out.vdb", ("write", "out.vdb"))):
            with self.subTest(target=target):
                small = ("read", "part.vdb", "!", *sink, "--overwrite")
                self.succeed(*small)
                before = self.listing()
                process = self.start("read", "large.vdb", "!", *sink, "--overwrite")
                deadline = time.monotonic() + 60 * PATIENCE
                while not self.hidden():
                    self.assertIsNone(process.poll())
                    self.assertLess(time.monotonic(), deadline)
                process.send_signal(signal.SIGKILL)
                process.wait()
                left = self.hidden()
                self.assertEqual(len(left), 1)
                self.assertTrue(re.fullmatch(rf"\.{target}\.partial-[0-9a-f]{{8}}-{process.pid}", left[0]), left)
                hidden = tuple(left)
                self.assertEqual([entry for entry in self.listing() if not entry[0].startswith(hidden)], before)
                self.succeed(*small)
                self.assertEqual(self.listing(), before)


if __name__ == "__main__":
    unittest.main()
