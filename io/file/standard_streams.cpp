#include "io/file/standard_streams.h"

#include <cerrno>
#include <cstring>
#include <fcntl.h>
#include <string>
#include <unistd.h>

#include "io/file/descriptor_wait.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/printable.h"

namespace vdbdither {

namespace {

int data_descriptor = STDOUT_FILENO;

}  // namespace

void openStandardDescriptors() {
  for (const int descriptor : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) {
    if (::fcntl(descriptor, F_GETFD) >= 0 || errno != EBADF) continue;
    // It gets the lowest number that is free, and only the wrong direction.
    ::open("/dev/null", descriptor == STDIN_FILENO ? O_WRONLY : O_RDONLY);
  }
}

void setStandardOutputAside() {
  const int copy = ::dup(STDOUT_FILENO);
  if (copy < 0) return;
  data_descriptor = copy;
  ::dup2(STDERR_FILENO, STDOUT_FILENO);
}

int dataOutput() { return data_descriptor; }

void printData(const char* given) {
  const std::string shown = printableLines(given);
  const char* text = shown.data();
  for (std::size_t left = shown.size(); left > 0;) {
    const ssize_t count = ::write(data_descriptor, text, left);
    if (count < 0 && (errno == EINTR || errno == EAGAIN)) {
      waitForOutput(data_descriptor);
      continue;
    }
    if (count < 0)
      throw DataError(std::string("cannot write to standard output: ") + std::strerror(errno));
    text += count;
    left -= static_cast<std::size_t>(count);
  }
}

}  // namespace vdbdither
