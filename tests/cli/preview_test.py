"""The page of preview: what it shows in a browser, and its refusals."""

import json
import os
import pathlib
import random
import shutil
import time
import unittest

import meshes
from PIL import Image
from program import MIMAKI, ProgramTest

try:
    from selenium import webdriver
    from selenium.webdriver.chrome.service import Service
    from selenium.webdriver.common import utils
    from selenium.webdriver.common.keys import Keys

    class Driver(Service):
        """Is reached also where the name "localhost" has no address, as in a container without /etc/hosts."""

        service_url = property(lambda self: f"http://127.0.0.1:{self.port}")

        def is_connectable(self):
            return utils.is_connectable(self.port, "127.0.0.1")
except ImportError:
    webdriver = None

RED, GREEN, BLUE, NONE = (220, 30, 40), (20, 160, 60), (30, 60, 200), (0, 0, 0)
ADDED, REMOVED, CHANGED, SAME = (43, 158, 88), (222, 72, 72), (139, 92, 246), (150, 158, 168)
STAGE = {"light": (198, 206, 215), "dark": (42, 48, 56)}
SLICES = [
    # Rows from the top; the column and row of a letter are those of its voxel.
    ["RRGG", "RR..", "BBBB"],
    ["RRGG", "R.G.", "BBRB"],
    ["RRRR", "....", "BBBB"],
]
COLOURS = {"R": RED, "G": GREEN, "B": BLUE, ".": NONE}


class Pages(ProgramTest):
    def make_stack(self, name, slices, pitch="0.1,0.2,0.05"):
        images = self.folder / f"{name}-images"
        images.mkdir()
        for z, rows in enumerate(slices):
            image = Image.new("RGB", (len(rows[0]), len(rows)))
            image.putdata([COLOURS[letter] for row in rows for letter in row])
            image.save(images / f"{z:03}.png")
        self.succeed("slice-import", images, "--pitch", pitch, "--materials", "palette", "!", "slice-export", name)


class Files(Pages):
    def test_slice_export_writes_the_same_page(self):
        meshes.write_stl(self.folder / "part.stl", meshes.sphere(1.2))
        self.succeed("mesh2sdf", "part.stl", *MIMAKI, "!", "dither", "!", "material-assign", "--shell", "0.3mm:white", "--core", "clear",
                     "!", "slice-export", "out", "--page", "exported.html")
        self.succeed("preview", "out")
        page = (self.folder / "out.html").read_bytes()
        self.assertEqual(page, (self.folder / "exported.html").read_bytes())
        self.assertIn(b"0.022", page)
        os.rename(self.folder / "out.html", self.folder / "before.html")
        os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
        self.succeed("preview", "out/manifest.json")
        self.assertEqual(page, (self.folder / "out.html").read_bytes())

    def test_refusals_say_what_to_do(self):
        self.make_stack("out", SLICES)
        self.make_stack("finer", SLICES, "0.1,0.1,0.05")
        self.refuse(2, "'page.txt' must end in .html", "preview", "out", "page.txt")
        self.refuse(1, "'finer' has another pitch or origin than 'out'; make both stacks for one printer",
                    "preview", "out", "--against", "finer")
        self.refuse(1, "no such file or folder", "preview", "nothing")
        self.refuse(2, "'page.htm' must end in .html", "slice-import", "out", "!", "slice-export", "again", "--page", "page.htm")
        self.refuse(2, "--page: './out/page.html' lies in the stack, which holds slices only",
                    "slice-import", "finer", "!", "slice-export", "out", "--page", "./out/page.html", "--overwrite")
        self.succeed("preview", "out")
        self.refuse(2, "--overwrite", "preview", "out")
        self.refuse(2, "--overwrite", "slice-import", "out", "!", "slice-export", "again", "--page", "out.html")
        self.succeed("preview", "out", "--overwrite")

    def test_a_stack_that_does_not_tell_materials_apart_has_one(self):
        self.make_stack("out", SLICES)
        self.succeed("slice-import", "out", "!", "slice-export", "grey", "--format", "png8")
        self.succeed("preview", "grey")
        text = (self.folder / "grey.html").read_text().split('id="stack">')[1].split("</script>")[0]
        page = json.loads(text)
        self.assertEqual([material["name"] for material in page["materials"]], ["printed"])
        self.assertEqual(page["stacks"][0]["voxels"], [sum(letter != "." for rows in SLICES for row in rows for letter in row)])


@unittest.skipUnless(webdriver and shutil.which("chromium") and shutil.which("chromedriver"), "chromium and selenium are not installed")
class Browser(Pages):
    @classmethod
    def setUpClass(cls):
        options = webdriver.ChromeOptions()
        options.binary_location = shutil.which("chromium")
        for argument in ("--headless=new", "--no-sandbox", "--disable-dev-shm-usage", "--enable-unsafe-swiftshader", "--remote-debugging-pipe",
                         "--window-size=1200,800", f"--user-data-dir={cls.folder_of_class()}"):
            options.add_argument(argument)
        options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
        cls.browser = webdriver.Chrome(service=Driver(shutil.which("chromedriver")), options=options)
        cls.addClassCleanup(cls.browser.quit)

    def open(self, name):
        self.browser.get(pathlib.Path(self.folder / name).as_uri())
        self.wait_for("return document.body.dataset.ready !== undefined")

    def run_script(self, script, *arguments):
        return self.browser.execute_script(script, *arguments)

    def wait_for(self, script):
        deadline = time.monotonic() + 30
        while not self.run_script(script):
            self.assertLess(time.monotonic(), deadline, script)
            time.sleep(0.02)

    def settle(self):
        """Waits until the slice and the mode that were asked for last are drawn."""
        self.browser.execute_async_script("const done = arguments[0]; requestAnimationFrame(() => requestAnimationFrame(() => setTimeout(done, 30)))")
        self.wait_for("const {slice, mode} = document.querySelector('#view-xy canvas').dataset;"
                      "return Number(slice) === viewer.state.slice && mode === viewer.state.mode")

    def pixels(self, places, view="xy"):
        """Returns the colours in voxels, beside the lines through their middle."""
        self.settle()
        return [tuple(colour) for colour in self.run_script(
            "const context = document.querySelector(`#view-${arguments[0]} canvas`).getContext('2d');"
            "return arguments[1].map((place) => [...context.getImageData(...viewer.pixelOf(arguments[0], ...place), 1, 1).data].slice(0, 3))",
            view, [(across - 0.3, along - 0.3) for across, along in places])]

    def pixel(self, across, along):
        return self.pixels([(across, along)])[0]

    def press(self, key):
        self.browser.switch_to.active_element.send_keys(key)
        self.settle()

    def check_silence(self):
        """Checks that the page wrote nothing to the console and asked for no other file."""
        # Where a processor draws in place of a graphics card, Chromium says that this takes time.
        said = [entry for entry in self.browser.get_log("browser") if "GPU stall due to ReadPixels" not in entry["message"]]
        self.assertEqual(said, [])
        self.assertEqual(self.run_script("return performance.getEntriesByType('resource').map((entry) => entry.name)"), [])

    def check_view(self, expected, view="xy"):
        """Checks the colours of a view, which are given row by row."""
        places = [(x, y) for y, row in enumerate(expected) for x in range(len(row))]
        self.assertEqual(self.pixels(places, view), [colour for row in expected for colour in row])

    def test_voxels_have_the_colours_of_their_materials_and_differences(self):
        self.make_stack("out", SLICES)
        self.make_stack("other", [["RRGG", "RR..", "B..B"], ["GGRR", "RRRR", "BBRB"], ["RRRR", "....", "BBBB"]])
        self.succeed("preview", "out", "--against", "other")
        self.open("out.html")
        colours = {**COLOURS, ".": STAGE["light"]}
        self.run_script("viewer.setTheme('light'); viewer.setSlice(0)")
        for z, rows in enumerate(SLICES):
            self.run_script("viewer.setSlice(arguments[0])", z)
            self.check_view([[colours[letter] for letter in row] for row in rows])
        self.run_script("viewer.setSlice(1); viewer.setCursor(2, 1)")
        # The front shows row 1 of every slice, the highest at the top; the side shows column 2, its last row first.
        self.wait_for("return viewer.sectionsRead()")
        self.check_view([[colours[letter] for letter in rows[1]] for rows in reversed(SLICES)], "xz")
        self.check_view([[colours[row[2]] for row in reversed(rows)] for rows in reversed(SLICES)], "yz")

        self.run_script("viewer.setMode('below')")
        self.check_view([[SAME, SAME, SAME, SAME], [SAME, REMOVED, ADDED, STAGE["light"]], [SAME, SAME, CHANGED, SAME]])
        shown = self.run_script("return [...document.querySelectorAll('#difference tbody tr')].map((row) => row.cells[1].textContent)")
        self.assertEqual(shown, ["1", "1", "1"])
        self.run_script("viewer.setMode('against')")
        self.check_view([[CHANGED] * 4, [SAME, REMOVED, CHANGED, REMOVED], [SAME] * 4])
        self.run_script("viewer.setMode('other')")
        self.check_view([[colours[letter] for letter in row] for row in ("GGRR", "RRRR", "BBRB")])

        self.run_script("viewer.setMode('materials'); viewer.setSlice(0)")
        self.press("1")
        self.assertEqual(self.pixel(0, 0), STAGE["light"])
        self.assertEqual(self.pixel(2, 0), GREEN)
        self.assertFalse(self.run_script("return document.querySelectorAll('#materials input')[0].checked"))
        self.browser.find_elements("css selector", "#materials input")[0].click()
        self.assertEqual(self.pixel(0, 0), RED)
        counts = self.run_script("return [...document.querySelectorAll('#materials tbody tr')].map((row) => [...row.cells].map((cell) => cell.textContent))")
        self.assertEqual([row[1:3] for row in counts], [["4", "12"], ["2", "5"], ["4", "11"], ["10", "28"]])
        self.assertEqual(counts[3][3], f"{28 * 0.1 * 0.2 * 0.05 / 1000:.1e}".replace("e-05", "e-5"))
        self.check_silence()

    def test_the_script_unpacks_what_was_packed(self):
        # Large even areas, rims with grain, and areas of noise.
        chance = random.Random(1)

        def letter(x, y, z):
            distance = (x - 35) ** 2 + 2 * (y - 20) ** 2 + (z - 18) ** 2
            if distance > 700 + chance.randrange(200):
                return "."
            return chance.choice("RRRG") if x > 40 else "B" if y > 22 else "R"

        stacks = {name: [["".join(letter(x, y, z) for x in range(75)) for y in range(40)] for z in range(36)] for name in ("out", "other")}
        for name, slices in stacks.items():
            self.make_stack(name, slices)
        self.succeed("preview", "out", "--against", "other")
        self.open("out.html")
        named = {colour: letter for letter, colour in COLOURS.items()}
        letters = "." + "".join(named[tuple(material["rgba"][:3])] for material in self.run_script("return viewer.page.materials"))
        for stack, name in enumerate(("out", "other")):
            for z, rows in enumerate(stacks[name]):
                found = self.browser.execute_async_script("viewer.valuesOf(arguments[0], arguments[1]).then(arguments[2])", stack, z)
                self.assertEqual(["".join(letters[value] for value in row) for row in found], rows, (name, z))

    def test_keys_wheels_fingers_and_buttons_lead_through_the_page(self):
        self.make_stack("out", SLICES * 12)
        self.succeed("preview", "out")
        self.open("out.html")
        state = lambda name: self.run_script("return viewer.state[arguments[0]]", name)
        self.press(Keys.HOME)
        self.assertEqual(state("slice"), 0)
        for key, slice in ((Keys.ARROW_UP, 1), (Keys.PAGE_UP, 17), (Keys.END, 35), (Keys.ARROW_DOWN, 34), (Keys.PAGE_DOWN, 18)):
            self.press(key)
            self.assertEqual(state("slice"), slice)
        self.assertEqual(self.run_script("return document.getElementById('number').value"), "18")
        canvas = self.browser.find_element("css selector", "#view-xy canvas")
        webdriver.ActionChains(self.browser).scroll_from_origin(
            webdriver.common.actions.wheel_input.ScrollOrigin.from_element(canvas), 0, 120).perform()
        self.settle()
        self.assertEqual(state("slice"), 16)
        self.browser.find_element("id", "up").click()
        self.settle()
        self.assertEqual(state("slice"), 17)

        middle = {key: canvas.rect[key] for key in ("x", "y", "width", "height")}
        x, y = middle["x"] + middle["width"] / 2, middle["y"] + middle["height"] / 2

        def touch(kind, *places):
            self.browser.execute_cdp_cmd("Input.dispatchTouchEvent", {"type": kind, "touchPoints": [{"x": x + by, "y": y, "id": i} for i, by in enumerate(places)]})

        touch("touchStart", -50, 50)
        touch("touchMove", -75, 75)
        touch("touchMove", -100, 100)
        touch("touchEnd")
        self.assertAlmostEqual(state("zoom"), 2, delta=0.3)
        self.press("0")
        self.assertEqual(state("zoom"), 1)
        self.press("z")
        self.assertGreater(self.run_script("const [a] = viewer.pixelOf('xy', 0, 0), [b] = viewer.pixelOf('xy', 1, 0); return b - a"), 20)
        # A voxel is twice as long as it is wide.
        ratio = self.run_script("const [a, c] = viewer.pixelOf('xy', 0, 0), [b, d] = viewer.pixelOf('xy', 100, 100); return (d - c) / (b - a)")
        self.assertAlmostEqual(ratio, 2, delta=0.01)
        self.press("0")
        before = state("centre")
        webdriver.ActionChains(self.browser).drag_and_drop_by_offset(canvas, 40, 0).perform()
        self.assertLess(state("centre")[0], before[0])

        for theme in ("light", "dark"):
            self.press("t")
            self.assertEqual(self.run_script("return document.documentElement.dataset.theme"), theme)
            self.run_script("viewer.showAll()")
            self.assertEqual(self.pixel(-2, 1), STAGE[theme])
        for main in ("xz", "yz", "solid", "xy"):
            self.press("v")
            self.assertEqual(self.run_script("return document.querySelector('.view.main').id"), f"view-{main}")
        self.press("d")
        self.assertEqual(state("mode"), "below")
        self.press("x")
        self.assertTrue(state("cut"))
        self.press("?")
        self.assertTrue(self.run_script("return document.getElementById('keys').open"))
        self.press(Keys.ESCAPE)
        unnamed = self.run_script(
            "return [...document.querySelectorAll('button, input, select, canvas')].filter((element) =>"
            "  !(element.getAttribute('aria-label') || element.textContent.trim() || (element.labels && element.labels.length)))"
            ".map((element) => element.outerHTML)")
        self.assertEqual(unnamed, [])
        self.check_silence()

    def test_the_part_is_drawn_in_three_dimensions_or_a_sentence_says_why_not(self):
        self.make_stack("out", [["." * 24] + ["...." + "R" * 16 + "...."] * 8 + ["." * 24]] * 32)
        self.succeed("preview", "out")
        self.open("out.html")
        self.settle()
        script = """
            const source = document.querySelector("#view-solid canvas"), copy = document.createElement("canvas");
            copy.width = source.width; copy.height = source.height;
            copy.getContext("2d").drawImage(source, 0, 0);
            const data = copy.getContext("2d").getImageData(0, 0, copy.width, copy.height).data;
            let red = 0;
            for (let i = 0; i < data.length; i += 4) if (data[i] > 2 * data[i + 1] && data[i] > 2 * data[i + 2]) ++red;
            return red / (data.length / 4);"""
        self.wait_for(f"return (() => {{{script}}})() > 0.02")
        self.assertLess(self.run_script(script), 0.9)
        self.press("1")
        self.wait_for(f"return (() => {{{script}}})() === 0")
        self.check_silence()
        added = self.browser.execute_cdp_cmd("Page.addScriptToEvaluateOnNewDocument", {"source":
            "const of = HTMLCanvasElement.prototype.getContext;"
            "HTMLCanvasElement.prototype.getContext = function(kind, ...rest) { return kind === 'webgl2' ? null : of.call(this, kind, ...rest); };"})
        self.addCleanup(self.browser.execute_cdp_cmd, "Page.removeScriptToEvaluateOnNewDocument", added)
        self.open("out.html")
        self.assertTrue(self.browser.find_element("css selector", "#view-solid .sorry").is_displayed())
        self.assertEqual(self.pixel(6, 3), RED)
        for key in ("v", "v", "v", "v", "x", "0", "z"):
            self.press(key)
        self.check_silence()

    def test_names_out_of_files_are_shown_as_they_are(self):
        self.make_stack("out", SLICES)
        hostile = "</script><img src=x onerror=\"document.title='broken'\"> &amp; '\x1b[31m"
        path = self.folder / "out/manifest.json"
        manifest = json.loads(path.read_text())
        manifest["materials"][0]["name"] = hostile
        manifest["history"] = [hostile]
        path.write_text(json.dumps(manifest))
        done = self.run_program("preview", "out", "--edited")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.open("out.html")
        self.settle()
        self.assertEqual(self.run_script("return document.querySelector('#materials tbody label').textContent"), hostile)
        self.assertEqual(self.run_script("return document.querySelector('#history li').textContent"), hostile)
        self.assertEqual(self.run_script("return document.images.length"), 0)
        self.assertEqual(self.browser.title, "out – slices")
        self.check_silence()


if __name__ == "__main__":
    unittest.main()
