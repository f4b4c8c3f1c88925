#pragma once

#include <memory>
#include <string>
#include <string_view>

#include "vdbdither/engine/verb.h"

namespace vdbdither {

/// A verb that works on files it names itself. It is the whole command line, never part of a chain.
class Tool : public Verb {
 public:
  /// Throws UsageError or DataError.
  virtual void run() = 0;
};

/// The registry's entry for a tool: `extern const ToolInfo printers` in ops/printers.cpp.
struct ToolInfo {
  std::string_view name;     ///< the verb, kebab-case
  std::string_view summary;  ///< one sentence, no full stop
  std::string_view example;  ///< a command line without the name of the program
  std::unique_ptr<Tool> (*make)();
  bool hidden = false;  ///< used by builds and left out of manuals
  /// Takes the options of a run that apply to a tool: threads, progress, no-flush, quiet and
  /// verbose.
  bool takes_run_options = false;
};

/// The tool that an operator becomes if it is the whole command line and its first word names a
/// file to work on in place of the slabs of a chain: `measure part.stl` measures a mesh, `measure`
/// at the end of a chain what comes down the chain.
struct FileTool {
  /// Whether the tool works on this file. Any other is read as the input of a chain.
  bool (*takes)(const std::string& file) = nullptr;
  /// The tool declares every option of the operator and, as its first positional, the file.
  std::unique_ptr<Tool> (*make)() = nullptr;
};

}  // namespace vdbdither
