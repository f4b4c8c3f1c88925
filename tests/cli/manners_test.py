"""Help for new users: unusual parts, full disks, estimates, and small files."""

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

    def test_a_folder_of_meshes_is_refused_with_advice(self):
        (self.folder / "parts").mkdir()
        meshes.write_stl(self.folder / "parts/a.stl", meshes.sphere(0.6))
        self.refuse(1, "'parts': a folder; name the meshes in it, as in parts/*.stl", "mesh2sdf", "parts", *MIMAKI, "-o", "x.vdb")

    def test_explain_reports_the_disk_space(self):
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

    def explained(self, chain):
        """Returns what --explain reports about memory, time and disk."""
        said = self.succeed("run", f"{chain} --explain").decode()
        return dict(re.findall(r"(?m)^(memory|time|disk) +(.*)$", said))

    def test_explain_reports_time_and_disk_after_every_source_with_a_known_size(self):
        meshes.write_stl(self.folder / "part.stl", meshes.sphere(2, 60))
        self.succeed("run", "mesh2sdf part.stl --printer mimaki-3duj-553 ! write surface.vdb ! dither ! write solid.vdb "
                            "! slice-export stack")
        for chain in ("mesh2sdf part.stl --printer mimaki-3duj-553 ! dither -o x.vdb", "read surface.vdb ! dither -o x.vdb",
                      "dither -i surface.vdb -o x.vdb", "read solid.vdb ! material-assign -o x.vdb",
                      "resample surface.vdb --printer mimaki-3duj-553 ! dither -o x.vdb", "slice-import stack -o x.vdb",
                      "read surface.vdb ! csg --union surface.vdb -o x.vdb"):
            with self.subTest(chain=chain):
                told = self.explained(chain)
                self.assertRegex(told["disk"], r"^about \d[\d.]* (KiB|MiB) of ")
                self.assertRegex(told["time"], r"^about \d+\.\d s on \d+ threads?$")

    def test_disk_after_a_file_or_a_stack_is_estimated_within_a_factor(self):
        meshes.write_stl(self.folder / "part.stl", meshes.sphere(6, 60))
        self.succeed("run", "mesh2sdf part.stl --printer mimaki-3duj-553 ! dither ! write job.vdb ! slice-export stack")
        for chain in ("read job.vdb", "slice-import stack", "resample job.vdb --printer mimaki-3duj-553"):
            with self.subTest(chain=chain):
                expected, unit = re.match(r"about ([\d.]+) (\w+) of", self.explained(f"{chain} -o x.vdb --overwrite")["disk"]).groups()
                self.succeed("run", f"{chain} -o x.vdb --overwrite")
                used = (self.folder / "x.vdb").stat().st_size
                self.assertTrue(0.3 < float(expected) * {"KiB": 2**10, "MiB": 2**20}[unit] / used < 3, (expected, unit, used))

    def test_explain_reports_unknown_costs(self):
        meshes.write_stl(self.folder / "part.stl", meshes.sphere(0.8))
        self.succeed("run", "mesh2sdf part.stl --printer mimaki-3duj-553 -o surface.vdb")
        piped = self.succeed("read", "surface.vdb")
        said = self.succeed("dither", "-o", "x.vdb", "--explain", input=piped).decode()
        self.assertRegex(said, r"(?m)^time +unknown of read, dither, write$")
        self.assertRegex(said, r"(?m)^disk +unknown of .* for x\.vdb$")

    def seconds(self, chain):
        """Returns the time that --explain expects on one thread."""
        said = self.explained(chain)["time"]
        number, unit = re.fullmatch(r"about ([\d.]+) (s|min|h) on 1 thread", said).groups()
        return float(number) * {"s": 1, "min": 60, "h": 3600}[unit]

    def test_more_work_has_a_longer_expected_time(self):
        meshes.write_stl(self.folder / "part.stl", meshes.sphere(2, 60))
        source = "mesh2sdf part.stl --printer mimaki-3duj-553 --threads 1"
        for little, much, least, most in (
                (f"{source} ! mesh-export x.stl --smooth taubin --iterations 2000", "--iterations 20000", 8, 12),
                (f"{source} ! render x.png --samples 2000", "--samples 20000", 8, 12),
                (f"{source} ! render x.png --samples 4000", "--frame part.stl", 0.5, 2),
                (f"{source} ! measure --reference part.stl --spacing 0.01", "--spacing 0.001", 50, 120),
                (f"{source} --band 100 -o x.vdb", "--band 1000", 400, 700),
                ("mask --size 64 --threads 1 --kernel gauss -o x.vdb", "--sigma 3", 4, 20),
                ("mask --size 96 --threads 1 -o x.vdb", "--size 192", 8, 30),
                ("mask --size 64 --threads 1 ! mask-spectrum x.json", "--step 0.5", 2, 4)):
            with self.subTest(much=much):
                ratio = self.seconds(f"{little} {much}") / self.seconds(little)
                self.assertTrue(least < ratio < most, ratio)

    def test_disk_of_a_mesh_or_a_mask_is_estimated_within_a_factor(self):
        meshes.write_stl(self.folder / "part.stl", meshes.sphere(4, 60))
        solid = "mesh2sdf part.stl --printer mimaki-3duj-553 ! dither"
        for chain, output in ((f"{solid} ! mesh-export x.stl", "x.stl"), (f"{solid} ! mesh-export x.ply", "x.ply"),
                              (f"{solid} ! mesh-export x.obj --smooth taubin --iterations 1", "x.obj"),
                              ("mask --size 32 --kind white -o x.vdb", "x.vdb")):
            with self.subTest(chain=chain):
                expected, unit = re.match(r"about ([\d.]+) (\w+) of", self.explained(chain)["disk"]).groups()
                self.succeed("run", chain)
                used = (self.folder / output).stat().st_size
                self.assertTrue(0.5 < float(expected) * {"KiB": 2**10, "MiB": 2**20}[unit] / used < 2, (expected, unit, used))

    def test_json_reports_expected_and_measured_time(self):
        meshes.write_stl(self.folder / "part.stl", meshes.sphere(2, 60))
        told = json.loads(self.succeed("run", "mesh2sdf part.stl --printer mimaki-3duj-553 ! dither ! slice-export out "
                                              "--threads 1 --json"))
        self.assertAlmostEqual(told["expected_seconds"], sum(stage["expected_cpu_seconds"] for stage in told["stages"]))
        half = json.loads(self.succeed("run", "mesh2sdf part.stl --printer mimaki-3duj-553 --threads 1 ! dither "
                                              "! slice-export half --layers 0:80 --json"))
        for stage, whole in zip(half["stages"], told["stages"]):
            self.assertLess(stage["expected_cpu_seconds"], whole["expected_cpu_seconds"], stage["name"])

    def test_work_at_the_surface_has_no_longer_expected_time_after_a_wide_band(self):
        meshes.write_stl(self.folder / "part.stl", meshes.sphere(2, 60))
        expected = {}
        for band in (1, 8):
            words = f"mesh2sdf part.stl --printer mimaki-3duj-553 --band {band} ! stats ! dither ! slice-export out --overwrite --json"
            told = self.succeed("run", words)
            for stage in json.loads(told.splitlines()[-1])["stages"]:
                expected[stage["name"], band] = stage["expected_cpu_seconds"]
        for name in ("stats", "dither"):
            self.assertAlmostEqual(expected[name, 8] / expected[name, 1], 1, delta=0.1, msg=name)
        # It has more layers, and each layer costs time.
        self.assertLess(expected["slice-export", 8], 1.5 * expected["slice-export", 1])
        self.assertGreater(expected["mesh2sdf", 8], 2 * expected["mesh2sdf", 1])

    def test_a_vdb_cannot_have_the_ending_of_another_format(self):
        meshes.write_stl(self.folder / "part.stl", meshes.sphere(0.8))
        self.refuse(2, "write: 'x.stl' is a mesh by its name, and this is a .vdb; mesh-export writes meshes",
                    "mesh2sdf", "part.stl", *MIMAKI, "-o", "x.stl")
        self.refuse(2, "write: 'x.png' holds pictures by its name", "mesh2sdf", "part.stl", *MIMAKI, "-o", "x.png")
        self.refuse(1, "'part.stl' is not a readable VDB archive: it is a file of another kind; meshes come in by mesh2sdf",
                    "dither", "-i", "part.stl", "-o", "x.vdb")

    def test_a_missing_argument_is_named(self):
        meshes.write_stl(self.folder / "part.stl", meshes.sphere(0.8))
        self.refuse(2, "slice-export: 'folder' is missing; see --help", "mesh2sdf", "part.stl", *MIMAKI, "!", "dither", "!",
                    "slice-export")
        self.refuse(2, "mesh2sdf: 'mesh' is missing; see --help", "mesh2sdf", *MIMAKI)
        (self.folder / "part.vdb").write_bytes(b"anything")
        self.refuse(1, "mesh2sdf: 'part.vdb': a .vdb is no mesh; read takes one of this lattice, resample any other",
                    "mesh2sdf", "part.vdb", *MIMAKI, "-o", "x.vdb")

    def test_a_length_out_of_range_is_refused(self):
        meshes.write_stl(self.folder / "part.stl", meshes.sphere(0.8))
        for length in ("-3", "-0", "0mm", "1e9mm"):
            self.refuse(2, f"mesh2sdf: --fit: '{length}' is not accepted; the length must be greater than 0 mm, up to 100000 mm",
                        "mesh2sdf", "part.stl", *MIMAKI, "--fit", length, "-o", "x.vdb")
        self.refuse(2, "mesh2sdf: --fit: the value is missing; give --fit LENGTH", "mesh2sdf", "part.stl", *MIMAKI, "--fit")

    def test_a_call_without_words_prints_the_overview(self):
        self.assertEqual(self.succeed(), self.succeed("--help"))
        self.assertEqual(self.shell("vdbdither | cat"), self.succeed("--help"))
        self.refuse(2, "run: the chain is empty", "run", " ")

    def test_an_output_larger_than_the_disk_is_refused_before_the_run(self):
        disk = self.folder / "disk"
        disk.mkdir()
        mounted = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", disk], capture_output=True)
        if mounted.returncode != 0:
            self.skipTest("a small disk can be mounted only by root")
        self.addCleanup(subprocess.run, ["umount", disk], check=True)
        meshes.write_stl(self.folder / "part.stl", meshes.sphere(6))
        self.refuse(1, "write: 'disk/x.vdb' needs about ", "mesh2sdf", "part.stl", *MIMAKI, "-o", "disk/x.vdb")

    def test_files_of_16_bit_values_are_small_and_read_again(self):
        meshes.write_stl(self.folder / "part.stl", meshes.sphere(1.5))
        self.succeed("run", "mesh2sdf part.stl --printer mimaki-3duj-553 ! normals ! write whole.vdb ! write half.vdb --half")
        sizes = [(self.folder / name).stat().st_size for name in ("half.vdb", "whole.vdb")]
        self.assertLess(sizes[0], 0.8 * sizes[1])
        whole, half = [json.loads(self.succeed("info", name, "--json")) for name in ("whole.vdb", "half.vdb")]
        self.assertEqual([grid["active_voxels"] for grid in whole["grids"]], [grid["active_voxels"] for grid in half["grids"]])
        self.succeed("run", "read half.vdb ! dither ! slice-export out")
        # A file read from 16-bit values is written with 32 bits again.
        self.succeed("run", "read half.vdb ! write again.vdb")
        self.assertGreater((self.folder / "again.vdb").stat().st_size, sizes[0])
        self.succeed("compare", "half.vdb", "again.vdb")

    def test_a_stack_of_some_layers_names_the_layers_it_has(self):
        meshes.write_stl(self.folder / "part.stl", meshes.sphere(0.8))
        self.succeed("run", "mesh2sdf part.stl --printer mimaki-3duj-553 ! dither ! slice-export some --layers 20:60")
        said = self.refuse(1, "'some' lacks layer 0; --layers ", "slice-import", "some", "-o", "x.vdb").stderr.decode()
        layers = re.search(r"--layers (\d+:\d+) takes", said)[1]
        self.assertNotEqual(layers, "20:60")
        self.succeed("slice-import", "some", "--layers", layers, "-o", "x.vdb")
        self.succeed("run", f"mesh2sdf part.stl --printer mimaki-3duj-553 ! dither ! compare x.vdb --grids solid --layers {layers}")

    def test_a_stack_of_fewer_layers_than_a_group_names_the_groups_to_export(self):
        meshes.write_stl(self.folder / "part.stl", meshes.sphere(0.8))
        chain = "mesh2sdf part.stl --printer mimaki-3duj-553 ! dither ! slice-export some --overwrite --layers "
        self.succeed("run", chain + "21:25")
        said = self.refuse(1, "'some' lacks layer 0; a stack is read in whole groups of eight layers, and it has 21:25; "
                           "export such groups: slice-export --layers ", "slice-import", "some", "-o", "x.vdb").stderr.decode()
        layers = re.search(r"slice-export --layers (\d+:\d+)", said)[1]
        self.succeed("run", chain + layers)
        self.succeed("slice-import", "some", "--layers", layers, "-o", "x.vdb")


if __name__ == "__main__":
    unittest.main()
