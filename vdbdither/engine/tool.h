#pragma once

#include <memory>
#include <string_view>

#include "vdbdither/engine/options.h"

namespace vdbdither {

/// A verb that works on files it names itself. It is the whole of its command line and no part of
/// a chain.
class Tool {
 public:
  virtual ~Tool() = default;
  virtual void declare(Options& options) = 0;
  /// Throws UsageError or DataError.
  virtual void run() = 0;
};

/// What the registry holds of a tool: `extern const ToolInfo printers` in ops/printers.cpp.
struct ToolInfo {
  std::string_view name;     ///< the verb, kebab-case
  std::string_view summary;  ///< one sentence, no full stop
  std::string_view example;  ///< a command line without the name of the program
  std::unique_ptr<Tool> (*make)();
  bool hidden = false;  ///< used by builds and left out of manuals
};

}  // namespace vdbdither
