"""Manuals and completion, which are made from the declarations of operators."""

import re
import shutil
import subprocess
import unittest

from program import PROGRAM, ROOT, ProgramTest


def operators():
    return sorted(link.name for link in (PROGRAM.parent / "operators").iterdir())


TOOLS = ("merge", "piece", "plan", "preview", "printers", "ssim", "verify")


class Manual(ProgramTest):
    def test_the_overview_fits_a_screen(self):
        lines = self.succeed("--help").decode().splitlines()
        self.assertLessEqual(len(lines), 24)
        self.assertLessEqual(max(map(len, lines)), 80)

    def test_help_all_has_a_line_for_every_verb(self):
        said = self.succeed("help", "all").decode()
        for name in [*operators(), *TOOLS]:
            self.assertRegex(said, rf"(?m)^{name} +\S")

    def test_the_committed_pages_are_those_of_the_program(self):
        self.succeed("docs", "markdown", "made")
        made = {path.name: path.read_text() for path in (self.folder / "made").iterdir()}
        kept = {path.name: path.read_text() for path in (ROOT / "docs/operators").iterdir()}
        self.assertEqual(sorted(made), sorted(kept), "renew them: cmake --build build/release --target docs")
        for name, text in made.items():
            self.assertEqual(kept[name], text, f"{name} is stale; renew it: cmake --build build/release --target docs")

    def test_the_page_on_formats_shows_them_as_they_are(self):
        page = (ROOT / "docs/writing-a-format.md").read_text()
        sources = [(ROOT / "io" / name).read_text() for name in ("mesh/off.cpp", "stack/png8.cpp")]
        pieces = re.findall(r"```cpp\n(.*?)```", page, re.DOTALL)
        self.assertGreater(len(pieces), 5)
        for piece in pieces:
            self.assertTrue(any(piece in source for source in sources), piece)

    def test_every_verb_has_a_manual_page_that_man_accepts(self):
        self.succeed("docs", "man", "man")
        self.assertEqual(sorted(path.name for path in (self.folder / "man").iterdir()),
                         sorted([f"vdbdither-{name}.1" for name in [*operators(), *TOOLS]] + ["vdbdither.1"]))
        if not shutil.which("groff"):
            self.skipTest("groff is not installed")
        for page in (self.folder / "man").iterdir():
            done = subprocess.run(["groff", "-man", "-ww", "-Tutf8", page], capture_output=True, text=True)
            self.assertEqual((done.returncode, done.stderr), (0, ""), page.name)

    def completed(self, *words):
        """Returns the completions of bash for the last of these words."""
        self.succeed("docs", "completion", "share")
        script = self.folder / "share/bash-completion/completions/vdbdither"
        line = f"source {script}; COMP_WORDS=(\"$@\"); COMP_CWORD=$(($# - 1)); _vdbdither; printf '%s\\n' \"${{COMPREPLY[@]}}\""
        done = subprocess.run(["bash", "-c", line, "bash", "vdbdither", *words], capture_output=True, text=True,
                              env=self.environment(), cwd=self.folder)
        self.assertEqual((done.returncode, done.stderr), (0, ""), words)
        return done.stdout.split()

    def test_bash_completes_operators_options_choices_printers_and_files(self):
        self.assertEqual(self.completed("mesh2"), ["mesh2sdf"])
        self.assertIn("slice-export", self.completed("mesh2sdf", "part.stl", "!", "sl"))
        self.assertEqual(self.completed("dither", "--disp"), ["--displaced"])
        self.assertEqual(self.completed("read", "a.vdb", "!", "dither", "--at", ""),
                         ["closest", "foot", "voxel"])
        self.assertEqual(self.completed("mesh2sdf", "part.stl", "--printer", "longer"), ["longer-orange-4k"])
        self.assertEqual(self.completed("help", "prin"), ["printers"])
        (self.folder / "part.stl").touch()
        self.assertEqual(self.completed("mesh2sdf", "par"), ["part.stl"])

    def test_zsh_and_fish_accept_their_completion(self):
        self.succeed("docs", "completion", "share")
        scripts = {"zsh": "zsh/site-functions/_vdbdither", "fish": "fish/vendor_completions.d/vdbdither.fish"}
        ran = False
        for shell, script in scripts.items():
            self.assertTrue((self.folder / "share" / script).read_text())
            if shutil.which(shell):
                ran = True
                done = subprocess.run([shell, "-n", self.folder / "share" / script], capture_output=True, text=True)
                self.assertEqual((done.returncode, done.stderr), (0, ""), shell)
        if not ran:
            self.skipTest("neither zsh nor fish is installed")

    def test_what_the_manuals_are_is_told(self):
        self.refuse(2, "kind: 'html' is not accepted; choose markdown, man or completion", "docs", "html", "out")


if __name__ == "__main__":
    unittest.main()
