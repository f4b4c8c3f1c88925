#include "io/file/descriptor_wait.h"

#include <cerrno>
#include <poll.h>

#include "vdbdither/model/interrupt.h"

namespace vdbdither {

namespace {

void waitFor(int descriptor, short events) {
  // A signal may arrive just before the wait begins, or in another thread.
  constexpr int look_again_milliseconds = 100;
  pollfd wanted{descriptor, events, 0};
  int ready = 0;
  do {
    throwIfInterrupted();
    ready = ::poll(&wanted, 1, look_again_milliseconds);
  } while (ready == 0 || (ready < 0 && errno == EINTR));
}

}  // namespace

void waitForInput(int descriptor) { waitFor(descriptor, POLLIN); }

void waitForOutput(int descriptor) { waitFor(descriptor, POLLOUT); }

}  // namespace vdbdither
