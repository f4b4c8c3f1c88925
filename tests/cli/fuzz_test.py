"""Short runs of the fuzzers in tests/fuzz, from small files of every format. Longer runs: docs/reliability.md."""

import json
import os
import pathlib
import subprocess
import unittest
import zipfile
import zlib

from PIL import Image

import meshes
from program import ProgramTest

FUZZERS = os.environ.get("VDBDITHER_FUZZERS", "")
SECONDS = int(os.environ.get("VDBDITHER_FUZZ_SECONDS", "5"))
# Keeps the units of each fuzzer, what it says, and what it finds.
KEPT = os.environ.get("VDBDITHER_FUZZ_FOLDER", "")

# What slicers say of the volumes of a project, in both of their ways.
SETTINGS = """<config><object id="2"><volume firstid="0" lastid="1"><metadata type="volume" key="volume_type" value="ParameterModifier"/>
<metadata key="modifier" value="1"/></volume></object><object id="3"><part id="2" subtype="support_blocker"><metadata key="name" value="a"/></part></object></config>"""

MODEL = """<?xml version="1.0" encoding="UTF-8"?>
<model unit="millimeter" xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02">
<resources><basematerials id="1"><base name="red" displaycolor="#FF0000"/></basematerials>
<object id="2" type="model" pid="1" pindex="0"><mesh><vertices><vertex x="0" y="0" z="0"/><vertex x="1" y="0" z="0"/>
<vertex x="0" y="1" z="0"/><vertex x="0" y="0" z="1"/></vertices><triangles><triangle v1="0" v2="2" v3="1"/>
<triangle v1="0" v2="1" v3="3"/><triangle v1="1" v2="2" v3="3"/><triangle v1="0" v2="3" v3="2"/></triangles></mesh></object>
<object id="3" type="model"><components><component objectid="2" transform="2 0 0 0 1 0 0 0 1 3 0 0"/></components></object>
</resources><build><item objectid="2"/><item objectid="3"/></build></model>
"""

PROFILE = {"name": "jet", "title": "Jet", "source": "By definition", "technology": "resin", "pitch_mm": [0.25, 0.25, 0.25],
           "layer_mm": [0.05, 0.5], "build_mm": [5, 5, 5], "slice_px": [6, 6], "origin": "corner", "mirror_x": True,
           "minimum_slices": 3, "maximum_colours": 2, "containers": ["gcvf"], "point_spread_mm": [0.05, 0.05, 0.05],
           "materials": [{"name": "white", "rgba": [240, 240, 240, 255], "density_g_per_cm3": 1.2, "resin": "Vero"},
                         {"name": "black", "rgba": [26, 26, 29, 255], "linear_rgb": [0.01, 0.01, 0.01]}]}

# What the readers of texts compare with: a fuzzer guesses no words.
WORDS = ("name", "pitch_mm", "kubelka_munk", "yule_nielsen", "absorption", "scattering", "printer_notes", "number", "whole",
         "refused", "<![CDATA[", "<!DOCTYPE", "xmlns:", "&#x", "$'", "--flag", "--whole", "--number=", "--length", "--lengths",
         "--triple", "--coord", "--text", "white", "!", "\\x", "0.1mm,0.2mm,0.3mm")
STACK_WORDS = ("\n@@ ", "@@ manifest.json", "sha256", "slices", "layout", "lattice", "materials", "format", "padding", "flip_x",
               "NumberOfSlices", "StartIndex", "VoxelCount", "imagesheet", "transform", "config.ini", "displayWidth")
VDB_WORDS = ("Tree_float_5_4_3", "Tree_bool_5_4_3", "Tree_vec3s_5_4_3", "Tree_mask_5_4_3", "Tree_int32_5_4_3", "_HalfFloat", "AffineMap",
             "ScaleMap", "UniformScaleMap", "UniformScaleTranslateMap", "NonlinearFrustumMap", "is_saved_as_half_float", "bool",
             "__delayedload", "vdbdither:box", "vdbdither:layers", "vdbdither:frame", "head", "slab 0 8", "end 8", "\n@@\n", " BDV")


@unittest.skipUnless(FUZZERS, "the fuzzers are not built")
class Fuzzers(ProgramTest):
    def setUp(self):
        super().setUp()
        self.seeds = self.folder / "seeds"
        self.seeds.mkdir()

    def fuzz(self, name, words=(), arguments=()):
        if words:
            escaped = ("".join(f"\\x{byte:02x}" for byte in word.encode()) for word in words)
            (self.folder / "words").write_text("".join(f'"{word}"\n' for word in escaped))
            arguments = (*arguments, "-dict=words")
        units = pathlib.Path(KEPT or self.folder).resolve() / name
        (units / "units").mkdir(parents=True, exist_ok=True)
        with open(units / "log", "w+b") as log:
            done = subprocess.run([pathlib.Path(FUZZERS) / name, f"-max_total_time={SECONDS}", "-seed=1", "-timeout=10",
                                   "-rss_limit_mb=2000", "-max_len=8192", "-print_final_stats=1", f"-artifact_prefix={units}/",
                                   *arguments, units / "units", self.seeds],
                                  cwd=self.folder, stdin=subprocess.DEVNULL, stdout=log, stderr=log, timeout=SECONDS + 600)
            log.seek(0)
            self.assertEqual(done.returncode, 0, log.read().decode(errors="replace")[-4000:])

    def write_model(self):
        with zipfile.ZipFile(self.seeds / "model.3mf", "w", zipfile.ZIP_DEFLATED) as archive:
            archive.writestr("3D/3dmodel.model", MODEL)

    def test_the_readers_of_meshes(self):
        meshes.write_stl(self.folder / "part.stl", meshes.box((1, 1, 1)))
        exports = [word for ending in ("stl", "obj", "ply", "off", "glb", "drc") for word in ("!", "mesh-export", f"seeds/part.{ending}")]
        self.succeed("mesh2sdf", "part.stl", "--pitch", "0.5mm,0.5mm,0.5mm", *exports)
        meshes.write_textured(self.seeds / "textured.obj", meshes.box((1, 1, 1)))
        self.write_model()
        self.fuzz("mesh_reader_fuzz")

    def test_the_reader_of_3mf(self):
        (self.seeds / "part.model").write_text(MODEL)
        (self.seeds / "project.model").write_text(f"{MODEL}\n@@\n{SETTINGS}")
        self.write_model()
        self.fuzz("threemf_fuzz")

    def test_the_decoders_of_textures(self):
        image = Image.linear_gradient("L").resize((8, 8))
        for mode in ("L", "RGB", "RGBA", "P"):
            image.convert(mode).save(self.seeds / f"{mode}.png")
        for ending in ("jpg", "webp", "tif"):
            image.convert("RGB").save(self.seeds / f"image.{ending}")
        self.fuzz("texture_fuzz")

    def draw_images(self):
        image = Image.linear_gradient("L").resize((8, 8))
        for mode in ("1", "L", "LA", "RGB", "RGBA", "P"):
            image.convert(mode).save(self.seeds / f"{mode}.png")
        for mode, packing in (("1", "group4"), ("1", "packbits"), ("L", "tiff_lzw"), ("P", "tiff_lzw"), ("RGB", "tiff_deflate"),
                              ("RGBA", "raw"), ("L", "jpeg")):
            image.convert(mode).save(self.seeds / f"{mode}-{packing}.tif", compression=packing)
        image.convert("1").save(self.seeds / "1.bmp")

    def test_the_reader_of_plain_png(self):
        self.draw_images()
        for file in self.seeds.iterdir():
            if file.suffix != ".png":
                file.unlink()
        for kind, stride in enumerate((1 + 4 * 16, 1 + 16, 1 + 2)):
            row = bytes(i % 5 * 50 for i in range(stride - 1))
            rows = b"".join(bytes([y % 5]) + (row if y % 3 else bytes(stride - 1)) for y in range(16))
            for level, strategy in ((0, zlib.Z_DEFAULT_STRATEGY), (9, zlib.Z_DEFAULT_STRATEGY), (9, zlib.Z_FIXED), (9, zlib.Z_HUFFMAN_ONLY)):
                packer = zlib.compressobj(level, zlib.DEFLATED, -15, 9, strategy)
                (self.seeds / f"packed-{kind}-{level}-{strategy}").write_bytes(bytes([kind, 15, 15]) + packer.compress(rows) + packer.flush())
        self.fuzz("plain_png_fuzz")

    def test_the_decoders_of_slices(self):
        self.draw_images()
        self.make_stacks("exr")
        (self.seeds / "slice.exr").write_bytes(next((self.folder / "exr").rglob("*.exr")).read_bytes())
        self.fuzz("slice_image_fuzz")

    def make_stacks(self, *names):
        """Exports a box in formats, and to containers."""
        meshes.write_stl(self.folder / "part.stl", meshes.box((1, 1, 1)))
        (self.folder / "jet.json").write_text(json.dumps(PROFILE))
        for name in names:
            form = ("--3mf-level-set",) if name.endswith(".3mf") else () if "." in name else ("--format", name)
            self.succeed("mesh2sdf", "part.stl", "--printer", "jet.json", "!", "dither", "!", "material-assign", "--material", "white",
                         "!", "slice-export", name, *form)

    def test_the_readers_of_stacks(self):
        containers = ("out.gcvf", "out.sl1", "out.uvj", "out.3mf")
        formats = ("png", "png1", "png8", "tiff", "tiff1", "exr", "objet")
        self.make_stacks(*containers, *formats)
        for name in (*containers, *formats):
            text = b""
            for member, content in self.members(self.folder / name):
                # Pictures are not read, only looked for.
                text += f"\n@@ {member}\n".encode() + (content if len(content) < 2000 or ".png" not in member else b"")
            (self.seeds / name).write_bytes(text)
        self.fuzz("stack_fuzz", STACK_WORDS, ["-close_fd_mask=1", "-max_len=12288"])

    @staticmethod
    def members(path):
        if path.is_dir():
            return [(str(file.relative_to(path)), file.read_bytes()) for file in sorted(path.rglob("*")) if file.is_file()]
        with zipfile.ZipFile(path) as archive:
            return [(name, archive.read(name)) for name in archive.namelist()]

    def test_the_readers_of_archives(self):
        # In one branch of the tree, whose masks alone take 9 KiB.
        meshes.write_stl(self.folder / "part.stl", meshes.box((1, 1, 1), (9, 9, 9)))
        for stage, chain in (("surface", ()), ("solid", ("!", "dither")), ("N", ("!", "normals"))):
            for codec in ("mask", "blosc"):
                self.succeed("mesh2sdf", "part.stl", "--pitch", "0.25mm", *chain, "!", "write", "x.vdb", "--overwrite", "--codec", codec)
                archive = (self.folder / "x.vdb").read_bytes()
                # Without the checksum in the UUID, like those of other programs.
                foreign = archive[:21] + b"00000000-0000-4000-8000-000000000000" + archive[57:]
                (self.seeds / f"{stage}-{codec}").write_bytes(b"f" + foreign)
        frames = self.succeed("mesh2sdf", "part.stl", "--pitch", "0.25mm", "--slab", "8")
        magic = frames[:8]
        (self.seeds / "pipe").write_bytes(b"p" + b"\n@@\n".join(magic + part for part in frames.split(magic)[1:]))
        self.succeed("mask", "--size", "8", "--kind", "white", "-o", "mask.vdb")
        (self.seeds / "mask").write_bytes(b"m" + (self.folder / "mask.vdb").read_bytes())
        self.fuzz("vdb_fuzz", VDB_WORDS, ["-max_len=32768"])

    def test_the_readers_of_texts(self):
        materials = [{"index": 1, "name": "white", "rgba": [1, 2, 3, 4]}]
        texts = {"profile": "p" + json.dumps(PROFILE, indent=1), "materials": "m" + json.dumps(materials),
                 "values": "k# one\nnumber = 0.5\n[two]\nwhole = 12\n", "xml": "x" + MODEL,
                 "chain": "cwhite part.stl --flag --whole 3 --number=0.5 ! white=1,2,3 'a b' --lengths 0.1mm,0.2mm,300um | grey=#102030 "
                          "a --text $'w\\x41' --coord 1,2,3 --triple 1"}
        for name, text in texts.items():
            (self.seeds / name).write_text(text)
        meshes.write_stl(self.folder / "part.stl", meshes.sphere(0.3, 8))
        self.succeed("plan", "mesh2sdf part.stl --printer mimaki-3duj-553 ! dither ! slice-export out", "--pieces", "2")
        self.succeed("piece", "job", "1")
        (self.seeds / "job").write_bytes(b"j" + (self.folder / "job/job.json").read_bytes())
        (self.seeds / "piece").write_bytes(b"s" + next((self.folder / "job").rglob("piece.bin")).read_bytes())
        self.fuzz("text_fuzz", WORDS)


if __name__ == "__main__":
    unittest.main()
