"""Damaged pipes and files, interrupted runs, and processes that end early."""

import os
import random
import signal
import subprocess
import threading
import time
import unittest

import meshes
from program import MIMAKI, PATIENCE, ProgramTest


class Damage(ProgramTest):
    """Frames and files that are truncated or changed."""

    def setUp(self):
        super().setUp()
        meshes.write_stl(self.folder / "part.stl", meshes.sphere(0.6))
        self.frames = self.succeed("mesh2sdf", "part.stl", *MIMAKI, "--slab", "16")
        self.succeed("mesh2sdf", "part.stl", *MIMAKI, "-o", "surface.vdb")
        self.file = (self.folder / "surface.vdb").read_bytes()
        self.archives = self.beginnings(self.frames)
        self.assertGreater(len(self.archives), 4)
        self.random = random.Random(1)

    @staticmethod
    def beginnings(frames):
        """Returns the positions at which the archives of a pipe begin."""
        magic, at, found = frames[:8], 0, []
        while at >= 0:
            found.append(at)
            at = frames.find(magic, at + 1)
        return found

    def refuse_frames(self, frames, *messages):
        done = self.refuse(1, "standard input", "normals", "-o", "out.vdb", input=frames)
        said = done.stderr.decode()
        self.assertTrue(any(message in said for message in messages or ("",)), said)

    def refuse_file(self, content):
        (self.folder / "spoilt.vdb").write_bytes(content)
        self.refuse(1, "'spoilt.vdb'", "normals", "-i", "spoilt.vdb", "-o", "out.vdb")

    def test_an_empty_pipe_is_an_error(self):
        self.refuse_frames(b"", "is empty: the run upstream failed, or nothing was piped in")

    def test_a_pipe_without_its_closing_frame_is_an_error(self):
        for end in self.archives[1:]:
            self.refuse_frames(self.frames[:end], "ended before its closing frame")

    def test_a_pipe_cut_anywhere_is_an_error(self):
        cuts = [1, 20, 60, *(end + self.random.randrange(-200, 200) for end in self.archives[1:]), len(self.frames) - 1]
        for cut in cuts:
            self.refuse_frames(self.frames[:cut])

    def test_a_lost_or_doubled_frame_is_an_error(self):
        first, second, third = self.archives[1:4]
        self.refuse_frames(self.frames[:first] + self.frames[second:])
        self.refuse_frames(self.frames[:third] + self.frames[second:])
        self.refuse_frames(self.frames[first:])

    def test_a_flipped_bit_in_a_pipe_is_found(self):
        for _ in range(24):
            spoilt = bytearray(self.frames)
            spoilt[self.random.randrange(len(spoilt))] ^= 1 << self.random.randrange(8)
            self.refuse_frames(bytes(spoilt))

    def test_layers_that_never_come_are_an_error(self):
        for layers, first in (("16:32", 0), ("0:16", 16)):
            some = self.succeed("mesh2sdf", "part.stl", *MIMAKI, "--layers", layers)
            done = self.refuse(1, "standard input lacks layer", "normals", "-o", "out.vdb", input=some)
            self.assertIn(f"lacks layer {first};", done.stderr.decode())
        # The wanted layers and their neighbours are sufficient.
        some = self.succeed("mesh2sdf", "part.stl", *MIMAKI, "--layers", "0:32")
        self.succeed("normals", "--layers", "4:12", "-o", "out.vdb", input=some)

    def test_layers_that_a_file_lacks_are_an_error(self):
        self.succeed("mesh2sdf", "part.stl", *MIMAKI, "--layers", "0:32", "-o", "some.vdb")
        self.refuse(1, "'some.vdb' lacks layer 32;", "normals", "-i", "some.vdb", "-o", "out.vdb")
        self.succeed("normals", "-i", "some.vdb", "--layers", "4:12", "-o", "out.vdb")

    def test_data_other_than_vdb_is_refused(self):
        for text in (b"hello\n", bytes(5000), self.random.randbytes(5000)):
            self.refuse_frames(text)

    def test_a_file_cut_anywhere_is_an_error(self):
        for cut in (0, 1, 20, 60, 1000, len(self.file) // 2, len(self.file) - 1):
            self.refuse_file(self.file[:cut])

    def test_a_flipped_bit_in_a_file_is_found(self):
        for _ in range(24):
            spoilt = bytearray(self.file)
            spoilt[self.random.randrange(len(spoilt))] ^= 1 << self.random.randrange(8)
            self.refuse_file(bytes(spoilt))


class Stops(ProgramTest):
    """Runs that end early leave no files."""

    def setUp(self):
        super().setUp()
        meshes.write_stl(self.folder / "tall.stl", meshes.cylinder(5, 60))
        meshes.write_stl(self.folder / "part.stl", meshes.sphere(0.6))
        self.inputs = self.listing()

    def chain(self):
        return ["mesh2sdf", "tall.stl", *MIMAKI, "--slab", "8", "!", "normals", "!", "dither", "!", "slice-export", "out"]

    def wait_for_slices(self, process):
        """Waits until the first slice exists."""
        deadline = time.monotonic() + 60 * PATIENCE
        while not any(path.suffix == ".png" for path in self.folder.rglob("*")):
            self.assertIsNone(process.poll())
            self.assertLess(time.monotonic(), deadline)
            time.sleep(0.01)

    def test_interrupt_and_termination_leave_nothing(self):
        for number in (signal.SIGINT, signal.SIGTERM):
            process = self.start(*self.chain())
            self.wait_for_slices(process)
            process.send_signal(number)
            said = process.communicate()[1].decode()
            self.assertEqual(process.returncode, 128 + number)
            self.assertRegex(said, r"^vdbdither.*: stopped: \w+\n$")
            self.expect_removed(self.inputs)

    def test_a_process_that_waits_for_a_pipe_can_be_stopped(self):
        os.mkfifo(self.folder / "silent.vdb")
        self.succeed("mesh2sdf", "part.stl", *MIMAKI, "-o", "part.vdb")
        before = self.listing()
        reader, writer = os.pipe()
        self.addCleanup(os.close, writer)
        for arguments, keywords in (
                (("dither", "-o", "out.vdb"), {"stdin": reader}),
                (("resample", *MIMAKI, "-o", "out.vdb"), {"stdin": reader}),
                (("csg", "--union", "silent.vdb", "-i", "part.vdb", "-o", "out.vdb"), {}),
                (("mesh2sdf", "tall.stl", *MIMAKI), {"stdout": writer})):
            for number in (signal.SIGINT, signal.SIGTERM):
                process = self.start(*arguments, **keywords)
                time.sleep(1)
                self.assertIsNone(process.poll(), arguments)
                process.send_signal(number)
                said = process.communicate(timeout=20 * PATIENCE)[1].decode()
                self.assertEqual(process.returncode, 128 + number, (arguments, said))
                self.assertEqual(said.count("\n"), 1, said)
                self.expect_removed(before)
        os.close(reader)

    def test_files_of_a_killed_run_are_removed_by_the_next(self):
        process = self.start(*self.chain())
        self.wait_for_slices(process)
        process.kill()
        process.wait()
        self.assertNotEqual(self.listing(), self.inputs)
        self.succeed("mesh2sdf", "part.stl", *MIMAKI, "!", "dither", "!", "slice-export", "out")
        self.assertEqual([path.name for path in self.folder.iterdir() if path.name.startswith(".")], [])

    def test_a_killed_run_upstream_fails_the_run_downstream(self):
        upstream = self.start("mesh2sdf", "tall.stl", *MIMAKI, "--slab", "8", stderr=None)
        downstream = self.start("dither", "!", "slice-export", "out", stdin=upstream.stdout)
        self.wait_for_slices(downstream)
        upstream.kill()
        said = downstream.communicate()[1].decode()
        self.assertEqual(downstream.returncode, 1)
        self.assertRegex(said, r"^vdbdither read: standard input .*\n$")
        self.assertEqual(self.listing(), self.inputs)

    def test_a_reader_that_closes_the_pipe_is_an_error(self):
        process = self.start("mesh2sdf", "tall.stl", *MIMAKI, "--slab", "8")
        self.assertEqual(len(process.stdout.read(1000)), 1000)
        process.stdout.close()
        said = process.stderr.read().decode()
        self.assertEqual(process.wait(), 1)
        self.assertEqual(said, "vdbdither write: the reader of the pipe has gone\n")

    def test_pipes_that_do_not_block_are_waited_for(self):
        meshes.write_stl(self.folder / "part.stl", meshes.sphere(3, 40))
        expected = self.succeed("mesh2sdf", "part.stl", *MIMAKI)
        self.assertGreater(len(expected), 500000)
        read, written = os.pipe()
        os.set_blocking(written, False)
        upstream = self.start("mesh2sdf", "part.stl", *MIMAKI, stdout=written)
        os.close(written)
        time.sleep(0.5)
        received = b""
        while block := os.read(read, 20000):
            received += block
            time.sleep(0.001)
        os.close(read)
        self.assertEqual((upstream.wait(), upstream.stderr.read(), received == expected), (0, b"", True))
        read, written = os.pipe()
        os.set_blocking(read, False)
        downstream = self.start("read", stdin=read)
        os.close(read)

        def send():
            with open(written, "wb") as pipe:
                for begin in range(0, len(expected), 50000):
                    pipe.write(expected[begin:begin + 50000])
                    pipe.flush()
                    time.sleep(0.01)

        sender = threading.Thread(target=send)
        sender.start()
        data, said = downstream.communicate(timeout=60 * PATIENCE)
        sender.join()
        self.assertEqual((downstream.returncode, said, data == expected), (0, b"", True))

    def test_the_name_of_standard_output_is_standard_output(self):
        expected = self.succeed("mesh2sdf", "part.stl", *MIMAKI)
        log = self.folder / "log.txt"
        with open(self.folder / "out.vdb", "wb") as out, open(log, "wb") as said:
            said.write(b"precious")
            said.flush()
            process = self.start("mesh2sdf", "part.stl", *MIMAKI, "-o", "/dev/stdout", "--overwrite", stdout=out, stderr=said)
            self.assertEqual(process.wait(60 * PATIENCE), 0)
        self.assertEqual(log.read_bytes(), b"precious")
        self.assertEqual((self.folder / "out.vdb").read_bytes(), expected)

    def test_a_full_disk_at_standard_output_is_reported(self):
        with open("/dev/full", "wb") as full:
            self.refuse(1, "No space left on device", "mesh2sdf", "part.stl", *MIMAKI, stdout=full)
            self.refuse(1, "No space left on device", "--help", stdout=full)

    def test_an_output_is_replaced_only_when_the_new_one_is_complete(self):
        self.succeed("mesh2sdf", "part.stl", *MIMAKI, "!", "dither", "!", "slice-export", "out")
        before = self.listing()
        process = self.start(*self.chain(), "--overwrite")
        deadline = time.monotonic() + 60 * PATIENCE
        while self.listing() == before:
            self.assertLess(time.monotonic(), deadline)
        process.send_signal(signal.SIGINT)
        process.communicate()
        self.expect_removed(before)


class Explained(ProgramTest):
    """--explain at the end of a pipe."""

    def setUp(self):
        super().setUp()
        meshes.write_stl(self.folder / "part.stl", meshes.sphere(2, 60))
        self.source = "vdbdither mesh2sdf part.stl --printer mimaki-3duj-553"

    def test_explain_after_a_pipe_lets_its_writer_succeed(self):
        self.succeed("mesh2sdf", "part.stl", *MIMAKI, "-o", "part.vdb")
        before = self.listing()
        for reader in ("dither ! slice-export out", "dither --layers 0:8 -o x.vdb", "compare part.vdb",
                       f"csg --union <({self.source}) -o x.vdb"):
            with self.subTest(reader=reader):
                self.assertIn(b"\nmemory ", self.shell(f"{self.source} | vdbdither {reader} --explain"))
                self.assertIn(b'"memory_bytes":', self.shell(f"{self.source} | vdbdither read --json ! {reader} --explain"))
                self.assertEqual(self.listing(), before)

    def test_explain_prints_before_its_writer_is_done(self):
        frames = self.succeed("mesh2sdf", "part.stl", *MIMAKI)
        process = self.start("dither", "-o", "x.vdb", "--explain", stdin=subprocess.PIPE)
        process.stdin.write(frames[:-1])
        process.stdin.flush()
        self.assertTrue(process.stdout.readline().startswith(b"lattice "))
        self.assertIsNone(process.poll())
        said = process.communicate()[1].decode()
        self.assertEqual(process.returncode, 1)
        self.assertRegex(said, r"^vdbdither read: standard input .*\n$")


if __name__ == "__main__":
    unittest.main()
