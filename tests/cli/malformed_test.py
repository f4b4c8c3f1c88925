"""Malformed mesh files through the whole chain give slices, with a warning after a repair, or a refusal in one line, in limited
time and memory."""

import json
import math
import os
import pathlib
import resource
import struct
import unittest
import zipfile

import meshes
import stack
from program import MIMAKI, PATIENCE, ProgramTest

CHAIN = ("--fit", "2", "--threads", "2", "!", "dither", "!", "slice-export", "out", "--overwrite", "--quiet")
BOX = meshes.box((2, 2, 2))

# Limits for slow and loaded machines. A run that hangs, or that trusts the sizes in a header, exceeds them.
SECONDS = 10
BYTES = 2 << 30


def binary_stl(triangles, count=None, header=b"mm"):
    records = b"".join(struct.pack("<12fH", 0, 0, 0, *sum(triangle, ()), 0) for triangle in triangles)
    return header.ljust(80) + struct.pack("<I", len(triangles) if count is None else count) + records


def ascii_stl(triangles, end="\n"):
    lines = ["solid box"]
    for triangle in triangles:
        lines += ["facet normal 0 0 0", "outer loop", *(f"vertex {x} {y} {z}" for x, y, z in triangle), "endloop", "endfacet"]
    return end.join([*lines, "endsolid box", ""]).encode()


def corners_and_faces(triangles):
    corners = sorted(set(sum(triangles, ())))
    return corners, [[corners.index(corner) for corner in triangle] for triangle in triangles]


def obj(triangles, faces=None, end="\n"):
    corners, own = corners_and_faces(triangles)
    lines = [f"v {x} {y} {z}" for x, y, z in corners]
    lines += ["f " + " ".join(str(index + 1) for index in face) for face in (own if faces is None else faces)]
    return end.join([*lines, ""]).encode()


def ply(triangles, vertices=None, faces=None, end="\n"):
    corners, own = corners_and_faces(triangles)
    lines = ["ply", "format ascii 1.0", f"element vertex {len(corners) if vertices is None else vertices}",
             *(f"property float {axis}" for axis in "xyz"), f"element face {len(own) if faces is None else faces}",
             "property list uchar int vertex_indices", "end_header"]
    lines += [f"{x} {y} {z}" for x, y, z in corners] + ["3 " + " ".join(map(str, face)) for face in own]
    return end.join([*lines, ""]).encode()


def binary_ply(triangles, list_length=3, index=0):
    corners, faces = corners_and_faces(triangles)
    header = (f"ply\nformat binary_little_endian 1.0\nelement vertex {len(corners)}\nproperty float x\nproperty float y\n"
              f"property float z\nelement face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n")
    return (header.encode() + b"".join(struct.pack("<3f", *corner) for corner in corners) +
            b"".join(struct.pack("<B3i", list_length, *(index + i for i in face)) for face in faces))


def spoilt(value):
    """Returns the box with `value` as one coordinate."""
    (a, b, c), *rest = BOX
    return [((value, *a[1:]), b, c), *rest]


def attributed_stl(triangles, size):
    """Returns a binary STL of which `size` bytes of attributes follow each record."""
    plain = binary_stl(triangles)
    return plain[:84] + b"".join(plain[84 + 50 * i:132 + 50 * i] + struct.pack("<H", size) + bytes([7] * size)
                                 for i in range(len(triangles)))


def faces_first(content):
    """Returns a mesh of text with its vertices after its faces."""
    lines = content.splitlines(keepends=True)
    if content.startswith(b"ply"):
        head, end = lines[:2], lines.index(b"end_header\n")
        vertices = end + 1 + int(lines[2].split()[-1])
        return b"".join(head + lines[6:end] + lines[2:6] + lines[end:end + 1] + lines[vertices:] + lines[end + 1:vertices])
    return b"".join(sorted(lines))


def strip(twisted):
    """Returns a hoop, or a Moebius strip."""
    def point(turn, across):
        angle, tilt = turn * math.tau / 60, turn * math.pi / 60 if twisted else math.pi / 2
        radius = 5 + across * math.cos(tilt)
        return radius * math.cos(angle), radius * math.sin(angle), across * math.sin(tilt)
    corners = [(point(i, -1), point(i, 1)) for i in range(60)]
    corners.append(corners[0][::-1] if twisted else corners[0])
    return [triangle for (a, b), (c, d) in zip(corners, corners[1:]) for triangle in ((a, c, d), (a, d, b))]


WHOLE_STL, WHOLE_TEXT, WHOLE_OBJ, WHOLE_PLY = binary_stl(BOX), ascii_stl(BOX), obj(BOX), ply(BOX)
NAN, INF = math.nan, math.inf

# Files that contain the whole box, and whether they cause a warning.
MENDED = {
    "windows.stl": (ascii_stl(BOX, "\r\n"), False),
    "old-mac.obj": (obj(BOX, end="\r"), False),
    "windows.obj": (obj(BOX, end="\r\n"), False),
    "windows.ply": (ply(BOX, end="\r\n"), False),
    "no-newline.stl": (WHOLE_TEXT.rstrip(), False),
    "no-newline.obj": (WHOLE_OBJ.rstrip(), False),
    "no-newline.ply": (WHOLE_PLY.rstrip(), False),
    "marked.obj": (b"\xef\xbb\xbf" + WHOLE_OBJ, False),
    "capitals.stl": (WHOLE_TEXT.upper(), False),
    "solid-header.stl": (binary_stl(BOX, header=b"solid box"), False),
    "wrong-name.stl": (WHOLE_OBJ, False),
    "wrong-name.obj": (WHOLE_STL, False),
    "count-0.stl": (binary_stl(BOX, 0), True),
    "count-4G.stl": (binary_stl(BOX, 0xFFFFFFFF), True),
    "count-too-low.stl": (binary_stl(BOX, 5), True),
    "more-behind.stl": (WHOLE_STL + b"made by a tool", True),
    "doubled-face.stl": (binary_stl([*BOX, BOX[0]]), True),
    "flipped-face.stl": (binary_stl([BOX[0][::-1], *BOX[1:]]), True),
    "missing-face.stl": (binary_stl(BOX[1:]), True),
    "inside-out.stl": (binary_stl([triangle[::-1] for triangle in BOX]), True),
    "flat-face.stl": (binary_stl([*BOX, (BOX[0][0],) * 3]), True),
    "attributes.stl": (attributed_stl(BOX, 2), False),
    "two-files.stl": (binary_stl(BOX[:6]) + binary_stl(BOX[6:]), True),
    "end-loop.stl": (WHOLE_TEXT.replace(b"endloop", b"end loop"), False),
    "end-all.stl": (WHOLE_TEXT.replace(b"end", b"END "), False),
    "glued.stl": (WHOLE_TEXT.replace(b"endsolid box", b"endsolidbox"), False),
    "colours.stl": (WHOLE_TEXT.replace(b"facet normal", b"color 0.5 0.5 0.5\n# red\nfacet normal"), False),
    "facets-in-lines.stl": (WHOLE_TEXT.replace(b"\n", b" ").replace(b" facet", b"\nfacet"), False),
    "one-line.stl": (WHOLE_TEXT.replace(b"\n", b" "), False),
    "no-end.stl": (WHOLE_TEXT.replace(b"endsolid box\n", b""), True),
    "commented.obj": (WHOLE_OBJ.replace(b"\n", b" # 1\n"), False),
    "glued-comments.obj": (WHOLE_OBJ.replace(b"\n", b"#1\n"), False),
    "faces-first.obj": (faces_first(WHOLE_OBJ), False),
    "continued.obj": (WHOLE_OBJ.replace(b"f ", b"f \\\n"), False),
    "faces-first.ply": (faces_first(WHOLE_PLY), False),
    "blank.ply": (WHOLE_PLY.replace(b"ply\n", b"ply \nobj_info x\n"), False),
    "more-on-lines.ply": (WHOLE_PLY.replace(b"\n3 ", b" 0 0\n3 ").replace(b"end_header 0 0", b"end_header"), True),
    "int64.ply": (WHOLE_PLY.replace(b"uchar int", b"uchar int64"), False),
    "return.binary.ply": (binary_ply(BOX).replace(b"end_header\n", b"end_header\r\n"), False),
    "no-return.binary.ply": (binary_ply(BOX).replace(b"\n", b"\r\n", 9).replace(b"end_header\r", b"end_header"), False),
}

# Files that must be refused.
REFUSED = {
    "empty.stl": b"", "empty.obj": b"", "empty.ply": b"", "blank.obj": b"\n\n \n",
    "header-only.stl": WHOLE_STL[:84], "half-header.stl": WHOLE_STL[:40], "no-triangles.stl": binary_stl([]),
    "cut.stl": WHOLE_STL[:-30], "cut-by-one.stl": WHOLE_STL[:-1], "cut-between.stl": WHOLE_STL[:-50],
    "count-too-high.stl": binary_stl(BOX, 13), "count-2G.stl": binary_stl(BOX, 0x7FFFFFFF),
    "text-cut.stl": WHOLE_TEXT[:len(WHOLE_TEXT) // 2], "text-empty.stl": b"solid\nendsolid\n", "text-start.stl": b"solid",
    "text-word.stl": WHOLE_TEXT.replace(b"outer", b"inner", 1), "text-two-corners.stl": WHOLE_TEXT.replace(b"vertex 0 0 0\n", b"", 1),
    **{f"{name}.{kind}": write(spoilt(value)) for name, value in (("nan", NAN), ("inf", INF), ("minus-inf", -INF))
       for kind, write in (("stl", binary_stl), ("obj", obj), ("ply", ply), ("text.stl", ascii_stl), ("binary.ply", binary_ply))},
    "index-0.obj": obj(BOX, [[-1, 1, 2]]), "index-beyond.obj": obj(BOX, [[0, 1, 99]]),
    "index-4G.obj": obj(BOX, [[0, 1, 1 << 32]]), "index-below.obj": WHOLE_OBJ + b"f -1 -2 -99\n", "index-text.obj": WHOLE_OBJ + b"f a b c\n",
    "no-faces.obj": obj(BOX, []), "two-corners.obj": obj(BOX, [[0, 1]]), "short-vertex.obj": b"v 1 2\n" + WHOLE_OBJ,
    "more-vertices.ply": ply(BOX, vertices=9), "fewer-vertices.ply": ply(BOX, vertices=7), "more-faces.ply": ply(BOX, faces=13),
    "no-faces.ply": ply(BOX, faces=0), "4G-vertices.ply": ply(BOX, vertices=1 << 32), "4G-faces.ply": ply(BOX, faces=1 << 62),
    "minus-faces.ply": ply(BOX, faces=-1), "no-header-end.ply": WHOLE_PLY.replace(b"end_header\n", b""), "header-only.ply": b"ply\n",
    "index-beyond.ply": WHOLE_PLY.replace(b"3 0", b"3 9", 1), "list-of-255.ply": binary_ply(BOX, 255), "list-of-0.ply": binary_ply(BOX, 0),
    "index-beyond.binary.ply": binary_ply(BOX, index=5), "index-below.binary.ply": binary_ply(BOX, index=-1),
    "cut.ply": WHOLE_PLY[:-20], "cut.binary.ply": binary_ply(BOX)[:-5],
    "noise.stl": bytes(range(256)) * 4, "zeros.stl": bytes(1000), "text.stl": b"this is no mesh\n", "page.stl": b"<html></html>\n",
    "broken.3mf": b"PK\x03\x04 and no more", "a.glb": b"glTF\x02\0\0\0", "a.off": b"OFF\n8 12 0\n",
    "one-triangle.stl": binary_stl(BOX[:1]), "flat.stl": binary_stl([(BOX[0][0],) * 3]), "plane.obj": obj([*BOX[:2], *BOX[:2]]),
    "moebius.stl": binary_stl(strip(True)), "hoop.stl": binary_stl(strip(False)),
    "longer-records.stl": binary_stl(BOX)[:84] + b"".join(binary_stl(BOX)[84 + 50 * i:134 + 50 * i] + b"xy" for i in range(12)),
    "undeclared-colours.binary.ply": binary_ply(BOX)[:-156] + b"".join(binary_ply(BOX)[-156:][13 * i:13 * i + 13] + b"rgb" for i in range(12)),
}


class Malformed(ProgramTest):
    def limit(self):
        if not os.environ.get("VDBDITHER_SANITIZER"):
            # The shadow memory of a sanitizer needs terabytes of addresses.
            resource.setrlimit(resource.RLIMIT_AS, (BYTES, BYTES))

    def outcome(self, mesh):
        """Returns standard error of a successful run, or None after a valid refusal."""
        before = self.listing()
        done = self.run_program("mesh2sdf", mesh, *MIMAKI, *CHAIN, timeout=SECONDS * PATIENCE,
                                preexec_fn=self.limit)
        said = done.stderr.decode()
        if done.returncode == 0:
            for line in said.splitlines():
                self.assertRegex(line, r"\Avdbdither [a-z0-9-]+: warning: ")
            manifest = json.loads((self.folder / "out/manifest.json").read_text())
            printed = sum(material["voxels"] for material in manifest["materials"])
            self.assertEqual(printed == 0, "warning: no voxel is printed; " in said, said)
            return said
        self.assertEqual(done.returncode, 1, said)
        self.assertRegex(said.splitlines()[-1], r"\Avdbdither mesh2sdf: .*[^.]\Z")
        errors = [line for line in said.splitlines() if ": warning: " not in line]
        self.assertEqual(len(errors), 1, said)
        self.assertEqual(self.listing(), before)
        return None

    def test_repairable_files_give_the_slices_of_the_whole_part(self):
        (self.folder / "whole.stl").write_bytes(WHOLE_STL)
        self.assertEqual(self.outcome("whole.stl"), "")
        whole = stack.sums(self.folder / "out")
        for name, (content, told) in MENDED.items():
            with self.subTest(name=name):
                (self.folder / name).write_bytes(content)
                said = self.outcome(name)
                self.assertIsNotNone(said)
                self.assertEqual(said != "", told, said)
                self.assertEqual(stack.sums(self.folder / "out"), whole)

    def test_unrepairable_files_are_refused(self):
        for name, content in REFUSED.items():
            with self.subTest(name=name):
                (self.folder / name).write_bytes(content)
                self.assertIsNone(self.outcome(name))

    def test_a_file_cut_anywhere_is_repaired_or_refused(self):
        for kind, content in (("stl", WHOLE_STL), ("text.stl", WHOLE_TEXT), ("obj", WHOLE_OBJ), ("ply", WHOLE_PLY),
                              ("binary.ply", binary_ply(BOX))):
            for part in range(1, 8):
                (self.folder / f"cut.{kind}").write_bytes(content[:len(content) * part // 8])
                with self.subTest(kind=kind, part=part):
                    self.outcome(f"cut.{kind}")

    def test_sparse_files_are_refused_by_their_heads(self):
        header = b"ply\nformat binary_little_endian 1.0\nelement vertex 400000000\nproperty float x\nproperty float y\nproperty float z\n"
        for name, content, why in (("zeros.stl", b"", "holds no triangles but zeros"),
                                   ("box.stl", WHOLE_STL, "its header announces 12 triangles, which are not what"),
                                   ("many.ply", header + b"end_header\n", "counts more than the file holds"),
                                   ("many.off", b"OFF\n400000000 1 0\n", "more than the file holds")):
            with self.subTest(name=name):
                (self.folder / name).write_bytes(content)
                os.truncate(self.folder / name, 2 << 30)
                process = self.start("mesh2sdf", name, *MIMAKI, "-o", "out.vdb")
                said = process.stderr.read().decode()
                _, status, usage = os.wait4(process.pid, 0)
                process.returncode = os.waitstatus_to_exitcode(status)
                self.assertEqual(process.returncode, 1, said)
                self.assertIn(why, said)
                if not os.environ.get("VDBDITHER_SANITIZER"):
                    self.assertLess(usage.ru_maxrss, 500 << 10)
                self.assertFalse((self.folder / "out.vdb").exists())

    def test_an_empty_part_is_reported(self):
        # It lies between the centres of two layers.
        (self.folder / "thin.stl").write_bytes(binary_stl(meshes.box((2, 2, 0.0002), (0, 0, 0.011))))
        self.assertIn("warning: no voxel is printed; ", self.outcome("thin.stl"))

    def test_an_archive_of_a_mesh_is_refused(self):
        with zipfile.ZipFile(self.folder / "part.3mf", "w") as archive:
            archive.writestr("part.stl", "solid")
        self.refuse(1, "'part.3mf': a zip archive without a 3MF model; name the mesh", "mesh2sdf", "part.3mf", *MIMAKI, *CHAIN)

    @unittest.skipUnless("VDBDITHER_MODELS" in os.environ, "VDBDITHER_MODELS names no folder of models")
    def test_every_malformed_model_is_repaired_or_refused(self):
        models = sorted((pathlib.Path(os.environ["VDBDITHER_MODELS"]) / "malformed").iterdir())
        self.assertGreater(len(models), 0)
        for model in models:
            with self.subTest(model=model.name):
                self.outcome(model)


if __name__ == "__main__":
    unittest.main()
