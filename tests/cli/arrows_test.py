"""Includes go ops -> io -> vdbdither and ops -> ops/kernels -> vdbdither/model, and never form a circle between families."""

import graphlib
import pathlib
import re
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]


def included(path):
    """Returns the files of the project that a source includes."""
    return re.findall(r'^\s*#\s*include\s*["<]((?:vdbdither|io|ops|tests)/[^">]+)', path.read_text(), re.MULTILINE)


def sources(folder, below=True):
    """Returns the sources in a folder and, if `below`, in the folders below it."""
    found = [path for path in sorted((ROOT / folder).glob("**/*" if below else "*")) if path.suffix in (".h", ".cpp")]
    return found


def families(folder):
    return sorted(path.name for path in (ROOT / folder).iterdir() if path.is_dir())


class Arrows(unittest.TestCase):
    def assert_includes(self, folder, *allowed, below=True):
        """Checks that every include in `folder` begins with one of `allowed`."""
        paths = sources(folder, below)
        self.assertTrue(paths)
        for path in paths:
            for name in included(path):
                self.assertTrue(name.startswith(allowed), f"{path.relative_to(ROOT)} includes {name}")

    def assert_no_circle(self, folder):
        """Checks that the families of a folder include each other in one direction."""
        arrows = {}
        for family in families(folder):
            named = {name for path in sources(f"{folder}/{family}") for name in included(path)}
            arrows[family] = {name.split("/")[-2] for name in named if name.startswith(folder + "/")} - {family}
        self.assertGreater(len(arrows), 4)
        try:
            list(graphlib.TopologicalSorter(arrows).static_order())
        except graphlib.CycleError as error:
            self.fail(f"{folder}: the families {' -> '.join(error.args[1])} form a circle")

    def test_the_model_knows_nothing_above_it(self):
        self.assert_includes("vdbdither/model", "vdbdither/model/")

    def test_the_engine_knows_no_operator_and_no_format(self):
        self.assert_includes("vdbdither/engine", "vdbdither/engine/", "vdbdither/model/")

    def test_the_program_knows_no_operator(self):
        self.assert_includes("vdbdither/program", "vdbdither/", "io/")

    def test_io_knows_no_operator_and_no_program(self):
        self.assert_includes("io", "io/", "vdbdither/engine/", "vdbdither/model/")

    def test_operators_include_no_operator(self):
        self.assert_includes("ops", "ops/kernels/", "io/", "vdbdither/engine/", "vdbdither/model/", below=False)

    def test_operators_have_no_headers(self):
        self.assertEqual([path.name for path in sources("ops", below=False) if path.suffix == ".h"], [])

    def test_kernels_know_no_pipeline(self):
        beyond = ("find_grid", "layers", "schema", "slab")
        self.assert_includes("ops/kernels", "ops/kernels/", "vdbdither/model/")
        for path in sources("ops/kernels"):
            for name in included(path):
                self.assertNotIn(pathlib.Path(name).stem, beyond, path)

    def test_every_source_lives_in_a_family(self):
        for folder in ("vdbdither", "io", "ops/kernels"):
            self.assertEqual(sources(folder, below=False), [])

    def test_kernel_families_form_no_circle(self):
        self.assert_no_circle("ops/kernels")

    def test_io_families_form_no_circle(self):
        self.assert_no_circle("io")

    def test_nothing_but_tests_includes_tests(self):
        for folder in ("vdbdither", "io", "ops"):
            for path in sources(folder):
                self.assertFalse([name for name in included(path) if name.startswith("tests/")], path)


if __name__ == "__main__":
    unittest.main()
