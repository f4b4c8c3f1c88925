#include "vdbdither/engine/tool_run.h"

#include <optional>

#include <tbb/global_control.h>

namespace vdbdither {

ToolRun::ToolRun(const ToolInfo& info, const std::vector<std::string>& arguments)
    : tool_(info.make()), monitor_(info.name) {
  callNamed(monitor_.verb(), [&] {
    Options own;
    tool_->declare(own);
    Options common;
    if (info.takes_run_options) options_.declareForTool(common);
    own.parse(arguments, common);
  });
}

ToolRun::ToolRun(const OperatorInfo& info, const std::vector<std::string>& arguments)
    : tool_(info.on_file.make()), monitor_(info.name) {
  callNamed(monitor_.verb(), [&] {
    Options own;
    tool_->declare(own);
    Options common;
    options_.declare(common);
    own.parse(arguments, common);
    for (const auto& [name, given] : {std::pair("--input", !options_.input.empty()),
                                      {"--output", !options_.output.empty()},
                                      {"--layers", !options_.layers.empty()},
                                      {"--explain", options_.explain}}) {
      if (given)
        throw UsageError(std::string(name) + ": only for chains, not with a file to work on");
    }
  });
}

void ToolRun::run(Watcher& watcher) {
  std::optional<tbb::global_control> threads;
  if (options_.threads > 0) {
    threads.emplace(tbb::global_control::max_allowed_parallelism, options_.threads);
  }
  monitor_.attach(watcher);
  tool_->setReporter(&monitor_);
  monitor_.timed([&] { tool_->run(); });
}

}  // namespace vdbdither
