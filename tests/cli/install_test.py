"""Files installed by `cmake --install` work from their prefix."""

import subprocess
import unittest

import meshes
import stack
from program import MIMAKI, PROGRAM, ProgramTest

CONSUMER = {
    "CMakeLists.txt": """
        cmake_minimum_required(VERSION 3.25)
        project(consumer LANGUAGES CXX)
        set(CMAKE_CXX_STANDARD 20)
        find_package(vdbdither 0.1 REQUIRED)
        add_executable(consumer consumer.cpp)
        target_link_libraries(consumer PRIVATE vdbdither::vdbdither)
        """,
    "consumer.cpp": """
        #include <cstdio>

        #include "vdbdither/model/lattice.h"
        #include "vdbdither/engine/registry.h"
        #include "vdbdither/engine/version.h"

        int main() {
          const vdbdither::Lattice lattice{{0.042, 0.084, 0.022}, {}, openvdb::CoordBBox({0, 0, 0}, {9, 9, 9})};
          std::printf("%s %d", vdbdither::version, lattice.layers().size());
          for (const auto* info : vdbdither::registeredOperators()) {
            if (info->make()) std::printf(" %.*s", static_cast<int>(info->name.size()), info->name.data());
          }
        }
        """,
}


class Install(ProgramTest):
    def setUp(self):
        super().setUp()
        self.prefix = self.folder / "prefix"
        self.call("cmake", "--install", PROGRAM.parent, "--prefix", self.prefix)

    def call(self, *command, **keywords):
        done = subprocess.run([*map(str, command)], capture_output=True, text=True, timeout=500, **keywords)
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        return done.stdout

    def test_the_installed_program_and_its_links_find_their_printers_and_mask(self):
        meshes.write_stl(self.folder / "part.stl", meshes.sphere(0.6))
        program = self.prefix / "bin/vdbdither"
        self.succeed("mesh2sdf", "part.stl", *MIMAKI, "!", "dither", "!", "slice-export", "out", program=program)
        stack.check(self.folder / "out")
        links = self.prefix / "libexec/vdbdither"
        self.succeed("part.stl", *MIMAKI, "-o", "a.vdb", program=links / "mesh2sdf")
        self.succeed("-i", "a.vdb", "-o", "b.vdb", program=links / "dither")
        self.succeed("-i", "b.vdb", "again", program=links / "slice-export")
        self.assertEqual(stack.sums(self.folder / "again"), stack.sums(self.folder / "out"))

    def test_manual_pages_and_completion_are_where_shells_look(self):
        share = self.prefix / "share"
        pages = {page.name for page in (share / "man/man1").iterdir()}
        self.assertLessEqual({"vdbdither.1", "vdbdither-slice-export.1", "vdbdither-printers.1"}, pages)
        for script in ("bash-completion/completions/vdbdither", "zsh/site-functions/_vdbdither",
                       "fish/vendor_completions.d/vdbdither.fish"):
            self.assertIn("slice-export", (share / script).read_text())

    def test_a_program_that_finds_the_package_links_every_operator(self):
        source = self.folder / "consumer"
        source.mkdir()
        for name, text in CONSUMER.items():
            (source / name).write_text(text)
        self.call("cmake", "-G", "Ninja", "-S", source, "-B", source / "build", f"-DCMAKE_PREFIX_PATH={self.prefix}")
        self.call("cmake", "--build", source / "build")
        names = sorted(link.name for link in (PROGRAM.parent / "operators").iterdir())
        version = self.succeed("--version").decode().split()[1]
        self.assertEqual(self.call(source / "build/consumer").split(), [version, "10", *names])


if __name__ == "__main__":
    unittest.main()
