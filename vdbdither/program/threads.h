#pragma once

#include <optional>
#include <string>
#include <system_error>

#include <tbb/global_control.h>

namespace vdbdither {

/// Returns what to tell the user if the system grants no thread.
std::string refusedThread(const std::error_code& reason);

/// Starts a thread that runs until the program ends. Throws DataError if the system grants none.
void startThread(void (*function)());

/// Limits the threads of TBB, which fails where one is not granted, to those that the system
/// grants.
class GrantedThreads {
 public:
  /// Throws DataError if the system grants no thread beside the calling one.
  GrantedThreads();

 private:
  std::optional<tbb::global_control> limit_;
};

}  // namespace vdbdither
