#include "io/vdb/pipe_input.h"

#include <cerrno>
#include <cstring>
#include <fcntl.h>
#include <unistd.h>

#include "io/file/descriptor_wait.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {

namespace {

[[noreturn]] void fail(const std::string& where) {
  throw DataError("cannot read " + where + ": " + std::strerror(errno));
}

}  // namespace

int openNamedPipe(const std::string& path, const std::string& where) {
  // Otherwise this would wait for a writer that may never come, deaf to the user.
  const int descriptor = ::open(path.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC);
  if (descriptor < 0) fail(where);
  const int flags = ::fcntl(descriptor, F_GETFL);
  if (flags < 0 || ::fcntl(descriptor, F_SETFL, flags & ~O_NONBLOCK) < 0) {
    ::close(descriptor);
    fail(where);
  }
  return descriptor;
}

std::size_t readSome(int descriptor, char* bytes, std::size_t size, const std::string& where) {
  for (;;) {
    waitForInput(descriptor);
    const ssize_t count = ::read(descriptor, bytes, size);
    if (count >= 0) return static_cast<std::size_t>(count);
    if (errno != EINTR && errno != EAGAIN) fail(where);
  }
}

}  // namespace vdbdither
