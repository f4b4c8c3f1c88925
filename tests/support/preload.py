"""Libraries between the program and the system, that change what the system answers."""

import os
import subprocess

# Calls that change files are numbered from 1. `KILL_AT=n` ends the process before call n, `FAIL_AT=n` makes it fail with FAIL_AS,
# and with FAIL_ON every later one that takes space, FAIL_CLOSE each close of a file that was written. To remove a file takes
# SLOW_MS longer. CALLS receives the names of the calls.
CHANGES = r"""
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/uio.h>
#include <unistd.h>

static int number(const char* name) { const char* text = getenv(name); return text ? atoi(text) : 0; }

static pthread_mutex_t mutex = PTHREAD_MUTEX_INITIALIZER;
static int calls;

/* Whether the next change is to fail. */
static int fails(const char* name) {
  pthread_mutex_lock(&mutex);
  const int call = ++calls;
  if (call == number("KILL_AT")) kill(getpid(), SIGKILL);
  const char* log = getenv("CALLS");
  if (log) {
    const int file = syscall(SYS_openat, AT_FDCWD, log, O_WRONLY | O_CREAT | O_APPEND, 0666);
    syscall(SYS_write, file, name, strlen(name));
    syscall(SYS_write, file, "\n", 1);
    syscall(SYS_close, file);
  }
  const int at = number("FAIL_AT");
  const int takes_space = strcmp(name, "remove") != 0 && strcmp(name, "rename") != 0;
  const int does = at && (call == at || (call > at && takes_space && number("FAIL_ON")));
  pthread_mutex_unlock(&mutex);
  if (does) errno = number("FAIL_AS");
  return does;
}

static int is_file(int file) {
  struct stat status;
  const int error = errno;
  const int is = fstat(file, &status) == 0 && S_ISREG(status.st_mode);
  errno = error;
  return is;
}
static int is_written(int file) { return is_file(file) && (fcntl(file, F_GETFL) & O_ACCMODE) != O_RDONLY; }
static int changes(const char* mode) { return strpbrk(mode, "wa+") != NULL; }

#define REAL(type, name, ...) type (*real)(__VA_ARGS__) = dlsym(RTLD_NEXT, name)
#define OPEN(name)                                                         \
  int name(const char* path, int flags, ...) {                             \
    va_list list; va_start(list, flags); const int mode = va_arg(list, int); va_end(list); \
    if ((flags & O_CREAT) && fails("open")) return -1;                     \
    REAL(int, #name, const char*, int, ...);                               \
    return real(path, flags, mode);                                        \
  }
OPEN(open) OPEN(open64)
#define FOPEN(name)                                         \
  FILE* name(const char* path, const char* mode) {          \
    if (changes(mode) && fails("open")) return NULL;        \
    REAL(FILE*, #name, const char*, const char*);           \
    return real(path, mode);                                \
  }
FOPEN(fopen) FOPEN(fopen64)

ssize_t write(int file, const void* bytes, size_t size) {
  if (is_file(file) && fails("write")) return -1;
  REAL(ssize_t, "write", int, const void*, size_t);
  return real(file, bytes, size);
}
ssize_t writev(int file, const struct iovec* parts, int count) {
  if (is_file(file) && fails("write")) return -1;
  REAL(ssize_t, "writev", int, const struct iovec*, int);
  return real(file, parts, count);
}
size_t fwrite(const void* bytes, size_t size, size_t count, FILE* file) {
  if (is_file(fileno(file)) && fails("write")) return 0;
  REAL(size_t, "fwrite", const void*, size_t, size_t, FILE*);
  return real(bytes, size, count, file);
}
int close(int file) {
  const int bad = number("FAIL_CLOSE") && is_written(file);
  REAL(int, "close", int);
  const int done = real(file);
  if (bad) errno = number("FAIL_AS");
  return bad ? -1 : done;
}
int fclose(FILE* file) {
  const int bad = number("FAIL_CLOSE") && is_written(fileno(file));
  REAL(int, "fclose", FILE*);
  const int done = real(file);
  if (bad) errno = number("FAIL_AS");
  return bad ? EOF : done;
}
int mkdir(const char* path, mode_t mode) { REAL(int, "mkdir", const char*, mode_t); return fails("mkdir") ? -1 : real(path, mode); }
int fsync(int file) { REAL(int, "fsync", int); return fails("flush") ? -1 : real(file); }
int syncfs(int file) { REAL(int, "syncfs", int); return fails("flush") ? -1 : real(file); }
int rename(const char* from, const char* to) { REAL(int, "rename", const char*, const char*); return fails("rename") ? -1 : real(from, to); }
int renameat2(int old, const char* from, int new, const char* to, unsigned flags) {
  REAL(int, "renameat2", int, const char*, int, const char*, unsigned);
  if (flags && number("NO_EXCHANGE")) { errno = EINVAL; return -1; }
  return fails("rename") ? -1 : real(old, from, new, to, flags);
}
int unlinkat(int folder, const char* path, int flags) { usleep(1000 * number("SLOW_MS")); REAL(int, "unlinkat", int, const char*, int); return fails("remove") ? -1 : real(folder, path, flags); }
int unlink(const char* path) { REAL(int, "unlink", const char*); return fails("remove") ? -1 : real(path); }
int rmdir(const char* path) { REAL(int, "rmdir", const char*); return fails("remove") ? -1 : real(path); }
int remove(const char* path) { usleep(1000 * number("SLOW_MS")); REAL(int, "remove", const char*); return fails("remove") ? -1 : real(path); }
"""

# Each look at a clock finds it a day later than the one before, or a day earlier, in turn, or always later: CLOCK=later.
CLOCK = r"""
#define _GNU_SOURCE
#include <dlfcn.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

int clock_gettime(clockid_t clock, struct timespec* time) {
  static int looks;
  int (*real)(clockid_t, struct timespec*) = dlsym(RTLD_NEXT, "clock_gettime");
  const int done = real(clock, time);
  const int look = __atomic_add_fetch(&looks, 1, __ATOMIC_RELAXED);
  time->tv_sec += 86400L * (strcmp(getenv("CLOCK"), "later") == 0 ? look : look % 2);
  return done;
}
"""


def library(folder, source):
    """Compiles a library into a folder and returns its path."""
    path = folder / "preloaded.so"
    (folder / "preloaded.c").write_text(source)
    subprocess.run(["cc", "-shared", "-fPIC", "-O1", "-o", path, folder / "preloaded.c", "-ldl"], check=True)
    return path


def environment(path, **variables):
    """Returns an environment in which the program meets the library, with variables that say what it does."""
    return {**os.environ, "LD_PRELOAD": str(path), **{name: str(value) for name, value in variables.items()}}
