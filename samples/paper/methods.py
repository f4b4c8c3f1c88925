"""Shared by the scripts of the figures of the paper: the methods, and running a chain."""

import os
import pathlib
import subprocess

PRINTER = "mimaki-3duj-553"

PAPER = "dither --preset paper"
BLUE = f"{PAPER} --size 64 --sigma"

# By name: the options of mesh2sdf, and the stages between mesh2sdf and the print.
METHODS = {
    "control": ([], "dither --mask none"),
    "interlacing": (["--refine-y", "2"], "interlace"),
    "white noise": ([], f"{PAPER} --mask white"),
    "blue noise 2.5": ([], f"{BLUE} 2.5"),
    "blue noise 1.1": ([], f"{BLUE} 1.1"),
    "the default": ([], "dither"),
}

HERE = pathlib.Path(__file__).resolve().parent
RESULT = HERE.parents[1] / "docs/paper"


def file_name(words):
    return words.replace(" ", "-").replace(",", "")


def program(folder, *words):
    """Runs the first `vdbdither` on the PATH in `folder`. Returns its standard output."""
    return subprocess.run(["vdbdither", *map(str, words)], cwd=folder, check=True, stdout=subprocess.PIPE,
                          env={**os.environ, "LC_ALL": "C.UTF-8"}).stdout


def chain(folder, mesh, method, *rest, pitch=None):
    """Runs mesh2sdf ! the method ! `rest`, where `rest` is text."""
    refine, step = method
    lattice = ["--pitch", pitch] if pitch else ["--printer", PRINTER]
    return program(folder, "mesh2sdf", mesh, *lattice, *refine, "!", *step.split(), *" ".join(rest).split(), "--quiet")
