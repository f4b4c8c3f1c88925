#pragma once

#include "vdbdither/model/errors.h"

namespace vdbdither {

/// The user or the system asked the run to stop. Destructors take away what was half made.
class Interrupted : public Error {
 public:
  explicit Interrupted(int signal_number);
  [[nodiscard]] int signal() const { return signal_; }

 private:
  int signal_;
};

/// From here on SIGINT, SIGTERM and SIGHUP are noted, for throwIfInterrupted to find; a second one
/// ends the program at once. SIGPIPE is left to the failing write.
void noteInterrupts();

/// Throws Interrupted once a signal was noted. Cheap; called wherever a run can be left.
void throwIfInterrupted();

}  // namespace vdbdither
