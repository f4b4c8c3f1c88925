"""Runs that are killed at random moments: the old output or the new one is there, whole, and the next run removes what is left.

A library between the program and the system kills the run before one of its calls that change files. VDBDITHER_SEED repeats a
choice of moments.
"""

import os
import random
import signal
import unittest

import meshes
import preload
from program import ProgramTest

MOMENTS = 50


@unittest.skipIf(os.environ.get("VDBDITHER_SANITIZER"), "a sanitizer wants to be the first library")
class Killed(ProgramTest):
    @classmethod
    def setUpClass(cls):
        cls.inputs = cls.folder_of_class()
        cls.library = preload.library(cls.inputs, preload.CHANGES)
        for name, size in (("old", 0.5), ("new", 0.7)):
            meshes.write_stl(cls.inputs / f"{name}.stl", meshes.box((size, size, 0.4)))

    def content(self):
        """Returns all files of the folder with their bytes, and the hidden names that it holds."""
        files = {str(path.relative_to(self.folder)): path.read_bytes() for path in self.folder.rglob("*") if path.is_file()}
        hidden = [path.name for path in self.folder.iterdir() if path.name.startswith(".")]
        return {name: bytes for name, bytes in files.items() if not name.startswith(".")}, hidden

    def clear(self):
        for path in sorted(self.folder.rglob("*"), reverse=True):
            path.rmdir() if path.is_dir() else path.unlink()

    def write(self, which, sink, **variables):
        arguments = ("mesh2sdf", self.inputs / f"{which}.stl", "--pitch", "0.1mm", "!", "dither", "!", *sink, "--overwrite", "--threads", 1)
        return self.run_program(*arguments, env=preload.environment(self.library, **variables))

    def made(self, which, sink, **variables):
        done = self.write(which, sink, **variables)
        self.assertEqual((done.returncode, done.stderr), (0, b""))
        content, hidden = self.content()
        self.assertEqual(hidden, [])
        return content

    def calls(self, sink, **variables):
        """Returns the names of the calls of a whole run."""
        log = self.inputs / "calls"
        log.write_text("")
        self.made("new", sink, CALLS=log, **variables)
        return log.read_text().split()

    def test_the_old_output_or_the_new_one_is_there_whole(self):
        seed = int(os.environ.get("VDBDITHER_SEED", random.SystemRandom().randrange(1 << 32)))
        print(f"VDBDITHER_SEED={seed}")
        chance = random.Random(seed)
        cases = [(sink, overwrites, {}) for sink in (("slice-export", "out"), ("slice-export", "out.zip"), ("write", "out.vdb"))
                 for overwrites in (False, True)] + [(("slice-export", "out"), True, {"NO_EXCHANGE": 1})]
        outcomes = set()
        for case, (sink, overwrites, variables) in enumerate(cases):
            self.clear()
            old = self.made("old", sink) if overwrites else {}
            calls = self.calls(sink, **variables)
            new = self.content()[0]
            self.assertNotEqual(new, old)
            # From the flush on, the new output takes its place: half of the moments are there.
            commit = calls.index("flush") + 1
            for n in range(case, MOMENTS, len(cases)):
                at = chance.randint(commit, len(calls)) if n % 2 else chance.randint(1, len(calls))
                with self.subTest(seed=seed, sink=sink, overwrites=overwrites, at=at, call=calls[at - 1], **variables):
                    self.clear()
                    for name, content in old.items():
                        (self.folder / name).parent.mkdir(exist_ok=True)
                        (self.folder / name).write_bytes(content)
                    done = self.write("new", sink, KILL_AT=at, **variables)
                    self.assertEqual(done.returncode, -signal.SIGKILL)
                    found, hidden = self.content()
                    # Without an exchange of folders there is a moment between them, which the next run mends.
                    between = bool(variables) and found == {} and any(name.endswith(".old") for name in hidden)
                    self.assertTrue(found in (old, new) or between, (sorted(found), hidden))
                    outcomes.add((found == new, bool(hidden)))
                    done = self.write("new", sink)
                    said = done.stderr.decode()
                    self.assertEqual(done.returncode, 0, said)
                    self.assertRegex(said, r"\A(vdbdither slice-export: warning: [^\n]* is put back\n)?\Z" if between else r"\A\Z")
                    self.assertEqual(self.content(), (new, []))
        self.assertTrue({(False, True), (True, True)} <= outcomes, outcomes)


if __name__ == "__main__":
    unittest.main()
