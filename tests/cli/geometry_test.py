"""Chains with resample, offset, csg and hollow give correct slices in every way to run them."""

import json
import math
import shutil
import subprocess
import unittest

import meshes
import stack
from program import MIMAKI, ProgramTest

SLICES = "dither --mask white ! material-assign ! slice-export out --overwrite"


class Geometry(ProgramTest):
    def voxels(self, chain):
        """Returns the number of voxels in the slices of a chain."""
        self.shell(f"vdbdither {chain} ! {SLICES}")
        manifest = stack.check(self.folder / "out")
        return sum(material["voxels"] for material in manifest["materials"])

    def assert_volume(self, chain, mm3, delta=0.02):
        volume = self.voxels(chain) * 0.042 * 0.084 * 0.022
        self.assertAlmostEqual(volume / mm3, 1, delta=delta)

    def box(self, name, size, corner=(0, 0, 0)):
        meshes.write_stl(self.folder / name, meshes.box(size, corner))

    def test_a_shell_has_the_volume_of_its_walls(self):
        self.box("part.stl", (3, 3, 3))
        whole = "mesh2sdf part.stl --printer mimaki-3duj-553 --band 0.7mm ! normals ! hollow --thickness 0.5mm"
        self.assert_volume(whole, 27 - 8)
        self.assert_volume(f"{whole} --drain 1.5,1.5,0:0,0,1:1mm", 27 - 8 - 0.5 * 0.7854)

    def test_an_offset_has_the_volume_of_the_grown_part(self):
        meshes.write_stl(self.folder / "part.stl", meshes.sphere(1.0, rings=48))
        whole = "mesh2sdf part.stl --printer mimaki-3duj-553 --band 0.4mm ! offset"
        self.assert_volume(f"{whole} --by 0.2mm", 4.18879 * 1.2 ** 3)
        self.assert_volume(f"{whole} --by -0.2mm", 4.18879 * 0.8 ** 3)

    def test_a_coarse_lattice_is_dithered_within_seconds(self):
        meshes.write_stl(self.folder / "ball.stl", meshes.turned(meshes.sphere(60, 40), 5, 3))
        for pitch, radius in (("10mm,10mm,10mm", 60), ("1mm,1mm,1mm", 60), ("0.4mm,0.4mm,0.4mm", 20), ("5mm,0.1mm,5mm", 30)):
            chain = ("mesh2sdf", "ball.stl", "--scale", radius / 60, "--pitch", pitch, "!", "dither")
            # All waves that the blur leaves would take minutes.
            self.succeed(*chain, "-o", "x.vdb", "--explain")
            told = json.loads(self.succeed(*chain, "!", "stats", "--json"))
            self.assertAlmostEqual(told["solid"]["ml"] * 1000 / (4 / 3 * math.pi * radius**3), 1, delta=0.05)

    def test_a_union_reaches_as_high_as_both_and_keeps_their_materials(self):
        self.box("low.stl", (1, 1, 1), (0, 0, 0.5))
        self.box("high.stl", (1, 1, 2), (0.5, 0, 1.25))
        self.succeed("mesh2sdf", "low.stl", *MIMAKI, "-o", "low.vdb")
        self.succeed("mesh2sdf", "high.stl", *MIMAKI, "-o", "high.vdb")
        sums = set()
        for first, second, priority in (("low", "high", "first"), ("high", "low", "second")):
            for slab in ("8", "64", "all"):
                self.shell(f"vdbdither read {first}.vdb ! csg --union {second}.vdb --priority {priority} ! normals "
                           f"! dither --preset paper --mask white ! material-assign --parts "
                           f"{'white,black' if first == 'low' else 'black,white'} "
                           f"! slice-export out --overwrite --slab {slab}")
                manifest = stack.check(self.folder / "out")
                volumes = {m["name"]: m["voxels"] * 0.042 * 0.084 * 0.022 for m in manifest["materials"]}
                self.assertAlmostEqual(volumes["white"], 1, delta=0.03)
                self.assertAlmostEqual(volumes["black"], 2 - 0.5 * 0.25, delta=0.05)
                sums.add((first, *stack.sums(self.folder / "out")))
        self.assertEqual(len(sums), 2)

    def test_a_union_takes_only_the_layers_that_are_asked_for(self):
        self.box("low.stl", (1, 1, 1))
        self.box("high.stl", (1, 1, 1), (0, 0, 2))
        self.succeed("mesh2sdf", "high.stl", *MIMAKI, "-o", "high.vdb")
        chain = "mesh2sdf low.stl --printer mimaki-3duj-553 ! csg --union high.vdb ! normals"
        self.shell(f"vdbdither {chain} ! {SLICES} --keep-blank")
        whole = stack.sums(self.folder / "out")
        for begin, end in ((0, 9), (40, 70), (100, len(whole))):
            self.shell(f"vdbdither {chain} ! {SLICES} --keep-blank --layers {begin}:{end}")
            self.assertEqual(stack.sums(self.folder / "out"), whole[begin:end])

    def test_the_second_operand_may_be_a_named_pipe(self):
        self.box("part.stl", (2, 2, 2))
        self.box("hole.stl", (1, 1, 3), (0.5, 0.5, -0.5))
        self.succeed("mesh2sdf", "hole.stl", *MIMAKI, "-o", "hole.vdb")
        part = "mesh2sdf part.stl --printer mimaki-3duj-553"
        self.assert_volume(f"{part} ! csg --difference hole.vdb", 8 - 2)
        of_file = stack.sums(self.folder / "out")
        # The part needs only some of its layers; the writer must succeed.
        self.shell("mkfifo hole.fifo; mesh2sdf hole.stl --printer mimaki-3duj-553 > hole.fifo & "
                   f"vdbdither {part} ! csg --difference hole.fifo ! {SLICES} && wait $!")
        self.assertEqual(stack.sums(self.folder / "out"), of_file)

    def test_one_writer_may_feed_both_operands_of_which_only_some_layers_are_wanted(self):
        # Each slab fits into the buffers of the pipes and of `cat`.
        self.box("part.stl", (1, 1, 8))
        self.shell("mkfifo second.fifo; mesh2sdf part.stl --printer mimaki-3duj-553 --slab 8 | tee >(cat > second.fifo) | "
                   f"csg --intersection second.fifo ! {SLICES} --slab 8 --layers 20:30")
        self.assertEqual(len(stack.sums(self.folder / "out")), 10)

    def test_a_level_set_of_vdb_tool_is_within_a_tenth_of_a_voxel(self):
        if not shutil.which("vdb_tool"):
            self.skipTest("vdb_tool is not installed")
        try:
            import pyopenvdb
        except ImportError:
            self.skipTest("pyopenvdb is not installed")
        subprocess.run(["vdb_tool", "-sphere", "r=1.2", "dim=60", "-write", "sphere.vdb"], cwd=self.folder, check=True,
                       capture_output=True, timeout=60)
        meshes.write_stl(self.folder / "sphere.stl", meshes.sphere(1.2, rings=400))
        self.succeed("mesh2sdf", "sphere.stl", *MIMAKI, "-o", "ours.vdb")
        self.succeed("resample", "sphere.vdb", *MIMAKI, "-o", "theirs.vdb")
        ours = pyopenvdb.read(str(self.folder / "ours.vdb"), "surface")
        theirs = pyopenvdb.read(str(self.folder / "theirs.vdb"), "surface").getConstAccessor()
        worst = count = 0
        for voxel in ours.citerOnValues():
            if voxel.count == 1 and abs(voxel.value) < 0.02:
                worst = max(worst, abs(theirs.getValue(voxel.min) - voxel.value))
                count += 1
        self.assertGreater(count, 1000)
        self.assertLess(worst, 0.1 * 0.022)

    def test_a_piped_level_set_gives_slices(self):
        meshes.write_stl(self.folder / "part.stl", meshes.turned(meshes.box((1, 1.5, 1.2)), 20, 30))
        self.succeed("mesh2sdf", "part.stl", "--pitch", "0.05,0.05,0.05", "-o", "cubes.vdb")
        resampled = "resample - --printer mimaki-3duj-553 ! normals"
        sums = []
        for slab, threads in (("8", 1), ("all", 2)):
            self.shell(f"cat cubes.vdb | vdbdither {resampled} ! {SLICES} --slab {slab} --threads {threads}")
            sums.append(stack.sums(self.folder / "out"))
        # From another operator, in slabs.
        self.shell("mesh2sdf part.stl --pitch 0.05,0.05,0.05 --slab 8 | "
                   f"vdbdither {resampled} ! {SLICES} --slab 8")
        sums.append(stack.sums(self.folder / "out"))
        self.assertEqual(sums[0], sums[1])
        self.assertEqual(sums[0], sums[2])
        manifest = json.loads((self.folder / "out/manifest.json").read_text())
        volume = sum(m["voxels"] for m in manifest["materials"]) * 0.042 * 0.084 * 0.022
        self.assertAlmostEqual(volume, 1.8, delta=0.03)


if __name__ == "__main__":
    unittest.main()
