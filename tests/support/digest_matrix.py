#!/usr/bin/python3
"""Checks that chains give the same bytes in every way to run them: programs of several builds, instruction sets, numbers of
threads and slab heights; fused, piped, and by files.

    digest_matrix.py PROGRAM...

PROGRAM is the vdbdither of a build tree, with operators/ and share/ next to it. Prints a line for each program and instruction
set, and exits with 1 if any run differs from the first one.
"""

import hashlib
import itertools
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile

from PIL import Image

import meshes
from vdb_archive import digest_of_voxels

# Variables that hide the instructions from the program, and from the mathematical functions of the C library.
BASELINE = {"VDBDITHER_INSTRUCTIONS": "baseline", "GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX2,-FMA,-FMA4,-AVX512F"}
INSTRUCTIONS = {"best": {}, "baseline": BASELINE}

CHAINS = {
    "colour": ("mesh2sdf part.obj --texture texture.png --colour --printer stratasys-j750-27um", "normals", "dither",
               "halftone --size 32"),
    "masks": ("mesh2sdf part.obj --printer mimaki-3duj-553 --normals --band 0.3mm", "hollow --thickness 0.2mm",
              "dither --preset paper --size 16", "material-assign --shell 0.1mm:white,0.1mm:cyan --core clear"),
}
WAYS = ("fused", "piped", "filed")


def write_inputs(folder):
    """Writes part.obj and texture.png. Rounded, so that they do not depend on the mathematical functions of the machine."""
    blob = meshes.lathe([(0, 0), (0.7, 0.1), (0.45, 0.5), (0.6, 0.9), (0, 1.1)], 20)
    turned = meshes.turned(blob, 25, 35)
    meshes.write_textured(folder / "part.obj", [tuple(tuple(round(x, 4) for x in corner) for corner in t) for t in turned])
    ramp = Image.linear_gradient("L").resize((64, 64), Image.Resampling.NEAREST)
    Image.merge("RGB", (ramp, ramp.rotate(90), ramp.rotate(180).point(lambda x: x // 2))).save(folder / "texture.png")


def line_of(stages, way, common):
    """Returns the line of bash that writes out.vdb and the stack `out`."""
    sinks = f"write out.vdb --codec none ! slice-export out {common}"
    if way == "fused":
        return f"vdbdither {' ! '.join(stages)} ! {sinks}"
    if way == "piped":
        return " | ".join([*(f"{stage} {common}" for stage in stages), f"vdbdither read - ! {sinks}"])
    filed = [f"{stages[0]} {common} -o 0.vdb"]
    filed += [f"{stage} {common} -i {n}.vdb -o {n + 1}.vdb" for n, stage in enumerate(stages[1:])]
    return " && ".join([*filed, f"vdbdither read {len(stages) - 1}.vdb ! {sinks}"])


def digest(parts):
    return hashlib.sha256(b"".join(hashlib.sha256(part).digest() for part in parts)).hexdigest()


class Runs:
    """Runs of one program with one instruction set in `folder`, where they make their masks for themselves."""

    def __init__(self, program, instructions, folder):
        program = pathlib.Path(program).resolve()
        self.folder = folder
        folder.mkdir(parents=True)
        write_inputs(folder)
        self.environment = {**os.environ, "PATH": f"{program.parent}:{program.parent}/operators:/usr/bin:/bin",
                            "XDG_CACHE_HOME": str(folder / "cache"), **INSTRUCTIONS[instructions]}
        self.environment.pop("VDBDITHER_DATA", None)

    def digests(self, chain, way, slab, threads):
        """Returns the digest of every byte that a run writes, and that of its slices and voxels alone."""
        line = line_of(CHAINS[chain], way, f"--slab {slab} --threads {threads}")
        for path in [*self.folder.glob("*.vdb"), self.folder / "out"]:
            shutil.rmtree(path) if path.is_dir() else path.unlink(missing_ok=True)
        done = subprocess.run(["bash", "-o", "pipefail", "-c", line], cwd=self.folder, env=self.environment,
                              stdin=subprocess.DEVNULL, capture_output=True)
        if done.returncode or done.stderr:
            raise RuntimeError(f"{line}: exit {done.returncode}: {done.stderr.decode(errors='replace')}")
        files = sorted(path for path in (self.folder / "out").rglob("*") if path.is_file())
        slices = [path.read_bytes() for path in files if path.name.startswith("slice_")]
        volume = (self.folder / "out.vdb").read_bytes()
        names = [str(path.relative_to(self.folder)).encode() for path in files]
        assert len(set(slices)) > 20, f"{line}: {len(set(slices))} different slices"
        return (digest([*names, *(path.read_bytes() for path in files), volume]),
                digest([*slices, digest_of_voxels(volume).encode()]))


def main():
    programs = sys.argv[1:]
    if not programs:
        sys.exit(__doc__)
    first, differing = {}, 0
    settings = list(itertools.product(WAYS, (8, 24, "all"), (1, 2, 4)))
    for program, instructions, chain in itertools.product(programs, INSTRUCTIONS, CHAINS):
        with tempfile.TemporaryDirectory(prefix="vdbdither-digests-") as scratch:
            runs = Runs(program, instructions, pathlib.Path(scratch) / "runs")
            found = {setting: runs.digests(chain, *setting) for setting in settings}
        wanted = first.setdefault(chain, found[settings[0]])
        wrong = [setting for setting in settings if found[setting] != wanted]
        differing += len(wrong)
        print(f"{program} {instructions} {chain}: {len(settings) - len(wrong)} of {len(settings)} runs agree", flush=True)
        for way, slab, threads in wrong:
            content = "slices or voxels" if found[way, slab, threads][1] != wanted[1] else "metadata only"
            print(f"  {way} --slab {slab} --threads {threads} differs: {content}")
    for chain, (_, content) in first.items():
        print(f"{chain}: {content}")
    return 1 if differing else 0


if __name__ == "__main__":
    sys.exit(main())
