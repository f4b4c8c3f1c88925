"""A chain gives the same slices in every way to run it."""

import itertools
import json
import os
import pathlib
import unittest

import meshes
import stack
from program import ProgramTest


class Chain(ProgramTest):
    def chain(self, printer, mesh, arguments=""):
        """Returns the stages of the main chain."""
        return [f"mesh2sdf {mesh} --printer {printer} {arguments}", "normals", "dither", "material-assign"]

    def sums(self, line):
        """Returns the SHA-256 of every slice that a line of bash writes into the folder `out`."""
        self.shell(f"rm -rf out && {line}")
        return stack.sums(self.folder / "out")

    def ways(self, stages, slab, threads):
        """Returns lines of bash that write the same slices into the folder `out`."""
        common = f"--slab {slab} --threads {threads}"
        export = f"slice-export out {common}"
        each = [f"{stage} {common}" for stage in stages]
        return {
            "fused": f"vdbdither {' ! '.join(stages)} ! {export}",
            "quoted": f"vdbdither run '{' | '.join(stages)} | {export}'",
            "piped": " | ".join([*each, export]),
            "by files": f"{each[0]} -o a.vdb --overwrite && {each[1]} -i a.vdb -o b.vdb --overwrite && "
                        f"{each[2]} -i b.vdb -o c.vdb --overwrite && {each[3]} -i c.vdb -o d.vdb --overwrite && "
                        f"{export} -i d.vdb",
            "archived on the way": f"vdbdither {stages[0]} ! write s.vdb --overwrite ! "
                                   f"{' ! '.join(stages[1:])} ! {export} && rm -r out && "
                                   f"vdbdither read s.vdb ! {' ! '.join(stages[1:])} ! {export}",
        }

    def assert_all_agree(self, stages, settings):
        """Checks that all ways give the same sums with all slab heights and numbers of threads in `settings`. Returns the sums."""
        reference = None
        for slab, threads in settings:
            for way, line in self.ways(stages, slab, threads).items():
                with self.subTest(way=way, slab=slab, threads=threads):
                    sums = self.sums(line)
                    reference = reference or sums
                    self.assertEqual(sums, reference)
        return reference

    def assert_every_way_gives_the_same_on(self, printer):
        meshes.write_stl(self.folder / "part.stl", meshes.turned(meshes.box((1.4, 2.2, 1.1), (0.3, -1, -0.7)), 20, 35))
        slices = self.assert_all_agree(self.chain(printer, "part.stl"), (("8", 2), ("64", 1), ("all", 2)))
        stack.check(self.folder / "out")
        self.assertGreater(len(set(slices)), 30)

    def test_each_of_several_meshes_gets_its_material(self):
        meshes.write_stl(self.folder / "left.stl", meshes.box((1, 1, 1)))
        meshes.write_stl(self.folder / "right.stl", meshes.box((2, 1, 1), (1.2, 0, 0)))
        self.succeed("mesh2sdf", "left.stl", "right.stl", "--printer", "mimaki-3duj-553", "!", "dither", "--mask", "none",
                     "!", "material-assign", "--parts", "white,black", "!", "slice-export", "out")
        self.refuse(2, "material-assign: --parts: 1 material for 2 parts; name one for each, in the order of the meshes",
                    "mesh2sdf", "left.stl", "right.stl", "--printer", "mimaki-3duj-553", "!", "dither", "!", "material-assign",
                    "--parts", "white", "!", "slice-export", "few")
        white, black = json.loads((self.folder / "out/manifest.json").read_text())["materials"]
        self.assertEqual((white["name"], black["name"]), ("white", "black"))
        self.assertAlmostEqual(black["voxels"] / white["voxels"], 2, delta=0.1)
        stack.check(self.folder / "out")

    def test_fused_piped_and_filed_runs_of_any_slab_and_threads_agree_on_mimaki(self):
        self.assert_every_way_gives_the_same_on("mimaki-3duj-553")

    def test_fused_piped_and_filed_runs_of_any_slab_and_threads_agree_on_stratasys(self):
        self.assert_every_way_gives_the_same_on("stratasys-j750-27um")

    def test_copies_are_made_of_grids_that_a_later_stage_reads(self):
        meshes.write_stl(self.folder / "part.stl", meshes.sphere(0.5))
        chain = ("mesh2sdf", "part.stl", "--printer", "mimaki-3duj-553", "!", "dither", "!", "copies", "--rows", 2, "!")
        for end, expected in ((("slice-export", "out"), {"solid"}), (("write", "out.vdb"), {"solid", "surface"})):
            plan = json.loads(self.succeed(*chain, *end, "--explain", "--json"))
            self.assertEqual({read["grid"] for read in plan["stages"][2]["reads"]}, expected)
        self.succeed(*chain, "write", "out.vdb", "!", "slice-export", "out")
        self.succeed("verify", "out", "--against", "out.vdb")

    def test_grids_of_a_shape_that_changed_are_dropped_with_one_warning(self):
        meshes.write_stl(self.folder / "part.stl", meshes.box((2, 2, 2)))
        start = ("mesh2sdf", "part.stl", "--pitch", "0.1mm,0.1mm,0.1mm", "--band", "0.8mm")
        meshes.write_stl(self.folder / "other.stl", meshes.box((1, 1, 1)))
        self.succeed("mesh2sdf", "other.stl", *start[2:], "-o", "other.vdb")
        dithered = (*start, "!", "dither", "--mask", "none")
        for step in (("hollow", "--thickness", "0.2mm"), ("offset", "--by", "-0.2mm"), ("csg", "--difference", "other.vdb"), ("compensate",)):
            told = f"vdbdither {step[0]}: warning: drops 'solid', which describes the shape before it; make it after {step[0]}, not before\n"
            with self.subTest(step=step):
                plan = json.loads(self.run_program(*dithered, "!", *step, "-o", "x.vdb", "--explain", "--json").stdout)
                self.assertNotIn("solid", plan["stages"][-1]["grids"])
                self.assertEqual(self.run_program(*dithered, "!", *step, "!", "info").stderr.decode(), told)
                refused = self.run_program(*dithered, "!", *step, "!", "slice-export", "new")
                self.assertEqual(refused.returncode, 2)
                self.assertTrue(refused.stderr.decode().startswith(told + "vdbdither slice-export: needs a grid 'material' or 'solid'"))
                # What is made again needs no word.
                self.succeed(*dithered, "!", "material-assign", "-o", "old.vdb", "--overwrite")
                again = self.run_program("read", "old.vdb", "!", *step, "!", "dither", "!", "material-assign", "!", "slice-export", "out", "--overwrite")
                self.assertEqual((again.returncode, again.stderr), (0, b""))

    def test_materials_of_voxels_that_changed_are_dropped_with_one_warning(self):
        meshes.write_stl(self.folder / "part.stl", meshes.sphere(0.5))
        start = ("mesh2sdf", "part.stl", "--printer", "mimaki-3duj-553", "!", "dither", "!", "material-assign", "!", "simulate", "!")
        for step in ("dither", "interlace", "refine"):
            with self.subTest(step=step):
                self.assertEqual(self.run_program(*start, step, "!", "info").stderr.decode(),
                                 f"vdbdither {step}: warning: drops 'material', 'printed', which describe the shape before it; "
                                 f"make them after {step}, not before\n")
                again = self.run_program(*start, step, "!", "material-assign", "!", "simulate", "!", "info")
                self.assertEqual((again.returncode, again.stderr), (0, b""))

    def test_a_layer_range_gives_exactly_those_slices(self):
        meshes.write_stl(self.folder / "part.stl", meshes.sphere(1.2))
        stages = " ! ".join(self.chain("mimaki-3duj-553", "part.stl"))
        whole = self.sums(f"vdbdither {stages} ! slice-export out --keep-blank")
        for begin, end in ((0, 1), (13, 45), (32, 40), (len(whole) - 3, len(whole))):
            part = self.sums(f"vdbdither {stages} ! slice-export out --keep-blank --layers {begin}:{end}")
            self.assertEqual(part, whole[begin:end], (begin, end))
            piped = self.sums(f"{stages.replace('!', '|')} | slice-export out --keep-blank --layers {begin}:{end}")
            self.assertEqual(piped, whole[begin:end], (begin, end))

    def test_a_placed_part_as_high_as_ten_layers_is_ten_slices(self):
        pitch = (0.042, 0.084, 0.022)
        meshes.write_stl(self.folder / "plate.stl", meshes.box([10 * step for step in pitch], (3.3, -1.7, 5)))
        self.succeed("mesh2sdf", "plate.stl", "--printer", "mimaki-3duj-553", "--place", "!", "dither", "--mask", "none",
                     "!", "slice-export", "out")
        manifest = json.loads((self.folder / "out/manifest.json").read_text())
        self.assertEqual(manifest["size"][2], 10)
        self.assertEqual(manifest["first_layer"], 0)
        self.assertEqual(manifest["materials"][0]["voxels"], 1000)
        self.assertEqual(manifest["cropped"]["below"], -manifest["box"]["min"][2])
        self.assertEqual(manifest["cropped"]["above"], manifest["box"]["max"][2] - 9)
        # What was left out is blank when it is read back.
        self.succeed("slice-import", "out", "-o", "again.vdb")
        self.succeed("run", "mesh2sdf plate.stl --printer mimaki-3duj-553 --place ! dither --mask none ! compare again.vdb --grids solid")

    @unittest.skipUnless("VDBDITHER_MODELS" in os.environ, "VDBDITHER_MODELS is not set to a folder of models")
    def test_every_way_agrees_on_a_scan_of_40_mm(self):
        mesh = pathlib.Path(os.environ["VDBDITHER_MODELS"]) / "classic/armadillo.obj"
        for printer in ("mimaki-3duj-553", "stratasys-j750-27um"):
            with self.subTest(printer=printer):
                slices = self.assert_all_agree(self.chain(printer, mesh, "--fit 40"),
                                               itertools.product(("8", "64", "all"), (1, 2)))
                self.assertGreater(len(set(slices)), 1000)


if __name__ == "__main__":
    unittest.main()
