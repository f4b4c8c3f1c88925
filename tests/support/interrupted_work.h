#pragma once

#include <atomic>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <thread>

#include "vdbdither/model/interrupt.h"

namespace vdbdither::test {

/// Ends the process with 1 if `work` ends before a signal that comes after `delay`, or long after
/// it, and with 0 if it throws Interrupted.
template <class Work>
[[noreturn]] void endByInterrupt(std::chrono::milliseconds delay, const Work& work) {
  noteInterrupts();
  std::atomic<std::chrono::steady_clock::time_point> sent{};
  std::thread sender([&] {
    std::this_thread::sleep_for(delay);
    sent = std::chrono::steady_clock::now();
    std::raise(SIGINT);
  });
  try {
    work();
  } catch (const Interrupted&) {
    sender.join();
    std::_Exit(std::chrono::steady_clock::now() - sent.load() < std::chrono::seconds(10) ? 0 : 1);
  }
  std::_Exit(1);
}

}  // namespace vdbdither::test
