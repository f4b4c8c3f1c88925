"""Slices of other programs, which have no manifest: their order, their pixels, and what is refused."""

import json
import os
import resource
import unittest
import zipfile

import meshes
import numpy
import pyopenvdb
from PIL import Image
from program import MIMAKI, PATIENCE, ProgramTest

SECONDS = 20
BYTES = 2 << 30
PITCH = ("--pitch", "0.1,0.2,0.3")

RED = (255, 0, 0, 255)
GREEN = (0, 128, 0, 255)
FAINT = (0, 0, 255, 128)
CLEAR = (0, 0, 0, 0)


class ImageStacks(ProgramTest):
    def setUp(self):
        super().setUp()
        self.out = self.folder / "out"
        self.out.mkdir()

    def limit(self):
        if not os.environ.get("VDBDITHER_SANITIZER"):
            resource.setrlimit(resource.RLIMIT_AS, (BYTES, BYTES))

    def draw(self, name, pixels, mode="RGBA"):
        """Draws an image from rows of colours, the top row first."""
        image = Image.new(mode, (len(pixels[0]), len(pixels)))
        image.putdata([pixel for row in pixels for pixel in row])
        image.save(self.out / name)

    def draw_plain(self, *names, colour=RED, size=(4, 3)):
        for name in names:
            Image.new("RGBA", size, colour).save(self.out / name)
            with Image.open(self.out / name) as image:
                image.putpixel((0, 0), CLEAR)
                image.save(self.out / name)

    def imported(self, *arguments, stack="out", warning=""):
        """Imports a stack and returns its grids by name. The only message is the expected warning."""
        done = self.run_program("slice-import", stack, *PITCH, *arguments, "-o", "x.vdb", "--overwrite")
        said = done.stderr.decode()
        self.assertEqual(done.returncode, 0, said)
        self.assertIn(warning, said)
        self.assertEqual(said.count("\n"), 1 if warning else 0, said)
        self.metadata = pyopenvdb.readMetadata(str(self.folder / "x.vdb"))
        if "palette" in arguments:
            return {}  # Debian's pyopenvdb reads no whole numbers; see `materials`
        grids, _ = pyopenvdb.readAll(str(self.folder / "x.vdb"))
        return {grid.name: grid for grid in grids}

    def materials(self):
        """Returns the material of each voxel of the last import that has one, from its slices and its table."""
        self.succeed("slice-export", "-i", "x.vdb", "slices", "--background", "0,0,0,0", "--overwrite")
        indices = {tuple(entry["rgba"]): entry["index"] for entry in json.loads(self.metadata["vdbdither:materials"])}
        found = {}
        for z, path in enumerate(sorted((self.folder / "slices").glob("slice_*.png"))):
            with Image.open(path) as image:
                for x in range(image.width):
                    for y in range(image.height):
                        pixel = image.getpixel((x, image.height - 1 - y))
                        if pixel[3]:
                            found[x, y, z] = indices[pixel]
        return found

    def voxels(self, grid):
        """Returns the active voxels of a grid with their values."""
        accessor = grid.getConstAccessor()
        low, high = grid.evalActiveVoxelBoundingBox()
        return {(x, y, z): accessor.getValue((x, y, z))
                for x in range(low[0], high[0] + 1) for y in range(low[1], high[1] + 1) for z in range(low[2], high[2] + 1)
                if accessor.isValueOn((x, y, z))}

    def refuse_import(self, message, *arguments, stack="out", code=1):
        self.refuse(code, message, "slice-import", stack, *arguments, "-o", "x.vdb", timeout=SECONDS * PATIENCE, preexec_fn=self.limit)

    def test_a_stack_of_slice_export_reads_alike_without_its_manifest(self):
        meshes.write_stl(self.folder / "part.stl", meshes.sphere(0.5, 24))
        for line in (("mesh2sdf", "part.stl", *MIMAKI, "!", "dither", "!", "material-assign", "-o", "part.vdb"),
                     ("slice-export", "-i", "part.vdb", "stack", "--background", "0,0,0,0"),
                     ("slice-export", "-i", "part.vdb", "bits", "--format", "tiff")):
            self.succeed(*line)
        pixels = {}
        for path in sorted((self.folder / "stack").glob("slice_*.png")):
            with Image.open(path) as image:
                pixels[path.name] = image.tobytes()
        for stack in ("stack", "bits"):
            (self.folder / stack / "manifest.json").unlink()
            more = () if stack == "stack" else ("--background", "black")
            self.imported("--materials", "palette", *more, stack=stack, warning="a file is passed over, which is not a slice: 'preview.png'")
            self.succeed("slice-export", "-i", "x.vdb", "again", "--background", "0,0,0,0", "--overwrite")
            again = {path.name: Image.open(path).tobytes() for path in sorted((self.folder / "again").glob("slice_*.png"))}
            self.assertEqual(again, pixels, stack)

    def test_images_that_print_nothing_are_told(self):
        self.draw("a1.png", [[0, 1, 1], [0, 1, 1]], "L")
        self.draw("a2.png", [[0, 1, 1], [0, 1, 1]], "L")
        grids = self.imported(warning="'out': the images that were looked at print nothing; of grey images, pixels above half are printed")
        self.assertEqual(self.voxels(grids["solid"]), {})

    def test_colours_become_linear_light_and_the_last_row_is_the_least_y(self):
        self.draw("a1.png", [[RED, CLEAR, GREEN], [CLEAR, CLEAR, FAINT]])
        self.draw("a2.png", [[CLEAR, CLEAR, CLEAR], [RED, CLEAR, CLEAR]])
        grids = self.imported()
        self.assertEqual(set(grids), {"solid", "Cd", "Alpha"})
        self.assertEqual(grids["Cd"].metadata["vector_type"], "invariant")
        colours = self.voxels(grids["Cd"])
        self.assertEqual(set(colours), {(0, 1, 0), (2, 1, 0), (2, 0, 0), (0, 0, 1)})
        self.assertEqual(set(self.voxels(grids["solid"])), set(colours))
        self.assertEqual(tuple(colours[0, 1, 0]), (1, 0, 0))
        self.assertAlmostEqual(colours[2, 1, 0][1], ((128 / 255 + 0.055) / 1.055) ** 2.4, 6)
        alphas = self.voxels(grids["Alpha"])
        self.assertAlmostEqual(alphas[2, 0, 0], 128 / 255, 6)
        self.assertEqual(alphas[0, 0, 1], 1)
        numpy.testing.assert_allclose(grids["solid"].transform.voxelSize(), (0.1, 0.2, 0.3))
        flipped = self.imported("--flip-x", "--flip-y")
        self.assertEqual(set(self.voxels(flipped["solid"])), {(2, 0, 0), (0, 0, 0), (0, 1, 0), (2, 1, 1)})

    def test_slabs_and_threads_give_the_same_bytes(self):
        generator = numpy.random.default_rng(3)
        for number in range(20):
            pixels = numpy.kron(generator.integers(0, 4, (5, 7), dtype=numpy.uint8), numpy.ones((9, 9), numpy.uint8))
            Image.fromarray(numpy.dstack([pixels * 80, pixels * 20, pixels * 5, (pixels > 0) * 200]).astype(numpy.uint8)).save(self.out / f"s{number}.png")
        for more in ((), ("--materials", "palette")):
            made = set()
            for options in (("--slab", 8, "--threads", 1), ("--slab", 16, "--threads", 2), ()):
                self.imported(*more, *options)
                made.add(self.succeed("slice-import", "out", *PITCH, *more, *options, "!", "stats"))
                made.add((self.folder / "x.vdb").read_bytes())
            self.assertEqual(len(made), 2, more)

    def test_materials_are_numbered_in_the_order_of_their_first_pixels(self):
        self.draw("a1.png", [[CLEAR, GREEN], [RED, CLEAR]])
        self.draw("a2.png", [[FAINT, RED], [GREEN, CLEAR]])
        self.imported("--materials", "palette")
        self.assertEqual([(entry["index"], entry["name"], entry["rgba"]) for entry in json.loads(self.metadata["vdbdither:materials"])],
                         [(1, "#008000", list(GREEN)), (2, "#ff0000", list(RED)), (3, "#0000ff80", list(FAINT))])
        self.assertEqual(self.materials(), {(1, 1, 0): 1, (0, 0, 0): 2, (0, 1, 1): 3, (1, 1, 1): 2, (0, 0, 1): 1})
        self.refuse_import("--materials: 'ink' is not known; give palette", *PITCH, "--materials", "ink", code=2)

    def test_more_than_255_colours_are_no_materials(self):
        self.draw("a1.png", [[(x, y, 0, 255) for x in range(1, 16)] for y in range(17)])
        self.imported("--materials", "palette", warning="no pixel of its images is empty; give their --background if they have one")
        self.draw("a2.png", [[(x, y, 1, 255) for x in range(1, 16)] for y in range(17)])
        self.refuse_import("'out/a2.png' has colour 256 of the stack, and at most 255 can be materials; leave out --materials to read them as "
                           "colours", *PITCH, "--materials", "palette")

    def test_the_background_of_opaque_images_is_empty(self):
        white = (255, 255, 255)
        self.draw("a1.png", [[white, (0, 0, 0), RED[:3]]], "RGB")
        self.assertEqual(set(self.voxels(self.imported()["Cd"])), {(0, 0, 0), (2, 0, 0)})
        self.assertEqual(set(self.imported()), {"solid", "Cd"})
        self.assertEqual(set(self.voxels(self.imported("--background", "white")["solid"])), {(1, 0, 0), (2, 0, 0)})
        self.assertEqual(set(self.voxels(self.imported("--background", "#ff0000")["solid"])), {(0, 0, 0), (1, 0, 0)})
        self.refuse_import("--background: 'paper' is not a colour; give #rrggbb or r,g,b of 0 to 255", *PITCH, "--background", "paper", code=2)
        self.draw("a1.png", [[RED, (0, 0, 0, 255), CLEAR]])
        self.assertEqual(set(self.voxels(self.imported()["solid"])), {(0, 0, 0), (1, 0, 0)})
        self.assertEqual(set(self.voxels(self.imported("--background", "black")["solid"])), {(0, 0, 0)})

    def test_grey_images_are_masks(self):
        self.draw("a1.png", [[0, 127, 128, 255]], "L")
        grids = self.imported()
        self.assertEqual(set(grids), {"solid"})
        self.assertEqual(set(self.voxels(grids["solid"])), {(2, 0, 0), (3, 0, 0)})
        self.assertEqual(set(self.voxels(self.imported("--background", "white")["solid"])), {(0, 0, 0), (1, 0, 0)})
        self.refuse_import("--background: 'out/a1.png' is grey; give black or white", *PITCH, "--background", "#808080", code=2)
        self.imported("--materials", "palette")
        self.assertEqual(len(self.materials()), 3)
        self.draw("a1.png", [[(0, 255), (77, 255), (77, 0), (255, 255)]], "LA")
        self.assertEqual(set(self.imported()), {"solid"})
        self.assertEqual(set(self.voxels(self.imported()["solid"])), {(0, 0, 0), (1, 0, 0), (3, 0, 0)}, "opacity alone tells")
        self.assertEqual(set(self.voxels(self.imported("--background", "black")["solid"])), {(3, 0, 0)})
        self.assertEqual(set(self.voxels(self.imported("--background", "white")["solid"])), {(0, 0, 0), (1, 0, 0)})
        for name in ("a1.png", "a1.tif"):
            (self.out / "a1.png").unlink(missing_ok=True)
            Image.fromarray(numpy.array([[0, 32767, 32768, 65535]], numpy.uint16)).save(self.out / name)
            self.assertEqual(set(self.voxels(self.imported()["solid"])), {(2, 0, 0), (3, 0, 0)}, name)
        Image.fromarray(numpy.array([[0, 1, 1, 0]], bool)).save(self.out / "a1.tif")
        self.assertEqual(set(self.voxels(self.imported()["solid"])), {(1, 0, 0), (2, 0, 0)})

    def test_palettes_and_tiff_are_read_as_their_colours(self):
        pixels = [[RED, GREEN, (0, 0, 0, 255)], [GREEN, (0, 0, 0, 255), RED]]
        made = []
        for name, mode in (("a1.png", "P"), ("a1.png", "RGB"), ("a1.tif", "P"), ("a1.tiff", "RGB")):
            for old in self.out.iterdir():
                old.unlink()
            image = Image.new("RGB", (3, 2))
            image.putdata([pixel[:3] for row in pixels for pixel in row])
            (image.quantize(3) if mode == "P" else image).save(self.out / name)
            made.append(self.voxels(self.imported()["Cd"]))
            self.assertEqual(made[-1], made[0], (name, mode))
        self.assertEqual(len(made[0]), 4)
        self.draw("a1.tiff", [[RED, FAINT, CLEAR]])
        self.assertEqual(set(self.voxels(self.imported()["Alpha"])), {(0, 0, 0), (1, 0, 0)})

    def test_numbers_count_not_letters(self):
        for number in range(8, 13):
            self.draw(f"part_2_slice_{number}_of_20.png", [[RED if x == number - 8 else CLEAR for x in range(5)]])
        self.assertEqual(set(self.voxels(self.imported()["solid"])), {(z, 0, z) for z in range(5)})
        (self.out / "part_2_slice_10_of_20.png").unlink()
        self.refuse_import("'out': number 10 is missing between 'part_2_slice_9_of_20.png' and 'part_2_slice_11_of_20.png'; add the slice, or "
                           "number them without a gap", *PITCH)

    def test_names_without_one_order_are_refused(self):
        self.draw_plain("a1.png", "a01.png")
        self.refuse_import("'a01.png' and 'a1.png' have the same number 1; remove one of them", *PITCH)
        (self.out / "a01.png").unlink()
        self.draw_plain("b2.png")
        self.refuse_import("'a1.png' and 'b2.png' are named by different patterns; give the one to read, with * for the number and in quotes",
                           *PITCH)
        self.assertEqual(len(self.voxels(self.imported(stack="out/b*.png")["solid"])), 11)
        for name in ("a1.png", "b2.png"):
            (self.out / name).unlink()
        self.draw_plain("low.png", "high.png")
        self.refuse_import("'out': the names of its images, such as 'high.png', have no numbers; number the slices from bottom to top", *PITCH)
        self.draw_plain("a1234567890123456789.png")
        self.refuse_import("has a number of more than 18 digits", *PITCH)

    def test_tiff_packed_with_loss_is_refused(self):
        (self.folder / "lossy").mkdir()
        for z in range(2):
            Image.new("RGB", (16, 16), (200, 30, 30)).save(self.folder / f"lossy/{z}.tif", compression="jpeg")
        self.refuse(1, "is a TIFF packed as JPEG, which changes pixels; save it with LZW or deflate", "slice-import", "lossy",
                    "--pitch", "50um,50um,50um", "-o", "a.vdb")

    def test_slices_that_are_not_alike_are_refused(self):
        self.draw_plain("a1.png", "a2.png")
        self.draw_plain("a2.png", size=(5, 3))
        self.refuse_import("the slice 'out/a2.png' has 5 x 3 pixels, but the first slice 'out/a1.png' has 4 x 3 pixels; save all slices alike",
                           *PITCH)
        Image.new("L", (4, 3)).save(self.out / "a2.png")
        self.refuse_import("the slice 'out/a2.png' has grey pixels, but the first slice 'out/a1.png' has colours", *PITCH)
        Image.new("RGB", (4, 3)).save(self.out / "a2.png")
        self.refuse_import("the slice 'out/a2.png' has no opacity, but the first slice 'out/a1.png' has some", *PITCH)
        (self.out / "a2.png").unlink()
        self.draw_plain("a2.tif")
        self.refuse_import("'a1.png' and 'a2.tif' are files of different kinds; save all slices alike", *PITCH)

    def test_files_that_are_no_slices_are_counted(self):
        self.draw_plain("a1.png", "a2.png")
        (self.out / "thumbnails").mkdir()
        self.draw_plain("thumbnails/a1.png", size=(2, 2))
        for name in ("Thumbs.db", "job.xml", "notes.txt", "._a1.png"):
            (self.out / name).write_text("x")
        self.assertEqual(len(self.voxels(self.imported(warning="'out': 5 files are passed over, which are not slices, such as '._a1.png'")["solid"])), 22)
        self.imported(stack="out/a*.png")

    def test_an_archive_is_read_like_its_folder(self):
        self.draw_plain("a9.png", "a10.png")
        for archive, prefix in (("x.zip", ""), ("y.zip", "job/slices/"), ("z.cws", "")):
            with zipfile.ZipFile(self.folder / archive, "w", zipfile.ZIP_DEFLATED) as packed:
                for name in ("a9.png", "a10.png"):
                    packed.write(self.out / name, prefix + name)
            self.assertEqual(self.voxels(self.imported(stack=archive)["solid"]), self.voxels(self.imported()["solid"]))
        with zipfile.ZipFile(self.folder / "y.zip", "a") as packed:
            packed.write(self.out / "a9.png", "other/a9.png")
        self.refuse_import("'y.zip' has images in several folders, such as 'job/slices' and 'other'; give the folder of the slices", *PITCH,
                           stack="y.zip")
        with zipfile.ZipFile(self.folder / "x.zip", "a") as packed:
            packed.writestr("../a11.png", b"x")
        self.refuse_import("its member '../a11.png' has no proper name", *PITCH, stack="x.zip")

    def test_the_pitch_is_given_where_no_manifest_states_it(self):
        self.draw_plain("a1.png")
        self.refuse_import("'out' holds no manifest.json, so it is not a stack made by slice-export; for slices of another program give --pitch "
                           "DX,DY,DZ or --printer NAME")
        self.refuse_import("--edited: 'out' has no manifest.json; leave it out", *PITCH, "--edited", code=2)
        self.succeed("slice-import", "out", *MIMAKI, "-o", "x.vdb")
        self.succeed("material-assign", "-i", "x.vdb", "!", "slice-export", "stack")
        for options in (PITCH, MIMAKI, ("--layer", "50um"), ("--materials", "palette"), ("--background", "white"), ("--flip-x",), ("--flip-y",)):
            self.refuse(2, f"{options[0]}: the manifest.json of 'stack' states it; leave it out", "slice-import", "stack", *options, "-o", "y.vdb")

    def test_what_holds_no_images_is_refused(self):
        self.refuse_import("'out' holds no manifest.json and no PNG or TIFF images; give the folder of the slices", *PITCH)
        Image.new("RGB", (2, 2)).save(self.out / "a1.bmp")
        self.refuse_import("; save images like 'a1.bmp' as PNG", *PITCH)
        self.refuse_import("no PNG or TIFF image matches 'out/b*.png'; give the folder of the slices", *PITCH, stack="out/b*.png")
        self.refuse_import("no such file or folder 'gone'", *PITCH, stack="gone/b*.png")

    def test_hostile_images_are_refused_in_limited_time_and_memory(self):
        path = self.out / "a1.png"
        path.write_bytes(b"no image")
        self.refuse_import("the slice 'out/a1.png' is not a readable PNG: ", *PITCH)
        Image.new("1", (60000, 60000)).save(path)
        self.refuse_import("the slice 'out/a1.png' has 60000 x 60000 pixels; at most 268435456 are read", *PITCH)
        os.truncate(path, 1 << 40)
        self.refuse_import("'out/a1.png' has 1099511627776 bytes; at most 268435456 are read", *PITCH)
        path.unlink()
        path.symlink_to("/dev/zero")
        self.refuse_import("is a link to '/dev/zero', which is outside the stack", *PITCH)
        path.unlink()
        os.mkfifo(path)
        self.refuse_import("'out/a1.png' is not an ordinary file", *PITCH)
        path.unlink()
        pages = [Image.new("L", (2, 2)) for _ in range(2)]
        pages[0].save(self.out / "a1.tif", save_all=True, append_images=pages[1:])
        self.refuse_import("is a TIFF of several pages; save each page as a file of its own", *PITCH)
        Image.new("CMYK", (2, 2)).save(self.out / "a1.tif")
        self.refuse_import("is a TIFF of a kind that is not read; save it as grey or RGB", *PITCH)
        (self.out / "a1.tif").write_bytes(b"II*\0" + bytes(20))
        self.refuse_import("the slice 'out/a1.tif' is not a readable TIFF: ", *PITCH)

    def test_explain_knows_the_stack(self):
        self.draw_plain("a1.png", "a2.png")
        self.assertIn("out for slice-import", self.succeed("slice-import", "out", *PITCH, "-o", "x.vdb", "--explain").decode())


if __name__ == "__main__":
    unittest.main()
