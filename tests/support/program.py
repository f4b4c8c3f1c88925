"""Runs the built program like a user."""

import os
import pathlib
import signal
import subprocess
import tempfile
import time
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
PROGRAM = pathlib.Path(os.environ.get("VDBDITHER_PROGRAM", ROOT / "build/release/vdbdither")).resolve()

# Factor for time limits under a sanitizer.
PATIENCE = 10 if os.environ.get("VDBDITHER_SANITIZER") else 1

MIMAKI = ("--printer", "mimaki-3duj-553")


def start_program(test, *arguments, **keywords):
    """Starts a run of `test`, and returns when it notes signals. Signals are as at a terminal."""
    numbers = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGXCPU)

    def restore():
        for number in numbers:
            signal.signal(number, signal.SIG_DFL)

    process = test.start(*arguments, preexec_fn=restore, **keywords)
    deadline = time.monotonic() + 60 * PATIENCE
    while True:
        status = pathlib.Path(f"/proc/{process.pid}/status").read_text()
        noted = int(next(line for line in status.splitlines() if line.startswith("SigCgt:")).split()[1], 16)
        if all(noted & 1 << number - 1 for number in numbers):
            return process
        test.assertIsNone(process.poll(), arguments)
        test.assertLess(time.monotonic(), deadline)
        time.sleep(0.002)


class ProgramTest(unittest.TestCase):
    """A test that runs the program in its own empty folder."""

    def setUp(self):
        holder = tempfile.TemporaryDirectory(prefix="vdbdither-test-")
        self.addCleanup(holder.cleanup)
        self.folder = pathlib.Path(holder.name)

    @classmethod
    def folder_of_class(cls):
        """Returns a new folder that lasts as long as the tests of the class, for what they share."""
        holder = tempfile.TemporaryDirectory(prefix="vdbdither-test-")
        cls.addClassCleanup(holder.cleanup)
        return pathlib.Path(holder.name)

    def environment(self):
        """Returns an environment with the program and the links of operators on the PATH."""
        return {**os.environ, "PATH": f"{PROGRAM.parent}:{PROGRAM.parent / 'operators'}:{os.environ['PATH']}"}

    def start(self, *arguments, **keywords):
        keywords = {"stdin": subprocess.DEVNULL, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE, **keywords}
        process = subprocess.Popen([PROGRAM, *map(str, arguments)], cwd=self.folder, **keywords)
        self.addCleanup(process.__exit__, None, None, None)
        self.addCleanup(process.kill)
        return process

    def run_program(self, *arguments, program=PROGRAM, **keywords):
        """Returns the finished process. Standard output and error are bytes."""
        keywords = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "timeout": 120 * PATIENCE, **keywords}
        if "input" not in keywords:
            keywords.setdefault("stdin", subprocess.DEVNULL)
        return subprocess.run([program, *map(str, arguments)], cwd=self.folder, **keywords)

    def succeed(self, *arguments, **keywords):
        """Checks that a run succeeds without messages. Returns its standard output."""
        done = self.run_program(*arguments, **keywords)
        self.assertEqual((done.returncode, done.stderr), (0, b""), arguments)
        return done.stdout

    def shell(self, line):
        """Like `succeed`, for a line of bash; every process of a pipe must succeed."""
        done = subprocess.run(["bash", "-o", "pipefail", "-c", line], cwd=self.folder, env=self.environment(),
                              stdin=subprocess.DEVNULL, capture_output=True, timeout=120 * PATIENCE)
        self.assertEqual((done.returncode, done.stderr), (0, b""), line)
        return done.stdout

    def refuse(self, code, message, *arguments, **keywords):
        """Checks that a run exits with `code` and one line that contains `message`, and leaves the folder unchanged."""
        before = self.listing()
        done = self.run_program(*arguments, **keywords)
        said = done.stderr.decode()
        self.assertEqual(done.returncode, code, (arguments, said))
        self.assertIn(message, said)
        self.assertEqual(said.count("\n"), 1, said)
        self.assertRegex(said, r"^vdbdither( [a-z0-9-]+)?: ")
        self.assertFalse(said.endswith(".\n"), said)
        self.assertEqual(self.listing(), before)
        return done

    def listing(self):
        """Returns all files in the folder with their sizes, including hidden files."""
        return sorted((str(path.relative_to(self.folder)), path.stat().st_size) for path in self.folder.rglob("*"))

    def expect_removed(self, before):
        """Checks that the folder is as `before`, or soon will be: what a stopped run wrote may be removed behind it."""
        deadline = time.monotonic() + 60 * PATIENCE
        while True:
            try:
                after = self.listing()
            except FileNotFoundError:
                after = None
            if after == before:
                return
            self.assertLess(time.monotonic(), deadline, after)
            time.sleep(0.01)

    def as_nobody(self):
        """The keywords that run the program as a user without rights. Skips the test where only root may run the program."""
        keywords = {"user": 65534, "group": 65534, "extra_groups": []}
        try:
            runs = self.run_program("--version", **keywords).returncode == 0
        except PermissionError:
            runs = False
        if not runs:
            self.skipTest("only root may run the program where it lies")
        return keywords
