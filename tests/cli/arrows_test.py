"""The folders include one another only along ops -> io -> vdbdither and ops -> ops/kernels."""

import pathlib
import re
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]


def included(path):
    """The files of the project that a source names in its includes."""
    return re.findall(r'^\s*#\s*include\s*["<]((?:vdbdither|io|ops|commands|tests)/[^">]+)', path.read_text(), re.MULTILINE)


def sources(folder):
    return [path for path in sorted((ROOT / folder).iterdir()) if path.suffix in (".h", ".cpp")]


class Arrows(unittest.TestCase):
    def assert_includes(self, folder, *allowed, but=()):
        """Every include of every source in `folder` begins with one of `allowed`."""
        paths = [path for path in sources(folder) if path.name not in but]
        self.assertTrue(paths)
        for path in paths:
            for name in included(path):
                self.assertTrue(name.startswith(allowed), f"{path.relative_to(ROOT)} includes {name}")

    def test_the_engine_knows_no_operator_and_no_format(self):
        # main.cpp is where the engine meets the file system.
        self.assert_includes("vdbdither", "vdbdither/", but=("main.cpp",))

    def test_the_main_program_knows_no_operator(self):
        self.assertEqual([name for name in included(ROOT / "vdbdither/program/main.cpp") if name.startswith("ops/")], [])

    def test_io_knows_no_operator(self):
        self.assert_includes("io", "io/", "vdbdither/")

    def test_operators_include_no_operator(self):
        self.assert_includes("ops", "ops/kernels/", "io/", "vdbdither/")

    def test_commands_know_no_operator(self):
        self.assert_includes("commands", "commands/", "ops/kernels/", "io/", "vdbdither/")

    def test_operators_have_no_headers(self):
        self.assertEqual([path.name for path in sources("ops") if path.suffix == ".h"], [])

    def test_kernels_know_no_pipeline(self):
        vocabulary = ("errors", "grid", "lattice", "mesh", "openvdb", "visit_grid")
        self.assert_includes("ops/kernels", "ops/kernels/", *(f"vdbdither/{name}.h" for name in vocabulary))

    def test_nothing_but_tests_includes_tests(self):
        for folder in ("vdbdither", "io", "ops", "ops/kernels", "commands"):
            for path in sources(folder):
                self.assertFalse([name for name in included(path) if name.startswith("tests/")], path)


if __name__ == "__main__":
    unittest.main()
