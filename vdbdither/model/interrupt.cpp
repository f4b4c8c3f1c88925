#include "vdbdither/model/interrupt.h"

#include <atomic>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <ctime>
#include <semaphore.h>
#include <string>
#include <unistd.h>

namespace vdbdither {

namespace {

// Lock-free, as a signal handler needs them.
std::atomic<int> noted_signal = 0;  ///< the first
std::atomic<int> noted_count = 0;
sem_t noted;  ///< counts the signals that nobody waited for yet

void note(int number) {
  // `timeout` and the shells of clusters send the same signal twice, to the process and to its
  // group.
  constexpr int most = 2;
  const int error = errno;
  if (noted_count++ == most) {
    std::signal(number, SIG_DFL);
    std::raise(number);
  }
  int none = 0;
  noted_signal.compare_exchange_strong(none, number);
  ::sem_post(&noted);
  errno = error;
}

void noteAndStay(int number) {
  // Behind the failed access the thread has nothing to go on with.
  noted_signal = number;
  ::sem_post(&noted);
  for (;;) ::pause();
}

void handle(int number, void (*handler)(int)) {
  struct sigaction action {};
  ::sigaction(number, nullptr, &action);
  if (action.sa_handler == SIG_IGN) return;
  // No SA_RESTART: a write to a pipe that nobody reads is to come back.
  action = {};
  action.sa_handler = handler;
  ::sigaction(number, &action, nullptr);
}

}  // namespace

Interrupted::Interrupted(int signal_number)
    : Error(std::string("stopped: ") + strsignal(signal_number)), signal_(signal_number) {}

void noteInterrupts() {
  ::sem_init(&noted, 0, 0);
  for (const int number : {SIGINT, SIGTERM, SIGHUP, SIGXCPU}) handle(number, note);
  handle(SIGBUS, noteAndStay);
  for (const int number : {SIGPIPE, SIGXFSZ}) std::signal(number, SIG_IGN);
}

void throwIfInterrupted() {
  if (const int number = noted_signal.load(std::memory_order_relaxed)) throw Interrupted(number);
}

int waitForInterrupt() {
  while (::sem_wait(&noted) != 0) {
  }
  return noted_signal;
}

void waitForAnotherInterrupt(std::chrono::milliseconds patience) {
  timespec end{};
  ::clock_gettime(CLOCK_MONOTONIC, &end);
  const auto nanoseconds = std::chrono::nanoseconds(patience).count() + end.tv_nsec;
  end.tv_sec += nanoseconds / 1'000'000'000;
  end.tv_nsec = nanoseconds % 1'000'000'000;
  while (::sem_clockwait(&noted, CLOCK_MONOTONIC, &end) != 0 && errno == EINTR) {
  }
}

}  // namespace vdbdither
