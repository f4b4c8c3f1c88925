"""Tests the tool verify: each finding by a stack that has just that fault."""

import json
import os
import shutil
import struct
import subprocess
import unittest
import zipfile

from PIL import Image
from program import PATIENCE, PROGRAM, ProgramTest

JETTING = {"name": "jet", "title": "Jet", "source": "By definition", "technology": "jetting", "pitch_mm": [0.1, 0.1, 0.1],
           "build_mm": [5, 5, 5], "minimum_slices": 3, "maximum_colours": 2, "containers": ["gcvf", "png"],
           "materials": [{"name": "white", "rgba": [240, 240, 240, 255], "density_g_per_cm3": 1.2, "resin": "VeroPureWht"},
                         {"name": "black", "rgba": [26, 26, 29, 255]}]}
RESIN = {"name": "vat", "title": "Vat", "source": "By definition", "technology": "resin", "pitch_mm": [0.1, 0.1, 0.1],
         "layer_mm": [0.05, 0.1], "slice_px": [20, 12], "origin": "corner",
         "materials": [{"name": "solid", "rgba": [240, 240, 240, 255]}]}
COLOURS = {".": (0, 0, 0, 255), "w": (240, 240, 240, 255), "b": (26, 26, 29, 255), "r": (200, 1, 2, 255), "g": (3, 200, 4, 255)}
BLACK = ("--background", "black")
PALETTE = ("--materials", "palette", *BLACK)

# How each stack and volume of the tests is made.
RECIPES = {
    "drawn.vdb": ("slice-import", "drawn", "--printer", "jet.json", *PALETTE, "-o", "drawn.vdb"),
    "vat.vdb": ("slice-import", "drawn", "--printer", "vat.json", *BLACK, "!", "material-assign", "--material", "solid", "-o", "vat.vdb"),
    **{f"{kind}-out": ("slice-export", "-i", "drawn.vdb", f"{kind}-out", "--format", kind) for kind in ("png", "png1", "png8", "tiff", "exr", "objet")},
    **{name: ("slice-export", "-i", "drawn.vdb", name) for name in ("out.zip", "out.gcvf")},
    "out.3mf": ("slice-export", "-i", "drawn.vdb", "out.3mf", "--3mf-level-set"),
    **{name: ("slice-export", "-i", "vat.vdb", name) for name in ("out.sl1", "out.uvj")},
}

# Six layers of a block of two materials, 12 x 8.
BLOCK = [["." * 12] * 2 + ["..wwwwbbbb.."] * 4 + ["." * 12] * 2] * 6


class Verify(ProgramTest):
    @classmethod
    def setUpClass(cls):
        cls.made = cls.folder_of_class()
        for profile in (JETTING, RESIN):
            (cls.made / f"{profile['name']}.json").write_text(json.dumps(profile))
        cls.draw(cls.made / "drawn", BLOCK)

    def make(self, *names):
        """Puts stacks and volumes that RECIPES names into the folder, as they are made."""
        for name in names:
            if not (self.made / name).exists():
                self.make(*(word for word in RECIPES[name] if word in RECIPES and word != name))
                done = subprocess.run([PROGRAM, *RECIPES[name]], cwd=self.made, timeout=120 * PATIENCE, capture_output=True)
                self.assertEqual(done.returncode, 0, done.stderr)
            source, target = self.made / name, self.folder / name
            if source.is_dir():
                shutil.rmtree(target, ignore_errors=True)
                shutil.copytree(source, target)
            else:
                shutil.copy(source, target)

    @staticmethod
    def draw(folder, layers, mode="RGBA"):
        """Draws slices, from the lowest one on."""
        folder.mkdir()
        for number, rows in enumerate(layers):
            image = Image.new("RGBA", (len(rows[0]), len(rows)))
            image.putdata([COLOURS[pixel] for row in rows for pixel in row])
            if mode == "L":
                image = image.convert(mode).point(lambda level: 255 if level > 100 else 0)
            image.convert(mode).save(folder / f"s{number}.png")

    def setUp(self):
        super().setUp()
        for name in ("drawn", "jet.json", "vat.json"):
            self.make(name)

    def report(self, *arguments):
        """Returns the report as JSON. Checks the exit code. Makes what is not there."""
        self.make(*(word for word in arguments if word in RECIPES and not (self.folder / word).exists()))
        done = self.run_program("verify", *arguments, "--json")
        report = json.loads(done.stdout)
        self.assertEqual(done.returncode, 1 if report["errors"] else 0)
        if report["errors"]:
            self.assertRegex(done.stderr.decode(), r"^vdbdither verify: '.*' has [\d,]+ errors?\n$")
        return report

    def find(self, expected, *arguments):
        """Checks the kinds of findings with their severities and how often each is there. Returns the findings."""
        findings = self.report(*arguments)["findings"]
        found = {}
        for finding in findings:
            found.setdefault((finding["severity"], finding["id"]), []).append(finding)
        self.assertEqual({kind: len(several) for kind, several in found.items()}, expected, findings)
        return findings

    def drawn(self, layers, *arguments, expected, mode="L", printer="vat.json"):
        shutil.rmtree(self.folder / "x", ignore_errors=True)
        self.draw(self.folder / "x", layers, mode)
        return self.find(expected, "x", "--printer", printer, *BLACK, *arguments)

    def edit_manifest(self, stack, change):
        """Changes the manifest as if it had been written so."""
        self.make(stack)
        path = self.folder / stack / "manifest.json"
        manifest = json.loads(path.read_text())
        change(manifest)
        path.write_text(json.dumps(manifest))

    def repack(self, name, changes):
        """Writes a container anew with changed members; without those that become None."""
        self.make(name)
        with zipfile.ZipFile(self.folder / name) as archive:
            members = {member: archive.read(member) for member in archive.namelist()}
        for member, change in changes.items():
            members[member] = change(members.get(member)) if callable(change) else change
        with zipfile.ZipFile(self.folder / name, "w", zipfile.ZIP_DEFLATED) as archive:
            for member, content in members.items():
                if content is not None:
                    archive.writestr(member, content)

    # What has no fault

    def test_a_sound_stack_of_every_kind_has_no_finding(self):
        for stack in (name for name in RECIPES if not name.endswith(".vdb")):
            with self.subTest(stack=stack):
                self.make(stack)
                self.assertRegex(self.succeed("verify", stack).decode(), r"^0 errors, 0 warnings; .+\n$")
        self.succeed("verify", "drawn", "--printer", "jet.json", *BLACK)
        self.succeed("verify", "drawn", "--pitch", "0.1,0.1,0.1", *BLACK)
        self.find({}, "out.sl1", "--printer", "vat.json")
        self.find({}, "out.gcvf", "--printer", "jet.json")

    def test_the_last_line_counts_materials(self):
        self.make("out.gcvf")
        self.assertEqual(self.succeed("verify", "out.gcvf", "--printer", "jet.json").decode(),
                         "0 errors, 0 warnings; #f0f0f0 96 voxels, 9.6e-05 ml, 0.0001152 g; #1a1a1d 96 voxels, 9.6e-05 ml\n")
        materials = self.report("png-out")["materials"]
        self.assertEqual([(entry["name"], entry["voxels"]) for entry in materials], [("#f0f0f0", 96), ("#1a1a1d", 96)])
        self.assertAlmostEqual(materials[0]["g"], 0.0001152)

    # Files

    def test_missing_and_extra_slices_are_told_together(self):
        self.make("png-out")
        (self.folder / "png-out/slice_00002.png").unlink()
        (self.folder / "png-out/slice_00004.png").unlink()
        shutil.copy(self.folder / "png-out/slice_00001.png", self.folder / "png-out/slice_00009.png")
        findings = self.find({("error", "missing-slice"): 2, ("error", "extra-slice"): 1}, "png-out")
        self.assertEqual((findings[0]["file"], findings[0]["layer"]), ("png-out/slice_00002.png", 2))

    def test_a_container_misses_a_slice_or_has_one_more(self):
        for name, missing, extra in (("out.gcvf", "layer_3.png", "layer_6.png"), ("out.sl1", "slice00003.png", "slice00006.png"),
                                     ("out.uvj", "slice/00000003.png", "slice/00000006.png")):
            with self.subTest(name=name):
                self.repack(name, {extra: b"", missing: None})
                expected = {("error", "missing-slice"): 1, ("error", "extra-slice"): 1}
                if name == "out.gcvf":
                    expected["error", "voxel-count"] = 2
                self.find(expected, name)

    def test_a_changed_slice_is_told_by_its_digest(self):
        self.make("png-out")
        path = self.folder / "png-out/slice_00002.png"
        Image.open(path).save(path)
        self.find({("error", "slice-changed"): 1}, "png-out")

    def test_a_changed_manifest_is_told_by_its_digest(self):
        self.edit_manifest("png-out", lambda manifest: manifest.update(history=[]))
        self.find({("error", "manifest-changed"): 1}, "png-out")

    def test_a_slice_of_another_size_or_damaged_does_not_end_the_check(self):
        Image.new("RGBA", (5, 5)).save(self.folder / "drawn/s1.png")
        (self.folder / "drawn/s4.png").write_bytes(b"no image")
        findings = self.find({("error", "slice-size"): 1, ("error", "unreadable-slice"): 1}, "drawn", "--printer", "jet.json", *BLACK)
        self.assertEqual(findings[0]["text"], "the slice has 5 x 5 pixels, and the first one 12 x 8 pixels; save all slices alike")
        self.repack("out.sl1", {"slice00001.png": (self.folder / "drawn/s1.png").read_bytes(), "slice00002.png": b"x"})
        self.find({("error", "slice-size"): 1, ("error", "unreadable-slice"): 1}, "out.sl1")

    def peak_mb(self, *arguments):
        """Returns the memory that a run takes at most, and what it says."""
        process = self.start(*arguments, stderr=subprocess.STDOUT)
        said = process.stdout.read().decode()
        return os.wait4(process.pid, 0)[2].ru_maxrss / 1024, said

    def test_a_size_that_no_slice_has_takes_no_memory(self):
        def heighten(manifest):
            manifest["box"]["min"][1], manifest["box"]["max"][1] = -2**23, 2**23 - 1
            manifest["size"][1] = 2**24

        readers = (("verify", "png1-out"), ("slice-import", "png1-out", "--edited", "-o", "new.vdb"))
        self.make("png1-out")
        usual = [self.peak_mb(*reader)[0] for reader in readers]
        self.edit_manifest("png1-out", heighten)
        for reader, sound in zip(readers, usual):
            peak, said = self.peak_mb(*reader)
            self.assertIn("12 x 8 pixels, not 12 x 16777216", said)
            self.assertLess(peak, sound + 128)

    def test_every_stray_colour_is_told_with_its_first_pixel(self):
        def spoil(content):
            (self.folder / "x.png").write_bytes(content)
            with Image.open(self.folder / "x.png") as image:
                for place, colour in (((3, 4), (1, 2, 3, 255)), ((4, 4), (1, 2, 3, 255)), ((9, 5), (241, 240, 240, 255))):
                    image.putpixel(place, colour)
                image.save(self.folder / "x.png")
            return (self.folder / "x.png").read_bytes()

        self.repack("out.gcvf", {"layer_2.png": spoil, "layer_4.png": spoil})
        findings = self.find({("error", "stray-colour"): 2, ("error", "voxel-count"): 2}, "out.gcvf")
        strays = [finding for finding in findings if finding["id"] == "stray-colour"]
        self.assertEqual([(stray["layer"], stray["pixel"], stray["count"]) for stray in strays], [(2, [3, 4], 4), (2, [9, 5], 2)])
        self.assertEqual(strays[0]["text"], "no material has the colour 1,2,3,255, which is in 4 pixels of 2 slices; give them one of a "
                                            "material, and mind that smoothing makes new colours")

    def test_materials_of_one_colour_or_name_are_told(self):
        def one_colour(manifest):
            manifest["materials"][1]["rgba"] = manifest["materials"][0]["rgba"]
            manifest["materials"][1]["name"] = manifest["materials"][0]["name"]

        self.edit_manifest("png-out", one_colour)
        self.find({("error", "manifest-changed"): 1, ("error", "same-name"): 1, ("error", "same-colour"): 1, ("error", "stray-colour"): 1}, "png-out")

    def test_two_materials_in_a_voxel_are_told(self):
        self.make("png1-out")
        slices = sorted((self.folder / "png1-out").glob("*/slice_00001.png"))
        shutil.copy(slices[0], slices[1])
        findings = self.find({("error", "slice-changed"): 1, ("error", "two-materials"): 1}, "png1-out")
        self.assertEqual((findings[1]["layer"], findings[1]["count"]), (1, 16))

    def test_a_png_that_is_not_of_32_bits_is_told_where_the_printer_takes_such_alone(self):
        self.draw(self.folder / "x", BLOCK, "RGB")
        self.find({("error", "pixel-kind"): 6}, "x", "--printer", "jet.json", *BLACK)
        self.find({}, "x", "--pitch", "0.1,0.1,0.1", *BLACK)

    def test_gaps_in_numbers_are_all_told(self):
        for number in (1, 3):
            (self.folder / f"drawn/s{number}.png").unlink()
        findings = self.find({("error", "numbering"): 2}, "drawn", "--printer", "jet.json", *BLACK)
        self.assertEqual(findings[1]["text"], "number 3 is missing between 's2.png' and 's4.png'; add the slice, or number them without a gap")

    def test_images_of_other_kinds_are_told(self):
        Image.open(self.folder / "drawn/s2.png").convert("L").save(self.folder / "drawn/s2.png")
        Image.open(self.folder / "drawn/s3.png").convert("RGB").save(self.folder / "drawn/s3.png")
        self.find({("error", "slice-kind"): 2}, "drawn", "--pitch", "0.1,0.1,0.1", *BLACK)

    def test_what_cannot_be_read_at_all_is_one_finding(self):
        self.repack("out.sl1", {"config.ini": lambda text: text.replace(b"layerHeight = 0.1", b"layerHeight = x")})
        self.find({("error", "unreadable-stack"): 1}, "out.sl1")
        self.make("png-out")
        (self.folder / "png-out/manifest.json").write_text("{}")
        self.find({("error", "unreadable-stack"): 1}, "png-out")
        self.refuse(1, "no such file or folder 'nothing'", "verify", "nothing")
        self.refuse(2, "'drawn' holds no manifest.json", "verify", "drawn")
        self.refuse(2, "--pitch: 'png-out' states it; leave it out", "verify", "png-out", "--pitch", "1,1,1")
        self.refuse(2, "--layer goes with --printer", "verify", "png-out", "--layer", "0.1")

    def test_images_without_an_empty_pixel_are_told(self):
        self.find({("warning", "no-background"): 1}, "drawn", "--pitch", "0.1,0.1,0.1")

    # What containers say

    def test_what_a_gcvf_says_is_compared_with_its_slices(self):
        def replaced(old, new):
            return lambda text: text.replace(old, new)

        for changes, kinds in (({"MeshBbx.ktn": None, "Mesh.stl": None}, {("error", "missing-file"): 2}),
                               ({"MeshBbx.ktn": struct.pack("<6f", 0, 0, 0, 12, 9, 6)}, {("error", "mesh-bounds"): 1}),
                               ({"Mesh.stl": lambda stl: stl.replace(struct.pack("<f", 0.6), struct.pack("<f", 0.8))}, {("error", "mesh-bounds"): 1}),
                               ({"ConfigFile.xml": replaced(b"<VoxelCount>96", b"<VoxelCount>97")}, {("error", "voxel-count"): 2}),
                               ({"ConfigFile.xml": replaced(b"<MaxNumberOfColors>2", b"<MaxNumberOfColors>1")}, {("error", "too-many-colours"): 1})):
            with self.subTest(kinds=kinds):
                self.repack("out.gcvf", changes)
                self.find(kinds, "out.gcvf")

    def test_what_the_configurations_of_an_sl1_say_is_compared(self):
        def replaced(old, new):
            return lambda text: text.replace(old, new)

        for changes, kinds in (({"prusaslicer.ini": replaced(b"\nlayer_height = 0.1", b"\nlayer_height = 0.05")}, {("error", "layer-height"): 1}),
                               ({"prusaslicer.ini": replaced(b"initial_layer_height = 0.1", b"initial_layer_height = 0.2")}, {("warning", "layer-height"): 1}),
                               ({"config.ini": replaced(b"expTime = 2.5", b"expTime = 3")}, {("warning", "exposure"): 1}),
                               ({"config.ini": replaced(b"numFast = 6", b"numFast = 7")}, {("error", "missing-slice"): 1}),
                               ({"thumbnail/thumbnail400x400.png": None}, {("warning", "missing-picture"): 1})):
            with self.subTest(kinds=kinds):
                self.repack("out.sl1", changes)
                self.find(kinds, "out.sl1")

    def test_the_layers_that_a_uvj_lists_are_compared(self):
        def change(function):
            def changed(text):
                settings = json.loads(text)
                function(settings)
                return json.dumps(settings)

            return {"config.json": changed}

        for changes, kinds in ((change(lambda settings: settings["Layers"].pop()), {("error", "layer-list"): 1}),
                               (change(lambda settings: settings["Layers"][2].update(Z=0.35)), {("error", "layer-height"): 1}),
                               ({"preview/tiny.png": None, "preview/huge.png": None}, {("warning", "missing-picture"): 2})):
            with self.subTest(kinds=kinds):
                self.repack("out.uvj", changes)
                self.find(kinds, "out.uvj")

    def test_grey_pixels_of_a_resin_printer_are_a_warning(self):
        image = Image.new("L", (20, 12))
        image.paste(255, (4, 4, 12, 8))
        image.putpixel((12, 4), 100)
        image.putpixel((12, 5), 200)
        image.save(self.folder / "x.png")
        self.repack("out.sl1", {"slice00003.png": (self.folder / "x.png").read_bytes()})
        [grey] = [finding for finding in self.report("out.sl1")["findings"] if finding["id"] == "grey-pixels"]
        self.assertEqual((grey["severity"], grey["count"], grey["layer"], grey["pixel"]), ("warning", 2, 3, [12, 4]))

    # What the printer takes

    def printer(self, name, base=JETTING, **changes):
        (self.folder / name).write_text(json.dumps({**base, "name": name[:-5], **changes}))
        return "--printer", name

    def test_what_the_printer_does_not_take_is_told(self):
        for changes, kind in (({"minimum_slices": 7}, "too-few-slices"), ({"maximum_colours": 1}, "too-many-colours"),
                              ({"pitch_mm": [0.1, 0.2, 0.1]}, "pitch"), ({"pitch_mm": [0.1, 0.1, 0.05]}, "layer-height"),
                              ({"build_mm": [0.4, 5, 5]}, "build-volume")):
            with self.subTest(kind=kind):
                self.find({("error", kind): 1}, "png-out", *self.printer("other.json", **changes))
        self.find({}, "png-out", *self.printer("other.json", pitch_mm=[0.1, 0.1, 0.05], layer_mm=[0.02, 0.1]))
        self.find({("error", "layer-height"): 1}, "png-out", *self.printer("other.json", pitch_mm=[0.1, 0.1, 0.05], layer_mm=[0.02, 0.09]))

    def test_slices_show_the_display_of_the_printer(self):
        for stack in ("out.sl1", "out.uvj"):
            self.find({("error", "display-size"): 1}, stack, *self.printer("other.json", RESIN, slice_px=[12, 20]))
            self.find({("warning", "mirrored"): 1}, stack, *self.printer("other.json", RESIN, mirror_x=True))

    def test_the_rarest_of_too_many_colours_are_told(self):
        rows = list(BLOCK[0])
        rows[2] = "..wrwwbbbb.."
        findings = self.drawn([*BLOCK[:2], rows, *BLOCK[3:]], mode="RGBA", printer="jet.json",
                              expected={("error", "too-many-colours"): 1, ("error", "stray-colour"): 1})
        self.assertEqual((findings[1]["layer"], findings[1]["count"]), (2, 1))
        self.assertIn("the colour 200,1,2,255 is in 1 pixel of 1 slice alone", findings[1]["text"])

    # The part

    BASE = ["." * 20, *["." + "w" * 12 + "." * 7] * 10, "." * 20]

    def test_islands_are_lost_in_resin(self):
        top = [*self.BASE[:4], "." + "w" * 12 + "..www..", *self.BASE[5:9], "." + "w" * 12 + "..wwww.", "." + "w" * 12 + "..wwww.", "." * 20]
        layers = [self.BASE, top, top]
        findings = self.drawn(layers, expected={("error", "island"): 1, ("note", "small-island"): 1})
        self.assertEqual((findings[0]["layer"], findings[0]["pixel"], findings[0]["count"]), (1, [15, 9], 8))
        self.assertIn("an island of 0.08 mm2 ", findings[0]["text"])
        self.drawn(layers, expected={}, mode="RGBA", printer="jet.json")

    def test_specks_cavities_and_empty_layers_are_told(self):
        hollow = [*self.BASE[:5], ".www..wwwwwww......", *self.BASE[6:]]
        hollow[5] = ".www..wwwwwww" + "." * 7
        speck = [*self.BASE[:5], "." + "w" * 12 + "....w..", *self.BASE[6:]]
        [cavity] = self.drawn([self.BASE, hollow, hollow, self.BASE], expected={("warning", "cavity"): 1})
        self.assertEqual((cavity["layer"], cavity["pixel"], cavity["count"]), (1, [4, 5], 1))
        self.assertIn("1 closed cavity, 4e-06 ml in all, the largest one of 4 voxels here", cavity["text"])
        [found] = self.drawn([self.BASE, speck, self.BASE], expected={("note", "speck"): 1})
        self.assertEqual((found["layer"], found["pixel"]), (1, [17, 5]))
        blank = ["." * 20] * 12
        empty = self.drawn([self.BASE, blank, blank, self.BASE], expected={("warning", "empty-layers"): 1, ("error", "island"): 1})[0]
        self.assertEqual((empty["layer"], empty["count"]), (1, 2))

    def test_cups_hold_resin(self):
        ring = ["." * 20, "." + "w" * 12 + "." * 7, *["." + "w" + "." * 10 + "w" + "." * 7] * 8, "." + "w" * 12 + "." * 7, "." * 20]
        layers = [self.BASE, *[ring] * 20]
        [cup] = self.drawn(layers, expected={("warning", "cup"): 1})
        self.assertEqual((cup["layer"], cup["count"]), (1, 1600))
        self.assertIn("a cup of 0.0016 ml ", cup["text"])
        self.drawn(layers[:8], expected={})
        self.drawn(layers, expected={}, mode="RGBA", printer="jet.json")

    def test_a_stack_without_a_voxel_is_no_part(self):
        self.drawn([["." * 20] * 12] * 3, expected={("error", "nothing-printed"): 1})

    # Against the .vdb

    def test_a_stack_is_what_the_vdb_says(self):
        for stack in ("png-out", "png1-out", "png8-out", "tiff-out", "exr-out", "objet-out", "out.zip", "out.gcvf", "out.3mf"):
            with self.subTest(stack=stack):
                self.make(stack, "drawn.vdb")
                self.succeed("verify", stack, "--against", "drawn.vdb")
        for stack in ("out.sl1", "out.uvj"):
            self.make(stack, "vat.vdb")
            self.succeed("verify", stack, "--against", "vat.vdb")
        self.succeed("verify", "drawn", "--printer", "jet.json", *BLACK, "--against", "drawn.vdb")
        self.run_program("slice-export", "-i", "drawn.vdb", "flipped.gcvf", "--padding", "3", "--flip-x")
        self.assertEqual({finding["id"] for finding in self.report("flipped.gcvf", "--against", "drawn.vdb")["findings"]},
                         {"differs", "differs-in-material"}, "a GCVF does not say that it is mirrored")

    def test_one_voxel_that_differs_is_told(self):
        rows = list(BLOCK[0])
        rows[3] = "..wwwwwbbb.."
        shutil.rmtree(self.folder / "drawn")
        self.draw(self.folder / "drawn", [*BLOCK[:4], rows, BLOCK[5]])
        self.succeed("slice-import", "drawn", "--printer", "jet.json", *PALETTE, "-o", "other.vdb")
        for stack in ("png-out", "out.gcvf"):
            findings = self.find({("error", "differs"): 1, ("error", "differs-in-material"): 2}, stack, "--against", "other.vdb")
            place = findings[0]
            self.assertEqual((place["layer"], place["pixel"], place["count"]), (4, [6, 3], 1))
            self.assertEqual(sorted(finding["text"] for finding in findings[1:]), ["'#1a1a1d': 0 voxels missing, 1 too many",
                                                                                  "'#f0f0f0': 1 voxel missing, 0 too many"])
        self.find({}, "png8-out", "--against", "other.vdb")

    def test_voxels_outside_of_the_slices_are_told(self):
        self.draw(self.folder / "x", [*BLOCK, BLOCK[0]])
        self.succeed("slice-import", "x", "--printer", "jet.json", *PALETTE, "-o", "other.vdb")
        findings = self.find({("error", "differs-outside"): 1}, "png-out", "--against", "other.vdb")
        self.assertEqual(findings[0]["count"], 32)

    def test_a_vdb_on_another_lattice_is_not_compared(self):
        self.succeed("slice-import", "drawn", "--pitch", "0.1,0.1,0.2", *PALETTE, "-o", "other.vdb")
        self.find({("error", "other-lattice"): 1}, "png-out", "--against", "other.vdb")
        self.make("drawn.vdb")
        self.succeed("mesh-export", "-i", "drawn.vdb", "drawn.stl")
        self.succeed("mesh2sdf", "drawn.stl", "--pitch", "0.1,0.1,0.1", "-o", "surface.vdb")
        self.refuse(2, "--against: 'surface.vdb' has no grid 'material' or 'solid'", "verify", "png-out", "--against", "surface.vdb")

    # The report

    def test_many_findings_of_a_kind_are_counted(self):
        self.make("png1-out")
        for path in (self.folder / "png1-out").glob("*/*.png"):
            path.write_bytes(b"x")
        done = self.run_program("verify", "png1-out")
        lines = done.stdout.decode().splitlines()
        self.assertEqual(done.returncode, 1)
        self.assertEqual(sum("[slice-changed]" in line for line in lines), 11)
        self.assertEqual(lines[10], "  and 2 more [slice-changed]")
        self.assertEqual(self.report("png1-out")["left_out"]["slice-changed"], 2)

    def test_names_from_files_have_no_effect_on_a_terminal(self):
        self.make("png-out")
        shutil.copy(self.folder / "png-out/slice_00001.png", self.folder / "png-out/slice_\x1b[31m.png")
        done = self.run_program("verify", "png-out")
        self.assertIn(rb"error: 'png-out/slice_\x1b[31m.png': the stack does not name this slice; remove it, or make the stack again [extra-slice]",
                      done.stdout)
        self.assertNotIn(b"\x1b", done.stdout + done.stderr)


if __name__ == "__main__":
    unittest.main()
