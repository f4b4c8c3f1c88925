"""Jobs cut into pieces: what their runs make together is what one run makes, byte for byte."""

import json
import os
import pathlib
import re
import shutil
import signal
import subprocess
import unittest

import meshes
from program import MIMAKI, PROGRAM, ProgramTest, start_program

DITHER = f"mesh2sdf part.stl {' '.join(MIMAKI)} ! dither ! material-assign --core cyan --shell 0.2mm:white"


class Jobs(ProgramTest):
    def setUp(self):
        super().setUp()
        # Taller than a row of leaves, with blank layers below and above.
        meshes.write_stl(self.folder / "part.stl", meshes.sphere(0.9, 24))

    def plan(self, chain, *options):
        self.succeed("plan", chain, *(options or ("--pieces", "4")))
        return json.loads((self.folder / "job/job.json").read_text())

    def make(self, job):
        self.succeed("piece", "job", f"0-{len(job['pieces']) - 1}")
        self.succeed("merge", "job")

    def files(self, name):
        path = self.folder / name
        if path.is_file():
            return {".": path.read_bytes()}
        return {str(file.relative_to(path)): file.read_bytes() for file in path.rglob("*") if file.is_file()}

    def check_merged(self, chain, *outputs):
        """Checks that the outputs of a chain are the same in one run and in pieces."""
        self.succeed("run", chain)
        one = {output: self.files(output) for output in outputs}
        for output in outputs:
            self.assertTrue(one[output], output)
            path = self.folder / output
            shutil.rmtree(path) if path.is_dir() else path.unlink()
        job = self.plan(chain)
        self.assertEqual(len(job["pieces"]), 4)
        self.make(job)
        for output in outputs:
            self.assertEqual(self.files(output), one[output], (chain, output))
            path = self.folder / output
            shutil.rmtree(path) if path.is_dir() else path.unlink()
        shutil.rmtree(self.folder / "job")

    def test_folders_of_slices_are_those_of_one_run(self):
        for options in ("", "--keep-blank --format tiff", "--format png1 --digits 1 --first 98 --prefix layer", "--tray centred"):
            self.check_merged(f"{DITHER} ! slice-export out {options}", "out")

    def test_formats_that_keep_blank_layers_are_those_of_one_run(self):
        self.check_merged(f"{DITHER} ! slice-export out --format exr", "out")

    def test_archives_and_containers_are_those_of_one_run(self):
        self.check_merged(f"{DITHER} ! slice-export out.zip", "out.zip")
        self.check_merged(f"{DITHER} ! slice-export out.3mf --3mf-level-set", "out.3mf")
        jetted = DITHER.replace(MIMAKI[1], "stratasys-j750-27um").replace("white", "VeroClear").replace("cyan", "VeroCyan")
        self.check_merged(f"{jetted} ! slice-export out.gcvf", "out.gcvf")

    def test_grids_are_those_of_one_run_and_several_outputs_too(self):
        self.check_merged(f"mesh2sdf part.stl {' '.join(MIMAKI)} --normals ! write mid.vdb --half ! dither -o out.vdb", "mid.vdb", "out.vdb")

    def test_leaves_that_are_constant_only_as_half_floats_are_those_of_one_run(self):
        self.check_merged(f"mesh2sdf part.stl {' '.join(MIMAKI)} ! dither ! simulate --spread 20um,20um,100um ! write out.vdb --half", "out.vdb")

    def test_a_file_of_grids_is_cut_too(self):
        self.succeed("mesh2sdf", "part.stl", *MIMAKI, "-o", "surface.vdb")
        self.check_merged("dither surface.vdb ! slice-export out", "out")

    def test_a_job_runs_wherever_it_is_started_and_moves_with_its_files(self):
        self.succeed("run", f"{DITHER} ! slice-export one")
        self.plan(f"{DITHER} ! slice-export out")
        moved = self.folder / "elsewhere"
        moved.mkdir()
        for name in ("part.stl", "job"):
            (self.folder / name).rename(moved / name)
        lines = (moved / "job/jobs.txt").read_text().splitlines()
        self.assertEqual(lines, [f"vdbdither piece . {number}" for number in range(4)])
        for line in reversed(lines):
            subprocess.run(line, shell=True, cwd=moved / "job", env=self.environment(), check=True, capture_output=True)
        (moved / "part.stl").rename(moved / "other.stl")
        self.refuse(1, f"there is no '{moved}/part.stl', which the job reads; a job that is moved takes its inputs along",
                    "merge", "elsewhere/job")
        (moved / "other.stl").rename(moved / "part.stl")
        self.succeed("merge", "elsewhere/job")
        self.assertEqual(self.files("elsewhere/out"), self.files("one"))

    def test_xargs_runs_the_list_side_by_side(self):
        self.succeed("run", f"{DITHER} ! slice-export one")
        self.plan(f"{DITHER} ! slice-export out")
        self.shell("cd job && xargs -P 2 -I LINE sh -c LINE <jobs.txt && vdbdither merge .")
        self.assertEqual(self.files("out"), self.files("one"))

    def test_a_piece_that_is_there_is_not_made_again(self):
        job = self.plan(f"{DITHER} ! slice-export out")
        self.assertEqual(self.succeed("piece", "job", "1,3"), b"piece 1 is made\npiece 3 is made\n")
        kept = self.folder / "job/pieces/0001"
        before = kept.stat().st_ino
        self.assertEqual(self.succeed("piece", "job", "0-1"), b"piece 0 is made\npiece 1 is there\n")
        self.assertEqual(kept.stat().st_ino, before)
        self.refuse(1, "piece 2 is missing; make it with: vdbdither piece job 2", "merge", "job")
        self.assertEqual(len(job["pieces"]), 4)

    def test_a_piece_that_changed_is_made_again(self):
        job = self.plan(f"{DITHER} ! slice-export out")
        self.make(job)
        one = self.files("out")
        shutil.rmtree(self.folder / "out")
        piece = self.folder / "job/pieces/0002"
        slices = sorted(piece.rglob("slice_*.png"))

        def drop():
            slices[0].unlink()

        def alter():
            slices[0].write_bytes(slices[0].read_bytes() + b" ")

        def add():
            (piece / "more").write_text("")

        def empty():
            (piece / "piece.json").write_text("{}")

        def overflow():
            (piece / "piece.json").write_text('{"layers": [0, 1e400]}')

        for change, problem in ((overflow, "says nothing (line 1, column 16: the number 1e400 is too large)"), (drop, "lacks its file"), (alter, "has another"), (add, "holds a foreign file 'more'"),
                                (empty, "says nothing")):
            change()
            self.refuse(1, problem, "merge", "job")
            self.assertEqual(self.succeed("piece", "job", "0-3").count(b"made"), 1, problem)
        self.succeed("merge", "job")
        self.assertEqual(self.files("out"), one)

    def test_pieces_of_another_plan_are_made_again(self):
        self.plan(f"{DITHER} ! slice-export out")
        self.succeed("piece", "job", "0")
        pieces = self.folder / "pieces"
        (self.folder / "job/pieces").rename(pieces)
        self.plan(f"{DITHER.replace('cyan', 'magenta')} ! slice-export out", "--pieces", "4", "--overwrite")
        pieces.rename(self.folder / "job/pieces")
        self.refuse(1, "piece 0 was made for another plan of the job", "merge", "job")
        self.assertEqual(self.succeed("piece", "job", "0"), b"piece 0 is made\n")

    def test_a_killed_run_leaves_no_piece(self):
        meshes.write_stl(self.folder / "part.stl", meshes.sphere(8, 60))
        self.plan(f"{DITHER} ! slice-export out", "--pieces", "2")
        for number in (signal.SIGKILL, signal.SIGINT):
            run = start_program(self, "piece", "job", "1", stdout=subprocess.DEVNULL)
            while not any((self.folder / "job/pieces").glob(".0001*")):
                self.assertIsNone(run.poll())
            run.send_signal(number)
            run.wait()
            self.assertFalse((self.folder / "job/pieces/0001").exists())
        self.succeed("piece", "job", "1")
        self.assertEqual([path.name for path in (self.folder / "job/pieces").iterdir()], ["0001"])

    def test_a_job_without_pieces_can_be_planned_again(self):
        chain = f"{DITHER} ! slice-export out"
        self.plan(chain)
        (self.folder / "job/pieces").mkdir()
        self.plan(chain, "--pieces", "2", "--overwrite")
        self.assertFalse((self.folder / "job/pieces").exists())
        self.succeed("piece", "job", "0")
        self.refuse(2, "'job' holds pieces that took time to make; remove 'job/pieces' to plan it again", "plan", chain, "--overwrite")
        shutil.rmtree(self.folder / "job/pieces")
        (self.folder / "job/job-12-0.log").write_text("said\n")
        self.plan(chain, "--pieces", "2", "--overwrite")
        self.assertFalse((self.folder / "job/job-12-0.log").exists())

    def test_a_file_that_was_missing_in_the_plan_is_not_read_later(self):
        vertices = "".join(f"v {x} {y} {z}\n" for z in (0, 2) for y in (0, 2) for x in (0, 2))
        faces = "".join(f"f {face}\n" for face in ("1 3 4 2", "5 6 8 7", "1 2 6 5", "3 7 8 4", "1 5 7 3", "2 4 8 6"))
        (self.folder / "cube.obj").write_text(f"mtllib cube.mtl\n{vertices}usemtl red\n{faces}")
        chain = "mesh2sdf cube.obj --pitch 0.1mm --colour ! write out.vdb"
        self.assertEqual(self.run_program("plan", chain, "job", "--pieces", "2").returncode, 0)
        self.assertEqual(self.run_program("piece", "job", "0").returncode, 0)
        (self.folder / "cube.mtl").write_text("newmtl red\nKd 1 0 0\n")
        said = "'cube.mtl' was not read when the job was planned; take it away, or plan the job again"
        self.refuse(1, said, "piece", "job", "1")
        (self.folder / "cube.mtl").unlink()
        self.assertEqual(self.run_program("piece", "job", "1").returncode, 0)
        (self.folder / "cube.mtl").write_text("newmtl red\nKd 1 0 0\n")
        self.refuse(1, said, "merge", "job")

    def test_two_runs_may_make_the_same_piece_at_once(self):
        self.plan(f"{DITHER} ! slice-export out")
        runs = [self.start("piece", "job", "0-3") for _ in range(3)]
        self.assertEqual([(run.wait(), run.stderr.read()) for run in runs], [(0, b"")] * 3)
        self.succeed("merge", "job")
        self.assertEqual(sorted(path.name for path in (self.folder / "job/pieces").iterdir()), ["0000", "0001", "0002", "0003"])

    def test_inputs_must_be_the_files_that_were_planned(self):
        (self.folder / "own.json").write_text((pathlib.Path(__file__).parents[2] / "samples/printers/mimaki-3duj-553.json").read_text())
        job = self.plan(f"mesh2sdf part.stl --printer own.json ! dither ! slice-export out")
        self.assertEqual([entry["file"] for entry in job["inputs"]], ["own.json", "part.stl"])
        self.succeed("piece", "job", "0-3")
        whole = (self.folder / "part.stl").read_bytes()
        (self.folder / "part.stl").write_bytes(whole[:-1] + b"\1")
        self.refuse(1, "'part.stl' is not the file that the job was planned with", "merge", "job")
        self.refuse(1, "'part.stl' is not the file that the job was planned with", "piece", "job", "0")
        shutil.rmtree(self.folder / "job/pieces/0001")
        self.refuse(1, "'part.stl' is not the file that the job was planned with", "piece", "job", "0-3")
        (self.folder / "part.stl").write_bytes(whole)
        self.succeed("piece", "job", "0-3")

    def test_files_beside_a_mesh_and_profiles_of_the_program_are_inputs(self):
        (self.folder / "part.obj").write_text("mtllib part.mtl\nusemtl a\n" + "".join(
            f"v {x} {y} {z}\n" for x, y, z in ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1))) + "f 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n")
        (self.folder / "part.mtl").write_text("newmtl a\nKd 1 0 0\n")
        job = self.plan(f"mesh2sdf part.obj --colour {' '.join(MIMAKI)} ! dither ! halftone ! slice-export out", "--pieces", "2")
        names = [entry.get("file", entry.get("data")) for entry in job["inputs"]]
        self.assertEqual(sorted(names), ["part.mtl", "part.obj", "printers/mimaki-3duj-553.json"])
        self.make(job)

    def test_a_job_is_cut_by_memory_and_by_time(self):
        self.assertEqual(len(self.plan(f"{DITHER} ! slice-export out", "--piece-time", "2h")["pieces"]), 1)
        shutil.rmtree(self.folder / "job")
        meshes.write_stl(self.folder / "part.stl", meshes.sphere(8, 60))
        chain = f"mesh2sdf part.stl {' '.join(MIMAKI)} -o out.vdb"
        whole = self.plan(chain, "--pieces", "1")["pieces"][0]["memory_bytes"]
        shutil.rmtree(self.folder / "job")
        limit = int(0.8 * whole)
        pieces = self.plan(chain, "--piece-memory", str(limit))["pieces"]
        self.assertGreater(len(pieces), 1)
        self.assertLessEqual(max(piece["memory_bytes"] for piece in pieces), limit)
        self.refuse(1, "--piece-memory: the smallest piece takes about", "plan", chain, "small", "--piece-memory", "1MB")

    def test_what_cannot_be_cut_is_refused_before_work(self):
        sdf = f"mesh2sdf part.stl {' '.join(MIMAKI)}"
        for chain, message in (
                (f"{sdf} ! dither ! stats", "stats: its result cannot be made in pieces"),
                (f"{sdf} ! mesh-export out.ply", "mesh-export: its result cannot be made in pieces"),
                (f"{sdf} ! dither", "write: what goes into a pipe cannot be made in pieces"),
                (f"{DITHER} ! slice-export out --crop", "slice-export: --crop: the frame of the slices follows from all layers"),
                (f"{DITHER} ! slice-export out --page out.html", "slice-export: --page: a piece has no page"),
                (f"{DITHER} ! slice-export out --layers 0:8", "--layers: plan cuts the layers"),
                (f"{DITHER} ! slice-export out --explain", "--explain: plan runs nothing"),
                (f"{DITHER} ! slice-export out --help", "asks for --help")):
            self.refuse(2, message, "plan", chain, "--pieces", "2")
        for folder in ("job", "./job"):
            self.refuse(2, f"slice-export: '{folder}' lies in the folder of the job; name another place", "plan",
                        f"{DITHER} ! slice-export {folder}", "--pieces", "2")
        self.refuse(2, "give one of --pieces, --piece-memory and --piece-time", "plan", f"{DITHER} ! slice-export out", "--pieces", "2",
                    "--piece-time", "1h")
        self.refuse(2, "'soon' is not accepted; give a time such as 90s, 10min or 2h", "plan", DITHER, "--piece-time", "soon")

    def test_pipes_are_refused(self):
        surface = self.succeed("mesh2sdf", "part.stl", *MIMAKI)
        self.refuse(2, "read: reads a pipe, which other machines cannot", "plan", "dither ! slice-export out", "--pieces", "2", input=surface)

    def test_names_that_are_not_utf_8_are_refused(self):
        name = os.fsdecode(b"bad\xff")
        shutil.copy(self.folder / "part.stl", self.folder / f"{name}.stl")
        for chain in (f"mesh2sdf {name}.stl --printer mimaki-3duj-553 ! dither ! slice-export out", f"{DITHER} ! slice-export {name}"):
            self.refuse(2, "is not UTF-8, and a job keeps names as UTF-8; rename the file", "plan", chain, "--pieces", "2")
        self.assertFalse((self.folder / "job").exists())

    def test_numbers_that_are_none_of_a_piece_are_refused(self):
        self.plan(f"{DITHER} ! slice-export out")
        for numbers in ("4", "0-4", "-1", "2-1", "1,1", "1,,2", "x", "0x1", "99999999999999999999"):
            self.refuse(2, "is not accepted; give numbers of pieces from 0 to 3", "piece", "job", "--", numbers)

    def test_what_is_no_job_is_refused(self):
        self.refuse(1, "holds no job.json, so it is not a job made by plan", "piece", "nowhere", "0")
        self.plan(f"{DITHER} ! slice-export out")
        self.refuse(2, "exists; --overwrite replaces it", "plan", f"{DITHER} ! slice-export out", "--pieces", "2")
        path = self.folder / "job/job.json"
        job = json.loads(path.read_text())

        def damaged(message, **changes):
            path.write_text(json.dumps({key: value for key, value in {**job, **changes}.items() if value is not None}))
            self.refuse(1, message, "piece", "job", "0")

        damaged("was planned by vdbdither 0.0.1, and this is", version="0.0.1")
        damaged("'chain' is missing", chain=None)
        damaged("'chain' is not a list", chain="mesh2sdf")
        damaged("its pieces are not all layers", pieces=job["pieces"][:-1])
        damaged("do not follow each other", pieces=job["pieces"][::-1])
        damaged("'slab_layers' must be a whole number from 1", slab_layers=0)
        damaged("'pitch_mm' must be three numbers", lattice={**job["lattice"], "pitch_mm": [1, 2]})
        damaged("makes another lattice here", lattice={**job["lattice"], "pitch_mm": [1, 1, 1]})
        damaged("cannot go to", folder="nowhere")
        path.write_text("[")
        self.refuse(1, "is not a job of plan: line 1, column 2: this is not JSON: ", "merge", "job")
        path.write_text("[]")
        self.refuse(1, "is not a job of plan: it is not a JSON object", "merge", "job")
        path.write_text('{"version":\n 1e400}')
        self.refuse(1, "is not a job of plan: line 2, column 2: the number 1e400 is too large; plan it again", "merge", "job")

    def test_merging_replaces_what_is_there_only_where_it_is_told_to(self):
        chain = f"{DITHER} ! slice-export out ! write solid.vdb"
        self.make(self.plan(chain))
        one = {name: self.files(name) for name in ("out", "solid.vdb")}
        self.refuse(2, "'out' exists; --overwrite replaces it", "merge", "job")
        (self.folder / "solid.vdb").unlink()
        self.succeed("merge", "job", "--overwrite")
        self.assertEqual({name: self.files(name) for name in ("out", "solid.vdb")}, one)
        shutil.rmtree(self.folder / "job")
        self.plan(f"{DITHER} -o solid.vdb --overwrite", "--pieces", "2")
        chain = json.loads((self.folder / "job/job.json").read_text())
        chain["chain"].remove("--overwrite")
        (self.folder / "job/job.json").write_text(json.dumps(chain))
        self.succeed("piece", "job", "0-1")
        self.refuse(2, "'solid.vdb' exists; --overwrite replaces it", "merge", "job")
        self.succeed("merge", "job", "--overwrite")

    def test_what_a_chain_reads_it_cannot_write_in_pieces(self):
        self.succeed("run", f"{DITHER} ! slice-export out ! write solid.vdb")
        os.symlink(self.folder, self.folder / "link")
        for chain, read, written in (("read solid.vdb ! write solid.vdb --overwrite", "solid.vdb", "solid.vdb"),
                                     ("read link/solid.vdb ! write solid.vdb --overwrite", "link/solid.vdb", "solid.vdb"),
                                     ("slice-import out ! slice-export out --overwrite", "out/manifest.json", "out")):
            self.refuse(2, f"the chain reads '{read}' and writes '{written}', so that pieces would read what the merge has written",
                        "plan", chain, "--pieces", "2")
        # The old output is no input.
        job = self.plan(f"{DITHER} ! slice-export out --overwrite", "--pieces", "2")
        self.assertEqual([entry["file"] for entry in job["inputs"] if entry.get("file", "").startswith("out")], [])

    def test_every_slice_of_a_stack_without_digests_is_an_input(self):
        self.succeed("run", f"{DITHER} ! slice-export out")
        slices = sorted(path.name for path in (self.folder / "out").glob("slice_*.png"))
        (self.folder / "images").mkdir()
        for name in slices:
            shutil.copy(self.folder / "out" / name, self.folder / "images" / name)
        for chain, folder in (("slice-import images --pitch 42um,84um,22um --background black", "images"),
                              ("slice-import out --edited", "out")):
            job = self.plan(f"{chain} ! slice-export again", "--pieces", "2")
            self.assertEqual([entry["file"] for entry in job["inputs"] if entry.get("file", "").endswith("png")],
                             [f"{folder}/{name}" for name in slices])
            self.succeed("piece", "job", "0")
            changed = self.folder / folder / slices[-1]
            changed.write_bytes(changed.read_bytes() + b" ")
            self.refuse(1, f"'{folder}/{slices[-1]}' is not the file that the job was planned with", "piece", "job", "1")
            shutil.rmtree(self.folder / "job")

    def test_files_of_desktops_beside_a_piece_do_not_spoil_it(self):
        job = self.plan(f"{DITHER} ! slice-export out")
        self.succeed("piece", "job", "0-3")
        for name in (".DS_Store", "Thumbs.db", "desktop.ini", ".nfs000001"):
            (self.folder / "job/pieces/0001" / name).write_text("x")
        self.assertEqual(self.succeed("piece", "job", "0-3").count(b"is there"), 4)
        self.succeed("merge", "job")

    def test_the_script_of_slurm_asks_for_what_the_pieces_take(self):
        job = self.plan(f"{DITHER} ! slice-export out --threads 1")
        script = (self.folder / "job/job.sbatch").read_text()
        subprocess.run(["sh", "-n", self.folder / "job/job.sbatch"], check=True)
        self.assertIn("#SBATCH --cpus-per-task=1\n", script)
        memory = int(re.search(r"--mem=(\d+)M", script)[1])
        self.assertGreater(memory * 2**20, max(piece["memory_bytes"] for piece in job["pieces"]))
        # An sbatch that tells how it was called, and the number of the array.
        (self.folder / "sbatch").write_text('#!/bin/sh\necho "$VDBDITHER_STEP $*" >>calls\necho "17;cluster"\n')
        (self.folder / "sbatch").chmod(0o755)
        environment = {**self.environment(), "PATH": f"{self.folder}:{self.environment()['PATH']}"}
        subprocess.run(["sh", "job.sbatch", "--partition=a"], cwd=self.folder / "job", env=environment, check=True, capture_output=True)
        array, merge = (self.folder / "job/calls").read_text().splitlines()
        self.assertEqual(array, "piece --parsable --array=0-3 --export=ALL --partition=a job.sbatch")
        self.assertTrue(merge.startswith("merge --dependency=afterok:17 --kill-on-invalid-dep=yes "), merge)
        # Each step does what it says.
        for step, task in [("piece", number) for number in range(4)] + [("merge", 0)]:
            subprocess.run(["sh", "job.sbatch"], cwd=self.folder / "job", check=True, capture_output=True,
                           env={**environment, "VDBDITHER_STEP": step, "SLURM_ARRAY_TASK_ID": str(task), "SLURM_CPUS_PER_TASK": "1"})
        self.assertTrue((self.folder / "out/manifest.json").exists())
        # Slurm counts how often it has queued a task again.
        for restarts, code in (({}, 2), ({"SLURM_RESTART_COUNT": "1"}, 0)):
            again = subprocess.run(["sh", "job.sbatch"], cwd=self.folder / "job", capture_output=True,
                                   env={**environment, "VDBDITHER_STEP": "merge", "SLURM_CPUS_PER_TASK": "1", **restarts})
            self.assertEqual(again.returncode, code)

    def test_the_template_of_open_job_description_says_the_same(self):
        self.plan(f"{DITHER} ! slice-export out")
        template = json.loads((self.folder / "job/job.openjd.json").read_text())
        self.assertEqual((template["specificationVersion"], template["extensions"]), ("jobtemplate-2023-09", ["TASK_CHUNKING"]))
        pieces, merge = template["steps"]
        self.assertEqual(merge["dependencies"], [{"dependsOn": pieces["name"]}])
        parameter, = pieces["parameterSpace"]["taskParameterDefinitions"]
        self.assertEqual((parameter["type"], parameter["range"]), ("CHUNK[INT]", "0-3"))
        self.assertIn(parameter["chunks"]["defaultTaskCount"], range(1, 151))

        def run(step, chunk=""):
            action = step["script"]["actions"]["onRun"]
            words = [word.replace("{{Param.JobFolder}}", "job").replace("{{Task.Param.Piece}}", chunk) for word in action["args"]]
            done = subprocess.run([action["command"], *words], cwd=self.folder, env=self.environment(), check=True, capture_output=True)
            return done.stderr.decode()

        for chunk in ("0-1", "2-3"):
            self.assertIn("openjd_progress: 100.0\n", run(pieces, chunk))
        run(merge)
        self.assertTrue((self.folder / "out/manifest.json").exists())


class ProgressLines(ProgramTest):
    """Progress for programs."""

    def setUp(self):
        super().setUp()
        meshes.write_stl(self.folder / "part.stl", meshes.sphere(8, 60))

    def test_each_line_is_json_and_the_last_one_is_the_whole(self):
        done = self.run_program("mesh2sdf", "part.stl", *MIMAKI, "!", "dither", "!", "slice-export", "out", "--progress", "json")
        self.assertEqual((done.returncode, done.stdout), (0, b""))
        lines = [json.loads(line) for line in done.stderr.decode().splitlines()]
        shares = [line["share"] for line in lines]
        self.assertEqual(shares, sorted(shares))
        self.assertEqual((shares[-1], lines[-1]["layers"]["done"]), (1, lines[-1]["layers"]["all"]))
        self.assertEqual(set(lines[-1]), {"stage", "share", "seconds", "seconds_left", "layers"})
        self.succeed("plan", "mesh2sdf part.stl --pitch 1mm ! dither ! slice-export small", "job", "--pieces", "1")
        self.succeed("piece", "job", "0")
        done = self.run_program("piece", "job", "0", "--progress", "json")
        self.assertEqual(json.loads(done.stderr)["stage"], "piece")
        self.assertEqual(lines[-1]["seconds_left"], 0)

    def test_a_run_tells_each_second_how_far_it_is(self):
        (self.folder / "pipe").mkdir()
        os.mkfifo(self.folder / "pipe/in")
        surface = self.succeed("mesh2sdf", "part.stl", *MIMAKI)
        run = self.start("dither", "pipe/in", "--progress", "json", "-o", "out.vdb")
        with open(self.folder / "pipe/in", "wb") as pipe:
            pipe.write(surface[:-1000])
            pipe.flush()
            # The run waits for the rest, and goes on telling.
            lines = [json.loads(run.stderr.readline()) for _ in range(2)]
            self.assertNotIn("", [line["stage"] for line in lines])
            pipe.write(surface[-1000:])
        self.assertLess(max(line["share"] for line in lines), 1)
        self.assertGreater(lines[1]["seconds"], lines[0]["seconds"])
        self.assertEqual(run.wait(), 0)

    def test_voxels_are_not_disturbed(self):
        plain = self.succeed("mesh2sdf", "part.stl", *MIMAKI, "--layers", "0:8")
        told = self.run_program("mesh2sdf", "part.stl", *MIMAKI, "--layers", "0:8", "--progress", "openjd")
        self.assertRegex(told.stderr.decode(), r"openjd_status: \w*\nopenjd_progress: 100.0\n$")
        self.assertEqual(len(told.stdout), len(plain))

    def test_a_failure_is_told(self):
        done = self.run_program("mesh2sdf", "part.stl", *MIMAKI, "!", "dither", "-o", "/dev/full/x.vdb", "--progress", "openjd")
        self.assertEqual(done.returncode, 2)
        self.assertIn("openjd_fail: write: cannot write to '/dev/full/x.vdb'", done.stderr.decode())
        done = self.run_program("mesh2sdf", "part.stl", "--printer", "none", "-o", "x.vdb", "--progress=openjd")
        self.assertRegex(done.stderr.decode(), r"^openjd_fail: .*no printer 'none'")
        stopped = start_program(self, "mask", "--size", 256, "-o", "m.vdb", "--progress", "openjd")
        stopped.send_signal(signal.SIGTERM)
        self.assertIn("openjd_fail: stopped: Terminated\n", stopped.communicate()[1].decode())
        meshes.write_stl(self.folder / "part.stl", meshes.sphere(1, 20))
        job = self.run_program("plan", f"mesh2sdf part.stl {' '.join(MIMAKI)} -o out.vdb", "--pieces", "1")
        self.assertEqual(job.returncode, 0)
        failed = self.run_program("merge", "job", "--progress", "openjd")
        self.assertIn("openjd_fail: merge: 'job': piece 0 is missing", failed.stderr.decode())


if __name__ == "__main__":
    unittest.main()
