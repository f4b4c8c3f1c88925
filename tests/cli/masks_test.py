"""Masks made by dither are kept, completely or not at all, and found again."""

import os
import signal
import time
import unittest

import meshes
from program import MIMAKI, PATIENCE, ProgramTest


class Masks(ProgramTest):
    def setUp(self):
        super().setUp()
        meshes.write_stl(self.folder / "part.stl", meshes.sphere(0.3))
        self.succeed("mesh2sdf", "part.stl", *MIMAKI, "-o", "part.vdb")
        self.cache = self.folder / "cache/vdbdither/masks"

    def dithered(self, *arguments, warning=None, cache=None, **environment):
        """Returns the archive of the voxels. Checks for one warning, or for none."""
        environment = {**os.environ, "XDG_CACHE_HOME": cache or str(self.folder / "cache"), **environment}
        done = self.run_program("dither", "-i", "part.vdb", *arguments, env=environment)
        said = done.stderr.decode()
        self.assertEqual(done.returncode, 0, said)
        if warning is None:
            self.assertEqual(said, "")
        else:
            self.assertRegex(said, rf"\Avdbdither dither: warning: [^\n]*{warning}[^\n]*\n\Z")
        return done.stdout

    def kept(self):
        return sorted(self.cache.iterdir()) if self.cache.exists() else []

    def test_a_made_mask_is_the_one_that_mask_makes(self):
        self.succeed("mask", "--kernel", "axis-mix", "--size", 16, "--sigma", 1.2, "--seed", 3, "-o", "mask.vdb")
        self.dithered("--size", 16, "--sigma", 1.2, "--seed", 3, "-o", "made.vdb")
        self.dithered("--mask", "mask.vdb", "-o", "given.vdb")
        self.succeed("compare", "made.vdb", "given.vdb")

    def test_a_made_mask_is_found_again(self):
        first = self.dithered("--size", 16)
        [mask] = self.kept()
        before = mask.stat()
        self.assertEqual(self.dithered("--size", 16), first)
        self.assertEqual(self.kept(), [mask])
        after = mask.stat()
        self.assertEqual((after.st_ino, after.st_mtime_ns), (before.st_ino, before.st_mtime_ns))

    def test_every_setting_has_its_own_mask(self):
        for count, arguments in enumerate((("--size", 8), ("--size", 8, "--sigma", 1.5), ("--size", 8, "--seed", 2),
                                           ("--size", 12), ("--size", 8, "--sigma", 1.50000001)), 1):
            self.dithered(*arguments)
            self.assertEqual(len(self.kept()), count, arguments)

    def test_the_installed_mask_needs_no_cache(self):
        self.dithered("--mask", "blue")
        self.assertEqual(self.kept(), [])

    def test_the_installed_mask_is_the_one_that_would_be_made(self):
        self.dithered("--mask", "blue", "-o", "installed.vdb")
        self.dithered("--size", 64, "-o", "made.vdb")
        self.assertEqual(len(self.kept()), 1)
        self.succeed("compare", "installed.vdb", "made.vdb")

    def test_the_mask_of_the_paper_takes_another_size(self):
        self.dithered("--mask", "paper", "--size", 16, "-o", "made.vdb")
        self.succeed("mask", "--kernel", "peters", "--size", 16, "--sigma", 1.1, "-o", "mask.vdb")
        self.dithered("--mask", "mask.vdb", "-o", "given.vdb")
        self.succeed("compare", "made.vdb", "given.vdb")

    def test_a_damaged_mask_is_made_again(self):
        first = self.dithered("--size", 16)
        [mask] = self.kept()
        whole = mask.read_bytes()
        middle = len(whole) // 2
        flipped = whole[:middle] + bytes([whole[middle] ^ 4]) + whole[middle + 1:]
        for damaged in (flipped, whole[:middle], b"", b"x" * len(whole)):
            mask.write_bytes(damaged)
            self.assertEqual(self.dithered("--size", 16, warning="; it is made again"), first)
            self.assertEqual(mask.read_bytes(), whole)
            self.assertEqual(self.dithered("--size", 16), first)

    def test_a_mask_under_the_name_of_another_is_made_again(self):
        first = self.dithered("--size", 16)
        [mask] = self.kept()
        self.succeed("mask", "--size", 16, "--sigma", 2, "-o", mask, "--overwrite")
        self.assertEqual(self.dithered("--size", 16, warning="holds another mask than its name says; it is made again"), first)

    def test_without_a_cache_the_mask_is_still_made(self):
        first = self.dithered("--size", 16)
        (self.folder / "file").write_text("in the way")
        self.assertEqual(self.dithered("--size", 16, cache=str(self.folder / "file"),
                                       warning="the mask is not kept for the next run: cannot make the folder"), first)
        self.assertEqual(self.dithered("--size", 16, cache="relative", HOME="",
                                       warning="made anew in every run: neither XDG_CACHE_HOME nor HOME names a folder"), first)
        self.assertFalse((self.folder / "relative").exists())

    def test_without_a_cache_folder_the_home_folder_has_one(self):
        home = self.folder / "home"
        self.dithered("--size", 8, cache="relative", HOME=str(home),
                      warning="made anew in every run: neither XDG_CACHE_HOME nor HOME names a folder")
        self.assertFalse(home.exists())
        home.mkdir()
        self.dithered("--size", 8, cache="relative", HOME=str(home))
        self.assertEqual(len(list((self.folder / "home/.cache/vdbdither/masks").iterdir())), 1)

    def test_an_interrupted_run_leaves_no_mask(self):
        environment = {**os.environ, "XDG_CACHE_HOME": str(self.folder / "cache")}
        for arguments in (("dither", "-i", "part.vdb", "--size", 192, "-o", "x.vdb"), ("mask", "--size", 192, "-o", "x.vdb")):
            before = self.listing()
            process = self.start(*arguments, env=environment)
            time.sleep(1)
            process.send_signal(signal.SIGINT)
            _, said = process.communicate(timeout=60 * PATIENCE)
            self.assertEqual(process.returncode, 128 + signal.SIGINT, said)
            self.assertEqual(self.listing(), before)

    def test_what_no_mask_takes_is_refused(self):
        self.refuse(2, "--sigma: only --mask blue and --mask paper have it; leave it out", "dither", "-i", "part.vdb",
                    "--mask", "white", "--sigma", 1, "-o", "x.vdb")
        self.refuse(2, "--size: only --mask blue and --mask paper have it; leave it out", "dither", "-i", "part.vdb",
                    "--mask", "none", "--size", 32, "-o", "x.vdb")
        self.refuse(2, "--sigma: '0.2' is not accepted; the value must be a number from 0.3 to 16", "dither", "-i", "part.vdb", "--sigma", 0.2,
                    "-o", "x.vdb")


if __name__ == "__main__":
    unittest.main()
