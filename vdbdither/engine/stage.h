#pragma once

#include <memory>
#include <string>
#include <vector>

#include "vdbdither/engine/job_plan.h"
#include "vdbdither/engine/monitor.h"
#include "vdbdither/engine/operator.h"

namespace vdbdither {

/// An operator in its place in a chain, with its options and what watches it.
class Stage {
 public:
  explicit Stage(const OperatorInfo& info);
  Stage(const Stage&) = delete;
  Stage& operator=(const Stage&) = delete;

  /// Reads the arguments into the options of the operator and `common`. Throws UsageError.
  void parse(const std::vector<std::string>& arguments, const Options& common);

  /// Plans the operator on what comes from the stage before; a source ignores it. Fills the parts
  /// of the result that concern this stage alone. Throws UsageError or DataError.
  StagePlan plan(const Schema& in);

  [[nodiscard]] const OperatorInfo& info() const { return info_; }
  [[nodiscard]] std::string name() const { return std::string(info_.name); }
  [[nodiscard]] const Options& options() const { return options_; }
  [[nodiscard]] Monitor& monitor() { return monitor_; }
  [[nodiscard]] const Monitor& monitor() const { return monitor_; }

  [[nodiscard]] std::vector<Input*> inputs() { return operator_->inputs(); }
  /// Each is null unless the operator is of that kind.
  [[nodiscard]] Source* source() const { return dynamic_cast<Source*>(operator_.get()); }
  [[nodiscard]] Filter* filter() const { return dynamic_cast<Filter*>(operator_.get()); }
  [[nodiscard]] Sink* sink() const { return dynamic_cast<Sink*>(operator_.get()); }

 private:
  [[nodiscard]] Schema planOperator(const Schema& in, std::vector<Read>& reads);

  const OperatorInfo& info_;
  Options options_;
  std::unique_ptr<Operator> operator_;
  Monitor monitor_;
};

}  // namespace vdbdither
