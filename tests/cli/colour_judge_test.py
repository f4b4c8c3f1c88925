"""Tests samples/colour: the judge knows what prints with known answers look like."""

import dataclasses
import json
import subprocess
import sys
import unittest

import numpy as np
from program import PROGRAM, ROOT, ProgramTest

COLOUR = ROOT / "samples/colour"
sys.path.insert(0, str(COLOUR))

import judge  # noqa: E402
import optics  # noqa: E402
import oracles  # noqa: E402
import study  # noqa: E402
from printed_stack import Stack, read_stack, write_stack  # noqa: E402

MATERIALS = [{"name": "white", "rgba": [255, 255, 255, 255]}, {"name": "black", "rgba": [0, 0, 1, 255]},
             {"name": "red", "rgba": [200, 30, 40, 255]}]
PITCH_MM = (0.04, 0.08, 0.02)

# Test data of Sharma, Wu and Dalal (2005), table 1: two colours and their difference.
SHARMA = """
50.0000 2.6772 -79.7751 50.0000 0.0000 -82.7485 2.0425
50.0000 -1.3802 -84.2814 50.0000 0.0000 -82.7485 1.0000
50.0000 0.0000 0.0000 50.0000 -1.0000 2.0000 2.3669
50.0000 2.4900 -0.0010 50.0000 -2.4900 0.0009 7.1792
50.0000 2.4900 -0.0010 50.0000 -2.4900 0.0011 7.2195
50.0000 -0.0010 2.4900 50.0000 0.0009 -2.4900 4.8045
50.0000 -0.0010 2.4900 50.0000 0.0011 -2.4900 4.7461
50.0000 2.5000 0.0000 50.0000 0.0000 -2.5000 4.3065
50.0000 2.5000 0.0000 73.0000 25.0000 -18.0000 27.1492
50.0000 2.5000 0.0000 61.0000 -5.0000 29.0000 22.8977
60.2574 -34.0099 36.2677 60.4626 -34.1751 39.4387 1.2644
61.2901 3.7196 -5.3901 61.4292 2.2480 -4.9620 1.8731
22.7233 20.0904 -46.6940 23.0331 14.9730 -42.5619 2.0373
2.0776 0.0795 -1.1350 0.9033 -0.0636 -0.5514 0.9082
"""


def plate(normal=(0, 0, 1), size_mm=(4.4, 4.4, 1.2), profile=None):
    """Returns a stack whose first material fills a box; the third axis of the box is the normal."""
    axes = np.array(optics.frame(normal))
    reach = np.ceil(np.abs(axes.T) @ size_mm / 2 / PITCH_MM).astype(int)
    z, y, x = np.meshgrid(*(np.arange(-count, count + 1) for count in reach[::-1]), indexing="ij")
    inside = (np.abs(np.stack([x, y, z], -1) * PITCH_MM @ axes.T) <= np.array(size_mm) / 2).all(axis=-1)
    return Stack(inside.astype(np.uint8), (-reach[0], -reach[1], -reach[2]), np.array(PITCH_MM), np.zeros(3), MATERIALS,
                 profile or {})


def painted(stack, voxels):
    return dataclasses.replace(stack, voxels=voxels)


class ColourJudge(ProgramTest):
    def judge(self, *arguments):
        return subprocess.run(["/usr/bin/python3", COLOUR / "judge.py", *arguments], cwd=self.folder, capture_output=True,
                              text=True, timeout=300)

    def test_ciede2000_has_the_published_values(self):
        for line in SHARMA.strip().splitlines():
            numbers = [float(word) for word in line.split()]
            for a, b in ((numbers[:3], numbers[3:6]), (numbers[3:6], numbers[:3])):
                self.assertAlmostEqual(float(optics.ciede2000(a, b)), numbers[6], delta=1e-4)

    def test_mixtures_follow_yule_and_nielsen(self):
        colours = np.array([[1, 1, 1], [0, 0.25, 0.04]])
        half = optics.mixed([0.5, 0.5], colours, np.array([1, 2, 2]))
        np.testing.assert_allclose(half, [0.5, 0.75**2, 0.6**2])
        profile = {"yule_nielsen": [1, 2, 4]}
        np.testing.assert_array_equal(optics.yule_nielsen(profile), [1, 2, 4])
        measured = [{"name": "a", "rgba": [0, 0, 0, 255], "linear_rgb": [0.1, 0.2, 0.3]}]
        np.testing.assert_array_equal(optics.material_colours(measured), [[0.1, 0.2, 0.3]])

    def test_slices_are_read_as_the_manifest_places_them(self):
        box = ("v 0 0 0|v 1 0 0|v 0 1.5 0|v 0 0 0.5|f 1 3 2|f 1 2 4|f 1 4 3|f 2 3 4").split("|")
        (self.folder / "part.obj").write_text("\n".join(box) + "\n")
        made = {}
        for name, options in {"plain": (), "mirrored": ("--flip-x", "--flip-y", "--padding", "3"),
                              "folders": ("--format", "png1", "--flip-x"), "tiff": ("--format", "tiff")}.items():
            self.succeed("mesh2sdf", "part.obj", "--pitch", "0.04,0.08,0.02", "!", "dither", "!", "material-assign", "--shell",
                         "0.1mm:a=#ff0000", "--core", "b=#0000ff", "!", "slice-export", name, *options, "-q")
            made[name] = read_stack(self.folder / name)
        plain = made.pop("plain")
        self.assertGreater(len(set(plain.voxels.ravel())), 2)
        # The corner at the origin is the only right one.
        z, y, x = np.nonzero(plain.voxels)
        off = np.abs(plain.centre_mm(x, y, z).mean(axis=0) - (0.25, 0.375, 0.125))
        self.assertTrue((off < plain.pitch_mm / 4).all(), off)
        for name, stack in made.items():
            np.testing.assert_array_equal(stack.voxels, plain.voxels, name)
            self.assertEqual(tuple(stack.first), tuple(plain.first), name)
        again = self.folder / "again"
        write_stack(again, plain)
        np.testing.assert_array_equal(read_stack(again).voxels, plain.voxels)

    def test_coverages_are_counted(self):
        stack = plate(profile={"yule_nielsen": 1})
        z, y, x = np.indices(stack.voxels.shape)
        voxels = np.where(stack.voxels > 0, 1 + (x % 4 == 0) + 2 * (x % 4 == 1), 0).astype(np.uint8)
        write_stack(self.folder / "stack", painted(stack, voxels))
        done = self.judge("stack", "--json", "figures.json")
        self.assertEqual((done.returncode, done.stderr), (0, ""))
        figures = json.loads((self.folder / "figures.json").read_text())
        printed = voxels[voxels > 0]
        for number, name in enumerate(("white", "black", "red"), 1):
            self.assertAlmostEqual(figures["coverage_whole"][name], (printed == number).mean(), places=9)
            self.assertAlmostEqual(figures["coverage"][name], (0.5, 0.25, 0.25)[number - 1], delta=0.012)
        colours = optics.material_colours(MATERIALS)
        np.testing.assert_allclose(figures["predicted"]["linear_rgb"], np.array(list(figures["coverage"].values())) @ colours)

    def test_one_material_has_no_grain(self):
        for normal in ((0, 0, 1), (0.3, -0.5, 0.8)):
            result = judge.judge(plate(normal), normal, seeds=(1,))
            self.assertEqual(result["coverage"]["white"], 1)
            for entry in result["grain"]:
                self.assertLess(entry["dl"], 1e-6)
                self.assertIsNone(entry["share"])

    def test_random_choice_has_the_grain_of_random_choice(self):
        for normal in ((0, 0, 1), (0.3, -0.5, 0.8)):
            stack = plate(normal)
            shares = []
            for seed in range(20, 26):
                voxels = judge.random_choice(stack.voxels > 0, [0.5, 0.2, 0.3], seed)
                result = judge.judge(painted(stack, voxels), normal, seeds=(1, 2, 3))
                shares.append([entry["share"] for entry in result["grain"]])
            np.testing.assert_allclose(np.mean(shares, axis=0), 1, atol=0.12)

    def test_error_diffusion_has_less_grain(self):
        normal = (0.3, -0.5, 0.8)
        stack = plate(normal)
        coverages = [0.5, 0.2, 0.3]
        made = dict(oracles.alternatives(stack, coverages))
        for name, limit in {"serial 3D": 0.4, "along the surface": 0.45, "nearest ink": 0}.items():
            result = judge.judge(painted(stack, made[name]), normal, seeds=(1,))
            share = result["grain"][1]["share"]
            self.assertEqual(share is None, name == "nearest ink")
            self.assertLessEqual(share or 0, limit, name)
        for name in ("serial 3D", "along the surface", "Floyd-Steinberg"):
            found = np.bincount(made[name][stack.voxels > 0], minlength=4)[1:] / np.count_nonzero(stack.voxels)
            np.testing.assert_allclose(found, coverages, atol=0.005)

    def test_error_diffusion_follows_a_ramp(self):
        stack = plate()
        share = np.linspace(0, 1, stack.voxels.shape[2])
        ramp = np.broadcast_to(np.stack([1 - share, share, 0 * share], -1), (*stack.voxels.shape, 3))
        for voxels in (oracles.diffused(stack.voxels > 0, ramp, oracles.SERIAL),
                       oracles.along_surface(stack.voxels > 0, ramp, PITCH_MM)):
            for x in range(20, 100, 8):
                part = voxels[:, :, x:x + 8]
                self.assertAlmostEqual((part == 2).sum() / (part > 0).sum(), share[x:x + 8].mean(), delta=0.01)

    def test_ink_fades_with_its_depth(self):
        for normal in ((0, 0, 1), (0, 0, -1), (0.3, -0.5, 0.8)):
            stack = plate(normal, (4.4, 4.4, 1.18))
            n = optics.frame(normal)[2]
            z, y, x = np.nonzero(stack.voxels)
            voxels = stack.voxels.copy()
            voxels[z, y, x] = np.where(stack.centre_mm(x, y, z) @ n < 0.59 - 0.1, 2, 1)
            facet = judge.Facet(painted(stack, voxels), normal)
            # Both sides of the white layer are stairs of voxels, except across an axis; depths are counted in steps.
            stairs = 0 if normal[0] == 0 else np.abs(n * PITCH_MM).sum() / 2
            for length, shares in zip(judge.LENGTHS_MM, facet.shares(voxels, 3)):
                found = shares[1].mean()
                self.assertAlmostEqual(shares[0].mean() + found, 1, places=5)
                if length == 0:
                    self.assertEqual(found, 0)
                else:
                    thickness = -length * np.log(found)
                    self.assertAlmostEqual(thickness, 0.1, delta=stairs + facet.step_mm, msg=(normal, length))

    def test_the_eye_filters_a_wave_as_published(self):
        count, spacing_mm, waves = 200, 0.02, 6
        eye = optics.Eye(count, spacing_mm)
        along = np.cos(2 * np.pi * waves * np.arange(count) / count)
        share = np.broadcast_to(0.5 + 0.1 * along, (count, count)).ravel()
        seen = eye.lightness_alone(eye.spectra(share))
        contrast = (((seen + 16) / 116) ** 3).std() * np.sqrt(2)
        # By hand: 1.5 waves a mm are 7.855 waves a degree at 30 cm.
        passed = [sum(w * np.exp(-(np.pi * s * 7.8548) ** 2) for w, s in channel) / sum(w for w, _ in channel)
                  for channel in (((0.921, 0.0283), (0.105, 0.133), (-0.108, 4.336)), ((0.531, 0.0392), (0.33, 0.494)),
                                  ((0.488, 0.0536), (0.371, 0.386)))]
        white = np.array([0.95047, 1, 1.08883])
        matrix = np.array([[0.279, 0.722, -0.107], [-0.449, 0.29, 0.077], [0.086, -0.59, 0.501]])
        luminance = (np.linalg.inv(matrix) @ (passed * (matrix @ white)))[1]
        drops = np.exp(-2 * (np.pi * 1.5 * 0.025) ** 2)
        self.assertAlmostEqual(contrast, 0.1 * luminance * drops, delta=2e-4)
        self.assertAlmostEqual(luminance / passed[0], 1, delta=0.05)

    def test_a_plate_that_is_too_small_is_refused(self):
        write_stack(self.folder / "small", plate(size_mm=(2, 2, 1)))
        done = self.judge("small")
        self.assertEqual(done.returncode, 1)
        self.assertRegex(done.stderr, r"^judge: the facet shows .* mm away from its edges; 3\.0 mm are needed\n$")
        self.assertIn("normal", self.judge("small", "--normal", "0,0,0").stderr)

    def test_the_study_judges_prints_of_the_program(self):
        parts = [word for part in study.PARTS for word in ("--part", part)]
        done = subprocess.run(["/usr/bin/python3", COLOUR / "study.py", "--program", PROGRAM, "--normals", "2", "--recipes", "1",
                               "--colours", "2", "--seeds", "1", "--printer", "mimaki-3duj-553", *parts, "--steps",
                               "dither ! material-assign --shell 0.1mm:cyan --core white", "--json", "cases.json"],
                              cwd=self.folder, capture_output=True, text=True, timeout=500)
        self.assertEqual(done.returncode, 0, done.stderr)
        cases = json.loads((self.folder / "cases.json").read_text())["mimaki-3duj-553"]
        self.assertEqual((len(cases["grain"]), len(cases["accuracy"])), (2, 3))
        for case in cases["grain"]:
            self.assertAlmostEqual(case["coverage"]["cyan"], 0.1, delta=0.02)
            self.assertEqual(case["grain"][0]["dl"], 0)
        self.assertEqual([len(cases[part]) for part in ("dither", "oracles")], [6, 2])
        for case in cases["oracles"]:
            found, random = (case["methods"][name]["grain"][1]["share"] for name in ("the stack", "random choice"))
            self.assertLess(found, random)
        for text in ("random mixtures", "interlaced", "along the surface"):
            self.assertIn(text, done.stdout)

    def test_stacks_with_different_materials_share_a_table(self):
        def case(name, share):
            entry = {"dl": 1.0, "random_dl": 2.0, "share": share}
            return {"coverage": {"white": 0.5, name: 0.5}, "recipe": "r", "normal": [0, 0, 1], "coverage_rms": {"white": 0.1},
                    "grain": [{**entry, "inks": {"white": entry, name: entry}} for _ in judge.LENGTHS_MM]}

        lines = study.lines_of_grain([case("cyan", 0.25), case("black", 0.75)])
        rows = {line.split()[0]: line.split()[1:4] for line in lines if line.split()[0] in ("recipe", "white", "cyan", "black")}
        self.assertEqual(rows, {"recipe": ["2", "0.500", "0.750"], "white": ["2", "0.500", "0.750"],
                                "cyan": ["1", "0.250", "0.250"], "black": ["1", "0.750", "0.750"]})

    def test_what_inks_can_mix_is_known(self):
        colours = np.array([[1, 1, 1], [0.9, 0.1, 0.1], [0.1, 0.9, 0.1], [0.1, 0.1, 0.9], [0.01, 0.01, 0.01]])
        for rgb in study.random_mixtures(20, colours, np.array([2, 2, 2])):
            self.assertTrue(study.is_mixable(rgb, colours, np.array([2, 2, 2])))
        for rgb in ((0.9, 0, 0), (0.005, 0.005, 0.005), (1.1, 1.1, 1.1)):
            self.assertFalse(study.is_mixable(rgb, colours, np.array([2, 2, 2])))


if __name__ == "__main__":
    unittest.main()
