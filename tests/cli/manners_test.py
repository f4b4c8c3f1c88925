"""What a new user meets: odd parts, full disks, and files that are to be small."""

import json
import re
import subprocess
import unittest

import meshes
from program import MIMAKI, ProgramTest


class Manners(ProgramTest):
    def sized(self, size):
        meshes.write_stl(self.folder / "part.stl", meshes.box(size))
        done = self.run_program("mesh2sdf", "part.stl", *MIMAKI, "-o", "x.vdb", "--explain")
        self.assertEqual(done.returncode, 0)
        return done.stderr.decode()

    def test_a_part_of_an_unlikely_size_is_questioned_with_the_likely_unit(self):
        self.assertEqual(self.sized((3000, 2000, 500)),
                         "vdbdither mesh2sdf: warning: the part is 3000 x 2000 x 500 mm; are the file's numbers um? "
                         "--unit um makes its longest side 3 mm\n")
        self.assertEqual(self.sized((0.1, 0.05, 0.02)),
                         "vdbdither mesh2sdf: warning: the part is 0.1 x 0.05 x 0.02 mm; are the file's numbers m? "
                         "--unit m makes its longest side 100 mm\n")
        self.assertEqual(self.sized((600, 20, 20)),
                         "vdbdither mesh2sdf: warning: the part is 600 x 20 x 20 mm, more than the 508 x 508 x 305 mm that "
                         "the printer builds; turn it with --rotate, or see --unit and --fit\n")
        self.assertEqual(self.sized((200, 20, 20)), "")

    def test_a_folder_of_meshes_is_told_how_to_be_given(self):
        (self.folder / "parts").mkdir()
        meshes.write_stl(self.folder / "parts/a.stl", meshes.sphere(0.6))
        self.refuse(1, "'parts': a folder; name the meshes in it, as in parts/*.stl", "mesh2sdf", "parts", *MIMAKI, "-o", "x.vdb")

    def test_explain_tells_what_the_disk_needs(self):
        meshes.write_stl(self.folder / "part.stl", meshes.sphere(6, 60))
        for arguments, output in (("-o x.vdb", "x.vdb"), ("! dither ! slice-export out", "out")):
            said = self.succeed("run", f"mesh2sdf part.stl --printer mimaki-3duj-553 {arguments} --explain").decode()
            found = re.search(rf"(?m)^disk +about ([\d.]+) (\w+) of [\d.]+ \w+ for {re.escape(output)}$", said)
            self.assertTrue(found, said)
            expected = float(found[1]) * {"KiB": 2**10, "MiB": 2**20}[found[2]]
            self.succeed("run", f"mesh2sdf part.stl --printer mimaki-3duj-553 {arguments}")
            path = self.folder / output
            files = [path] if path.is_file() else list(path.iterdir())
            used = sum(file.stat().st_blocks * 512 for file in files)
            self.assertTrue(0.4 < expected / used < 2.5, (used, said))

    def test_what_does_not_fit_on_the_disk_is_refused_before_the_run(self):
        disk = self.folder / "disk"
        disk.mkdir()
        mounted = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", disk], capture_output=True)
        if mounted.returncode != 0:
            self.skipTest("a small disk can be mounted only by root")
        self.addCleanup(subprocess.run, ["umount", disk], check=True)
        meshes.write_stl(self.folder / "part.stl", meshes.sphere(6))
        self.refuse(1, "write: 'disk/x.vdb' needs about ", "mesh2sdf", "part.stl", *MIMAKI, "-o", "disk/x.vdb")

    def test_half_floats_are_small_and_taken_up_again(self):
        meshes.write_stl(self.folder / "part.stl", meshes.sphere(1.5))
        self.succeed("run", "mesh2sdf part.stl --printer mimaki-3duj-553 ! normals ! write whole.vdb ! write half.vdb --half")
        sizes = [(self.folder / name).stat().st_size for name in ("half.vdb", "whole.vdb")]
        self.assertLess(sizes[0], 0.8 * sizes[1])
        whole, half = [json.loads(self.succeed("info", name, "--json")) for name in ("whole.vdb", "half.vdb")]
        self.assertEqual([grid["active_voxels"] for grid in whole["grids"]], [grid["active_voxels"] for grid in half["grids"]])
        self.succeed("run", "read half.vdb ! dither ! slice-export out")
        # What was read from half floats is written in full again.
        self.succeed("run", "read half.vdb ! write again.vdb")
        self.assertGreater((self.folder / "again.vdb").stat().st_size, sizes[0])
        self.succeed("compare", "half.vdb", "again.vdb")

    def test_a_stack_of_some_layers_says_which_it_can_give(self):
        meshes.write_stl(self.folder / "part.stl", meshes.sphere(0.8))
        self.succeed("run", "mesh2sdf part.stl --printer mimaki-3duj-553 ! dither ! slice-export some --layers 20:60")
        said = self.refuse(1, "'some' lacks layer 0; --layers ", "slice-import", "some", "-o", "x.vdb").stderr.decode()
        layers = re.search(r"--layers (\d+:\d+) takes", said)[1]
        self.assertNotEqual(layers, "20:60")
        self.succeed("slice-import", "some", "--layers", layers, "-o", "x.vdb")
        self.succeed("run", f"mesh2sdf part.stl --printer mimaki-3duj-553 ! dither ! compare x.vdb --grids solid --layers {layers}")


if __name__ == "__main__":
    unittest.main()
