"""Every example runs: in the help texts, in README.md and in docs."""

import os
import re
import shutil
import subprocess
import unittest
import unittest.mock

from PIL import Image

import meshes
from program import PROGRAM, ROOT, ProgramTest


class Examples(ProgramTest):
    def test_the_example_of_every_operator_runs_with_a_part(self):
        links = sorted((PROGRAM.parent / "operators").iterdir())
        self.assertGreater(len(links), 5)
        for link in links:
            with self.subTest(operator=link.name):
                # Each example runs in a folder that contains only a part, and the same with colours.
                self.doCleanups()
                super().setUp()
                meshes.write_stl(self.folder / "part.stl", meshes.sphere(0.8))
                meshes.write_coloured(self.folder / "part.ply", meshes.sphere(0.8))
                help_text = self.succeed("help", link.name).decode()
                example = help_text.split("Example:\n")[1].strip()
                for line in example.splitlines():
                    self.assertTrue(line.strip().startswith("vdbdither "), example)
                    self.assertRegex(self.shell(f"{line} --explain").decode(), r"(?m)^time +about \d", line)
                    self.shell(line)
                self.assertGreater(len(self.listing()), 2, "no output")


class Documents(ProgramTest):
    """Runs the commands in README.md and docs."""

    def blocks(self, path):
        """Yields the indented blocks that contain only commands of the program."""
        for block in re.findall(r"(?m)(?:^    .+\n)+", path.read_text()):
            lines = [line.split("  #")[0].strip() for line in re.sub(r"\\\n\s*", "", block).splitlines()]
            if all(line.split()[0] in ("vdbdither", "mesh2sdf") for line in lines):
                yield lines

    def test_every_command_in_the_documents_runs(self):
        ran = 0
        for path in sorted([ROOT / "README.md", *ROOT.glob("docs/**/*.md")]):
            for lines in self.blocks(path):
                with self.subTest(document=path.name, lines=lines):
                    self.doCleanups()
                    super().setUp()
                    meshes.write_stl(self.folder / "part.stl", meshes.sphere(0.8))
                    meshes.write_stl(self.folder / "lid.stl", meshes.box((0.6, 0.6, 0.4), (-0.3, -0.3, 0.9)))
                    meshes.write_textured(self.folder / "part.obj", meshes.sphere(0.8))
                    meshes.write_coloured(self.folder / "part.ply", meshes.sphere(0.8))
                    Image.linear_gradient("L").convert("RGB").save(self.folder / "texture.png")
                    for line in lines:
                        # Several lines of a block can write the same stack.
                        if "slice-export out" in line:
                            shutil.rmtree(self.folder / "out", ignore_errors=True)
                        self.shell(line)
                    ran += 1
        self.assertGreater(ran, 15)

    def test_the_python_node_for_houdini_runs_with_a_stand_in_for_houdini(self):
        meshes.write_stl(self.folder / "part.stl", meshes.sphere(0.8))
        table, node = re.findall(r"```python\n(.*?)```", (ROOT / "docs/houdini.md").read_text(), re.DOTALL)
        hou = unittest.mock.MagicMock()
        hou.NodeError = RuntimeError
        hou.text.expandString.return_value = str(self.folder)
        parameters = {"mesh": str(self.folder / "part.stl"), "chain": "--printer mimaki-3duj-553 ! dither ! material-assign"}
        hou.pwd().evalParm.side_effect = parameters.get
        with unittest.mock.patch.dict(os.environ, self.environment()):
            exec(node, {"hou": hou})
            loaded, = hou.pwd().geometry().loadFromFile.call_args.args
            shutil.copy(loaded, self.folder / "part.vdb")
            told = subprocess.run(["python3", "-c", table + "print(names)"], cwd=self.folder, capture_output=True, text=True)
            self.assertEqual((told.returncode, told.stdout), (0, "{1: 'white'}\n"), told.stderr)
            before = self.listing()
            parameters["chain"] = "--printer mimaki-3duj-553 ! dihter"
            with self.assertRaisesRegex(RuntimeError, "^vdbdither: no operator 'dihter'; did you mean 'dither'[?]$"):
                exec(node, {"hou": hou})
        self.assertEqual(self.listing(), before)


if __name__ == "__main__":
    unittest.main()
