#!/usr/bin/python3
"""Renders simulated prints side by side: the picture of the README, and figures 1 and 10 to 14 of the paper.

    samples/paper/pictures.py [WORK FOLDER] [RESULT FOLDER] [PART] [METHOD]

PART is token (for the README: images/prints.png beside the RESULT FOLDER), cube, sphere, relief, figurine, or all. Finished
pictures in the work folder are not repeated, except for METHOD. The program is the first `vdbdither` on the PATH.
"""

import pathlib
import subprocess
import sys

import matplotlib
from PIL import Image, ImageDraw, ImageFont

import parts
from methods import HERE, METHODS, RESULT, chain, file_name, program

COLUMNS = {"plain": "control", "interlaced": "interlacing", "the paper's dither": "blue noise 1.1", "the default": "the default"}
PROCESSES = {"droplets": "! simulate ! mesh-export {}", "smoothed": "! mesh-export {} --smooth taubin"}
LOW = ("--look", "staircase", "--brightness", "0.18")
DIFFUSE = ("--look", "area")
ROWS = {"droplets of 50 µm, light from the side": ("droplets", LOW), "droplets of 50 µm, light from above": ("droplets", DIFFUSE),
        "160 times smoothed, light from the side": ("smoothed", LOW)}
# The view, and the part of the picture that is shown: left, top, right, bottom, as shares.
VIEWS = {"token": (("--azimuth", "30", "--elevation", "45", "--pixel", "0.03mm"), (0.09, 0.085, 0.545, 0.885)),
         "cube": (("--pixel", "0.05mm"), (0, 0, 1, 1)), "sphere": (("--pixel", "0.035mm"), (0, 0, 1, 1)),
         "relief": (("--azimuth", "20", "--elevation", "55", "--pixel", "0.06mm"), (0, 0, 1, 1)),
         "figurine": (("--azimuth", "-35", "--elevation", "20", "--pixel", "0.05mm"), (0, 0, 1, 1))}
GREY, LABEL_HEIGHT, GAP = 120, 24, 4

work = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else "out/paper-pictures").resolve()
result = pathlib.Path(sys.argv[2]).resolve() if len(sys.argv) > 2 else RESULT
which = sys.argv[3] if len(sys.argv) > 3 else "all"
anew = sys.argv[4] if len(sys.argv) > 4 else None
if which not in (*VIEWS, "all"):
    raise SystemExit(f"pictures: unknown part '{which}'; use {', '.join(VIEWS)} or all")
work.mkdir(parents=True, exist_ok=True)
font = ImageFont.truetype(matplotlib.get_data_path() + "/fonts/ttf/DejaVuSans.ttf", 14)


def renewed(part, name, process, looks):
    """Returns the files of the pictures of one print under several lights. Makes them if one is missing."""
    files = [f"{file_name(f'{part}-{process}-{name}')}-{look[1]}.png" for look in looks]
    if name == anew or not all((work / file).exists() for file in files):
        mesh = f"{part}-print.ply"
        chain(work, f"{part}.stl", METHODS[name], PROCESSES[process].format(mesh), "--overwrite")
        for file, look in zip(files, looks):
            program(work, "render", mesh, file, "--frame", f"{part}.stl", *VIEWS[part][0], *look, "--samples", "32", "--quiet",
                    "--overwrite")
        (work / mesh).unlink()
    return files


def shown(part, file):
    """Returns the shown part of a picture, on grey."""
    with Image.open(work / file) as picture:
        picture = picture.convert("RGBA")
    ground = Image.new("RGBA", picture.size, (GREY, GREY, GREY, 255))
    ground.alpha_composite(picture)
    box = [round(share * picture.size[n % 2]) for n, share in enumerate(VIEWS[part][1])]
    return ground.convert("L").crop(box)


def side_by_side(part, rows, path):
    pictures = [[shown(part, file) for file in row] for row in rows.values()]
    width, height = pictures[0][0].size
    many = len(rows) > 1
    row_height = height + (LABEL_HEIGHT if many else 0)
    sheet = Image.new("L", (len(COLUMNS) * (width + GAP) - GAP, LABEL_HEIGHT + len(rows) * (row_height + GAP) - GAP), 255)
    pen = ImageDraw.Draw(sheet)
    for column, label in enumerate(COLUMNS):
        pen.text((column * (width + GAP) + width / 2, LABEL_HEIGHT / 2), label, 0, font, anchor="mm")
    for row, label in enumerate(rows):
        top = LABEL_HEIGHT + row * (row_height + GAP)
        if many:
            pen.text((2, top + LABEL_HEIGHT / 2), label, 0, font, anchor="lm")
        for column, picture in enumerate(pictures[row]):
            sheet.paste(picture, (column * (width + GAP), top + row_height - height))
    path.parent.mkdir(parents=True, exist_ok=True)
    sheet.quantize(64, dither=Image.Dither.NONE).save(path, optimize=True)
    print(f"{path}: {path.stat().st_size / 1024:.0f} KB", flush=True)


def draw(part):
    if part == "token":
        subprocess.run([sys.executable, HERE.parent / "make_part.py", work / "token.stl"], check=True)
        files = [renewed(part, name, "droplets", [LOW])[0] for name in COLUMNS.values()]
        side_by_side(part, {"": files}, result.parent / "images/prints.png")
        return
    parts.write_stl(work / f"{part}.stl", parts.PARTS[part]())
    made = {(name, process): renewed(part, name, process, [look for of, look in ROWS.values() if of == process])
            for process in PROCESSES for name in COLUMNS.values()}
    rows = {label: [next(file for file in made[name, process] if file.endswith(f"-{look[1]}.png")) for name in COLUMNS.values()]
            for label, (process, look) in ROWS.items()}
    side_by_side(part, rows, result / f"pictures-{part}.png")


for part in VIEWS if which == "all" else [which]:
    draw(part)
