#pragma once

#include <memory>
#include <span>
#include <string_view>

#include "vdbdither/engine/options.h"

namespace vdbdither {

/// A word that stands in place of a chain and does something of its own.
class Command {
 public:
  virtual ~Command() = default;
  virtual void declare(Options& options) = 0;
  /// Throws UsageError or DataError.
  virtual void run() = 0;
};

/// What the program holds of a command: `extern const CommandInfo printers` in
/// ops/printers.cpp.
struct CommandInfo {
  std::string_view name;
  std::string_view summary;  ///< one sentence, no full stop
  std::string_view example;  ///< its arguments
  std::unique_ptr<Command> (*make)();
  bool hidden = false;  ///< for builds, not for people
};

/// Every command.
std::span<const CommandInfo* const> commands();

/// The command of that name, or null.
const CommandInfo* findCommand(std::string_view name);

}  // namespace vdbdither
