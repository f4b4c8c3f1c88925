#include "vdbdither/model/interrupt.h"

#include <csignal>
#include <cstring>
#include <string>

namespace vdbdither {

namespace {

volatile std::sig_atomic_t noted_signal = 0;

void note(int number) {
  if (noted_signal) {
    std::signal(number, SIG_DFL);
    std::raise(number);
  }
  noted_signal = number;
}

}  // namespace

Interrupted::Interrupted(int signal_number)
    : Error(std::string("stopped: ") + strsignal(signal_number)), signal_(signal_number) {}

void noteInterrupts() {
  struct sigaction noting {};
  noting.sa_handler = note;
  // No SA_RESTART: a write to a pipe that nobody reads is to come back.
  for (const int number : {SIGINT, SIGTERM, SIGHUP}) ::sigaction(number, &noting, nullptr);
  std::signal(SIGPIPE, SIG_IGN);
}

void throwIfInterrupted() {
  if (noted_signal) throw Interrupted(noted_signal);
}

}  // namespace vdbdither
