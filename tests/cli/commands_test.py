"""Output and refusals of the command line."""

import json
import os
import pty
import unittest

import meshes
from program import MIMAKI, PROGRAM, ROOT, ProgramTest


def operators():
    return sorted(link.name for link in (PROGRAM.parent / "operators").iterdir())


def read_terminal(descriptor):
    """Returns the output of a terminal whose other end is closed. Closes this end."""
    text = b""
    with open(descriptor, "rb", buffering=0) as terminal:
        try:
            while chunk := terminal.read(4096):
                text += chunk
        except OSError:  # Linux reports a closed other end in this way
            pass
    return text


class Words(ProgramTest):
    def setUp(self):
        super().setUp()
        meshes.write_stl(self.folder / "part.stl", meshes.sphere(0.6))
        self.inputs = self.listing()

    def test_version_names_the_program_and_three_numbers(self):
        self.assertRegex(self.succeed("--version").decode(), r"^vdbdither \d+\.\d+\.\d+\n$")

    def test_overview_names_every_operator(self):
        overview = self.succeed("--help").decode()
        self.assertEqual(overview, self.succeed("help").decode())
        for name in operators():
            self.assertRegex(overview, rf"(?m)^(Sources|Filters|Sinks|  ) .*\b{name}\b")

    def test_help_of_every_operator_shows_usage_options_and_an_example(self):
        for name in operators():
            text = self.succeed(name, "--help").decode()
            self.assertEqual(text, self.succeed("help", name).decode())
            self.assertEqual(text, self.succeed("--help", program=PROGRAM.parent / "operators" / name).decode())
            self.assertIn(f"Usage: vdbdither {name}", text)
            for expected in ("Example:\n  vdbdither ", "--threads N", "--layers A:B", "--help"):
                self.assertIn(expected, text, name)

    def test_version_is_accepted_by_every_operator(self):
        for name in operators():
            self.assertEqual(self.succeed(name, "--version"), self.succeed("--version"), name)

    def test_explain_reports_stages_and_cost_and_makes_nothing(self):
        text = self.succeed("mesh2sdf", "part.stl", *MIMAKI, "!", "normals", "!", "dither", "!", "material-assign", "!",
                            "slice-export", "out", "--explain").decode()
        for pattern in (r"lattice +0\.042 x 0\.084 x 0\.022 mm, \d+ x \d+ x \d+ voxels", r"layers +(\d+) of \1, in slabs of \d+",
                        r"memory +about \d+ MiB of ", r"stage +dither .*reads [1-9]\d* layers below, [1-9]\d* above",
                        r"stage +slice-export out"):
            self.assertRegex(text, pattern)
        self.assertEqual(self.listing(), self.inputs)

    def test_explain_reports_barriers(self):
        text = self.succeed("mesh2sdf", "part.stl", *MIMAKI, "-o", "a.vdb", "--explain").decode()
        self.assertRegex(text, r"stage +write a\.vdb .*\(barrier")
        self.assertEqual(self.listing(), self.inputs)

    def test_explain_lists_what_is_read_besides_the_slabs(self):
        self.succeed("mesh2sdf", "part.stl", *MIMAKI, "-o", "a.vdb")
        text = self.succeed("csg", "a.vdb", "--union", "a.vdb", "-o", "b.vdb", "--explain").decode()
        self.assertRegex(text, r"(?m)^input +a\.vdb for read, a file of (\d+) layers$(.*\n)+"
                               r"^input +a\.vdb for csg, a file of \1 layers$")
        text = self.shell("vdbdither read a.vdb | vdbdither compare a.vdb --explain").decode()
        self.assertRegex(text, r"(?m)^input +standard input for read, a pipe of (\d+) layers$(.*\n)+"
                               r"^input +a\.vdb for compare, a file of \1 layers$")

    def test_explain_as_json_is_the_plan_of_the_job(self):
        chain = ("mesh2sdf", "part.stl", *MIMAKI, "!", "dither", "!", "slice-export", "out", "--layers", "8:24", "--slab", "16")
        plan = json.loads(self.succeed(*chain, "--explain", "--json"))
        self.assertEqual(self.listing(), self.inputs)
        self.assertEqual(plan["layers"], {"begin": 8, "end": 24})
        self.assertEqual(plan["slab_layers"], 16)
        self.assertEqual([stage["name"] for stage in plan["stages"]], ["mesh2sdf", "dither", "slice-export"])
        source, dither, export = plan["stages"]
        self.assertIn(f"part.stl {' '.join(MIMAKI)}", source["arguments"])
        self.assertLess(source["layers"]["begin"], 8)
        self.assertGreater(source["layers"]["end"], 24)
        self.assertEqual(dither["reads"][0]["grid"], "surface")
        self.assertGreater(dither["reads"][0]["below"], 0)
        self.assertEqual(dither["handed_on"], ["solid"])
        self.assertGreater(source["leaves"]["total"], 0)
        self.assertEqual(export["output"]["path"], "out")
        self.assertGreater(export["output"]["bytes"], 0)
        for key in ("seconds", "memory_bytes", "memory_limit_bytes"):
            self.assertGreater(plan[key], 0)
        # The documented keys are those that there are.
        page = (ROOT / "docs/job-plan.md").read_text()
        for keys in (plan, source, dither["reads"][0], source["leaves"], export["output"]):
            for key in keys:
                self.assertIn(f"`{key}`", page)
        report = json.loads(self.succeed(*chain, "--json"))
        self.assertAlmostEqual(report["expected_seconds"], plan["seconds"])

    def test_json_reports_every_stage(self):
        report = json.loads(self.succeed("mesh2sdf", "part.stl", *MIMAKI, "!", "dither", "!", "slice-export", "out",
                                         "--keep-blank", "--json"))
        self.assertEqual([stage["name"] for stage in report["stages"]], ["mesh2sdf", "dither", "slice-export"])
        for stage in report["stages"]:
            self.assertLessEqual({"seconds", "active_voxels", "bytes", "peak_memory_bytes"}, stage.keys())
        surface, solid, _ = report["stages"]
        self.assertGreater(surface["active_voxels"], 1000)
        self.assertGreater(solid["bytes"], 1000)
        slices = json.loads((self.folder / "out/manifest.json").read_text())["size"]
        self.assertEqual(report["layers"], slices[2])
        self.assertEqual(report["box_voxels"], slices[0] * slices[1] * slices[2])
        self.assertGreater(report["peak_memory_bytes"], 1e6)

    def test_json_goes_to_standard_error_where_voxels_go_to_standard_output(self):
        done = self.run_program("mesh2sdf", "part.stl", *MIMAKI, "--json")
        self.assertEqual(done.returncode, 0)
        self.assertEqual(json.loads(done.stderr)["stages"][0]["name"], "mesh2sdf")
        self.assertEqual(done.stdout, self.succeed("mesh2sdf", "part.stl", *MIMAKI))

    def test_verbose_has_a_line_for_every_stage(self):
        done = self.run_program("mesh2sdf", "part.stl", *MIMAKI, "!", "dither", "-o", "solid.vdb", "--verbose")
        self.assertEqual(done.returncode, 0)
        for name in ("mesh2sdf", "dither", "write"):
            self.assertRegex(done.stderr.decode(), rf"(?m)^{name} +[\d.]+ s +\d+ voxels")

    def test_a_terminal_shows_a_progress_bar_and_quiet_hides_it(self):
        meshes.write_stl(self.folder / "tall.stl", meshes.cylinder(3, 25))
        shown = {}
        for quiet in ((), ("--quiet",)):
            ours, theirs = pty.openpty()
            process = self.start("mesh2sdf", "tall.stl", *MIMAKI, "!", "dither", "!", "slice-export", "out",
                                 "--overwrite", "--slab", "8", *quiet, stderr=theirs)
            os.close(theirs)
            shown[quiet] = read_terminal(ours)
            self.assertEqual(process.wait(), 0)
        self.assertRegex(shown[()], rb"\d+ %")
        self.assertTrue(shown[()].endswith(b"\r\x1b[K"), "the bar is wiped away")
        self.assertEqual(shown[("--quiet",)], b"")

    def test_a_long_run_shows_its_expected_time_at_once_on_a_terminal(self):
        meshes.write_stl(self.folder / "ball.stl", meshes.sphere(4))
        self.succeed("mesh2sdf", "ball.stl", *MIMAKI, "-o", "surface.vdb")
        ours, theirs = pty.openpty()
        process = self.start("resample", "surface.vdb", *MIMAKI, "-o", "again.vdb", "--threads", "1", stderr=theirs)
        os.close(theirs)
        shown = read_terminal(ours)
        self.assertEqual(process.wait(), 0)
        self.assertRegex(shown, rb"^\r\x1b\[K +0 %  about 0:0[1-9] left\r")


class Refusals(ProgramTest):
    def setUp(self):
        super().setUp()
        meshes.write_stl(self.folder / "part.stl", meshes.sphere(0.6))

    def test_an_unknown_operator_names_the_nearest(self):
        self.refuse(2, "no operator 'normal'; did you mean 'normals'?", "mesh2sdf", "part.stl", *MIMAKI, "!", "normal")
        self.refuse(2, "did you mean 'mesh2sdf'?", "help", "mesh2sfd")

    def test_an_unknown_word_without_a_near_operator_lists_all(self):
        done = self.refuse(2, "no operator 'xyzzyplugh'; the operators are", "xyzzyplugh")
        for name in operators():
            self.assertIn(f" {name}", done.stderr.decode())

    def test_an_unknown_option_names_the_nearest(self):
        self.refuse(2, "--amplitude", "mesh2sdf", "part.stl", *MIMAKI, "!", "dither", "--amplitud", "3", "-o", "x.vdb")

    def test_a_choice_lists_what_it_accepts(self):
        self.refuse(2, "choose closest, foot or voxel", "mesh2sdf", "part.stl", *MIMAKI, "!", "dither", "--at", "corner", "-o", "x.vdb")

    def test_an_unknown_printer_lists_the_known(self):
        self.refuse(2, "mimaki-3duj-553", "mesh2sdf", "part.stl", "--printer", "mimaki", "-o", "x.vdb")

    def test_a_missing_mesh_is_bad_data_and_is_named(self):
        self.refuse(1, "'nothing.stl': no such file", "mesh2sdf", "nothing.stl", *MIMAKI, "-o", "x.vdb")

    def test_a_file_that_is_not_a_mesh_is_bad_data(self):
        (self.folder / "noise.stl").write_bytes(bytes(range(256)) * 9)
        self.refuse(1, "noise.stl", "mesh2sdf", "noise.stl", *MIMAKI, "-o", "x.vdb")

    def test_a_missing_input_is_bad_data(self):
        self.refuse(1, "no such file 'gone.vdb'", "normals", "-i", "gone.vdb", "-o", "x.vdb")

    def test_a_missing_mask_is_named(self):
        self.refuse(2, "dither: --mask: no such file 'x.vdb'", "mesh2sdf", "part.stl", *MIMAKI, "!", "dither", "--mask",
                    "x.vdb", "-o", "y.vdb")

    def test_a_filter_without_its_grid_names_the_grid(self):
        self.succeed("mask", "--size", "8", "-o", "mask.vdb")
        self.refuse(1, "no grid 'surface'; there is 'mask'", "dither", "-i", "mask.vdb", "-o", "x.vdb")

    def test_an_existing_output_stays_without_overwrite(self):
        self.succeed("mesh2sdf", "part.stl", *MIMAKI, "-o", "a.vdb")
        kept = (self.folder / "a.vdb").read_bytes()
        self.refuse(2, "'a.vdb' exists; --overwrite replaces it", "mask", "--size", "8", "-o", "a.vdb")
        self.assertEqual((self.folder / "a.vdb").read_bytes(), kept)
        self.succeed("mask", "--size", "8", "-o", "a.vdb", "--overwrite")
        self.assertNotEqual((self.folder / "a.vdb").read_bytes(), kept)

    def test_an_existing_stack_stays_without_overwrite(self):
        chain = ("mesh2sdf", "part.stl", *MIMAKI, "!", "dither", "!", "slice-export", "out")
        self.succeed(*chain)
        self.refuse(2, "'out' exists; --overwrite replaces it", *chain)
        self.succeed(*chain, "--overwrite")

    def test_overwrite_behind_any_operator_is_for_all_outputs(self):
        chain = ("mesh2sdf", "part.stl", *MIMAKI)
        end = ("!", "dither", "!", "slice-export", "out", "!", "write", "a.vdb")
        self.succeed(*chain, *end)
        self.succeed(*chain, "--overwrite", *end)
        self.succeed(*chain, "!", "dither", "--overwrite", *end[2:], "!", "mesh-export", "a.stl")
        # One that is behind an output is for this output.
        self.refuse(2, "'out' exists; --overwrite replaces it", *chain, *end, "--overwrite")

    def test_a_sink_that_fails_leaves_all_outputs_as_they_were(self):
        def chain(scale):
            return ("mesh2sdf", "box.stl", *MIMAKI, "--scale", scale, "--overwrite", "!", "dither", "--mask", "none", "!", "write", "a.vdb",
                    "!", "slice-export", "out", "--page", "out.html", "!", "mesh-export", "a.stl")

        # Made small, it holds the centre of no voxel.
        meshes.write_stl(self.folder / "box.stl", meshes.box((1, 1, 1), (0.3, 0.3, 0.3)))
        self.succeed(*chain(1))

        def contents():
            return {path: path.read_bytes() for path in self.folder.rglob("*") if path.is_file()}

        kept = contents()
        self.assertIn(self.folder / "out.html", kept)
        failed = self.run_program(*chain(0.001))
        self.assertEqual(failed.returncode, 1)
        self.assertIn("mesh-export: grid 'solid' has no surface", failed.stderr.decode())
        self.assertEqual(contents(), kept)

    def test_explain_takes_outputs_that_exist_and_tells_of_them(self):
        (self.folder / "holiday").mkdir()
        (self.folder / "holiday/beach.jpg").write_bytes(b"sand")
        chain = ("mesh2sdf", "part.stl", *MIMAKI, "!", "dither", "!", "write", "a.vdb", "!", "slice-export")
        self.assertNotIn("exists", self.succeed(*chain, "out", "--explain").decode())
        self.succeed(*chain, "out")
        for folder in ("out", "holiday"):
            text = self.succeed(*chain, folder, "--explain").decode()
            for name in ("a.vdb", folder):
                self.assertIn(f" for {name}, which exists: --overwrite replaces it\n", text)
        plan = json.loads(self.succeed(*chain, "new", "--explain", "--json"))
        self.assertEqual([stage["output"]["exists"] for stage in plan["stages"][2:]], [True, False])

    def test_a_folder_without_a_stack_is_never_replaced(self):
        (self.folder / "holiday").mkdir()
        (self.folder / "holiday/beach.jpg").write_bytes(b"sand")
        self.refuse(2, "holiday", "mesh2sdf", "part.stl", *MIMAKI, "!", "dither", "!", "slice-export", "holiday", "--overwrite")

    def test_an_output_in_a_missing_folder_is_refused(self):
        self.refuse(2, "there is no folder 'nowhere'", "mask", "--size", "8", "-o", "nowhere/a.vdb")

    def test_vdb_is_not_written_to_a_terminal(self):
        ours, theirs = pty.openpty()
        self.addCleanup(os.close, ours)
        self.addCleanup(os.close, theirs)
        self.refuse(2, "not for a terminal", "mask", "--size", "8", stdout=theirs)

    def test_vdb_is_not_read_from_a_terminal(self):
        ours, theirs = pty.openpty()
        self.addCleanup(os.close, ours)
        self.addCleanup(os.close, theirs)
        self.refuse(2, "nothing is piped in", "normals", "-o", "x.vdb", stdin=theirs)

    def test_stream_refuses_a_barrier(self):
        self.refuse(2, "write: needs the whole volume at once, which --stream forbids", "mesh2sdf", "part.stl", *MIMAKI,
                    "-o", "x.vdb", "--stream")
        self.succeed("mesh2sdf", "part.stl", *MIMAKI, "!", "dither", "!", "slice-export", "out", "--stream")

    def test_more_memory_than_allowed_is_refused_before_the_run(self):
        self.refuse(1, "the job needs about", "mesh2sdf", "part.stl", *MIMAKI, "-o", "x.vdb", "--memory", "1MiB")

    def test_layers_slab_and_memory_list_accepted_values(self):
        chain = ("mesh2sdf", "part.stl", *MIMAKI, "-o", "x.vdb")
        for text in ("5", "5:5", "9:2", "0:99999", "-1:4", "a:b", "1:2:3"):
            self.refuse(2, "is not A:B with 0 <= A < B <= ", *chain, f"--layers={text}")
        for text in ("0", "7", "-8", "many", "8x", "1000000000"):
            self.refuse(2, f"--slab: '{text}' is not accepted; the value must be a multiple of 8 up to 1048576, auto or all", *chain, f"--slab={text}")
        for text in ("much", "-4GiB", "4 apples", "0", "inf", "1e400GiB"):
            self.refuse(2, f"--memory: '{text}' is not accepted; give a size such as 4GiB or 500MB, or auto", *chain, f"--memory={text}")

    def test_a_source_can_only_begin_a_chain(self):
        self.refuse(2, "can only begin a chain", "mesh2sdf", "part.stl", *MIMAKI, "!", "mask", "-o", "x.vdb")

    def test_an_empty_step_is_refused(self):
        self.refuse(2, "no operator after the last", "mesh2sdf", "part.stl", *MIMAKI, "!")
        self.refuse(2, "no operator before", "!", "normals")
        self.refuse(2, "run: takes one argument", "run")
        self.refuse(2, "is not closed", "run", "mesh2sdf 'part.stl")

    def test_unused_input_and_output_are_refused(self):
        self.refuse(2, "--input", "mesh2sdf", "part.stl", *MIMAKI, "-i", "a.vdb", "-o", "x.vdb")
        self.refuse(2, "--output", "mesh2sdf", "part.stl", *MIMAKI, "!", "dither", "!", "slice-export", "out", "-o", "x.vdb")


if __name__ == "__main__":
    unittest.main()
