"""Containers as a program that is not ours reads them: zipfile, Pillow and the facts of each format."""

import configparser
import io
import json
import struct
import subprocess
import unittest
import xml.etree.ElementTree as xml
import zipfile

import meshes
import numpy
from PIL import Image
from program import PATIENCE, PROGRAM, ProgramTest

SIZE_MM = (1.1, 0.9, 1.0)
# A display of 64 x 40 pixels that are not square, and mirrored.
DISPLAY = {"name": "small", "title": "A small display", "source": "for this test", "technology": "resin", "pitch_mm": [0.05, 0.08, 0.1],
           "build_mm": [3.2, 3.2, 5], "slice_px": [64, 40], "mirror_x": True, "printer_notes": "FILEFORMAT_GOO",
           "materials": [{"name": "resin", "rgba": [90, 120, 160, 255]}]}


class Containers(ProgramTest):
    @classmethod
    def setUpClass(cls):
        cls.made = cls.folder_of_class()
        triangles = meshes.box(SIZE_MM)
        meshes.write_stl(cls.made / "part.stl", triangles)
        (cls.made / "small.json").write_text(json.dumps(DISPLAY))

        def run(*line):
            subprocess.run([PROGRAM, *line], cwd=cls.made, check=True, timeout=120 * PATIENCE, stderr=subprocess.DEVNULL)

        run("mesh2sdf", "part.stl", "--printer", "stratasys-j750-27um", "!", "dither", "!", "material-assign", "--core", "VeroCyan", "--shell",
            "0.3mm:white", "-o", "jetted.vdb")
        run("mesh2sdf", "part.stl", "--printer", "small.json", "!", "dither", "-o", "cured.vdb")
        for name in ("a.gcvf", "plain.zip"):
            run("slice-export", "-i", "jetted.vdb", name)
        run("slice-export", "-i", "jetted.vdb", "level.3mf", "--3mf-level-set")
        run("slice-export", "-i", "jetted.vdb", "mesh.3mf", "--3mf-mesh", "part.stl")
        run("slice-export", "-i", "jetted.vdb", "--format", "objet", "bits")
        for name in ("a.sl1", "a.uvj"):
            run("slice-export", "-i", "cured.vdb", name)
        run("slice-export", "-i", "cured.vdb", "--format", "png8", "--tray", "centred", "--flip-x", "display.zip")

    def slices(self, archive, names):
        """Returns the images as Pillow reads them, in one array of layers."""
        with zipfile.ZipFile(self.made / archive) as files:
            self.assertIsNone(files.testzip())
            images = [Image.open(io.BytesIO(files.read(name))) for name in names]
            self.assertEqual(len({image.mode for image in images}), 1)
            return images[0].mode, numpy.array([numpy.asarray(image) for image in images])

    def plain(self, archive):
        with zipfile.ZipFile(self.made / archive) as files:
            manifest = json.loads(files.read("manifest.json"))
        return manifest, self.slices(archive, [entry["file"] for entry in manifest["slices"]])[1]

    def test_a_gcvf_holds_what_grabcad_print_reads(self):
        with zipfile.ZipFile(self.made / "a.gcvf") as files:
            root = xml.fromstring(files.read("ConfigFile.xml"))
            names = set(files.namelist())
            bounds = struct.unpack("<6f", files.read("MeshBbx.ktn"))
            mesh = files.read("Mesh.stl")
        text = {path: root.findtext(path) for path in (
            "Version", "Resolution/XDpi", "Resolution/YDpi", "Resolution/SliceThicknessNanoMeter", "BitDepth", "MaxNumberOfColors",
            "DataSemantics", "CreationMode", "ImageFilePrefix", "SliceRange/StartIndex", "MaterialList/BackGroundMaterialRGBA")}
        self.assertEqual(list(text.values()), ["2", "600", "300", "27000", "4", "6", "Materials", "MODEL_ONLY", "layer_", "0", "0 0 0 255"])
        count = int(root.findtext("SliceRange/NumberOfSlices"))
        width, height = (int(root.findtext(f"SliceDimensions/Slice{name}")) for name in ("Width", "Height"))
        self.assertEqual(names, {"ConfigFile.xml", "MeshBbx.ktn", "Mesh.stl", *(f"layer_{i}.png" for i in range(count))})
        self.assertGreaterEqual(count, 30)
        mode, layers = self.slices("a.gcvf", [f"layer_{i}.png" for i in range(count)])
        self.assertEqual((mode, layers.shape), ("RGBA", (count, height, width, 4)))
        self.assertEqual(bounds, (0, 0, 0, width, height, count))
        manifest, plain = self.plain("plain.zip")
        self.assertTrue((layers == plain).all())
        stated = {}
        for material in root.iter("Material"):
            rgba = tuple(map(int, material.findtext("RGBA").split()))
            stated[material.findtext("Name")] = int(material.findtext("VoxelCount"))
            self.assertEqual(stated[material.findtext("Name")], (layers == rgba).all(axis=3).sum())
        self.assertEqual(len(stated), 2)
        self.assertTrue(all(stated.values()))
        self.assertEqual(sum(stated.values()), (layers != (0, 0, 0, 255)).any(axis=3).sum())
        self.assertEqual(len(mesh), 84 + 50 * struct.unpack("<I", mesh[80:84])[0])
        corners = numpy.array([struct.unpack("<12fH", mesh[at:at + 50])[:12] for at in range(84, len(mesh), 50)]).reshape(-1, 4, 3)
        size = numpy.array([width * 25.4 / 600, height * 25.4 / 300, count * 0.027])
        self.assertTrue(numpy.allclose(corners[:, 1:].min(axis=(0, 1)), (0, -size[1], 0), atol=1e-4))
        self.assertTrue(numpy.allclose(corners[:, 1:].max(axis=(0, 1)), (size[0], 0, size[2]), atol=1e-4))
        a, b, c = corners[:, 1], corners[:, 2], corners[:, 3]
        self.assertAlmostEqual(numpy.einsum("ij,ij->i", a, numpy.cross(b, c)).sum() / 6, size.prod(), places=3)
        normals = numpy.cross(b - a, c - a)
        self.assertTrue(numpy.allclose(normals / numpy.linalg.norm(normals, axis=1)[:, None], corners[:, 0], atol=1e-5))

    def test_an_objet_stack_has_bitmaps_of_one_bit_whose_materials_do_not_overlap(self):
        lines = (self.made / "bits/print.txt").read_text().splitlines()
        manifest = json.loads((self.made / "bits/manifest.json").read_text())
        count = manifest["size"][2]
        self.assertEqual(lines[:4], ["[Build]", "Format version = 1;", "Layer thickness = 0.027;", f"Number of slices = {count};"])
        paths = [line.split(" = ")[1].rstrip(";").replace("\\", "/") for line in lines if line.startswith("Material")]
        self.assertEqual(len(paths), 2)
        layers = []
        for path in paths:
            images = [Image.open(self.made / "bits" / path.replace("xxxx", f"{i:04}")) for i in range(count)]
            self.assertEqual({image.mode for image in images}, {"1"})
            self.assertEqual(images[0].width % 32, 0)
            layers.append(numpy.array([numpy.asarray(image) for image in images]))
        self.assertFalse((layers[0] & layers[1]).any())
        _, plain = self.plain("plain.zip")
        width = plain.shape[2]
        for material, bits in zip(manifest["materials"], layers):
            self.assertTrue((bits[:, :, :width] == (plain == material["rgba"]).all(axis=3)).all())
            self.assertFalse(bits[:, :, width:].any())

    def check_display(self, mode, layers):
        """The whole display, mirrored, 255 where it hardens."""
        self.assertEqual((mode, layers.shape[1:]), ("L", (40, 64)))
        self.assertEqual(set(numpy.unique(layers)), {0, 255})
        self.assertTrue((layers == self.plain("display.zip")[1]).all())

    def test_an_sl1_holds_what_slicers_and_converters_read(self):
        with zipfile.ZipFile(self.made / "a.sl1") as files:
            texts = {name: "[all]\n" + files.read(name).decode() for name in ("config.ini", "prusaslicer.ini")}
            names = set(files.namelist())
        job, slicer = configparser.RawConfigParser(strict=True), configparser.RawConfigParser(strict=True)
        job.optionxform = slicer.optionxform = str
        job.read_string(texts["config.ini"])
        slicer.read_string(texts["prusaslicer.ini"])
        job, slicer = dict(job["all"]), dict(slicer["all"])
        for key in ("action", "jobDir", "expTime", "expTimeFirst", "expUserProfile", "fileCreationTimestamp", "hollow", "layerHeight", "materialName",
                    "numFade", "numFast", "numSlow", "printProfile", "printTime", "printerModel", "printerProfile", "printerVariant",
                    "prusaSlicerVersion", "usedMaterial"):
            self.assertIn(key, job)
        count = int(job["numFast"]) + int(job["numSlow"])
        self.assertEqual((job["action"], float(job["layerHeight"]), job["printerProfile"]), ("print", 0.1, "small"))
        self.assertEqual((slicer["display_pixels_x"], slicer["display_pixels_y"], slicer["display_mirror_x"], slicer["display_mirror_y"]),
                         ("64", "40", "1", "0"))
        self.assertAlmostEqual(float(slicer["display_width"]), 3.2)
        self.assertAlmostEqual(float(slicer["display_height"]), 3.2)
        self.assertEqual(slicer["printer_notes"], "FILEFORMAT_GOO")
        slices = [f"{job['jobDir']}{i:05}.png" for i in range(count)]
        thumbnails = {f"thumbnail/thumbnail{size}.png": size for size in ("400x400", "800x480")}
        self.assertEqual(names, {"config.ini", "prusaslicer.ini", *slices, *thumbnails})
        mode, layers = self.slices("a.sl1", slices)
        self.check_display(mode, layers)
        printed_ml = (layers == 255).sum() * 0.05 * 0.08 * 0.1 / 1000
        self.assertAlmostEqual(float(job["usedMaterial"]), printed_ml)
        self.assertAlmostEqual(printed_ml, numpy.prod(SIZE_MM) / 1000, delta=0.05 * printed_ml)
        for name, size in thumbnails.items():
            self.assertEqual("x".join(map(str, self.slices("a.sl1", [name])[1].shape[2:0:-1])), size)

    def test_grey_levels_are_the_shares_of_the_voxels(self):
        self.run_program("mesh2sdf", self.made / "part.stl", "--printer", self.made / "small.json", "!", "normals", "!", "dither", "-o", "n.vdb")
        self.succeed("slice-export", "-i", "n.vdb", "grey.sl1", "--sl1-grey")
        _, layers = self.slices(self.folder / "grey.sl1", [f"slice{i:05}.png" for i in range(10)])
        self.assertGreater(len(set(numpy.unique(layers))), 2)
        # The sides of the box lie within voxels: the area of a layer is that of its levels.
        for layer in layers[2:8]:
            self.assertAlmostEqual(layer.sum() / 255 * 0.05 * 0.08, SIZE_MM[0] * SIZE_MM[1], delta=0.005)
        done = self.run_program("slice-export", "-i", self.made / "cured.vdb", "no.sl1", "--sl1-grey")
        self.assertEqual(done.stderr.decode(), "vdbdither slice-export: --sl1-grey: needs the grids 'surface' and 'N'; put normals before\n")
        self.assertEqual(done.returncode, 2)

    def test_a_uvj_holds_what_its_readers_read(self):
        with zipfile.ZipFile(self.made / "a.uvj") as files:
            config = json.loads(files.read("config.json"))
            names = set(files.namelist())
        size = config["Properties"]["Size"]
        self.assertEqual((size["X"], size["Y"], size["LayerHeight"]), (64, 40, 0.1))
        self.assertAlmostEqual(size["Millimeter"]["X"], 3.2)
        self.assertEqual(len(config["Layers"]), size["Layers"])
        for number, layer in enumerate(config["Layers"]):
            self.assertAlmostEqual(layer["Z"], 0.1 * (number + 1))
            self.assertEqual(layer["Exposure"]["LightOnTime"], 30 if number < config["Properties"]["Bottom"]["Count"] else 2.5)
        slices = [f"slice/{i:08}.png" for i in range(size["Layers"])]
        self.assertEqual(names, {"config.json", "preview/tiny.png", "preview/huge.png", *slices})
        self.check_display(*self.slices("a.uvj", slices))

    def test_a_3mf_holds_a_volume_in_a_mesh_or_a_level_set(self):
        core, volumetric = "{http://schemas.microsoft.com/3dmanufacturing/core/2015/02}", "{http://schemas.3mf.io/3dmanufacturing/volumetric/2022/01}"
        manifest, plain = self.plain("plain.zip")
        for name, has_mesh in (("mesh.3mf", True), ("level.3mf", False)):
            with zipfile.ZipFile(self.made / name) as files:
                names = set(files.namelist())
                model = xml.fromstring(files.read("3D/3dmodel.model"))
                related = [entry.get("Target") for entry in xml.fromstring(files.read("3D/_rels/3dmodel.model.rels"))]
                roots = [entry.get("Target") for entry in xml.fromstring(files.read("_rels/.rels"))]
                types = {entry.get("Extension") for entry in xml.fromstring(files.read("[Content_Types].xml"))}
            self.assertEqual(types, {"rels", "model", "png"})
            self.assertEqual(roots, ["/3D/3dmodel.model", "/Metadata/thumbnail.png"])
            self.assertEqual(model.get("requiredextensions"), None if has_mesh else "v")
            ids = [element.get("id") for element in model.find(core + "resources")]
            self.assertEqual(len(ids), len(set(ids)))
            by_id = {element.get("id"): element for element in model.find(core + "resources")}
            sheets = [sheet.get("path") for sheet in model.iter(volumetric + "imagesheet")]
            self.assertEqual(sorted(sheets), sorted(related))
            self.assertTrue(all(path.startswith("/") and path[1:] in names for path in sheets))
            materials = list(model.iter(core + "base"))
            mappings = list(model.iter(volumetric + "materialmapping"))
            self.assertEqual(len(materials), len(mappings))
            height, width = plain.shape[1:3]
            shares = []
            for mapping in mappings:
                function = by_id[mapping.get("functionid")]
                stack = by_id[function.get("image3did")].find(volumetric + "imagestack")
                self.assertEqual([int(stack.get(f"{axis}count")) for axis in ("row", "column", "sheet")], [height, width, len(plain)])
                mode, layers = self.slices(name, [sheet.get("path")[1:] for sheet in stack])
                self.assertEqual(mode, "L")
                shares.append(layers)
            # Nowhere is the sum zero, and in a printed voxel it is one material.
            self.assertTrue((sum(layers.astype(int) for layers in shares) > 0).all())
            for material, layers in zip(manifest["materials"], shares):
                self.assertTrue(((layers > 127) == (plain == material["rgba"]).all(axis=3)).all())
            # The matrix takes the corners of the slices to 0 and 1.
            matrix = numpy.array([float(number) for number in mappings[0].get("transform").split()]).reshape(4, 3)
            pitch, low, high = (numpy.array(manifest[key] if key == "pitch_mm" else manifest["box"][key]) for key in ("pitch_mm", "min", "max"))
            low[2] = manifest["first_layer"]
            high[2] = low[2] + len(plain) - 1
            for corner, expected in ((low - 0.5, 0), (high + 0.5, 1)):
                self.assertTrue(numpy.allclose(corner * pitch @ matrix[:3] + matrix[3], expected, atol=1e-9))
            item = by_id[model.find(f"{core}build/{core}item").get("objectid")]
            if has_mesh:
                self.assertIn(item.find(core + "mesh").get(volumetric + "volumeid"), by_id)
                continue
            level = item.find(volumetric + "levelset")
            function = by_id[level.get("functionid")]
            stack = by_id[function.get("image3did")].find(volumetric + "imagestack")
            solid = self.slices(name, [sheet.get("path")[1:] for sheet in stack])[1] / 255
            values = solid * float(function.get("valuescale")) + float(function.get("valueoffset"))
            self.assertTrue(((values < 0) == (plain != (0, 0, 0, 255)).any(axis=3)).all())
            box = numpy.array([[float(vertex.get(axis)) for axis in "xyz"] for vertex in by_id[level.get("meshid")].iter(core + "vertex")])
            self.assertTrue(numpy.allclose(box.min(axis=0), (low - 0.5) * pitch) and numpy.allclose(box.max(axis=0), (high + 0.5) * pitch))

    def test_containers_come_back_voxel_for_voxel(self):
        for container, source in (("a.gcvf", "jetted.vdb"), ("mesh.3mf", "jetted.vdb"), ("level.3mf", "jetted.vdb"), ("a.sl1", "cured.vdb"), ("a.uvj", "cured.vdb")):
            back = self.folder / "back.vdb"
            self.succeed("slice-import", self.made / container, "-o", back, "--overwrite")
            counts = []
            for name in (self.made / source, back):
                # On any other lattice the slices differ.
                self.run_program("slice-export", "-i", name, "--format", "png8", "--tray", "none", "slices", "--overwrite")
                manifest = json.loads((self.folder / "slices/manifest.json").read_text())
                layers = numpy.array([numpy.asarray(Image.open(self.folder / "slices" / entry["file"])) for entry in manifest["slices"]])
                used = numpy.argwhere(layers)
                low, high = used.min(axis=0), used.max(axis=0) + 1
                counts.append(layers[low[0]:high[0], low[1]:high[1], low[2]:high[2]])
            self.assertEqual(counts[0].shape, counts[1].shape, container)
            self.assertTrue((counts[0] == counts[1]).all(), container)

    def test_names_that_do_not_fit_the_format_are_refused(self):
        def refuse(message, *arguments):
            done = self.run_program("slice-export", "-i", self.made / "jetted.vdb", *arguments)
            self.assertEqual(done.returncode, 2, arguments)
            self.assertEqual(done.stderr.decode(), f"vdbdither slice-export: {message}\n")

        refuse("--format: the name of a sl1 ends with .sl1, that of other stacks does not; it is 'out'", "--format", "sl1", "out")
        refuse("--format: the name of a gcvf ends with .gcvf, that of other stacks does not; it is 'a.gcvf'", "--format", "png", "a.gcvf")
        shape = "3mf: give either --3mf-mesh MESH, the surface of the part, or --3mf-level-set, which takes the voxels as the shape"
        refuse(shape, "a.3mf")
        refuse(shape, "a.3mf", "--3mf-level-set", "--3mf-mesh", self.made / "part.stl")
        refuse("--prefix: gcvf prescribes the names of its files; leave it out", "a.gcvf", "--prefix", "p")
        refuse("--sl1-grey: belongs to sl1, and the slices are png; leave it out", "out", "--sl1-grey")
        refuse("--3mf-level-set: belongs to 3mf, and the slices are gcvf; leave it out", "a.gcvf", "--3mf-level-set")


if __name__ == "__main__":
    unittest.main()
