#!/usr/bin/python3
"""Records the SHA-256 of everything that vdbdither writes, to prove that a refactoring changes no output.

    digests.py record PROGRAM > digests.json
    digests.py compare PROGRAM digests.json

`compare` takes two programs, two records, or one of each. PROGRAM is the vdbdither of a build tree, with operators/ and share/
next to it. Each chain runs in a folder of its own and uses relative file names only.

There are two groups of differences. Bytes are slices, volumes, masks, meshes, reports and exit codes; `compare` exits with 1 if
any differ. Texts are help, manuals, messages and other words; they are listed, and do not fail unless --texts is given. Of a
.vdb or a pipe, `compare` says whether voxels differ or only metadata. With two programs it also shows the metadata keys, the
result of `vdbdither compare`, and a diff of the texts.
"""

import argparse
import concurrent.futures
import difflib
import fnmatch
import hashlib
import json
import os
import pathlib
import re
import resource
import subprocess
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.dont_write_bytecode = True
sys.path[:0] = [str(ROOT / "tests/support"), str(ROOT / "samples")]
from digest_chains import all_chains, stages  # noqa: E402
from digest_inputs import write_inputs  # noqa: E402
from vdb_archive import archives, digest_of_voxels, is_vdb, turned_archive  # noqa: E402

# Keys of JSON whose values differ from run to run.
VOLATILE = {"seconds", "cpu_seconds", "expected_seconds", "expected_cpu_seconds", "peak_memory_bytes"}

TEXT_SUFFIXES = {".md", ".1", ".txt", ".bash", ".fish"}


def without_volatile(value):
    if isinstance(value, dict):
        return {key: without_volatile(item) for key, item in value.items() if key not in VOLATILE}
    return [without_volatile(item) for item in value] if isinstance(value, list) else value


def stable_json(text):
    """JSON without volatile values; None if `text` is not JSON."""
    if not text.startswith((b"{", b"[")):
        return None
    try:
        return json.dumps(without_volatile(json.loads(text))).encode() + b"\n"
    except ValueError:
        return None


def stable(data):
    """What a standard stream carried, without the volatile values of JSON, and its group."""
    if is_vdb(data):
        return data, "bytes"
    if whole := stable_json(data):
        return whole, "bytes"
    lines = [(stable_json(line), line) for line in data.splitlines(keepends=True)]
    return b"".join(json_line or line for json_line, line in lines), "bytes" if all(j for j, _ in lines) else "texts"


class Recording:
    """The folder of one program: `inputs`, and `chains` with the outputs of each."""

    def __init__(self, program, folder):
        self.program = pathlib.Path(program).resolve()
        if not os.access(self.program, os.X_OK) or self.program.is_dir():
            sys.exit(f"digests.py: '{program}' is not a program")
        self.folder = folder
        self.inputs = folder / "inputs"
        self.inputs.mkdir(parents=True)
        self.environment = {"PATH": f"{self.program.parent}:{self.program.parent}/operators:/usr/bin:/bin", "HOME": str(folder),
                            "XDG_CACHE_HOME": str(folder / "cache"), "LC_ALL": "C.UTF-8", "TZ": "UTC"}

    def run(self, chain, line):
        """The entry of a chain. Its outputs stay in its folder."""
        place = self.folder / "chains" / chain
        place.mkdir(parents=True)
        given = {name for name in re.findall(r"[\w.-]+", line) if (self.inputs / name).is_file()}
        for name in given:
            os.link(self.inputs / name, place / name)
        done = subprocess.run(["bash", "-o", "pipefail", "-c", line], cwd=place, env=self.environment, stdin=subprocess.DEVNULL,
                              capture_output=True)
        entry = {"command": line, "exit": done.returncode, "bytes": {}, "texts": {}, "voxels": {}}
        files = {str(path.relative_to(place)): path.read_bytes() for path in sorted(place.rglob("*")) if path.is_file()}
        for name, data in files.items():
            if name not in given:
                self.enter(entry, name, data, "texts" if pathlib.Path(name).suffix in TEXT_SUFFIXES or
                           line.startswith("vdbdither docs") else "bytes")
        for name, data in (("stdout", done.stdout), ("stderr", done.stderr)):
            data, group = stable(data)
            if data:
                self.enter(entry, name, data, group)
                (place / name).write_bytes(data)
        return entry

    @staticmethod
    def enter(entry, name, data, group):
        entry[group][name] = hashlib.sha256(data).hexdigest()
        if is_vdb(data):
            entry["voxels"][name] = digest_of_voxels(data)

    def make(self, pattern):
        """The record: an entry for each chain whose name matches, and for the stages."""
        write_inputs(self.inputs)
        record = {}
        for name, line in stages().items():
            record[name] = self.run(name, line)
            made = self.folder / "chains" / name / name
            if not made.is_file():
                sys.exit(f"digests.py: '{line}' failed: {(made.parent / 'stderr').read_text()}")
            os.link(made, self.inputs / name)
            if name == "cubes.vdb":
                (self.inputs / "turned.vdb").write_bytes(turned_archive(made.read_bytes()))
        wanted = {name: line for name, line in all_chains().items() if fnmatch.fnmatchcase(name, pattern)}
        with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
            record |= zip(wanted, pool.map(self.run, wanted.keys(), wanted.values()))
        return dict(sorted(record.items()))


def children_seconds():
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


def record_of(source, folder, pattern):
    """The record in a file or of a program, and the Recording of the latter."""
    if source.suffix == ".json":
        chains = json.loads(source.read_text())
        return {name: entry for name, entry in chains.items() if fnmatch.fnmatchcase(name, pattern) or name in stages()}, None
    start, cpu_start = time.monotonic(), children_seconds()
    recording = Recording(source, folder)
    record = recording.make(pattern)
    files = sum(len(entry["bytes"]) + len(entry["texts"]) for entry in record.values())
    print(f"{source}: {len(record)} chains, {files} outputs, {time.monotonic() - start:.0f} s, "
          f"{children_seconds() - cpu_start:.0f} s of CPU", file=sys.stderr)
    return record, recording


def differences(ours, theirs):
    """Chain, group, name and remark of each difference."""
    for chain in sorted(ours.keys() | theirs.keys()):
        a, b = ours.get(chain), theirs.get(chain)
        if not a or not b:
            yield chain, "bytes", "chain", "only the " + ("first" if a else "second") + " has it"
            continue
        for key in ("command", "exit"):
            if a[key] != b[key]:
                yield chain, "bytes", key, f"{a[key]} and {b[key]}"
        for group in ("bytes", "texts"):
            for name in sorted(a[group].keys() | b[group].keys()):
                one, other = a[group].get(name), b[group].get(name)
                if one == other:
                    continue
                remark = "differs" if one and other else "only the " + ("first" if one else "second") + " has it"
                if one and other and name in a["voxels"] and name in b["voxels"]:
                    same = a["voxels"][name] == b["voxels"][name]
                    remark = "only the metadata differs" if same else "voxels differ"
                yield chain, group, name, remark


def detail(recordings, chain, group, name):
    """Lines that describe a difference between the outputs of two programs."""
    paths = [recording.folder / "chains" / chain / name for recording in recordings]
    if not all(path.is_file() for path in paths):
        return
    data = [path.read_bytes() for path in paths]
    if group == "texts":
        texts = [part.decode("utf-8", "replace").splitlines() for part in data]
        yield from list(difflib.unified_diff(*texts, lineterm="", n=0))[2:]
    elif all(map(is_vdb, data)):
        first, second = ([archive.metadata for archive in archives(part)] for part in data)
        keys = {key for a, b in zip(first, second) for key in a.keys() | b.keys() if a.get(key) != b.get(key)}
        if keys:
            yield "metadata: " + ", ".join(sorted(keys))
        if name.endswith(".vdb"):
            done = subprocess.run([recordings[0].program, "compare", *paths], capture_output=True, text=True)
            yield (done.stdout + done.stderr).strip()


def compare(sources, folder, pattern, texts_count):
    found = [record_of(source, folder / number, pattern) for source, number in zip(sources, ("first", "second"))]
    (ours, first), (theirs, second) = found
    counts = {"bytes": 0, "texts": 0}
    lines = {"bytes": [], "texts": []}
    for chain, group, name, remark in differences(ours, theirs):
        counts[group] += 1
        lines[group].append(f"{chain}: {name}: {remark}")
        if first and second:
            lines[group] += ["    " + line for line in detail((first, second), chain, group, name)]
    for group in ("texts", "bytes"):
        if lines[group]:
            print(f"{group}:", *lines[group], sep="\n  ")
    print(f"{counts['bytes']} differences of bytes, {counts['texts']} of texts")
    return 1 if counts["bytes"] or (texts_count and counts["texts"]) else 0


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    shared = argparse.ArgumentParser(add_help=False)
    shared.add_argument("--only", default="*", metavar="PATTERN", help="chains whose names match, as in 'dither *'")
    shared.add_argument("--keep", type=pathlib.Path, metavar="FOLDER", help="keep the outputs in this new folder")
    actions = parser.add_subparsers(dest="action", required=True)
    recorder = actions.add_parser("record", parents=[shared], help="prints the record of a program")
    recorder.add_argument("program", type=pathlib.Path)
    comparer = actions.add_parser("compare", parents=[shared], help="prints what differs between two programs or records")
    comparer.add_argument("sources", type=pathlib.Path, nargs=2, metavar="PROGRAM|FILE.json")
    comparer.add_argument("--texts", action="store_true", help="exit with 1 where texts differ, too")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="vdbdither-digests-") as scratch:
        folder = given.keep or pathlib.Path(scratch) / "all"
        folder.mkdir(parents=True)
        folder = folder.resolve()
        if given.action == "compare":
            return compare(given.sources, folder, given.only, given.texts)
        json.dump(record_of(given.program, folder, given.only)[0], sys.stdout, indent=1)
        print()
        return 0


if __name__ == "__main__":
    sys.exit(main())
