#!/usr/bin/python3
"""Runs random jobs in every way, and checks that each way writes the same bytes. For nightly runs.

    tests/soak.py --jobs 300 --seed 1 --minutes 60 [--program build/release/vdbdither]

A job is a chain of random shape, size, lattice, colour and options. It runs fused, piped, by files, in pieces that are merged, and
in ranges of layers, each with another slab height and number of threads. Every file that it writes must be the same; nothing else may be left; no run may fail. A fixed job
runs between the others: its peak memory, the files that the program leaves in its cache and the time do not grow. A job that fails is
printed with the commands to repeat it, and its folder is kept.
"""

import argparse
import collections
import hashlib
import json
import os
import pathlib
import random
import shutil
import subprocess
import sys
import tempfile
import time

from PIL import Image

ROOT = pathlib.Path(__file__).resolve().parents[1]
sys.dont_write_bytecode = True
sys.path.insert(0, str(ROOT / "tests/support"))
import meshes  # noqa: E402

PRINTERS = ("mimaki-3duj-553", "stratasys-j750-27um", "stratasys-j750-14um")
MATERIALS = ("white=#f0f0f0", "black=#101012", "cyan=#00a0e0", "clear=255,255,255,40")


def write_part(chance, folder, name, largest_mm):
    """Writes a random closed mesh, with vertex colours or texture coordinates. Returns its file and what its colours need."""
    def side():
        return chance.uniform(0.1, 1) * largest_mm

    shape = chance.choice(("box", "sphere", "cylinder", "lathe", "two"))
    if shape == "box":
        triangles = meshes.box((side(), side(), side()), tuple(chance.uniform(-1, 1) for _ in range(3)))
    elif shape == "sphere":
        triangles = meshes.sphere(side() / 2, chance.randint(3, 16))
    elif shape == "cylinder":
        triangles = meshes.cylinder(side() / 2, side())
    elif shape == "lathe":
        rings, height = chance.randint(2, 7), side()
        profile = [(0, 0), *((side() / 2, height * (n + 1) / (rings + 1)) for n in range(rings)), (0, height)]
        triangles = meshes.lathe(profile, chance.randint(5, 40))
    else:
        shift = tuple(chance.uniform(0, 1) * largest_mm for _ in range(3))
        triangles = meshes.sphere(side() / 2, 8) + meshes.box((side(), side(), side()), shift)
    triangles = meshes.turned(triangles, chance.uniform(0, 90), chance.uniform(0, 90))
    colours = chance.choice(("none", "vertices", "texture"))
    if colours == "vertices":
        meshes.write_coloured(folder / f"{name}.ply", triangles)
        return f"{name}.ply", " --colour"
    if colours == "texture":
        meshes.write_textured(folder / f"{name}.obj", triangles)
        size = (chance.randint(1, 80), chance.randint(1, 80))
        Image.frombytes("RGB", size, chance.randbytes(3 * size[0] * size[1])).save(folder / f"{name}.png")
        return f"{name}.obj", f" --colour --texture {name}.png"
    meshes.write_stl(folder / f"{name}.stl", triangles)
    return f"{name}.stl", ""


class Job:
    """A random chain: `stages`, of which the first is the source, and `sinks`, options of slice-export."""

    def __init__(self, chance, folder, largest_mm):
        self.folder = folder
        self.folder.mkdir(parents=True)
        some = chance.random
        mesh, colour = write_part(chance, folder, "part", largest_mm)
        if some() < 0.5:
            pitch = [chance.choice((0.025, 0.04, 0.0635, 0.1)) for _ in range(3)]
            lattice = f"--pitch {','.join(map(str, pitch))}"
        else:
            lattice = f"--printer {chance.choice(PRINTERS)}"
        if some() < 0.3:
            colour += f" --colour-depth {chance.uniform(0, 0.5):.3f}mm" if colour else ""
        deep = some() < 0.3
        source = f"mesh2sdf {mesh} {lattice}{colour}"
        source += " --normals" if some() < 0.3 else ""
        source += " --closest" if some() < 0.2 else ""
        source += f" --rotate {chance.randint(-180, 180)},{chance.randint(0, 90)},{chance.randint(0, 360)}" if some() < 0.3 else ""
        source += " --place" if some() < 0.5 else ""
        source += " --band 0.6mm" if deep else ""
        self.stages = [source]
        if deep:
            self.stages.append(chance.choice((f"offset --by {chance.uniform(-0.1, 0.1):.3f}mm",
                                              f"hollow --thickness {chance.uniform(0.1, 0.3):.3f}mm", "normals")))
        elif some() < 0.3:
            self.stages.append(chance.choice(("normals", "compensate")))
        self.stages.append("dither" + chance.choice(
            ("", "", " --guard none", " --displaced", " --spread 40um", " --refine 1", " --method mask", " --mask none",
             f" --mask white --seed {chance.randint(1, 99)}", " --preset paper --size 16",
             f" --method mask --amplitude {chance.randint(0, 3)}", " --mask blue --size 16 --at closest")))
        if some() < 0.1:
            self.stages.append("refine --sweeps 1")
        if colour and some() < 0.8:
            self.stages.append(f"halftone --inks {','.join(MATERIALS[:3])}" + chance.choice((" --size 16", " --mask white")))
        else:
            shell = f" --shell {chance.uniform(0.05, 0.4):.3f}mm:{MATERIALS[1]} --core {MATERIALS[2]}"
            self.stages.append("material-assign" + chance.choice(("", f" --material {MATERIALS[0]}", shell)))
        if some() < 0.1:
            self.stages.append("simulate")
        self.export = chance.choice(("", "", " --format png1", " --format tiff", " --format tiff1", " --format png8",
                                     " --format exr --exr-packing zip"))
        self.export += chance.choice(("", f" --padding {chance.randint(0, 20)}", " --flip-x", " --flip-y"))
        self.commons = [f"--slab {chance.choice((8, 16, 24, 64, 'all'))} --threads {chance.randint(1, 4)}" for _ in range(4)]
        self.pieces = chance.randint(1, 5)
        self.cuts = sorted(some() for _ in range(chance.randint(1, 3)))

    def lines(self, with_pieces):
        """Returns the line of bash for each way, which writes out.vdb and the stack `out`."""
        def sinks(common):
            return f"write out.vdb ! slice-export out{self.export} {common}"

        fused, piped, filed, ranges = self.commons
        files = [f"{self.stages[0]} {filed} -o 0.vdb"]
        files += [f"{stage} {filed} -i {n}.vdb -o {n + 1}.vdb" for n, stage in enumerate(self.stages[1:])]
        lines = {
            "fused": f"vdbdither {' ! '.join(self.stages)} ! {sinks(fused)}",
            "piped": " | ".join([*(f"{stage} {piped}" for stage in self.stages), f"vdbdither read - ! {sinks(piped)}"]),
            "filed": " && ".join([*files, f"vdbdither read {len(self.stages) - 1}.vdb ! {sinks(filed)}"]),
        }
        if with_pieces:
            # The last piece first, then those that are missing.
            lines["in pieces"] = (f"vdbdither plan \"{' ! '.join(self.stages)} ! {sinks(ranges)}\" --pieces {self.pieces} && "
                                  "last=$(($(wc -l <job/jobs.txt) - 1)) && vdbdither piece job $last && "
                                  "vdbdither piece job 0-$last && vdbdither merge job && rm -r job")
        return lines


class Soak:
    def __init__(self, given, scratch):
        self.given, self.scratch = given, scratch
        self.cache = scratch / "cache"
        program = given.program.resolve()
        self.environment = {**os.environ, "PATH": f"{program.parent}:{program.parent}/operators:/usr/bin:/bin",
                            "XDG_CACHE_HOME": str(self.cache), "LC_ALL": "C.UTF-8"}
        self.runs, self.faults, self.peaks, self.refusals = 0, [], [], collections.Counter()
        self.with_pieces = self.run(scratch, "vdbdither plan --help")[0] == 0

    def run(self, folder, line):
        """Runs a line of bash. Returns its exit code and words, with the peak memory in bytes of its largest process."""
        self.runs += 1
        with open(folder / ".said", "w+b") as said:
            process = subprocess.Popen(["bash", "-o", "pipefail", "-c", line], cwd=folder, env=self.environment, stdin=subprocess.DEVNULL,
                                       stdout=said, stderr=said, start_new_session=True)
            _, status, usage = os.wait4(process.pid, 0)
            process.returncode = os.waitstatus_to_exitcode(status)
            said.seek(0)
            words = said.read().decode(errors="replace")
        (folder / ".said").unlink()
        return process.returncode, words, 1024 * usage.ru_maxrss

    @staticmethod
    def digests(folder):
        """Returns the digest of every file that a way has written."""
        paths = [folder / "out.vdb", *(folder / "out").rglob("*")]
        return {str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest() for path in paths if path.is_file()}

    @staticmethod
    def clear(folder, before):
        """Removes what a way has made. Returns the names of what should not be there."""
        expected = {"out", "out.vdb", *(f"{n}.vdb" for n in range(12))}
        strange = []
        for path in folder.iterdir():
            if path.name in before:
                continue
            if path.name not in expected:
                strange.append(path.name)
            shutil.rmtree(path) if path.is_dir() else path.unlink()
        return strange

    def in_ranges(self, job, whole):
        """Makes the layers of the job range by range. Returns what is wrong, or None."""
        layers = whole["layers"]
        cuts = sorted({0, *(int(cut * layers) for cut in job.cuts), layers})
        made = {}
        for begin, end in zip(cuts, cuts[1:]):
            line = (f"vdbdither {' ! '.join(job.stages)} ! slice-export out{job.export} --keep-blank --layers {begin}:{end} "
                    f"{job.commons[3]} --overwrite")
            code, words, _ = self.run(job.folder, line)
            if code or self.errors(words):
                return f"{line}: exit {code}: {words}"
            for group, digests in self.slices(job.folder).items():
                made[group] = made.get(group, []) + digests
        return None if made == whole["slices"] else f"ranges of layers at {cuts} differ from the whole"

    @staticmethod
    def slices(folder):
        """Returns the digests that the manifest of a stack states, slice by slice, for each folder of slices."""
        found = {}
        for entry in json.loads((folder / "out/manifest.json").read_text())["slices"]:
            found.setdefault(str(pathlib.Path(entry["file"]).parent), []).append(entry["sha256"])
        return found

    def check(self, job):
        """Runs a job in all ways. Returns what is wrong, or None."""
        inputs = {path.name for path in job.folder.iterdir()}
        reference, first = None, None
        for way, line in job.lines(self.with_pieces).items():
            code, words, _ = self.run(job.folder, line)
            if first is None:
                first = (code, words)
                if code == 1 or code == 2:
                    # A part without a printed voxel and the like. All ways must refuse it.
                    reference = "refused"
            if reference == "refused":
                if code == 0:
                    return f"{way}: goes through what fused refuses: {first[1]}"
                if strange := [name for name in self.clear(job.folder, inputs) if name.startswith(".")]:
                    return f"{way}: leaves {strange}"
                continue
            if code or self.errors(words):
                return f"{way}: {line}: exit {code}: {words}"
            found = self.digests(job.folder)
            reference = reference or found
            if found != reference:
                names = sorted(name for name in found.keys() | reference.keys() if found.get(name) != reference.get(name))
                return f"{way}: {line}: {len(names)} files differ from fused: {names[:5]}"
            if strange := self.clear(job.folder, inputs):
                return f"{way}: leaves {strange}"
        if reference == "refused":
            self.refusals[first[1].strip().split("\n")[-1]] += 1
            return "refused"
        line = f"vdbdither {' ! '.join(job.stages)} ! slice-export out{job.export} --keep-blank --overwrite"
        code, words, _ = self.run(job.folder, line)
        if code:
            return f"{line}: exit {code}: {words}"
        slices = self.slices(job.folder)
        wrong = self.in_ranges(job, {"slices": slices, "layers": max(map(len, slices.values()))})
        self.clear(job.folder, inputs)
        return wrong

    @staticmethod
    def errors(words):
        """Returns the lines of errors: tools tell what they did, and warnings and notes are no errors."""
        return [line for line in words.splitlines() if line.startswith("vdbdither") and ": warning: " not in line and ": note: " not in line]

    def fixed_job(self):
        """Runs the fixed job and notes its peak memory."""
        folder = self.scratch / "fixed"
        if not folder.is_dir():
            folder.mkdir()
            meshes.write_stl(folder / "part.stl", meshes.turned(meshes.box((2, 3, 4)), 20, 30))
        line = ("exec vdbdither mesh2sdf part.stl --printer mimaki-3duj-553 ! normals ! dither ! material-assign ! slice-export out "
                "--overwrite --slab 32 --threads 2 --quiet")
        code, words, peak = self.run(folder, line)
        if code or words:
            self.faults.append(f"the fixed job: exit {code}: {words}")
        self.peaks.append(peak)

    def go(self):
        start, done, refused = time.monotonic(), 0, 0
        for number in range(self.given.first, self.given.first + self.given.jobs):
            if time.monotonic() - start > 60 * self.given.minutes:
                break
            if done % 25 == 0:
                self.fixed_job()
            chance = random.Random(f"{self.given.seed} {number}")
            job = Job(chance, self.scratch / f"job{number}", self.given.largest)
            wrong = self.check(job)
            done += 1
            if wrong == "refused":
                refused += 1
                wrong = None
            if wrong:
                self.faults.append(f"job {number}: {wrong}")
                print(f"job {number} (--seed {self.given.seed} --first {number} --jobs 1): {wrong}", flush=True)
                print(f"  fused: {job.lines(False)['fused']}", flush=True)
                if self.given.keep:
                    shutil.copytree(job.folder, self.given.keep / job.folder.name, dirs_exist_ok=True)
            shutil.rmtree(job.folder)
        self.fixed_job()
        cached = sum(path.stat().st_size for path in self.cache.rglob("*") if path.is_file())
        growth = max(self.peaks) / self.peaks[0]
        if growth > 1.25:
            self.faults.append(f"the peak memory of the fixed job went from {self.peaks[0]} to {max(self.peaks)} bytes")
        print(f"seed {self.given.seed}: {done} jobs in {time.monotonic() - start:.0f} s, {self.runs} runs, {refused} jobs refused in every way; "
              f"fixed job {self.peaks[0] / 1e6:.0f} MB at first, {max(self.peaks) / 1e6:.0f} MB at most; cache {cached / 1e6:.1f} MB; "
              f"{len(self.faults)} faults")
        for words, count in self.refusals.most_common():
            print(f"  refused {count} times: {words}")
        return 1 if self.faults else 0


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--jobs", type=int, default=300, help="number of jobs (%(default)s)")
    parser.add_argument("--first", type=int, default=0, help="number of the first job (%(default)s)")
    parser.add_argument("--seed", type=int, default=int(time.time()), help="by default the time")
    parser.add_argument("--minutes", type=float, default=1e9, help="begin no job after this time")
    parser.add_argument("--largest", type=float, default=2, help="longest side of a part in mm (%(default)s)")
    parser.add_argument("--keep", type=pathlib.Path, help="folder for the inputs of jobs that fail")
    parser.add_argument("--program", type=pathlib.Path, default=ROOT / "build/release/vdbdither")
    given = parser.parse_args()
    print(f"seed {given.seed}", flush=True)
    with tempfile.TemporaryDirectory(prefix="vdbdither-soak-") as scratch:
        return Soak(given, pathlib.Path(scratch)).go()


if __name__ == "__main__":
    sys.exit(main())
