"""Tests samples/blender/view.py, if Blender is installed. Nothing else needs Blender."""

import shutil
import subprocess
import unittest

import meshes
from program import ROOT, ProgramTest


@unittest.skipUnless(shutil.which("blender"), "blender is not installed")
class Blender(ProgramTest):
    def view(self, *arguments):
        return subprocess.run(["blender", "--background", "--factory-startup", "--python-exit-code", "1", "--python",
                               ROOT / "samples/blender/view.py", "--", *arguments], cwd=self.folder, capture_output=True,
                              text=True, timeout=500)

    def setUp(self):
        super().setUp()
        meshes.write_stl(self.folder / "part.stl", meshes.sphere(0.5))
        self.succeed("run", "mesh2sdf part.stl --printer mimaki-3duj-553 ! dither ! write chain.vdb ! mesh-export voxels.ply")

    def test_grids_and_meshes_are_rendered(self):
        done = self.view("--output", "picture.png", "--surface", "chain.vdb:surface", "--volume", "chain.vdb:solid",
                         "--mesh", "voxels.ply", "--width", "96", "--height", "32", "--samples", "1")
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        self.assertGreater((self.folder / "picture.png").stat().st_size, 1000)

    def test_unusable_objects_are_refused_in_one_line(self):
        for arguments, said in ((["--surface", "chain.vdb:nothing"], "'chain.vdb' has no grid 'nothing'; it has solid surface"),
                                (["--volume", "none.vdb:solid"], "cannot read 'none.vdb'"),
                                (["--mesh", "chain.vdb"], "'chain.vdb' is not an .stl or .ply file")):
            done = self.view("--output", "picture.png", *arguments)
            self.assertNotEqual(done.returncode, 0)
            self.assertIn(f"view.py: {said}", done.stdout + done.stderr)
            self.assertFalse((self.folder / "picture.png").exists())


if __name__ == "__main__":
    unittest.main()
