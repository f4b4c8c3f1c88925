#include "vdbdither/program/ending.h"

#include <array>
#include <atomic>
#include <chrono>
#include <csignal>
#include <cstring>
#include <exception>
#include <new>
#include <poll.h>
#include <string>
#include <sys/uio.h>
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
  try {
    StagedOutput::abandonAll(patience_with_writes);
  } catch (...) {  // NOLINT(bugprone-empty-catch): memory is out, and the program ends
  }
  ::_exit(ending_code);
}

[[noreturn]] void endTerminated() {
  const char* message = "the program failed";
  std::string text;
  // Where memory is out, there may be none for a text either.
  constexpr const char* out_of_memory = "out of memory; try a smaller --slab or fewer --layers";
  try {
    try {
      if (std::current_exception()) throw;
    } catch (const std::bad_alloc&) {
      message = out_of_memory;
    } catch (const std::system_error& error) {
      text = refusedThread(error.code());
    } catch (const Error& error) {
      text = printable(error.what());
    } catch (const std::exception& error) {
      text = printable(unexpectedText(error));
    } catch (...) {
    }
  } catch (...) {
    message = out_of_memory;
  }
  claimEnding(1);
  endNow(text.empty() ? message : text.c_str(), 1);
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
  const auto part = [](const char* text) {
    return iovec{const_cast<char*>(text), std::strlen(text)};
  };
  // Over the line of progress. Without a string: memory may be out.
  const char* clear = ::isatty(STDERR_FILENO) ? "\r\033[K" : "";
  const std::array<iovec, 4> line{part(clear), part("vdbdither: "), part(message), part("\n")};
  pollfd output{STDERR_FILENO, POLLOUT, 0};
  if (::poll(&output, 1, 0) == 1)
    (void)!::writev(STDERR_FILENO, line.data(), static_cast<int>(line.size()));
}

void watchForInterrupts() { startThread(endOnInterrupt); }

}  // namespace vdbdither
