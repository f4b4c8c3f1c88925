"""Tests the walk of light in samples/colour against published values, and the fit of a profile to it."""

import json
import subprocess
import sys
import unittest

import numpy as np
from program import ROOT, ProgramTest

COLOUR = ROOT / "samples/colour"
sys.path.insert(0, str(COLOUR))

import characterize  # noqa: E402
import mixing_models  # noqa: E402
import optics  # noqa: E402

ONE_VOXEL = np.ones((1, 1, 1), np.uint8)
DEEP_MM = (1, 1, 1000)


class ColourWalk(ProgramTest):
    @classmethod
    def setUpClass(cls):
        cls.walker = characterize.Walker(cls.folder_of_class(), 400000)

    def near(self, found, error, expected):
        """Checks a mean within four standard errors, which must be small."""
        self.assertLess(error, 0.001)
        self.assertAlmostEqual(found, expected, delta=4 * error + 1e-5)

    def test_a_slab_agrees_with_the_tables_of_van_de_hulst(self):
        # Van de Hulst: Multiple Light Scattering, 1980: optical thickness 2, albedo 0.9, anisotropy 0.75, no surface.
        row, = self.walker.reflectances(ONE_VOXEL, (1, 1, 0.2), [[[1, 9, 0.75]]], refractive_index=1)
        self.near(row[0], row[1], 0.09739)
        self.near(row[2], row[3], 0.66096)

    def test_a_half_space_agrees_with_giovanelli(self):
        # Giovanelli: Reflection by Semi-infinite Diffusers, 1955: refractive index 1.5, albedo 0.9; with what is mirrored.
        row, = self.walker.reflectances(ONE_VOXEL, DEEP_MM, [[[1, 9, 0]]], refractive_index=1.5)
        self.near(row[0] + 0.04, row[1], 0.2600)

    def test_a_half_space_agrees_with_chandrasekhar(self):
        # Chandrasekhar: Radiative Transfer, 1950: isotropic scattering; from his function H by iteration.
        nodes, weights = np.polynomial.legendre.leggauss(64)
        nodes, weights = (nodes + 1) / 2, weights / 2
        for albedo in (0.5, 0.9, 0.99):
            root, h = np.sqrt(1 - albedo), np.ones(64)
            for _ in range(2000):
                h = 1 / (root + albedo / 2 * (weights * nodes * h / (nodes[:, None] + nodes)).sum(axis=1))
            at_normal = 1 / (root + albedo / 2 * (weights * nodes * h / (1 + nodes)).sum())
            optics_ = [[[1 - albedo, albedo, 0]]]
            row, = self.walker.reflectances(ONE_VOXEL, DEEP_MM, optics_, refractive_index=1)
            self.near(row[0], row[1], 1 - root * at_normal)
            row, = self.walker.reflectances(ONE_VOXEL, DEEP_MM, optics_, "diffuse", refractive_index=1)
            self.near(row[0], row[1], 1 - 2 * root * (weights * nodes * h).sum())
        # Kubelka and Munk, with K = 2 a and S = 3/4 s - 1/4 a, is an approximation that gets better with the albedo.
        ratio = 2 * 0.01 / (0.75 * 0.99 - 0.25 * 0.01)
        self.assertAlmostEqual(row[0], 1 + ratio - np.sqrt(ratio**2 + 2 * ratio), delta=0.004)

    def test_light_meets_the_voxels_in_their_places(self):
        # Without scattering every ray goes straight down: the mean over the columns is exact.
        random = np.random.default_rng(1)
        block = random.integers(1, 4, (5, 3, 2), np.uint8)
        pitch_mm, absorption = (0.04, 0.08, 0.02), np.array([0, 5, 20])
        row, = self.walker.reflectances(block, pitch_mm, [[[value, 0, 0]] for value in absorption], refractive_index=1)
        expected = np.exp(-absorption[block - 1].sum(axis=0) * pitch_mm[2]).mean()
        self.near(row[2], row[3], expected)
        self.assertEqual(row[0], 0)
        # Slanted rays tell the top from the bottom, and x from y.
        block = np.ones((2, 4, 4), np.uint8)
        block[1] = 2
        dark_top, = self.walker.reflectances(block, (0.1, 0.1, 0.1), [[[0, 20, 0]], [[20, 0, 0]]], refractive_index=1)
        dark_bottom, = self.walker.reflectances(block[::-1], (0.1, 0.1, 0.1), [[[0, 20, 0]], [[20, 0, 0]]], refractive_index=1)
        self.assertLess(dark_top[0], 0.1)
        self.assertGreater(dark_bottom[0], 0.4)

    def test_the_index_of_a_material_makes_no_difference_if_its_optics_are_alike(self):
        block = np.random.default_rng(2).integers(1, 3, (20, 5, 5), np.uint8)
        optics_ = [[1, 9, 0.75], [2, 3, 0]]
        mixed = self.walker.reflectances(block, (0.04, 0.08, 0.01), [optics_, optics_], refractive_index=1)
        plain = self.walker.reflectances(ONE_VOXEL, (1, 1, 0.2), [optics_], refractive_index=1)
        np.testing.assert_allclose(mixed, plain, atol=0.003)

    def test_scenes_that_are_not_as_described_are_refused(self):
        with self.assertRaisesRegex(ValueError, "^monte_carlo: a voxel has a material that is not described$"):
            self.walker.reflectances(2 * ONE_VOXEL, (1, 1, 1), [[[1, 1, 0]]])
        with self.assertRaisesRegex(ValueError, "must not be negative"):
            self.walker.reflectances(ONE_VOXEL, (1, 1, 1), [[[-1, 1, 0]]])
        program = self.walker.folder / "monte_carlo"
        (self.folder / "scene").write_text("size 1 1 1\nsise 1\n")
        done = subprocess.run([program, self.folder / "scene", self.folder / "none"], capture_output=True, text=True)
        self.assertEqual((done.returncode, done.stderr), (1, "monte_carlo: 'sise' means nothing here\n"))

    def test_fits_find_the_models_that_made_the_patches(self):
        coverages = characterize.patch_mixtures(4, 60)
        np.testing.assert_allclose(coverages.sum(axis=1), 1)
        colours = np.random.default_rng(3).uniform(0.02, 0.9, (4, 3))
        n = np.array([1.3, 2.5, 6])
        found_n, found = mixing_models.fit_yule_nielsen(coverages, optics.mixed(coverages, colours, n))
        np.testing.assert_allclose(found_n, n, rtol=0.02)
        np.testing.assert_allclose(found, colours, atol=0.005)
        n = np.array([1.5, -1, -3])
        found_n, found = mixing_models.fit_yule_nielsen(coverages, optics.mixed(coverages, colours, n), negative=True)
        np.testing.assert_allclose(found_n, n, rtol=0.02)
        np.testing.assert_allclose(found, colours, atol=0.005)
        model = np.random.default_rng(4).uniform(-1, 1, (3, 9))
        reflectances = mixing_models.predict_kubelka_munk(coverages, model)
        again = mixing_models.left_out(coverages, reflectances, mixing_models.fit_kubelka_munk,
                                       mixing_models.predict_kubelka_munk)
        np.testing.assert_allclose(again, reflectances, atol=0.003)

    def test_a_profile_is_fitted(self):
        profile = ROOT / "samples/printers/mimaki-3duj-553.json"
        done = subprocess.run(["/usr/bin/python3", COLOUR / "characterize.py", profile, "new.json", "--patches", "30",
                               "--photons", "4000", "--json", "patches.json"], cwd=self.folder, capture_output=True,
                              text=True, timeout=300)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertNotIn("nan", done.stdout)
        new = json.loads((self.folder / "new.json").read_text())
        old = json.loads(profile.read_text())
        self.assertEqual([entry["name"] for entry in new["materials"]], [entry["name"] for entry in old["materials"]])
        self.assertEqual(len(new["yule_nielsen"]), 3)
        of = {entry["name"]: entry.get("linear_rgb") for entry in new["materials"]}
        self.assertIsNone(of["clear"])
        self.assertGreater(min(of["white"]), 0.5)
        self.assertGreater(of["cyan"][2], 5 * of["cyan"][0])
        self.assertGreater(of["yellow"][1], 5 * of["yellow"][2])
        medians = {line[:40].strip(): float(line[46:56]) for line in done.stdout.splitlines() if line.startswith(("the ", "fitted"))}
        self.assertLess(medians["fitted: Kubelka and Munk"], medians["the profile as it was"])
        self.assertEqual(len(json.loads((self.folder / "patches.json").read_text())), 30)


if __name__ == "__main__":
    unittest.main()
