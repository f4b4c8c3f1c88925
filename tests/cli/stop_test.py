"""Every operator and tool obeys signals at any moment, and leaves nothing behind."""

import fcntl
import os
import pathlib
import signal
import subprocess
import time
import unittest

import meshes
import preload
from program import MIMAKI, PATIENCE, PROGRAM, ROOT, ProgramTest, start_program

# Printer profiles are read at once, and a chain is planned at once on parts as small as these.
INSTANT = {"plan", "printers"}

# Half a second is promised; the rest is for a busy machine.
BOUND_SECONDS = 2 * PATIENCE

# Seconds of work before the signal.
MOMENTS = ((signal.SIGINT, 0.05), (signal.SIGTERM, 0.25), (signal.SIGINT, 0.6))


def surface(radius):
    return ("mesh2sdf", f"part{radius}.stl", *MIMAKI)


def sink(verb, *arguments, input="solid"):
    return lambda radius: (verb, "-i", f"{input}{radius}.vdb", *arguments)


# For each verb, a run by the radius of the part in mm, on inputs that `Stopped.make` makes.
RUNS = {
    "compare": lambda radius: ("compare", f"solid{radius}.vdb", f"solid{radius}.vdb"),
    "compensate": lambda radius: ("compensate", "-i", f"surface{radius}.vdb", "-o", "out.vdb"),
    "copies": lambda radius: (*surface(radius), "!", "copies", "--columns", 4, "--rows", 4, "-o", "out.vdb"),
    "csg": lambda radius: ("csg", "-i", f"surface{radius}.vdb", "--union", f"surface{radius}.vdb", "-o", "out.vdb"),
    "dither": lambda radius: ("dither", "-i", f"surface{radius}.vdb", "-o", "out.vdb"),
    "halftone": lambda radius: ("halftone", "-i", f"coloured{radius}.vdb", "-o", "out.vdb"),
    "hollow": lambda radius: (*surface(radius), "--band", "0.2mm", "!", "hollow", "--thickness", "0.1mm", "-o", "out.vdb"),
    "info": lambda radius: ("info", f"solid{radius}.vdb"),
    "interlace": lambda radius: ("interlace", "-i", f"surface{radius}.vdb", "-o", "out.vdb"),
    "mask": lambda radius: ("mask", "--size", 8 * radius, "-o", "out.vdb"),
    "mask-spectrum": lambda radius: ("mask", "--size", 32, "--kind", "white", "!", "mask-spectrum", "out.json", "--step", 48 / radius),
    "material-assign": lambda radius: ("material-assign", "-i", f"solid{radius}.vdb", "-o", "out.vdb"),
    "measure": sink("measure", "--reference", "part8.stl", "--report", "out.json"),
    "merge": lambda radius: ("merge", f"job{radius}"),
    "mesh-export": sink("mesh-export", "out.ply"),
    "mesh2sdf": lambda radius: (*surface(radius), "--slab", "8", "!", "write", "out.vdb"),
    "normals": lambda radius: ("normals", "-i", f"surface{radius}.vdb", "-o", "out.vdb"),
    "offset": lambda radius: (*surface(radius), "--band", "0.2mm", "!", "offset", "--by", "0.05mm", "-o", "out.vdb"),
    "piece": lambda radius: ("piece", f"outjob{radius}", "0"),
    "preview": lambda radius: ("preview", f"stack{radius}", "out.html"),
    "read": lambda radius: ("read", f"surface{radius}.vdb", "-o", "out.vdb"),
    "refine": lambda radius: (*surface(radius), "!", "dither", "!", "refine", "-o", "out.vdb"),
    "render": lambda radius: ("render", "part8.stl", "out.png", "--samples", 16 * radius),
    "resample": lambda radius: ("resample", f"surface{radius}.vdb", *MIMAKI, "-o", "out.vdb"),
    "separate": lambda radius: ("separate", "-i", f"coloured{radius}.vdb", "-o", "out.vdb"),
    "simulate": lambda radius: ("simulate", "-i", f"solid{radius}.vdb", "-o", "out.vdb"),
    "slice-export": sink("slice-export", "out"),
    "slice-import": lambda radius: ("slice-import", f"stack{radius}", "-o", "out.vdb"),
    "ssim": lambda radius: ("ssim", f"picture{radius}.png", f"picture{radius}.png", "--maps", "out"),
    "stats": sink("stats"),
    "verify": lambda radius: ("verify", f"stack{radius}", "--against", f"solid{radius}.vdb"),
    "write": lambda radius: ("write", "-i", f"surface{radius}.vdb", "out.vdb"),
}


SOURCES = {"mask", "mesh2sdf", "read", "resample", "slice-import"}
FILTERS = {"compensate", "copies", "csg", "dither", "halftone", "hollow", "interlace", "material-assign", "normals", "offset", "refine", "separate",
           "simulate"}
SINKS = {"mask-spectrum", "measure", "mesh-export", "slice-export", "stats", "write"}
TOOLS = {"compare", "info", "merge", "piece", "preview", "render", "ssim", "verify"}


class Stopped(ProgramTest):
    """Each verb, stopped at several moments of its run on parts large enough."""

    RADII = (8, 16, 24, 40) if PATIENCE == 1 else (4, 8, 16, 24, 40)

    @classmethod
    def setUpClass(cls):
        cls.inputs = cls.folder_of_class()
        meshes.write_stl(cls.inputs / "part8.stl", meshes.sphere(8, 60))

    def setUp(self):
        super().setUp()
        self.folder = self.inputs

    def make(self, name):
        """Makes an input if it is not there: its name is what it holds, and the radius of the part."""
        kind, radius = name.split(".")[0].rstrip("0123456789"), int("".join(filter(str.isdigit, name)))
        if (self.folder / name).exists():
            return
        if kind == "part":
            meshes.write_stl(self.folder / name, meshes.sphere(radius, 60))
        elif kind == "surface":
            self.make(f"part{radius}.stl")
            self.succeed(*surface(radius), "-o", name)
        elif kind == "solid":
            self.make(f"part{radius}.stl")
            self.succeed(*surface(radius), "!", "dither", "-o", name)
        elif kind == "coloured":
            meshes.write_coloured(self.folder / f"part{radius}.ply", meshes.sphere(radius, 60))
            self.succeed("mesh2sdf", f"part{radius}.ply", *MIMAKI, "--colour", "--colour-depth", "0.2mm", "!", "dither", "-o", name)
        elif kind == "stack":
            self.make(f"solid{radius}.vdb")
            self.succeed("slice-export", "-i", f"solid{radius}.vdb", name)
        elif kind in ("outjob", "job"):
            self.make(f"part{radius}.stl")
            self.succeed("plan", f"mesh2sdf part{radius}.stl {' '.join(MIMAKI)} ! dither ! slice-export out{radius}", name, "--pieces", "1")
            if kind == "job":
                self.succeed("piece", name, "0")
        elif kind == "picture":
            self.succeed("render", "part8.stl", name, "--samples", 1, "--pixel", f"{0.16 / radius}mm")

    def listing(self):
        """As of other tests, without folders of pieces: an empty one stays where the disk is slow to remove what a piece wrote."""
        return [(path, size) for path, size in super().listing() if pathlib.PurePath(path).name != "pieces"]

    def remove_outputs(self):
        subprocess.run(["rm", "-rf", *self.folder.glob("out*")], check=True)

    def stop(self, verb, number, seconds):
        """Stops a run of `verb` with the signal after some time of work, on the first part that takes long enough.

        A run that is done before that even with the largest part is stopped sooner.
        """
        moments = [(radius, seconds) for radius in self.RADII] + [(self.RADII[-1], seconds / share) for share in (2, 4, 8)]
        for radius, seconds in moments:
            arguments = tuple(map(str, RUNS[verb](radius)))
            for name in (f"{kind}{radius}{ending}" for kind, ending in (
                    ("part", ".stl"), ("surface", ".vdb"), ("solid", ".vdb"), ("coloured", ".vdb"), ("stack", ""), ("picture", ".png"), ("outjob", ""), ("job", ""))):
                if name in arguments:
                    self.make(name)
            before = self.listing()
            one_thread = () if verb == "ssim" else ("--threads", 1)
            process = start_program(self, *arguments, *one_thread)
            time.sleep(seconds)
            process.send_signal(number)
            sent = time.monotonic()
            said = process.communicate(timeout=60 * PATIENCE)[1].decode()
            self.assertLess(time.monotonic() - sent, BOUND_SECONDS)
            if process.returncode == 0:
                # It was done before the signal, or about to be. A larger part shows whether it is stopped.
                self.assertEqual(said, "")
                self.remove_outputs()
                continue
            self.assertEqual(process.returncode, 128 + number, said)
            self.assertEqual(said, f"vdbdither: stopped: {signal.strsignal(number)}\n")
            self.expect_removed(before)
            return
        self.fail(f"{verb} ends before it can be stopped; give it a larger part")

    def stop_all(self, verbs):
        for verb in sorted(verbs):
            for number, seconds in MOMENTS:
                with self.subTest(verb=verb, seconds=seconds):
                    self.remove_outputs()
                    self.stop(verb, number, seconds)

    def test_every_verb_is_stopped_here(self):
        pages = {path.stem for path in (ROOT / "docs/operators").glob("*.md")} - {"README"}
        self.assertEqual(set(RUNS), pages - INSTANT)
        self.assertEqual(SOURCES | FILTERS | SINKS | TOOLS, set(RUNS))

    def test_sources_can_be_stopped(self):
        self.stop_all(SOURCES)

    def test_filters_can_be_stopped(self):
        self.stop_all(FILTERS)

    def test_sinks_can_be_stopped(self):
        self.stop_all(SINKS)

    def test_tools_can_be_stopped(self):
        self.stop_all(TOOLS)


class Signals(ProgramTest):
    """What signals mean, and what a run does that is stopped while it waits, sleeps or is started with signals ignored."""

    def setUp(self):
        super().setUp()
        meshes.write_stl(self.folder / "part.stl", meshes.sphere(0.6))
        self.mask = ("mask", "--size", 256, "-o", "out.vdb")

    def test_each_signal_has_its_exit_code(self):
        before = self.listing()
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGXCPU):
            process = start_program(self, *self.mask)
            process.send_signal(number)
            said = process.communicate(timeout=60 * PATIENCE)[1].decode()
            self.assertEqual((process.returncode, said), (128 + number, f"vdbdither: stopped: {signal.strsignal(number)}\n"))
            self.expect_removed(before)

    def test_a_signal_sent_twice_leaves_nothing(self):
        before = self.listing()
        chain = ("mesh2sdf", "part.stl", *MIMAKI, "--fit", "30mm", "--slab", "8", "!", "dither", "!", "slice-export", "out")
        for pause in (0, 0.02):
            process = start_program(self, *chain)
            deadline = time.monotonic() + 60 * PATIENCE
            while not any(path.suffix == ".png" for path in self.folder.rglob("*")):
                self.assertLess(time.monotonic(), deadline)
                time.sleep(0.01)
            process.send_signal(signal.SIGTERM)
            time.sleep(pause)
            process.send_signal(signal.SIGTERM)
            said = process.communicate(timeout=60 * PATIENCE)[1].decode()
            self.assertEqual((process.returncode, said), (143, "vdbdither: stopped: Terminated\n"))
            self.expect_removed(before)

    @unittest.skipIf(os.environ.get("VDBDITHER_SANITIZER"), "a sanitizer wants to be the first library")
    def test_a_disk_that_is_slow_to_remove_files_does_not_delay_the_end(self):
        library = preload.library(self.folder, preload.CHANGES)
        before = self.listing()
        process = start_program(self, "mesh2sdf", "part.stl", *MIMAKI, "--fit", "30mm", "--slab", "8", "!", "dither", "!", "slice-export", "out",
                                env=preload.environment(library, SLOW_MS=20))
        deadline = time.monotonic() + 60 * PATIENCE
        while sum(path.suffix == ".png" for path in self.folder.rglob("*")) < 100:
            self.assertIsNone(process.poll())
            self.assertLess(time.monotonic(), deadline)
        process.send_signal(signal.SIGTERM)
        said = process.communicate(timeout=60 * PATIENCE)[1].decode()
        self.assertEqual((process.returncode, said), (143, "vdbdither: stopped: Terminated\n"))
        self.assertTrue([path for path in self.folder.iterdir() if path.name.startswith(".out.partial-")])
        self.expect_removed(before)

    def test_an_ignored_signal_stays_ignored(self):
        for number in (signal.SIGHUP, signal.SIGINT):
            process = self.start("mask", "--size", 48, "-o", f"{number}.vdb", preexec_fn=lambda: signal.signal(number, signal.SIG_IGN))
            for _ in range(20):
                if process.poll() is None:
                    process.send_signal(number)
                time.sleep(0.01)
            self.assertEqual((process.communicate()[1], process.returncode), (b"", 0))

    def test_a_run_that_was_suspended_goes_on(self):
        process = start_program(self, "mask", "--size", 48, "-o", "out.vdb")
        for _ in range(5):
            process.send_signal(signal.SIGTSTP)
            time.sleep(0.05)
            process.send_signal(signal.SIGCONT)
            time.sleep(0.05)
        self.assertEqual((process.communicate(timeout=120 * PATIENCE)[1], process.returncode), (b"", 0))

    def test_a_suspended_run_that_is_stopped_ends_when_it_goes_on(self):
        before = self.listing()
        process = start_program(self, *self.mask)
        for number in (signal.SIGTSTP, signal.SIGTERM, signal.SIGCONT):
            process.send_signal(number)
            time.sleep(0.1)
        said = process.communicate(timeout=60 * PATIENCE)[1].decode()
        self.assertEqual((process.returncode, said), (143, "vdbdither: stopped: Terminated\n"))
        self.expect_removed(before)

    def test_a_run_that_waits_for_a_named_pipe_can_be_stopped(self):
        os.mkfifo(self.folder / "pipe.vdb")
        for arguments in (("info", "pipe.vdb"), ("compare", "pipe.vdb", "pipe.vdb")):
            before = self.listing()
            process = start_program(self, *arguments)
            time.sleep(0.2)
            process.send_signal(signal.SIGTERM)
            said = process.communicate(timeout=60 * PATIENCE)[1].decode()
            self.assertEqual((process.returncode, said), (143, "vdbdither: stopped: Terminated\n"), arguments)
            self.expect_removed(before)

    def test_a_run_whose_messages_nobody_reads_can_be_stopped(self):
        reader, writer = os.pipe()
        self.addCleanup(os.close, reader)
        fcntl.fcntl(writer, fcntl.F_SETFL, os.O_NONBLOCK)
        with self.assertRaises(BlockingIOError):
            while True:
                os.write(writer, bytes(4096))
        fcntl.fcntl(writer, fcntl.F_SETFL, 0)
        before = self.listing()
        process = start_program(self, *self.mask, stderr=writer)
        os.close(writer)
        process.send_signal(signal.SIGTERM)
        self.assertEqual(process.wait(timeout=60 * PATIENCE), 143)
        self.expect_removed(before)


if __name__ == "__main__":
    unittest.main()
