"""Stacks of slices that were changed, cut, or made to harm are refused in one line, in limited time and memory."""

import hashlib
import json
import os
import resource
import shutil
import struct
import subprocess
import unittest
import warnings
import zipfile
import zlib
from decimal import Decimal

import meshes
from PIL import Image
from program import MIMAKI, PATIENCE, PROGRAM, ProgramTest

# Limits for slow and loaded machines. A run that reads what it is given, or that waits for it, exceeds them.
SECONDS = 20
BYTES = 2 << 30


def canonical(value):
    """Returns the text of a JSON value by RFC 8785."""
    if isinstance(value, dict):
        keys = sorted(value, key=lambda key: key.encode("utf-16-be"))
        return "{" + ",".join(f"{canonical(key)}:{canonical(value[key])}" for key in keys) + "}"
    if isinstance(value, list):
        return "[" + ",".join(map(canonical, value)) + "]"
    if isinstance(value, float):
        text = repr(value)
        return str(int(value)) if value.is_integer() else format(Decimal(text), "f") if abs(value) >= 1e-6 else text.replace("e-0", "e-")
    return json.dumps(value, ensure_ascii=False)


class Stacks(ProgramTest):
    """A stack of a box, as a folder `out` and as an archive `out.zip`."""

    @classmethod
    def setUpClass(cls):
        cls.made = cls.folder_of_class()
        meshes.write_stl(cls.made / "part.stl", meshes.box((1, 1, 0.3)))
        for line in (("mesh2sdf", "part.stl", *MIMAKI, "!", "dither", "--mask", "white", "!", "material-assign", "-o", "part.vdb"),
                     ("slice-export", "-i", "part.vdb", "out"), ("slice-export", "-i", "part.vdb", "out.zip"),
                     ("slice-export", "-i", "part.vdb", "bits", "--format", "png1")):
            subprocess.run([PROGRAM, *line], cwd=cls.made, check=True, timeout=120 * PATIENCE)

    def setUp(self):
        super().setUp()
        shutil.copytree(self.made, self.folder, dirs_exist_ok=True)
        self.out = self.folder / "out"

    def limit(self):
        if not os.environ.get("VDBDITHER_SANITIZER"):
            resource.setrlimit(resource.RLIMIT_AS, (BYTES, BYTES))

    def refuse_import(self, message, *arguments):
        """Checks that an import ends with a refusal in one line, after warnings only if edits are taken, and leaves no file."""
        before = self.listing()
        done = self.run_program("slice-import", *arguments, "-o", "x.vdb", timeout=SECONDS * PATIENCE, preexec_fn=self.limit)
        *told, said = done.stderr.decode().splitlines()
        self.assertEqual(done.returncode, 1, said)
        self.assertIn(message, said)
        self.assertTrue(all(": warning: " in line for line in told), told)
        self.assertTrue(not told or "--edited" in arguments, told)
        self.assertEqual(self.listing(), before)

    def import_edited(self, stack="out"):
        """Imports a stack that was edited. Returns the warnings."""
        done = self.run_program("slice-import", stack, "--edited", "-o", "x.vdb", "--overwrite")
        self.assertEqual(done.returncode, 0, done.stderr)
        return done.stderr.decode()

    def manifest(self):
        return json.loads((self.out / "manifest.json").read_text())

    def edit(self, change):
        manifest = self.manifest()
        change(manifest)
        (self.out / "manifest.json").write_text(json.dumps(manifest))

    def slice(self, number=0):
        return self.out / self.manifest()["slices"][number]["file"]

    def pack(self, name="x.zip", members=(), method=zipfile.ZIP_DEFLATED, without=()):
        """Packs the folder of the stack, and more members."""
        with zipfile.ZipFile(self.folder / name, "w", method) as archive:
            for path in sorted(self.out.rglob("*")):
                if path.is_file() and path.name not in without:
                    archive.write(path, path.relative_to(self.out))
            for member, content in members:
                archive.writestr(member, content)

    def test_a_manifest_may_be_written_anew_by_any_json_tool(self):
        for write in (lambda m: json.dumps(m), lambda m: json.dumps(m, indent=4, sort_keys=True), lambda m: json.dumps(m, indent="\t")):
            (self.out / "manifest.json").write_text(write(self.manifest()))
            self.succeed("slice-import", "out", "-o", "x.vdb", "--overwrite")

    def test_the_digest_of_the_manifest_is_that_of_its_canonical_form(self):
        for stack in ("out", "bits"):
            manifest = json.loads((self.folder / stack / "manifest.json").read_text())
            stated = manifest.pop("sha256")
            self.assertEqual(hashlib.sha256(canonical(manifest).encode()).hexdigest(), stated)

    def test_changes_of_the_manifest_or_of_slices_are_refused_unless_they_are_edits(self):
        def flip():
            with Image.open(self.slice(3)) as image:
                changed = image.transpose(Image.FLIP_LEFT_RIGHT)
            changed.putpixel((0, 0), tuple(self.manifest()["background"]))
            changed.save(self.slice(3))

        def swap():
            a, b = self.slice(0), self.slice(1)
            a_bytes, b_bytes = a.read_bytes(), b.read_bytes()
            a.write_bytes(b_bytes)
            b.write_bytes(a_bytes + b"\0")

        for name, change in (("flipped", flip), ("swapped", swap), ("renamed", lambda: self.edit(lambda m: m.pop("cropped"))),
                             ("twice", lambda: self.edit(lambda m: m["slices"].append(m["slices"][0]))),
                             ("mirrored", lambda: self.edit(lambda m: m.update(flip_x=True))),
                             ("extra", lambda: shutil.copy(self.slice(1), self.out / "slice_09999.png"))):
            with self.subTest(name=name):
                change()
                self.refuse_import("; make the stack again with slice-export, or give --edited to take it as it is", "out")
                if name != "renamed":
                    self.assertIn("warning: ", self.import_edited())
                shutil.rmtree(self.out)
                shutil.copytree(self.made / "out", self.out)

    def test_a_key_that_a_manifest_has_twice_is_refused(self):
        path = self.out / "manifest.json"
        path.write_text(path.read_text().replace('"flip_x"', '"pitch_mm": [1, 1, 1], "flip_x"', 1))
        self.refuse_import("it has the key 'pitch_mm' twice", "out")
        self.refuse_import("it has the key 'pitch_mm' twice", "out", "--edited")

    def test_a_missing_slice_or_two_of_a_layer_are_refused_in_any_case(self):
        self.edit(lambda m: m["slices"][1].update(layer=m["slices"][0]["layer"]))
        self.refuse_import("names two slices of layer ", "out", "--edited")
        shutil.copy(self.made / "out/manifest.json", self.out)
        self.slice(2).unlink()
        self.refuse_import("is missing; make the stack again with slice-export", "out")
        self.refuse_import("is missing; make the stack again with slice-export", "out", "--edited")

    def test_an_archive_packed_by_another_program_is_read(self):
        self.pack("x.zip", method=zipfile.ZIP_DEFLATED)
        with zipfile.ZipFile(self.folder / "x.zip", "a") as archive:
            archive.writestr("notes/", "")
        self.succeed("slice-import", "x.zip", "-o", "a.vdb")
        self.succeed("slice-import", "out.zip", "-o", "b.vdb")
        self.succeed("compare", "a.vdb", "b.vdb")

    def test_an_archive_with_dangerous_names_is_refused(self):
        for name, message in (("/etc/evil", "its member '/etc/evil' has no proper name: it is an absolute path"),
                              ("../evil", "its member '../evil' has no proper name: it has a folder whose name is '..'"),
                              ("a/../../evil", "has no proper name"), ("C:\\evil", "has no proper name"),
                              (self.slice().name, "is there twice; pack it again"),
                              ("manifest.json", "its member 'manifest.json' is there twice")):
            with self.subTest(name=name):
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore")
                    self.pack(members=[(name, b"x")])
                self.refuse_import(message, "x.zip")
                self.refuse_import(message, "x.zip", "--edited")

    def test_a_member_that_inflates_beyond_a_slice_is_refused(self):
        name = self.slice(1).name
        self.pack(members=[(name, bytes(300 << 20))], without=[name])
        self.assertLess((self.folder / "x.zip").stat().st_size, 1 << 20)
        for options in ((), ("--edited",)):
            self.refuse_import(f"'x.zip': its member '{name}' inflates more than 200 to 1; pack it again", "x.zip",
                               *options)
        # The directory lies about the size.
        content = bytearray((self.folder / "x.zip").read_bytes())
        for at in range(len(content) - 46):
            if content[at:at + 4] == b"PK\1\2" and content[at + 46:at + 46 + len(name)] == name.encode():
                struct.pack_into("<I", content, at + 24, 100)
        (self.folder / "y.zip").write_bytes(content)
        self.refuse_import(f"'y.zip': its file '{name}' is damaged", "y.zip", "--edited")

    def test_a_member_larger_than_a_slice_is_refused(self):
        name = self.slice(1).name
        self.pack(members=[(name, bytes(8 << 20))], without=[name])
        self.refuse_import(f"'x.zip/{name}' has 8388608 bytes; at most ", "x.zip", "--edited")

    def test_a_slice_that_inflates_beyond_its_pixels_is_refused(self):
        def chunk(kind, data):
            return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

        content = self.slice(1).read_bytes()
        start = content.index(b"IDAT") - 4
        self.slice(1).write_bytes(content[:start] + chunk(b"IDAT", zlib.compress(bytes(400 << 20))) + chunk(b"IEND", b""))
        self.refuse_import("is not a readable PNG: ", "out", "--edited")

    def test_a_manifest_that_inflates_is_refused(self):
        self.pack(members=[("manifest.json", b" " * (200 << 20))], without=["manifest.json"], method=zipfile.ZIP_STORED)
        self.refuse_import("'x.zip': its file 'manifest.json' has 209715200 bytes; at most 67108864 are read", "x.zip")

    def test_an_archive_of_very_many_members_is_refused(self):
        self.pack()
        content = bytearray((self.folder / "x.zip").read_bytes())
        # A zip64 record states the number of members.
        end = content.rindex(b"PK\5\6")
        size, offset = struct.unpack_from("<II", content, end + 12)
        record = struct.pack("<4sQHHIIQQQQ", b"PK\6\6", 44, 45, 45, 0, 0, 1 << 40, 1 << 40, size, offset)
        locator = struct.pack("<4sIQI", b"PK\6\7", 0, end, 1)
        struct.pack_into("<HHII", content, end + 8, 0xFFFF, 0xFFFF, 0xFFFFFFFF, 0xFFFFFFFF)
        (self.folder / "y.zip").write_bytes(content[:end] + record + locator + content[end:])
        self.refuse_import("'y.zip' has 1099511627776 members; at most 262144 are read", "y.zip")

    def test_an_encrypted_member_is_refused(self):
        self.pack()
        content = bytearray((self.folder / "x.zip").read_bytes())
        at = content.index(b"PK\1\2")
        content[at + 8] |= 1
        (self.folder / "y.zip").write_bytes(content)
        self.refuse_import("is encrypted; pack it again", "y.zip")

    def test_a_member_of_an_unknown_method_is_refused(self):
        self.pack(method=zipfile.ZIP_BZIP2)
        self.refuse_import("is neither stored nor deflated; pack it again", "x.zip")

    def test_a_large_manifest_is_refused_before_it_is_read(self):
        os.truncate(self.out / "manifest.json", 200 << 20)
        self.refuse_import("'out/manifest.json' has 209715200 bytes; at most 67108864 are read", "out")
        self.refuse_import("'out/manifest.json' has 209715200 bytes; at most 67108864 are read", "out/manifest.json")

    def test_a_large_slice_is_refused_before_it_is_read(self):
        os.truncate(self.slice(1), 1 << 40)
        self.refuse_import("has 1099511627776 bytes; at most ", "out", "--edited")

    def test_a_large_image_is_refused_before_its_pixels_are_read(self):
        Image.new("1", (60000, 60000)).save(self.slice(1))
        self.refuse_import("has 60000 x 60000 pixels, not ", "out", "--edited")
        self.refuse_import("its digest differs", "out")

    def test_pipes_and_devices_are_refused(self):
        target = self.slice(1)
        target.unlink()
        os.mkfifo(target)
        self.refuse_import("is not an ordinary file", "out")
        target.unlink()
        target.symlink_to("/dev/zero")
        self.refuse_import("is a link to '/dev/zero', which is outside the stack", "out")
        os.mkfifo(self.folder / "pipe.zip")
        self.refuse_import("'pipe.zip' is not an ordinary file", "pipe.zip")
        self.refuse_import("'/dev/zero' is not an ordinary file", "/dev/zero")
        (self.out / "manifest.json").unlink()
        os.mkfifo(self.out / "manifest.json")
        self.refuse_import("'out/manifest.json' is not an ordinary file", "out")
        self.refuse_import("'out/manifest.json' is not an ordinary file", "out/manifest.json")

    def test_slices_outside_the_stack_are_refused(self):
        for name in ("/etc/passwd", "../part.vdb", "a/../../part.vdb", "..", ""):
            self.edit(lambda m, name=name: m["slices"][0].update(file=name))
            self.refuse_import(f"the name of the slice '{name}' ", "out", "--edited")

    def test_a_manifest_without_proper_values_is_refused(self):
        for change in (lambda m: m.update(size=[1, 2, 3]), lambda m: m.update(first_layer=1 << 40), lambda m: m.update(padding=-1),
                       lambda m: m["box"].update(max=[1 << 30] * 3), lambda m: m.update(pitch_mm=[0, 1, 1]),
                       lambda m: m.update(pitch_mm=["x", 1, 1]), lambda m: m["size"].__setitem__(2, 1 << 29),
                       lambda m: m.update(materials=[{}]), lambda m: m.update(background=[0, 0, 0, 256]),
                       lambda m: m["cropped"].update(below=1 << 29), lambda m: m.update(slices={}), lambda m: m.update(format="x")):
            shutil.copy(self.made / "out/manifest.json", self.out)
            self.edit(change)
            self.refuse_import("'out/manifest.json'", "out", "--edited")

    def test_explain_lists_the_stack(self):
        said = self.succeed("slice-import", "out", "-o", "x.vdb", "--explain").decode()
        self.assertRegex(said, r"(?m)^input     out for slice-import, a file of \d+ layers$")
        plan = json.loads(self.succeed("slice-import", "out.zip", "-o", "x.vdb", "--explain", "--json"))
        self.assertEqual([entry["path"] for entry in plan["stages"][0]["inputs"]], ["out.zip"])

    def test_a_stack_can_be_replaced_by_what_is_made_of_it(self):
        self.succeed("slice-import", "out", "!", "slice-export", "out", "--overwrite", "--format", "tiff")
        self.succeed("slice-import", "out", "-o", "x.vdb")
        self.assertEqual({path.suffix for path in self.out.iterdir()}, {".tif", ".json", ".png"})

    def test_a_folder_of_bits_is_replaced_with_its_folders(self):
        self.succeed("slice-export", "-i", "part.vdb", "bits", "--overwrite")
        self.assertEqual([path for path in (self.folder / "bits").iterdir() if path.is_dir()], [])

    def test_links_as_outputs_stay(self):
        os.mkdir(self.folder / "disk")
        for link, target in (("out-link", "disk/stack"), ("a.vdb", "disk/a.vdb"), ("a.zip", "disk/real.zip"), ("a.stl", "disk/a.stl"),
                             ("a.png", "disk/a.png"), ("a.json", "disk/a.json")):
            (self.folder / link).symlink_to(target)
        for _ in range(2):
            self.succeed("slice-export", "-i", "part.vdb", "out-link", "--overwrite")
            self.succeed("slice-export", "-i", "part.vdb", "a.zip", "--overwrite")
            self.succeed("read", "part.vdb", "!", "write", "a.vdb", "--overwrite")
            self.succeed("mesh-export", "-i", "part.vdb", "a.stl", "--overwrite")
            self.succeed("render", "part.stl", "a.png", "--samples", 1, "--overwrite", "-q")
            self.succeed("measure", "part.stl", "--reference", "part.stl", "--report", "a.json", "--overwrite", "-q")
        for link in ("out-link", "a.vdb", "a.zip", "a.stl", "a.png", "a.json"):
            self.assertTrue((self.folder / link).is_symlink(), link)
        self.assertEqual(sorted(path.name for path in (self.folder / "disk").iterdir()),
                         ["a.json", "a.png", "a.stl", "a.vdb", "real.zip", "stack"])

    def test_two_steps_do_not_write_one_file(self):
        self.refuse(2, "write: 'x.vdb' is written by another step already", "read", "part.vdb", "!", "write", "x.vdb", "!", "write", "x.vdb")
        self.refuse(2, "slice-export: './x/' is written by another step already", "read", "part.vdb", "!", "slice-export", "x", "!",
                    "slice-export", "./x/")

    def test_names_of_255_bytes_work(self):
        for ending, arguments in (("", ("slice-export", "-i", "part.vdb")), (".zip", ("slice-export", "-i", "part.vdb")),
                                  (".vdb", ("read", "part.vdb", "!", "write")), (".ply", ("mesh-export", "-i", "part.vdb")),
                                  (".stl", ("mesh-export", "-i", "part.vdb"))):
            name = "n" * (255 - len(ending)) + ending
            self.succeed(*arguments, name)
            self.succeed(*arguments, name, "--overwrite")
            self.assertTrue((self.folder / name).exists())
        self.assertEqual([path for path in self.folder.iterdir() if path.name.startswith(".")], [])

    def test_a_profile_is_an_ordinary_small_file_with_proper_names(self):
        os.mkfifo(self.folder / "pipe.json")
        self.refuse(2, "the printer profile 'pipe.json' is not a regular file", "mesh2sdf", "part.stl", "--printer", "pipe.json", "-o", "x.vdb",
                    timeout=SECONDS * PATIENCE)
        (self.folder / "large.json").touch()
        os.truncate(self.folder / "large.json", 1 << 40)
        self.refuse(1, "'large.json' has 1099511627776 bytes; at most 1048576 are read", "mesh2sdf", "part.stl", "--printer",
                    "large.json", "-o", "x.vdb")
        profile = {"name": "../mine", "pitch_mm": [0.1, 0.1, 0.1], "materials": [{"name": "a/b", "rgba": [0, 0, 0, 255]}]}
        (self.folder / "mine.json").write_text(json.dumps(profile))
        self.refuse(1, "its name contains '/'", "mesh2sdf", "part.stl", "--printer", "mine.json", "-o", "x.vdb")
        profile["name"] = "mine"
        (self.folder / "mine.json").write_text(json.dumps(profile))
        self.refuse(1, "material 1: its name contains '/'", "mesh2sdf", "part.stl", "--printer", "mine.json", "-o", "x.vdb")

    def test_materials_of_one_colour_are_refused_where_slices_could_not_tell_them_apart(self):
        profile = {"name": "mine", "pitch_mm": [0.1, 0.1, 0.1], "materials": [
            {"name": "white", "rgba": [255, 255, 255, 255]}, {"name": "clear", "rgba": [255, 255, 255, 255]}]}
        (self.folder / "mine.json").write_text(json.dumps(profile))
        meshes.write_stl(self.folder / "part.stl", meshes.box((2, 2, 2)))
        chain = ("mesh2sdf", "part.stl", "--printer", "mine.json", "!", "dither", "!", "material-assign", "--shell", "0.2mm:clear",
                 "--core")
        self.refuse(2, "slice-export: --format: png tells materials apart by colour, and 'clear' and 'white' both have "
                       "255,255,255,255; give one another colour", *chain, "white", "!", "slice-export", "alike")
        self.succeed(*chain, "white=#f0f0f0", "!", "slice-export", "apart")
        self.succeed("verify", "apart")

    def test_a_material_listed_twice_is_one_in_every_format(self):
        for x, name in enumerate(("a.stl", "b.stl", "c.stl")):
            meshes.write_stl(self.folder / name, meshes.box((1, 1, 1), (1.5 * x, 0, 0)))
        for target in ("png", "png1", "tiff", "exr", "gcvf"):
            name = "out.gcvf" if target == "gcvf" else target
            self.succeed("mesh2sdf", "a.stl", "b.stl", "c.stl", "--pitch", "0.1", "!", "dither", "--mask", "none", "!",
                         "material-assign", "--parts", "clear,white,clear", "!", "slice-export", name,
                         *(() if target == "gcvf" else ("--format", target)))
            self.succeed("slice-import", name, "-o", f"{target}.vdb")
            counts = json.loads(self.succeed("stats", f"{target}.vdb", "--json"))["materials"]
            self.assertEqual([(count["name"], count["voxels"]) for count in counts], [("clear", 2000), ("white", 1000)], target)


if __name__ == "__main__":
    unittest.main()
