#pragma once

#include <chrono>

#include "vdbdither/model/errors.h"

namespace vdbdither {

/// The user or the system stopped the run. Destructors remove unfinished output.
class Interrupted : public Error {
 public:
  explicit Interrupted(int signal_number);
  [[nodiscard]] int signal() const { return signal_; }

 private:
  int signal_;
};

/// From here on SIGINT, SIGTERM, SIGHUP and SIGXCPU are noted, unless the program was started with
/// them ignored (nohup); the third ends the program at once. SIGPIPE and SIGXFSZ are left to the
/// failing write. A SIGBUS, which a mapped file causes that becomes shorter, stops the thread that
/// meets it, and is noted too.
void noteInterrupts();

/// Throws Interrupted once a signal was noted. Cheap; called wherever a run can be left.
void throwIfInterrupted();

/// Waits until a signal is noted, and returns it. For the one thread that ends the program if
/// nothing else does.
int waitForInterrupt();

/// Waits for another signal, no longer than this.
void waitForAnotherInterrupt(std::chrono::milliseconds patience);

}  // namespace vdbdither
