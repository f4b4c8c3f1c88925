"""Short runs of the fuzzers in tests/fuzz, from small files of every format. Longer runs: docs/reliability.md."""

import os
import pathlib
import subprocess
import unittest
import zipfile

from PIL import Image

import meshes
from program import ProgramTest

FUZZERS = os.environ.get("VDBDITHER_FUZZERS", "")
SECONDS = int(os.environ.get("VDBDITHER_FUZZ_SECONDS", "15"))

MODEL = """<?xml version="1.0" encoding="UTF-8"?>
<model unit="millimeter" xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02">
<resources><basematerials id="1"><base name="red" displaycolor="#FF0000"/></basematerials>
<object id="2" type="model" pid="1" pindex="0"><mesh><vertices><vertex x="0" y="0" z="0"/><vertex x="1" y="0" z="0"/>
<vertex x="0" y="1" z="0"/><vertex x="0" y="0" z="1"/></vertices><triangles><triangle v1="0" v2="2" v3="1"/>
<triangle v1="0" v2="1" v3="3"/><triangle v1="1" v2="2" v3="3"/><triangle v1="0" v2="3" v3="2"/></triangles></mesh></object>
<object id="3" type="model"><components><component objectid="2" transform="2 0 0 0 1 0 0 0 1 3 0 0"/></components></object>
</resources><build><item objectid="2"/><item objectid="3"/></build></model>
"""


@unittest.skipUnless(FUZZERS, "the fuzzers are not built")
class Fuzzers(ProgramTest):
    def setUp(self):
        super().setUp()
        self.seeds = self.folder / "seeds"
        self.seeds.mkdir()

    def fuzz(self, name):
        done = subprocess.run([pathlib.Path(FUZZERS) / name, f"-max_total_time={SECONDS}", "-seed=1", "-timeout=10",
                               "-rss_limit_mb=2000", "-max_len=8192", "-verbosity=0", self.seeds],
                              cwd=self.folder, stdin=subprocess.DEVNULL, capture_output=True, timeout=SECONDS + 600)
        self.assertEqual(done.returncode, 0, done.stderr.decode(errors="replace")[-4000:])

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
        self.write_model()
        self.fuzz("threemf_fuzz")

    def test_the_decoders_of_textures(self):
        image = Image.linear_gradient("L").resize((8, 8))
        for mode in ("L", "RGB", "RGBA", "P"):
            image.convert(mode).save(self.seeds / f"{mode}.png")
        for ending in ("jpg", "webp", "tif"):
            image.convert("RGB").save(self.seeds / f"image.{ending}")
        self.fuzz("texture_fuzz")


if __name__ == "__main__":
    unittest.main()
