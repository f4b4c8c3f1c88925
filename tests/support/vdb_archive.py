"""Separates the metadata of VDB archives from their voxels, without OpenVDB.

The layout is that of openvdb/io/Archive.cc and GridDescriptor.cc, file version 224.
"""

import hashlib
import math
import struct


class Archive:
    """`metadata` of the file and its grids, and `voxels`, the SHA-256 object of everything else but the UUID."""

    def __init__(self, data):
        self.data, self.at = data, 57
        seekable = data[20]
        self.metadata = self.map()
        self.voxels = hashlib.sha256(data[self.at:self.at + 4])
        self.transforms = []
        if not seekable:  # on a pipe, archives do not state where their grids end
            self.voxels.update(data[self.at:])
            return
        for _ in range(self.number("i")):
            begin = self.at
            name = self.text()
            self.text(), self.text()
            self.voxels.update(data[begin:self.at])
            offsets = self.at
            _, _, end = struct.unpack_from("<3q", data, self.at)
            self.at += 24 + 4
            self.metadata |= {f"{name}: {key}": value for key, value in self.map().items()}
            self.transforms.append((offsets, self.at))
            self.voxels.update(data[self.at:end])
            self.at = end

    def number(self, kind):
        value, = struct.unpack_from("<" + kind, self.data, self.at)
        self.at += struct.calcsize(kind)
        return value

    def text(self):
        size = self.number("I")
        self.at += size
        return self.data[self.at - size:self.at].decode("utf-8", "replace")

    def map(self):
        entries = {}
        for _ in range(self.number("I")):
            key = self.text()
            self.text()
            entries[key] = self.text()
        return entries


def is_vdb(data):
    return data[:4] == b" BDV"


def archives(data):
    """The archives in a file or on a pipe. The UUID of each states its length, see docs/decisions/0002."""
    while is_vdb(data):
        uuid = data[21:57].decode()
        length = int(uuid[:8] + uuid[9:13], 16) if uuid[14] == "8" else len(data)
        yield Archive(data[:length])
        data = data[length:]


def digest_of_voxels(data):
    return hashlib.sha256(b"".join(archive.voxels.digest() for archive in archives(data))).hexdigest()


def turned_archive(data):
    """The archive of one grid with its scaling replaced by a rotation, and a random UUID, as other tools write it."""
    (offsets, at), = Archive(data).transforms
    size, = struct.unpack_from("<I", data, at)
    kind = data[at + 4:at + 4 + size].decode()
    old = 4 + size + {"UniformScaleMap": 120, "ScaleMap": 120, "UniformScaleTranslateMap": 144, "ScaleTranslateMap": 144}[kind]
    c, s, pitch = math.cos(0.4), math.sin(0.4), 0.06
    rows = (c * pitch, s * pitch, 0, 0, -s * pitch, c * pitch, 0, 0, 0, 0, pitch, 0, 0.3, -0.2, 0.1, 1)
    new = struct.pack("<I", 9) + b"AffineMap" + struct.pack("<16d", *rows)
    begin, blocks, end = struct.unpack_from("<3q", data, offsets)
    shift = len(new) - old
    moved = struct.pack("<3q", begin, blocks + shift, end + shift)
    uuid = b"00000000-0000-4000-8000-000000000000"
    return data[:21] + uuid + data[57:offsets] + moved + data[offsets + 24:at] + new + data[at + old:]
