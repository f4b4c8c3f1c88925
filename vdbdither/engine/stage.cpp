#include "vdbdither/engine/stage.h"

#include "vdbdither/engine/history.h"

namespace vdbdither {

Stage::Stage(const OperatorInfo& info) : info_(info), operator_(info.make()), monitor_(info.name) {
  operator_->declare(options_);
  operator_->setReporter(&monitor_);
}

void Stage::parse(const std::vector<std::string>& arguments, const Options& common) {
  callNamed(name(), [&] { options_.parse(arguments, common); });
}

StagePlan Stage::plan(const Schema& in) {
  return callNamed(name(), [&] {
    StagePlan plan;
    plan.name = info_.name;
    plan.kind = source()   ? StagePlan::Kind::source
                : filter() ? StagePlan::Kind::filter
                           : StagePlan::Kind::sink;
    plan.schema = planOperator(in, plan.reads);
    plan.arguments = options_.canonical();  // now, as the operator may have resolved values
    if (!info_.transport && !sink() && !operator_->keepsHistory())
      addToHistory(plan.schema, info_.name, options_);
    plan.is_barrier = operator_->isBarrier() || widest(plan.reads).whole;
    plan.memory_bytes = operator_->memoryBytes();
    for (const Input* input : operator_->inputs()) {
      const double bytes = input->memoryBytes();
      plan.inputs.push_back(
          {input->path(), input->isPipe(), input->schema().lattice.layers(), bytes});
      plan.memory_bytes += bytes;
    }
    plan.work = operator_->work();
    if (sink()) plan.output = sink()->output();
    return plan;
  });
}

Schema Stage::planOperator(const Schema& in, std::vector<Read>& reads) {
  if (source()) return source()->plan();
  if (filter()) {
    Schema out = filter()->plan(in);
    reads = filter()->reads();
    return out;
  }
  sink()->plan(in);
  if (const auto names = sink()->reads()) {
    for (const std::string& name : *names) reads.push_back({name, Reach::point()});
  } else {
    for (const auto& [name, grid] : in.grids) reads.push_back({name, Reach::point()});
  }
  return in;
}

}  // namespace vdbdither
