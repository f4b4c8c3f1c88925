#pragma once

#include <memory>
#include <string>
#include <vector>

#include "vdbdither/engine/monitor.h"
#include "vdbdither/engine/operator.h"
#include "vdbdither/engine/run_options.h"

namespace vdbdither {

/// A tool with its arguments read.
class ToolRun {
 public:
  /// A verb that is a tool. Throws UsageError.
  ToolRun(const ToolInfo& info, const std::vector<std::string>& arguments);

  /// The tool that an operator becomes on a file (see `worksOnFile`). It takes the options of every
  /// operator, too, apart from those that only a chain can obey. Throws UsageError.
  ToolRun(const OperatorInfo& info, const std::vector<std::string>& arguments);

  [[nodiscard]] const RunOptions& options() const { return options_; }

  /// Throws UsageError or DataError. `watcher` must outlive the call.
  void run(Watcher& watcher);

  [[nodiscard]] JobReport report() const { return {0, 0, {}, {monitor_.report()}}; }

 private:
  RunOptions options_;
  std::unique_ptr<Tool> tool_;
  Monitor monitor_;
};

}  // namespace vdbdither
