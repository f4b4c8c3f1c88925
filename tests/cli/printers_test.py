"""Tests the tool printers."""

import copy
import json
import re
import shutil
import unittest

import jsonschema
import meshes
from program import PROGRAM, ROOT, ProgramTest

PRINTERS = ROOT / "samples/printers"
PROFILES = sorted((path for path in PRINTERS.glob("*.json") if path.stem != "schema"), key=lambda path: path.stem)
SCHEMA = json.loads((PRINTERS / "schema.json").read_text())

# A profile with every key.
WHOLE = {
    "$schema": "schema.json", "name": "whole", "title": "Whole", "source": "By definition", "technology": "resin",
    "pitch_mm": ["600dpi", 0.03, "50um"], "layer_mm": ["10um", 0.2], "build_mm": [100, "20cm", 0], "slice_px": [100, 200.0],
    "origin": "centre", "mirror_x": True, "mirror_y": True, "minimum_slices": 30, "maximum_colours": 6,
    "containers": ["gcvf", "png"], "printer_notes": "FILEFORMAT_GOO\nB", "point_spread_mm": [0.05, "1um", 1],
    "yule_nielsen": [1, 2, 16], "kubelka_munk": {"outer": 0.04, "inner": [0.6, 0.6, 0.99]},
    "materials": [{"name": "clear-ink", "rgba": [0, 1, 2, 255], "linear_rgb": [0, 0.5, 1], "absorption": [0, 1, 2],
                   "scattering": [3, 4, 1e9], "density_g_per_cm3": 1.18, "resin": "VeroClear"}],
}


def changed(*path_and_value, profile=WHOLE):
    """Returns a profile with another value at a path of keys and indices, or without one where it is None."""
    *path, last, value = path_and_value
    profile = copy.deepcopy(profile)
    place = profile
    for step in path:
        place = place[step]
    if value is None:
        del place[last]
    else:
        place[last] = value
    return profile


class Printers(ProgramTest):
    def check(self, profile, file="whole.json"):
        """Writes a profile, text or JSON, and returns its problems."""
        (self.folder / file).write_text(profile if isinstance(profile, str) else json.dumps(profile, indent=1))
        done = self.run_program("printers", "check", file)
        if done.returncode == 0:
            self.assertEqual((done.stdout.decode(), done.stderr), (f"'{file}' is a proper profile\n", b""))
            return []
        problems = done.stdout.decode().splitlines()
        number = f"{len(problems)} problem{'s' if len(problems) > 1 else ''}"
        self.assertEqual((done.returncode, done.stderr.decode()), (1, f"vdbdither printers: '{file}' has {number}\n"))
        return problems

    def test_list_names_every_profile_with_its_pitch_in_columns(self):
        said = self.succeed("printers").decode()
        self.assertEqual(said, self.succeed("printers", "list").decode())
        lines = said.splitlines()
        self.assertEqual([line.split()[0] for line in lines], [path.stem for path in PROFILES])
        for profile, line in zip(map(json.loads, (path.read_text() for path in PROFILES)), lines):
            technology = profile.get("technology", "")
            self.assertRegex(line, rf"^{profile['name']} +[\d.]+ x [\d.]+ x [\d.]+ mm +{technology} +{profile['title']}$")
            self.assertEqual(line.index(profile["title"], line.index(" mm ")), lines[0].index("resin    Any") + len("resin    "))

    def test_show_prints_a_profile(self):
        said = self.succeed("printers", "show", "mimaki-3duj-553").decode()
        for line in ("name        mimaki-3duj-553", "pitch       0.042 x 0.084 x 0.022 mm", "build       508 x 508 x 305 mm",
                     "materials   white 240,240,240,255"):
            self.assertIn(line + "\n", said)
        self.refuse(2, "no printer 'mimaki'; there are anycubic-photon-mono-m5s ", "printers", "show", "mimaki")
        shutil.copy(PROGRAM, self.folder / "alone")
        self.refuse(2, "no printer 'mimaki': no profiles are installed, or share/vdbdither is not beside the program; set VDBDITHER_DATA to it, "
                    "or name a profile file ending in .json", "printers", "show", "mimaki", program=self.folder / "alone")
        self.refuse(2, "no printer 'schema'; there are ", "printers", "show", "schema")

    def test_show_tells_every_field(self):
        self.assertEqual(self.check(WHOLE), [])
        self.assertEqual(self.succeed("printers", "show", "whole.json").decode().splitlines(), [
            "name        whole",
            "title       Whole",
            "technology  resin",
            "pitch       0.042333 x 0.03 x 0.05 mm",
            "layers      0.01 to 0.2 mm",
            "build       100 x 200 x 0 mm",
            "origin      centre",
            "slices      100 x 200 pixels, mirrored in x, mirrored in y, at least 30 of them, at most 6 colours",
            "containers  gcvf, png",
            r"notes       FILEFORMAT_GOO\nB",
            "spread      0.05 x 0.001 x 1 mm",
            "mixing      Yule-Nielsen factor 1, 2, 16",
            "mixing      Kubelka-Munk, surface mirrors 0.04 outside, 0.6, 0.6, 0.99 inside",
            "materials   clear-ink 0,1,2,255, resin VeroClear, 1.18 g/cm3, measured 0, 0.5, 1, absorption 0, 1, 2, "
            "scattering 3, 4, 1e+09",
            "source      By definition"])
        shown = json.loads(self.succeed("printers", "show", "whole.json", "--json"))
        self.assertEqual(shown.keys(), WHOLE.keys() - {"$schema"})
        self.assertEqual(shown["materials"], WHOLE["materials"])

    def test_every_sample_profile_is_valid_and_states_its_source(self):
        validator = jsonschema.Draft202012Validator(SCHEMA)
        for path in PROFILES:
            self.assertEqual(self.succeed("printers", "check", path).decode(), f"'{path}' is a proper profile\n")
            profile = json.loads(path.read_text())
            validator.validate(profile)
            self.assertTrue(profile["source"], path)

    def test_the_manual_names_every_profile_and_field(self):
        page = (ROOT / "docs/printers.md").read_text()
        for path in PROFILES:
            self.assertIn(f"`{path.stem}`", page)
        for key in SCHEMA["properties"].keys() | SCHEMA["$defs"]["material"]["properties"].keys():
            self.assertRegex(page, rf"(?m)^\| (`\w+`, )?`{re.escape(key)}`(, `\w+`)? \|")

    def test_displays_are_as_wide_as_their_pixels(self):
        displays = [profile for profile in map(json.loads, (path.read_text() for path in PROFILES)) if "slice_px" in profile]
        self.assertGreaterEqual(len(displays), 10)
        for profile in displays:
            for pitch, pixels, build_mm in zip(profile["pitch_mm"], profile["slice_px"], profile["build_mm"]):
                self.assertAlmostEqual(float(pitch.removesuffix("um")) / 1000 * pixels, build_mm, delta=1e-3)

    def test_the_schema_knows_the_keys_that_the_program_knows(self):
        jsonschema.Draft202012Validator.check_schema(SCHEMA)
        properties = SCHEMA["properties"]
        objects = ((), properties), (("kubelka_munk",), properties["kubelka_munk"]["properties"]), \
                  (("materials", 0), SCHEMA["$defs"]["material"]["properties"])
        for path, known in objects:
            problems = self.check(changed(*path, "nothing of the kind", 1))
            self.assertEqual(len(problems), 1)
            accepted = re.fullmatch(r"line \d+: .*'nothing of the kind' means nothing here; accepted are (.*)", problems[0])[1]
            self.assertEqual(set(accepted.split(", ")), known.keys())
            self.assertTrue(all("description" in value for value in known.values()), known)

    def test_program_and_schema_accept_and_refuse_the_same_profiles(self):
        validator = jsonschema.Draft202012Validator(SCHEMA)
        good = [WHOLE, {"name": "whole", "pitch_mm": [1, 1, 1]}, changed("yule_nielsen", 3), changed("materials", []),
                changed("pitch_mm", ["+4.e1um", ".05", "50000nm"]), changed("containers", []), changed("printer_notes", "")]
        for profile in good:
            validator.validate(profile)
            self.assertEqual(self.check(profile), [], profile)
        for profile in (42, changed("pitch_mm", None), changed("kubelka_munk", 1), changed("kubelka_munk", "outer", None),
                        changed("materials", {}), changed("materials", [1]), changed("materials", 0, "rgba", None),
                        changed("materials", 0, "scattering", None)):
            self.assertFalse(validator.is_valid(profile), profile)
            self.assertNotEqual(self.check(profile), [], profile)

    def test_program_and_schema_refuse_the_same_values(self):
        # The values of a key are tried one after the other, those of different keys at once.
        material, mirror = ("materials", 0), ("kubelka_munk",)
        wrong = {
            ("name",): ["", "a/b", "..", 1, None], ("title",): [1], ("source",): [[]], ("$schema",): [1], ("misspelt",): [1],
            ("technology",): ["laser", 1], ("pitch_mm",): [[1, 1], [0, 1, 1], [1, 101, 1], ["1 um", 1, 1], ["wide", 1, 1], 1],
            ("layer_mm",): [[0.05], [0, 0.05], ["a", 1], 1], ("build_mm",): [[1, 1, -1], [1, 1], 1],
            ("slice_px",): [[0, 1], [1.5, 1], [1, 16777217], [1], "1"], ("origin",): ["center", 1], ("mirror_x",): [1],
            ("mirror_y",): ["true"], ("minimum_slices",): [0, "30", 1.5], ("maximum_colours",): [-1, True],
            ("containers",): ["png", [""], ["png", "png"], [1], ["png", "nonsense"]], ("printer_notes",): [1], ("point_spread_mm",): [[0, 0.05, 0.05], [0, 0, 0], [0.05, 0.05, 1.1]],
            ("yule_nielsen",): [0.5, [1, 2], 17], (*mirror, "inner"): [[0, 0, 1], [0, 0], 1], (*mirror, "colour"): [1],
            (*material, "name"): ["a\\b", 1, None, "a,b", "c:d", "e=f", " g ", "clear ink", ".g", "gr\u00fcn"], (*material, "rgba"): [[0, 0, 0], [0, 0, 0, 256], [0, 0, 0, 0.5]],
            (*material, "linear_rgb"): [[0, 0, 2], 1], (*material, "scattering"): [[0, -1, 0]],
            (*material, "absorption"): [[1, 1]], (*material, "density_g_per_cm3"): [0, 101, "1"], (*material, "resin"): [1],
            (*material, "colour"): [1],
        }
        for turn in range(max(map(len, wrong.values()))):
            profile = WHOLE
            tried = [path for path, values in wrong.items() if turn < len(values)]
            for path in tried:
                profile = changed(*path, wrong[path][turn], profile=profile)
            errors = list(jsonschema.Draft202012Validator(SCHEMA).iter_errors(profile))
            problems = self.check(profile)
            for path in tried:
                holders = [list(path), list(path[:-1])]
                self.assertTrue([error for error in errors if list(error.absolute_path)[:len(path)] in holders and
                                 (list(error.absolute_path)[:len(path)] == list(path) or path[-1] in error.message)], (path, turn))
                where = "material 1: " if path[:2] == material else "kubelka_munk: " if path[:1] == mirror else ""
                self.assertTrue([problem for problem in problems if re.match(rf"line \d+: {where}(.*\W)?{re.escape(path[-1])}\b",
                                                                            problem)], (path, turn, problems))

    def test_check_lists_what_is_wrong_with_the_colours_of_a_profile(self):
        self.assertEqual(self.check("""{"name": "odd", "pitch_mm": [0.04, 0.08, 0.02], "yule_nielsen": [2, 0.5, 2],
            "kubelka_munk": {"outer": 2, "inner": [0, 0, 0], "sides": 1}, "materials": [
            {"name": "white", "rgba": [1, 2, 3, 4], "linear_rgb": [0, 2, 0], "absorption": 1, "scattering": [1, 1, -1]},
            {"name": "black", "rgba": [1, 2, 3, 4], "absorption": [1, 1, 1]}]}""", "odd.json"), [
            "line 1: yule_nielsen must be a number from 1 to 16, or three of them",
            "line 2: kubelka_munk: 'sides' means nothing here; accepted are outer, inner",
            "line 2: kubelka_munk: outer must be a number and inner three, from 0 to 0.99",
            "line 3: material 1: absorption must be three numbers from 0 to 1e9",
            "line 3: material 1: scattering must be three numbers from 0 to 1e9",
            "line 3: material 1: linear_rgb must be three numbers from 0 to 1",
            "line 4: material 2: absorption and scattering go together",
        ])

    def test_check_lists_every_problem_with_its_line(self):
        self.assertEqual(self.check("""{"name": "even",
            "pitch_mm": ["42um", 0, "22um"],
            "bild_mm": [1, 2, 3],
            "materials": [
            {"name": "white", "rgba": [1, 2, 3, 300]},
            {"rgba": [1, 2, 3, 4],
             "name": "white",

             "resin": 1}], "bild_mm": 1}""", "odd.json"), [
            "line 1: its name 'even' is not that of its file",
            "line 2: pitch_mm must be three lengths between 0.0001 and 100 mm",
            "line 5: material 1: rgba must be four whole numbers from 0 to 255",
            "line 7: material 2: 'white' is there twice",
            "line 9: 'bild_mm' is there twice",
            "line 9: 'bild_mm' means nothing here; did you mean 'build_mm'?",
            "line 9: material 2: resin is no text"])
        meshes.write_stl(self.folder / "part.stl", meshes.sphere(0.8))
        self.refuse(1, "'odd.json' is not a printer profile: line 2: pitch_mm must be three lengths between 0.0001 and 100 mm "
                       "(and 5 more; `vdbdither printers check` lists them)", "mesh2sdf", "part.stl", "--printer", "odd.json",
                    "-o", "x.vdb")
        self.assertEqual(self.check("42", "none.json"), ["line 1: the text is not a JSON object"])

    def test_check_tells_where_a_file_is_not_json(self):
        [problem] = self.check('{\n  "name": "odd"\n  "pitch_mm": [1, 1, 1]\n}', "odd.json")
        self.assertRegex(problem, "^line 3, column 12: this is not JSON: ")
        self.refuse(1, "'odd.json' is not a printer profile: line 3, column 12: this is not JSON: ", "printers", "show", "odd.json")

    def test_check_lists_names_that_cannot_be_told_apart(self):
        self.assertEqual(self.check("""{"name": "odd", "pitch_mm": [1, 1, 1], "materials": [
            {"name": "A", "rgba": [255, 255, 255, 255]},
            {"name": "k", "rgba": [9, 0, 0, 255]},
            {"name": "a", "rgba": [255, 0, 0, 255]}]}""", "odd.json"), [
            "line 4: material 3: 'a' differs from 'A' by upper and lower case only"])

    def test_check_remarks_materials_of_one_colour_in_a_proper_profile(self):
        text = """{"name": "odd", "pitch_mm": [1, 1, 1], "materials": [
            {"name": "white", "rgba": [255, 255, 255, 255]},
            {"name": "clear",
             "rgba": [255, 255, 255, 255]}]}"""
        (self.folder / "odd.json").write_text(text)
        remark = ("line 4: material 2: 'clear' has the colour of 'white', so that formats that tell materials apart by colour, "
                  "such as png and gcvf, refuse jobs of both")
        self.assertEqual(self.succeed("printers", "check", "odd.json").decode(), f"'odd.json' is a proper profile\n{remark}\n")
        self.assertEqual(json.loads(self.succeed("printers", "check", "odd.json", "--json")),
                         {"profile": "odd.json", "problems": [], "remarks": [remark]})

    def test_check_remarks_a_material_of_the_colour_of_empty_voxels(self):
        (self.folder / "odd.json").write_text("""{"name": "odd", "pitch_mm": [1, 1, 1], "materials": [
            {"name": "k", "rgba": [0, 0, 0, 255]}]}""")
        remark = "line 2: material 1: 'k' has the colour of empty voxels; give slice-export another --background"
        self.assertEqual(self.succeed("printers", "check", "odd.json").decode(), f"'odd.json' is a proper profile\n{remark}\n")

    def test_every_format_of_slices_may_be_a_container(self):
        formats = re.search(r"--format ([\w|]+)", self.succeed("slice-export", "--help").decode())
        self.assertIsNotNone(formats, self.succeed("slice-export", "--help").decode())
        self.assertEqual(SCHEMA["properties"]["containers"]["items"]["enum"], sorted(formats[1].split("|")))

    def test_check_tells_where_a_number_is_too_large(self):
        text = '{"name": "odd",\n "pitch_mm": [1e400, 0.1, 0.1]}'
        self.assertEqual(self.check(text, "odd.json"), ["line 2, column 15: the number 1e400 is too large"])
        self.refuse(1, "'odd.json' is not a printer profile: line 2, column 15: the number 1e400 is too large", "printers",
                    "show", "odd.json")

    def test_problems_have_no_effect_on_a_terminal(self):
        for text in ('{"\\u001b[31m": 1}', '{"a" \x1b[31m'):
            (self.folder / "odd.json").write_text(text)
            done = self.run_program("printers", "check", "odd.json")
            self.assertEqual(done.returncode, 1)
            self.assertNotIn(b"\x1b", done.stdout + done.stderr)

    def test_new_writes_a_proper_profile_and_tells_what_comes_next(self):
        said = self.succeed("printers", "new", "mine.json").decode()
        self.assertIn("wrote 'mine.json', whose figures are examples. Next:\n", said)
        self.assertIn("  vdbdither printers check mine.json\n", said)
        self.assertRegex(said, r"\nAll fields: .*/printers/schema\.json\n$")
        profile = json.loads((self.folder / "mine.json").read_text())
        jsonschema.Draft202012Validator(SCHEMA).validate(profile)
        self.assertEqual((profile["name"], profile["source"][:15]), ("mine", "to be filled in"))
        self.succeed("printers", "check", "mine.json")
        (self.folder / "mine.json").write_text("mine")
        self.refuse(2, "'mine.json' exists; --overwrite replaces it", "printers", "new", "mine.json")
        self.assertEqual((self.folder / "mine.json").read_text(), "mine")
        self.assertEqual(json.loads(self.succeed("printers", "new", "mine.json", "--overwrite", "--json")), {"profile": "mine.json"})
        self.assertEqual(json.loads((self.folder / "mine.json").read_text()), profile)
        self.assertEqual(len(self.listing()), 1)

    def test_new_refuses_what_cannot_be_a_profile(self):
        self.refuse(2, "'mine' must end in .json; printers new NAME.json writes the profile of a printer called NAME",
                    "printers", "new", "mine")
        self.refuse(2, "the name of the printer contains the unprintable character U+0007", "printers", "new", "a\x07.json")
        self.refuse(2, "printers: --overwrite goes with printers new", "printers", "list", "--overwrite")

    def test_layer_sets_the_height_of_layers_within_the_range_of_the_profile(self):
        meshes.write_stl(self.folder / "part.stl", meshes.sphere(0.8))
        chosen = "mesh2sdf", "part.stl", "--printer", "elegoo-saturn-3-ultra"
        self.succeed(*chosen, "--layer", "30um", "-o", "part.vdb")
        metadata = json.loads(self.succeed("info", "part.vdb", "--json"))
        text = json.dumps(metadata)
        self.assertIn("--layer 0.03mm", text)
        self.assertIn("[0.019,0.024,0.03]", text.replace(" ", "").replace("\\", ""))
        self.refuse(2, "mesh2sdf: --layer: the printer 'elegoo-saturn-3-ultra' takes layers from 0.01 to 0.2 mm",
                    *chosen, "--layer", "0.3", "-o", "x.vdb")
        self.refuse(2, "mesh2sdf: --layer: the printer 'mimaki-3duj-553' has layers of 0.022 mm; its profile states no range "
                       "(layer_mm)", *chosen[:3], "mimaki-3duj-553", "--layer", "22um", "-o", "x.vdb")
        self.refuse(2, "mesh2sdf: --layer goes with --printer; --pitch states the height of a layer itself",
                    *chosen[:2], "--pitch", "0.1", "--layer", "22um", "-o", "x.vdb")

    def test_what_is_no_action_is_told(self):
        self.refuse(2, "printers: action: 'sell' is not accepted; choose list, show, check or new", "printers", "sell")
        self.refuse(2, "printers: 'printer' is missing; see --help", "printers", "show")
        self.refuse(2, "printers: 'printer' is missing; see --help", "printers", "new")
        self.refuse(2, "printers: 'x' is not expected; printers show x describes it", "printers", "list", "x")
        self.refuse(2, "no operator or tool 'printer'; did you mean 'printers'?", "printer")


if __name__ == "__main__":
    unittest.main()
