"""Tests samples/resin: coverages are exact, and the judge knows surfaces with known answers."""

import contextlib
import io
import itertools
import sys
import unittest

import numpy as np
from program import PROGRAM, ROOT

sys.path.insert(0, str(ROOT / "samples/resin"))

import study  # noqa: E402

PITCH_MM = np.array([0.019, 0.024, 0.05])


def half_space(tilt=11, facet="top, general", pitch_mm=PITCH_MM):
    return study.Case(pitch_mm, *study.FACETS.get(facet, study.UNDERSIDES.get(facet)), tilt, 1, 0.2)


class Coverage(unittest.TestCase):
    def test_is_that_of_many_points(self):
        """A million points tell two in a thousand, or a hundredth where the edge is parallel to rows of points."""
        inner = (np.arange(100) + 0.5) / 100 - 0.5
        x, y, z = np.meshgrid(*[inner * side for side in PITCH_MM], indexing="ij")
        for normal in ((0.6, 0.8, 0), (0.05, -0.2, 0.98), (-0.5, 0.5, 0.7), (1e-9, 0, 1), (0, 1, 0), (0.002, 0, -1)):
            along = normal[0] * x + normal[1] * y + normal[2] * z
            depths = np.array([-0.03, -0.009, -0.001, 0.0031, 0.011, 0.02])
            points = [(along <= depth).mean() for depth in depths]
            np.testing.assert_allclose(study.box_share(normal, PITCH_MM, depths), points, atol=0.011 if 0 in normal else 2e-3)

    def test_adds_up_to_the_volume(self):
        """What a shifted half-space adds to a row of boxes is the volume between, exactly."""
        normal = np.array([0.3, -0.4, np.sqrt(0.75)])
        layers = np.arange(-40, 41) * PITCH_MM[2] * normal[2]
        low, high = (study.box_share(normal, PITCH_MM, offset - layers).sum() for offset in (0.004, 0.034))
        self.assertAlmostEqual(high - low, 0.03 / normal[2] / PITCH_MM[2], places=9)

    def test_of_an_edge_along_the_lattice_is_zero_or_one(self):
        np.testing.assert_array_equal(study.box_share((0, 0, 0), PITCH_MM, np.array([-0.1, 0.1])), [0, 1])


class FloydSteinberg(unittest.TestCase):
    def test_is_that_of_the_paper(self):
        """Against the four assignments of Floyd and Steinberg (1976), pixel by pixel."""
        coverage = np.random.default_rng(1).uniform(0, 1, (2, 7, 9))
        for levels in ([0, 1], [0, 0.1, 0.4, 1]):
            found = study.floyd_steinberg(coverage, levels)
            for layer in range(2):
                image, expected = coverage[layer, ::-1].copy(), np.zeros((7, 9))
                for y, x in itertools.product(range(7), range(9)):
                    expected[y, x] = min(levels, key=lambda level: abs(level - image[y, x]))
                    error = image[y, x] - expected[y, x]
                    for dy, dx, share in ((0, 1, 7), (1, -1, 3), (1, 0, 5), (1, 1, 1)):
                        if y + dy < 7 and 0 <= x + dx < 9:
                            image[y + dy, x + dx] += error * share / 16
                np.testing.assert_array_equal(found[layer, ::-1], expected)


class Judge(unittest.TestCase):
    def test_finds_a_plane_where_it_is(self):
        """The same exact volumes, judged against a plane 3 µm lower: all of the error is that distance."""
        for facet in ("top, general", "wall, general", "underside, general"):
            case = half_space(20, facet, np.array([0.02, 0.02, 0.02]))
            exact = study.box_share(case.normal, case.pitch, case.depth())
            case.offset -= 0.003
            surface = study.linear_surfaces(case, [exact], 0.03)[0]
            np.testing.assert_allclose(surface, 3, atol=0.05)

    def test_finds_half_the_dose(self):
        """The dose at points of the surface, summed voxel by voxel."""
        for facet in ("top, general", "wall, general"):
            case = half_space(5, facet)
            grey = np.random.default_rng(1).uniform(0.5, 1, case.window[1]) * (case.depth() > -0.01)
            surface = study.linear_surfaces(case, [grey], 0.03)[0]
            low = (np.argwhere(grey > 0) + case.window[0] - 0.5) * case.pitch
            for a, b in ((0, 0), (20, 3), (41, 8)):
                point = np.zeros(3)
                point[case.sides] = case.grid[0][a], case.grid[1][b]
                point[case.axis] = case.height(*point[case.sides]) + surface[a, b] / 1e3 / case.normal[case.axis]
                shares = study.ndtr((low + case.pitch - point) / 0.03) - study.ndtr((low - point) / 0.03)
                self.assertAlmostEqual((shares.prod(1) * grey[grey > 0]).sum(), 0.5, places=3)

    def test_knows_the_cure_depth_of_an_overhang(self):
        """Under a thick solid, resin cures as deep as the sum of all doses tells by Jacobs' equation."""
        case = half_space(1, "underside, about x")
        case.normal, case.offset = np.array([0, 0, -1.0]), 0.025
        case.window = case.voxel_window()
        solid = (case.depth() > 0).astype(float)
        total = 1 / (1 - np.exp(-PITCH_MM[2] / study.PENETRATION_MM))
        deeper = study.CURE_DEPTH_MM - PITCH_MM[2] + study.PENETRATION_MM * np.log(total)
        surface = study.cured_surfaces(case, [solid])[0]
        np.testing.assert_allclose(surface, 1e3 * deeper, atol=1)

    def test_knows_the_amplitude_of_a_wave(self):
        x, y = np.arange(100)[:, None], np.arange(40)[None, :]
        self.assertAlmostEqual(study.strongest_wave(2 + 3 * np.cos(2 * np.pi * (x / 20 + y / 10))), 3, places=1)


class Study(unittest.TestCase):
    def test_measures_a_facet(self):
        found = study.measure(str(PROGRAM), study.CURVE_LATTICE_UM, study.FACETS["top, about y"], 11, 1)
        self.assertEqual(set(found), set(itertools.product(study.KNOWN, study.METHODS)))
        rms = {method: found["35", method][0] for method in study.METHODS}
        self.assertLess(rms["dither"], rms["plain"] / 2)
        self.assertLess(rms["grey 3D"], rms["plain"] / 2)
        self.assertGreater(rms["grey"], rms["dither"])

    def test_reports_means_and_worst(self):
        rows = {("1×2×3", facing, 1, cure, method): [[1, 1, 1, 1], [2, 2, -2, 2]] for facing in ("top", "wall", "underside")
                for cure in study.KNOWN for method in study.METHODS}
        text = io.StringIO()
        with contextlib.redirect_stdout(text):
            study.report(study.summarized(rows))
        self.assertIn("| dither | " + " | ".join(["1.50 (2.0)"] * 6) + " |", text.getvalue())


if __name__ == "__main__":
    unittest.main()
