"""Limits of the system and closed descriptors: one line of error, its exit code, and no files left."""

import os
import resource
import signal
import time
import unittest

import meshes
from program import MIMAKI, PATIENCE, ProgramTest

CHAIN = ("mesh2sdf", "part.stl", *MIMAKI, "!", "dither")


def limited(limit, value):
    return {"preexec_fn": lambda: (resource.setrlimit(resource.RLIMIT_CORE, (0, 0)), resource.setrlimit(limit, (value, value)))}


class Limits(ProgramTest):
    def setUp(self):
        super().setUp()
        meshes.write_stl(self.folder / "part.stl", meshes.sphere(1.5, 40))

    def test_a_limit_of_the_size_of_files_is_reported(self):
        self.succeed(*CHAIN, "-o", "part.vdb")
        small = limited(resource.RLIMIT_FSIZE, 512)
        for arguments in ((*CHAIN, "-o", "x.vdb"), (*CHAIN, "!", "slice-export", "x"), (*CHAIN, "!", "slice-export", "x.zip"),
                          (*CHAIN, "!", "slice-export", "x", "--format", "exr"), (*CHAIN, "!", "slice-export", "x", "--format", "tiff"),
                          (*CHAIN, "!", "mesh-export", "x.stl"), (*CHAIN, "!", "mesh-export", "x.ply"), (*CHAIN, "!", "mesh-export", "x.obj"),
                          ("mask", "--size", 16, "-o", "x.vdb"), ("render", "part.stl", "x.png", "--samples", 1),
                          ("mask", "--size", 8, "!", "mask-spectrum", "x.json", "--step", 45, "--plane-step", 45),
                          ("measure", "part.stl", "--reference", "part.stl", "--report", "x.json"),
                          ("measure", "part.stl", "--reference", "part.stl", "--map", "x.ply")):
            with self.subTest(arguments=arguments):
                self.refuse(1, ": File too large", *arguments, **small)
        with open(os.devnull, "rb") as nothing, open(self.folder / "frames", "wb") as frames:
            done = self.run_program(*CHAIN, stdin=nothing, stdout=frames, **small)
        self.assertEqual((done.returncode, done.stderr), (1, b"vdbdither write: cannot write to standard output: File too large\n"))

    def test_a_mask_too_large_for_the_cache_is_a_warning(self):
        done = self.run_program(*CHAIN, "--size", 16, "!", "stats", env={**os.environ, "XDG_CACHE_HOME": str(self.folder / "cache")},
                                **limited(resource.RLIMIT_FSIZE, 512))
        self.assertEqual(done.returncode, 0)
        self.assertRegex(done.stderr.decode(), r"\A[^\n]*warning: the mask is not kept for the next run: [^\n]*: File too large\n\Z")
        self.assertEqual([path for path in (self.folder / "cache").rglob("*") if path.is_file()], [])

    def test_threads_that_the_system_does_not_grant_are_reported(self):
        self.folder.chmod(0o777)
        nobody = self.as_nobody()
        granted = False
        # The limit counts all threads of the user.
        for processes in range(1, 40):
            before = self.listing()
            done = self.run_program(*CHAIN, "!", "slice-export", "out", **nobody, **limited(resource.RLIMIT_NPROC, processes))
            said = done.stderr.decode()
            if done.returncode == 0:
                self.assertEqual(said, "")
                granted = True
                break
            self.assertEqual(done.returncode, 1, said)
            self.assertRegex(said, r"\Avdbdither: cannot start a thread: Resource temporarily unavailable; "
                                   r"allow more processes \(ulimit -u\) or more memory \(ulimit -v\)\n\Z")
            self.assertEqual(self.listing(), before)
        self.assertGreater(processes, 1)
        self.assertTrue(granted)

    def test_memory_that_the_system_does_not_grant_is_reported(self):
        for arguments in ((*CHAIN, "!", "slice-export", "out"), ("render", "part.stl", "out.png", "--samples", 1),
                          (*CHAIN, "!", "mesh-export", "out.stl")):
            refused = 0
            for megabytes in (*range(130, 260, 10), 300, 400, 600, 800):
                before = self.listing()
                done = self.run_program(*arguments, **limited(resource.RLIMIT_AS, megabytes << 20))
                said = done.stderr.decode()
                if done.returncode == 127:
                    continue  # The libraries do not fit.
                if done.returncode == 0:
                    self.assertEqual(said, "")
                    break
                self.assertEqual((done.returncode, said.count("\n")), (1, 1), (arguments, megabytes, said))
                self.assertRegex(said, r"\Avdbdither( [a-z0-9-]+)?: (out of memory; |cannot start a thread: |[^\n]* of memory and may use |[^\n]* bytes do not fit into memory; )")
                self.assertEqual(self.listing(), before)
                refused += 1
            self.assertEqual(done.returncode, 0)
            self.assertGreater(refused, 0)


class Closed(ProgramTest):
    """Standard descriptors that are closed, in all combinations."""

    def setUp(self):
        super().setUp()
        meshes.write_stl(self.folder / "part.stl", meshes.sphere(0.6))

    def run_closed(self, closed, *arguments):
        """Runs with the descriptors closed. Returns the exit code, and what was printed to the others."""
        reader, writer = os.pipe()
        out, out_writer = os.pipe()

        def prepare():
            for number, target in ((0, os.open(os.devnull, os.O_RDONLY)), (1, out_writer), (2, writer)):
                os.dup2(target, number)
            os.closerange(3, 256)
            for number in closed:
                os.close(number)

        process = self.start(*arguments, stdin=None, stdout=None, stderr=None, close_fds=False, preexec_fn=prepare)
        os.close(writer)
        os.close(out_writer)
        with open(out, "rb") as printed, open(reader, "rb") as said:
            data = printed.read()
            words = said.read().decode()
        return process.wait(timeout=60 * PATIENCE), data, words

    def test_a_closed_input_is_reported(self):
        before = self.listing()
        for arguments in (("dither", "-o", "x.vdb"), ("normals",), ("resample", *MIMAKI, "-o", "x.vdb"), ("info",), ("stats",)):
            code, data, said = self.run_closed([0], *arguments)
            self.assertEqual((code, data), (1, b""), said)
            self.assertRegex(said, r"\Avdbdither [a-z]+: cannot read standard input: Bad file descriptor\n\Z")
            self.assertEqual(self.listing(), before)

    def test_a_closed_output_is_reported(self):
        for arguments in (CHAIN, ("mask", "--size", 8), ("--help",), ("printers",), ("mesh2sdf", "part.stl", *MIMAKI, "!", "stats")):
            code, _, said = self.run_closed([1], *arguments)
            self.assertEqual(code, 1, (arguments, said))
            self.assertRegex(said, r"\Avdbdither( [a-z0-9-]+)?: cannot write to standard output: Bad file descriptor\n\Z")
        self.assertEqual([path.name for path in self.folder.iterdir()], ["part.stl"])

    def test_a_closed_descriptor_that_is_not_needed_does_not_matter(self):
        self.succeed(*CHAIN, "-o", "expected.vdb")
        frames = self.succeed(*CHAIN)
        for closed in ([0], [1], [2], [0, 1], [0, 2], [1, 2], [0, 1, 2]):
            with self.subTest(closed=closed):
                code, data, said = self.run_closed(closed, *CHAIN, "!", "write", "x.vdb", "--overwrite", "!", "slice-export", "out", "--overwrite")
                self.assertEqual((code, data, said), (0, b"", ""))
                self.assertEqual((self.folder / "x.vdb").read_bytes(), (self.folder / "expected.vdb").read_bytes())
                if 1 not in closed:
                    self.assertEqual(self.run_closed(closed, *CHAIN), (0, frames, ""))

    def test_an_error_without_a_place_for_its_message_keeps_its_exit_code(self):
        for closed in ([2], [1, 2], [0, 1, 2]):
            self.assertEqual(self.run_closed(closed, "mesh2sdf", "none.stl", *MIMAKI, "-o", "x.vdb"), (1, b"", ""))
            self.assertEqual(self.run_closed(closed, "mesh2sdf", "part.stl"), (2, b"", ""))


class Shrunken(ProgramTest):
    def test_a_mapped_file_that_becomes_shorter_is_reported(self):
        # The kernel sends SIGBUS to a program that reads a mapped page whose file has become shorter.
        process = self.start("mask", "--size", 128, "-o", "x.vdb")
        deadline = time.monotonic() + 60 * PATIENCE
        while not list(self.folder.iterdir()):
            self.assertIsNone(process.poll())
            self.assertLess(time.monotonic(), deadline)
        process.send_signal(signal.SIGBUS)
        said = process.communicate(timeout=60 * PATIENCE)[1].decode()
        self.assertEqual((process.returncode, said),
                         (1, "vdbdither: a file became shorter or unreadable while it was read; run again\n"))
        self.assertEqual(list(self.folder.iterdir()), [])


if __name__ == "__main__":
    unittest.main()
