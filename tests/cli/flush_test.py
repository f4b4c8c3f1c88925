"""Outputs are on the disk before they get their names: a library between the program and the system notes the order of its calls."""

import os
import subprocess
import unittest

import meshes
from program import PROGRAM, ProgramTest

SOURCE = r"""
#define _GNU_SOURCE
#include <dlfcn.h>
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

static void note(const char* call, const char* name) {
  FILE* file = fopen(getenv("CALLS"), "a");
  fprintf(file, "%s %s\n", call, name);
  fclose(file);
}
static void note_file(const char* call, int file) {
  char link[64], name[4096];
  snprintf(link, sizeof link, "/proc/self/fd/%d", file);
  ssize_t size = readlink(link, name, sizeof name - 1);
  name[size < 0 ? 0 : size] = 0;
  note(call, name);
}
int fsync(int file) { note_file("fsync", file); return ((int (*)(int))dlsym(RTLD_NEXT, "fsync"))(file); }
int syncfs(int file) { note_file("syncfs", file); return ((int (*)(int))dlsym(RTLD_NEXT, "syncfs"))(file); }
int renameat2(int from, const char* old, int to, const char* name, unsigned flags) {
  note("rename", name);
  return ((int (*)(int, const char*, int, const char*, unsigned))dlsym(RTLD_NEXT, "renameat2"))(from, old, to, name, flags);
}
int rename(const char* old, const char* name) { note("rename", name); return ((int (*)(const char*, const char*))dlsym(RTLD_NEXT, "rename"))(old, name); }
"""


class Flush(ProgramTest):
    def calls(self, *options):
        """Returns the calls of a run that writes a file and a folder: what was done, and to which path."""
        (self.folder / "calls.c").write_text(SOURCE)
        library = self.folder / "calls.so"
        subprocess.run(["cc", "-shared", "-fPIC", "-o", library, self.folder / "calls.c", "-ldl"], check=True)
        meshes.write_stl(self.folder / "part.stl", meshes.box((1, 1, 0.3)))
        calls = self.folder / "calls.txt"
        environment = {**os.environ, "LD_PRELOAD": str(library), "CALLS": str(calls)}
        self.succeed("mesh2sdf", "part.stl", "--pitch", "0.1mm", "!", "dither", "!", "write", "part.vdb", "!", "slice-export", "out", *options,
                     env=environment)
        return [line.split(" ", 1) for line in calls.read_text().splitlines()]

    def test_files_and_folders_are_on_the_disk_before_they_have_their_names(self):
        home = self.folder.resolve()
        done = self.calls()
        for name, flush in (("part.vdb", "fsync"), ("out", "syncfs")):
            at = done.index(["rename", str(home / name)] if ["rename", str(home / name)] in done else ["rename", name])
            before = [call for call, path in done[:at] if f".{name}.partial-" in path]
            self.assertEqual(before, [flush], (name, done))
            self.assertIn(["fsync", str(home)], done[at:], (name, done))

    def test_nothing_waits_for_the_disk_where_that_is_not_wanted(self):
        self.assertEqual([call for call, _ in self.calls("--no-flush")], ["rename", "rename"])
        self.assertTrue((self.folder / "part.vdb").is_file() and (self.folder / "out").is_dir())


if __name__ == "__main__":
    unittest.main()
