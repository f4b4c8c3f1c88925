"""The example in the help of every operator runs."""

import unittest

import meshes
from program import PROGRAM, ProgramTest


class Examples(ProgramTest):
    def test_the_example_of_every_operator_runs_beside_a_part(self):
        links = sorted((PROGRAM.parent / "operators").iterdir())
        self.assertGreater(len(links), 5)
        for link in links:
            with self.subTest(operator=link.name):
                # Each in a folder with nothing but a part.
                self.doCleanups()
                super().setUp()
                meshes.write_stl(self.folder / "part.stl", meshes.sphere(0.8))
                help_text = self.succeed("help", link.name).decode()
                example = help_text.split("Example:\n")[1].strip()
                self.assertTrue(example.startswith("vdbdither "), example)
                self.shell(example)
                self.assertGreater(len(self.listing()), 1, "it makes something")


if __name__ == "__main__":
    unittest.main()
