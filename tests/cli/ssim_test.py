"""Tests the tool ssim, and pictures of the whole program."""

import json
import os
import unittest

import meshes
import numpy
from PIL import Image
from program import MIMAKI, ProgramTest

try:
    from skimage.metrics import structural_similarity
except ImportError:
    structural_similarity = None


def over_grey(picture):
    """Returns red, green and blue over a middle grey, and the coverage; all 0 … 1."""
    channels = numpy.asarray(picture.convert("RGBA")).astype(float) / 255
    cover = channels[..., 3:]
    return channels[..., :3] * cover + (1 - cover) * 0.5, cover[..., 0]


class Ssim(ProgramTest):
    def random_picture(self, name, seed, size=(40, 30)):
        values = numpy.random.default_rng(seed).integers(0, 256, (size[1], size[0], 3), dtype=numpy.uint8)
        Image.fromarray(values).save(self.folder / name)

    def figures(self, *arguments):
        return json.loads(self.succeed("ssim", *arguments, "--json"))

    @unittest.skipUnless(structural_similarity, "scikit-image is not installed")
    def test_ssim_is_that_of_an_independent_program(self):
        meshes.write_stl(self.folder / "part.stl", meshes.sphere(1.5))
        self.succeed("render", "part.stl", "part.png", "-q")
        self.succeed("mesh2sdf", "part.stl", *MIMAKI, "!", "dither", "--mask", "white", "!", "simulate", "!", "render",
                     "print.png", "--frame", "part.stl", "-q")
        self.random_picture("a.png", 1)
        self.random_picture("b.png", 2)
        for a, b in (("part.png", "print.png"), ("a.png", "b.png")):
            (colours_a, cover), (colours_b, _) = (over_grey(Image.open(self.folder / name)) for name in (a, b))
            grey_a, grey_b = (colours @ [0.299, 0.587, 0.114] for colours in (colours_a, colours_b))
            _, expected = structural_similarity(grey_a, grey_b, gaussian_weights=True, sigma=1.5,
                                                use_sample_covariance=False, data_range=1, full=True)
            object_pixels = cover >= 128 / 255
            if cover.min() == 1:
                object_pixels[:] = False
                object_pixels[5:-5, 5:-5] = True
            said = self.figures(a, b, "--maps", f"maps-{a}")
            self.assertEqual(said["pixels"], object_pixels.sum())
            self.assertAlmostEqual(said["ssim"], expected[object_pixels].mean(), places=10)
            drawn = numpy.asarray(Image.open(self.folder / f"maps-{a}/ssim.png").convert("L")) / 255
            self.assertLess(abs(drawn - numpy.clip(expected, 0, 1)).max(), 0.5001 / 255)

    def test_invisible_differences_do_not_count_for_the_eye(self):
        board = (numpy.indices((60, 60)).sum(axis=0) % 2 * 80 + 90).astype(numpy.uint8)
        Image.fromarray(board).save(self.folder / "fine.png")
        Image.fromarray(numpy.full((60, 60), 130, dtype=numpy.uint8)).save(self.folder / "plain.png")
        near, far = (self.figures("plain.png", "fine.png", "--distance", distance) for distance in ("50mm", "500mm"))
        self.assertLess(near["ssim"], 0.1)
        self.assertEqual(near["ssim"], far["ssim"])
        self.assertLess(near["ssim_seen"], 0.2)
        self.assertGreater(far["ssim_seen"], 0.99)
        self.assertLess(far["flip"], near["flip"])
        self.assertAlmostEqual(far["pixels_per_degree"], 99.96, places=2)

    def test_equal_pictures_have_perfect_scores(self):
        self.random_picture("a.png", 3)
        said = self.succeed("ssim", "a.png", "a.png").decode()
        self.assertRegex(said, r"^ssim +1\.000000\nssim seen +1\.000000  at 100\.0 pixels per degree\nflip +0\.000000\n"
                               r"pixels +600 of 1200\n$")

    def test_transparent_pixels_are_not_part_of_the_object(self):
        self.random_picture("a.png", 4)
        for name, noise in (("one.png", 5), ("two.png", 6)):
            picture = Image.open(self.folder / "a.png").convert("RGBA")
            values = numpy.asarray(picture).copy()
            values[:, :20, :3] = numpy.random.default_rng(noise).integers(0, 256, (30, 20, 3))
            values[:, :20, 3] = 0
            Image.fromarray(values).save(self.folder / name)
        said = self.figures("one.png", "two.png")
        self.assertEqual((said["pixels"], said["flip"]), (600, 0))
        self.assertAlmostEqual(said["ssim"], 1, places=12)

    def test_pictures_that_cannot_be_compared_are_refused(self):
        self.random_picture("a.png", 1)
        self.random_picture("wide.png", 1, (50, 30))
        self.random_picture("tiny.png", 1, (10, 10))
        Image.new("RGBA", (20, 20)).save(self.folder / "nothing.png")
        self.refuse(1, "ssim: 'wide.png' has 50 x 30 pixels and 'a.png' 40 x 30; only pictures of one size can be compared",
                    "ssim", "a.png", "wide.png")
        self.refuse(1, "'tiny.png' has 10 x 10 pixels; the minimum is 11 x 11", "ssim", "tiny.png", "tiny.png")
        self.refuse(1, "'nothing.png' shows nothing: all of it is transparent", "ssim", "nothing.png", "nothing.png")
        self.refuse(1, "no such file 'none.png'", "ssim", "a.png", "none.png")
        self.refuse(2, "--pixel: '0' is not accepted; the length must be greater than 0 mm", "ssim", "a.png", "a.png", "--pixel", "0")
        self.refuse(2, "give 0.9996", "ssim", "a.png", "a.png", "--distance", "5mm")
        (self.folder / "maps").mkdir()
        (self.folder / "maps/old").touch()
        self.refuse(2, "exists; --overwrite replaces it", "ssim", "a.png", "a.png", "--maps", "maps")

    def test_maps_replace_maps_and_nothing_else(self):
        self.random_picture("a.png", 1)
        maps = ("ssim", "a.png", "a.png", "--maps", "maps", "--overwrite")
        self.succeed(*maps)
        self.succeed(*maps)
        (self.folder / "maps/notes.txt").touch()
        self.refuse(2, "'maps' holds 'notes.txt', which was not written with the rest; move it elsewhere, or name another folder",
                    *maps)

    def test_pictures_that_take_too_much_are_refused_before_they_are_read(self):
        self.random_picture("a.png", 1)
        Image.new("1", (60000, 60000)).save(self.folder / "large.png")
        (self.folder / "long.png").touch()
        os.truncate(self.folder / "long.png", 1 << 40)
        os.mkfifo(self.folder / "pipe.png")
        for name, message in (("large.png", "'large.png' has 60000 x 60000 pixels; at most 67108864 are read"),
                              ("long.png", "'long.png' has 1099511627776 bytes; at most 536870912 are read"),
                              ("pipe.png", "'pipe.png' is not an ordinary file")):
            self.refuse(1, message, "ssim", "a.png", name)


if __name__ == "__main__":
    unittest.main()
