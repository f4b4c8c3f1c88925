#include "vdbdither/program/ending.h"

#include <atomic>
#include <chrono>
#include <csignal>
#include <cstring>
#include <exception>
#include <new>
#include <poll.h>
#include <string>
#include <system_error>
#include <thread>
#include <unistd.h>

#include "io/file/staged_output.h"
#include "vdbdither/model/interrupt.h"
#include "vdbdither/model/printable.h"
#include "vdbdither/model/unexpected.h"
#include "vdbdither/program/threads.h"

namespace vdbdither {

namespace {

using std::chrono::milliseconds;

/// How long `main` may take to come back after a signal.
constexpr milliseconds patience_with_main{200};
constexpr milliseconds patience_with_writes{100};

std::atomic<std::thread::id> ending_thread;
std::atomic<int> ending_code = 0;

/// Returns whether the calling thread is the one that ends the program.
bool isEnding(int code) {
  std::thread::id claimant;
  const std::thread::id self = std::this_thread::get_id();
  if (!ending_thread.compare_exchange_strong(claimant, self) && claimant != self) return false;
  ending_code = code;
  return true;
}

/// Ends the program; as another thread was about to, if it does not come to its end.
[[noreturn]] void endNow(const char* message, int code) {
  if (isEnding(code)) printLastLine(message);
  StagedOutput::abandonAll(patience_with_writes);
  ::_exit(ending_code);
}

[[noreturn]] void endTerminated() {
  std::string message = "the program failed";
  try {
    if (std::current_exception()) throw;
  } catch (const std::bad_alloc&) {
    message = "out of memory; try a smaller --slab or fewer --layers";
  } catch (const std::system_error& error) {
    message = refusedThread(error.code());
  } catch (const Error& error) {
    message = printable(error.what());
  } catch (const std::exception& error) {
    message = printable(unexpectedText(error));
  } catch (...) {
  }
  claimEnding(1);
  endNow(message.c_str(), 1);
}

[[noreturn]] void endOnInterrupt() {
  const int signal = waitForInterrupt();
  if (signal == SIGBUS)
    endNow("a file became shorter or unreadable while it was read; run again", 1);
  waitForAnotherInterrupt(patience_with_main);
  endNow(Interrupted(signal).what(), 128 + signal);
}

// Called before the initializers of the libraries, of which one starts threads and terminates the
// program where the system grants none. Sanitizers are not yet initialized then.
__attribute__((no_sanitize("address", "thread", "undefined"))) void handleTermination() {
  std::set_terminate(endTerminated);
}
[[gnu::section(".preinit_array"),
  gnu::used]] void (*const handles_termination)() = handleTermination;

}  // namespace

void claimEnding(int code) {
  while (!isEnding(code)) ::pause();
}

void printLastLine(const char* message) {
  std::string line = std::string("vdbdither: ") + message + "\n";
  if (::isatty(STDERR_FILENO)) line.insert(0, "\r\033[K");  // over the line of progress
  pollfd output{STDERR_FILENO, POLLOUT, 0};
  if (::poll(&output, 1, 0) == 1) (void)!::write(STDERR_FILENO, line.data(), line.size());
}

void watchForInterrupts() { startThread(endOnInterrupt); }

}  // namespace vdbdither
