#pragma once

#include <optional>
#include <vector>

#include "vdbdither/engine/chain.h"
#include "vdbdither/engine/job_plan.h"
#include "vdbdither/engine/monitor.h"
#include "vdbdither/engine/window.h"

namespace vdbdither {

/// Runs a chain of operators. Slabs are pushed upward in z, one at a time, from the source through
/// a window in front of each filter to the last sink; operators use all threads within a slab.
class Pipeline {
 public:
  /// See Chain.
  explicit Pipeline(const std::vector<Step>& steps, const FindOperator& find = findOperator);

  [[nodiscard]] const RunOptions& options() const { return chain_.options(); }
  [[nodiscard]] const OperatorInfo* helpWanted() const { return chain_.helpWanted(); }

  /// See planJob. `watcher` must outlive the pipeline.
  const JobPlan& plan(Watcher& watcher);

  /// Carries out the plan and publishes. Throws DataError; then nothing half-made remains.
  void run();

  /// Reads the pipes that feed a planned job to their end, so that their writers finish cleanly.
  /// `run` does this too; call it instead of `run` if nothing is made. Throws DataError if a writer
  /// fails.
  void readInputsToEnd();

  [[nodiscard]] JobReport report() const;

 private:
  /// A stage at work.
  struct Worker {
    Stage& stage;
    const StagePlan& plan;
    std::vector<Input*> inputs;    ///< of a filter
    std::optional<Window> window;  ///< of a filter
    int next_layer = 0;            ///< the first that has not come to it
  };

  void push(std::size_t index, Slab slab);
  void pushEmpty(std::size_t index, int end);
  void take(std::size_t index, Slab slab);
  void countOutput(Worker& worker, const Grids& grids) const;
  static void handOn(const Worker& worker, Grids& grids);
  [[nodiscard]] ZRange nextSlab(int begin, int end) const;

  Chain chain_;
  JobPlan plan_;
  Watcher* watcher_ = nullptr;
  std::vector<Worker> workers_;
};

}  // namespace vdbdither
