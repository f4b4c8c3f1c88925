"""Tests the page of samples/report.py."""

import html.parser
import importlib.util
import re
import subprocess
import unittest

import meshes
from program import MIMAKI, ROOT, ProgramTest


class Addresses(html.parser.HTMLParser):
    """Collects the addresses on a page, and its tables as rows of text."""

    def __init__(self, text):
        super().__init__()
        self.addresses, self.rows = [], []
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        self.addresses += [value for name, value in attributes if name in ("src", "href")]
        if tag == "tr":
            self.rows.append([])

    def handle_data(self, data):
        if self.rows and data.strip():
            self.rows[-1].append(data)


@unittest.skipUnless(importlib.util.find_spec("matplotlib"), "matplotlib is not installed")
class Report(ProgramTest):
    def report(self, *arguments):
        return subprocess.run(["/usr/bin/python3", ROOT / "samples/report.py", *arguments], cwd=self.folder,
                              capture_output=True, text=True, timeout=120)

    def test_a_page_contains_all_measurements_and_needs_no_other_file(self):
        meshes.write_stl(self.folder / "part.stl", meshes.box((2, 2, 1)))
        self.succeed("render", "part.stl", "part.png", "-q")
        (self.folder / "run").mkdir()
        for name, mask in (("plain", "none"), ("a<b", "white")):
            self.succeed("mesh2sdf", "part.stl", *MIMAKI, "!", "dither", "--mask", mask, "!", "simulate", "!", "measure",
                         "--reference", "part.stl", "--margin", "0.2", "--report", f"run/{name}.json", "!", "render",
                         f"run/{name}.png", "--frame", "part.stl", "-q")
            (self.folder / f"run/{name}-look.json").write_bytes(self.succeed("ssim", "part.png", f"run/{name}.png", "--json"))
        done = self.report("page.html", "run")
        self.assertEqual((done.returncode, done.stderr), (0, ""))
        page = Addresses((self.folder / "page.html").read_text())
        # Two plots and two pictures.
        self.assertEqual(len(page.addresses), 4)
        for address in page.addresses:
            self.assertRegex(address, r"^data:image/png;base64,iVBOR")
        names = ["".join(row[:1]) for row in page.rows]
        self.assertEqual(names, ["run", "a<b", "plain", "run", "a<b-look", "plain-look"])
        for number in page.rows[1][1:9]:
            self.assertTrue(re.fullmatch(r"-?[\d.]+(e[-+]\d+)?", number), number)

    def test_unknown_files_are_refused(self):
        self.assertIn("usage: ", self.report("page.html").stderr)
        self.assertEqual(self.report("page.html", "none").stderr, "report: no such file or folder 'none'\n")
        (self.folder / "odd.json").write_text("[1]")
        done = self.report("page.html", "odd.json")
        self.assertEqual(done.returncode, 1)
        self.assertIn("'odd.json' is skipped: not from measure --report or ssim --json", done.stderr)
        self.assertIn("nothing to show", done.stderr)
        (self.folder / "broken.json").write_text("{")
        self.assertIn("'broken.json' is not valid JSON", self.report("page.html", "broken.json").stderr)
        self.assertFalse((self.folder / "page.html").exists())


if __name__ == "__main__":
    unittest.main()
