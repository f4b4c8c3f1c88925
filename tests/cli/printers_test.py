"""Tests the tool printers."""

import unittest

import meshes
from program import ROOT, ProgramTest


class Printers(ProgramTest):
    def test_list_names_every_profile_with_its_pitch(self):
        said = self.succeed("printers").decode()
        self.assertEqual(said, self.succeed("printers", "list").decode())
        for profile in (ROOT / "samples/printers").iterdir():
            self.assertRegex(said, rf"(?m)^{profile.stem} +[\d.]+ x [\d.]+ x [\d.]+ mm  \S")

    def test_show_prints_a_profile(self):
        said = self.succeed("printers", "show", "mimaki-3duj-553").decode()
        for line in ("name      mimaki-3duj-553", "pitch     0.042 x 0.084 x 0.022 mm", "build     508 x 508 x 305 mm",
                     "materials white 240,240,240,255"):
            self.assertIn(line + "\n", said)
        self.refuse(2, "no printer 'mimaki'; there are mimaki-3duj-553 ", "printers", "show", "mimaki")

    def test_every_sample_profile_is_valid(self):
        for profile in (ROOT / "samples/printers").iterdir():
            self.assertIn("is a proper profile", self.succeed("printers", "check", profile).decode())

    def test_check_lists_what_is_wrong_with_the_colours_of_a_profile(self):
        (self.folder / "odd.json").write_text("""{"name": "odd", "pitch_mm": [0.04, 0.08, 0.02], "yule_nielsen": [2, 0.5, 2],
            "kubelka_munk": {"outer": 2, "inner": [0, 0, 0], "sides": 1}, "materials": [
            {"name": "white", "rgba": [1, 2, 3, 4], "linear_rgb": [0, 2, 0], "absorption": 1, "scattering": [1, 1, -1]},
            {"name": "black", "rgba": [1, 2, 3, 4], "absorption": [1, 1, 1]}]}""")
        done = self.run_program("printers", "check", "odd.json")
        self.assertEqual(done.returncode, 1)
        self.assertEqual(done.stdout.decode().splitlines(), [
            "yule_nielsen must be a number from 1 to 16, or three of them",
            "kubelka_munk: 'sides' means nothing here",
            "kubelka_munk: outer must be a number and inner three, from 0 to 0.99",
            "material 1: absorption must be three numbers from 0 to 1e9",
            "material 1: scattering must be three numbers from 0 to 1e9",
            "material 1: linear_rgb must be three numbers from 0 to 1",
            "material 2: absorption and scattering go together",
        ])

    def test_check_lists_every_problem(self):
        (self.folder / "odd.json").write_text("""{"name": "even", "pitch_mm": ["42um", 0, "22um"], "bild_mm": [1, 2, 3],
            "materials": [{"name": "white", "rgba": [1, 2, 3, 300]}, {"name": "white", "rgba": [1, 2, 3, 4]}]}""")
        done = self.run_program("printers", "check", "odd.json")
        self.assertEqual(done.returncode, 1)
        self.assertEqual(done.stdout.decode().splitlines(), [
            "'bild_mm' means nothing here; did you mean 'build_mm'?",
            "pitch_mm must be three lengths between 0.0001 and 100 mm",
            "material 1: rgba must be four whole numbers from 0 to 255",
            "material 2: 'white' is there twice",
            "its name 'even' is not that of its file"])
        self.assertEqual(done.stderr.decode(), "vdbdither printers: 'odd.json' has 5 problems\n")
        meshes.write_stl(self.folder / "part.stl", meshes.sphere(0.8))
        self.refuse(1, "'odd.json' is not a printer profile: 'bild_mm' means nothing", "mesh2sdf", "part.stl", "--printer",
                    "odd.json", "-o", "x.vdb")
        (self.folder / "none.json").write_text("42")
        self.assertEqual(self.run_program("printers", "check", "none.json").stdout.decode(), "the text is not a JSON object\n")

    def test_what_is_no_action_is_told(self):
        self.refuse(2, "printers: action: 'sell' is not accepted; choose list, show or check", "printers", "sell")
        self.refuse(2, "printers: 'printer' is missing; see --help", "printers", "show")
        self.refuse(2, "printers: 'x' is not expected; printers show x describes it", "printers", "list", "x")
        self.refuse(2, "no operator or tool 'printer'; did you mean 'printers'?", "printer")


if __name__ == "__main__":
    unittest.main()
