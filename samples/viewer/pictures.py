#!/usr/bin/python3
"""Makes a page of a coloured part and takes the pictures of docs/viewer.md in Chromium.

    samples/viewer/pictures.py MESH [TEXTURE] [RESULT FOLDER]

The RESULT FOLDER is docs/images by default. The program is the first `vdbdither` on the PATH. The pictures of the documents
show spot (Keenan Crane, public domain).
"""

import io
import pathlib
import subprocess
import sys
import tempfile
import time

from PIL import Image
from selenium import webdriver
from selenium.webdriver.chrome.service import Service

HERE = pathlib.Path(__file__).resolve().parent
# What is done with the page before a picture is taken.
PICTURES = {
    "viewer-light.png": ["viewer.setTheme('light')", "viewer.setCursor(0.79 * viewer.page.size[0], 0.57 * viewer.page.size[1])",
                         "viewer.showVoxels()", "viewer.setZoom(viewer.state.zoom / 5)"],
    "viewer-dark.png": ["viewer.setTheme('dark')", "viewer.setMain('solid')"],
}


def make_page(work, mesh, texture):
    chain = ["mesh2sdf", mesh, *(("--texture", texture) if texture else ()), "--fit", "40mm", "--rotate", "90,0,0",
             "--printer", "mimaki-3duj-553", "--colour", "!", "dither", "!", "halftone", "!", "slice-export", work / mesh.stem,
             "--page", work / "page.html", "--quiet"]
    subprocess.run(["vdbdither", *map(str, chain)], check=True)
    return work / "page.html"


def main():
    if not 2 <= len(sys.argv) <= 4:
        raise SystemExit("usage: samples/viewer/pictures.py MESH [TEXTURE] [RESULT FOLDER]")
    mesh = pathlib.Path(sys.argv[1])
    texture = sys.argv[2] if len(sys.argv) > 2 else None
    result = pathlib.Path(sys.argv[3]) if len(sys.argv) > 3 else HERE.parents[1] / "docs/images"
    options = webdriver.ChromeOptions()
    options.binary_location = "/usr/bin/chromium"
    for argument in ("--headless=new", "--no-sandbox", "--enable-unsafe-swiftshader", "--window-size=1280,860"):
        options.add_argument(argument)
    with tempfile.TemporaryDirectory() as folder:
        page = make_page(pathlib.Path(folder), mesh, texture)
        browser = webdriver.Chrome(service=Service("/usr/bin/chromedriver"), options=options)
        try:
            for name, scripts in PICTURES.items():
                browser.get(page.as_uri())
                while not browser.execute_script("return document.body.dataset.ready !== undefined"):
                    time.sleep(0.1)
                for script in scripts:
                    browser.execute_script(script)
                time.sleep(1)
                browser.execute_async_script(
                    "const done = arguments[0]; (function wait() { if (viewer.sectionsRead()) done(); else setTimeout(wait, 100); })()")
                time.sleep(1)
                picture = Image.open(io.BytesIO(browser.get_screenshot_as_png())).convert("RGB")
                picture.save(result / name, optimize=True)
                print(f"picture   {result / name}")
        finally:
            browser.quit()


if __name__ == "__main__":
    main()
