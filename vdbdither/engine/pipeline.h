#pragma once

#include <filesystem>
#include <optional>
#include <span>
#include <vector>

#include "vdbdither/engine/chain.h"
#include "vdbdither/engine/job_plan.h"
#include "vdbdither/engine/monitor.h"
#include "vdbdither/engine/window.h"

namespace vdbdither {

/// The layers of a job that one of several runs makes, and the folder of what their sinks publish.
struct Piece {
  ZRange layers;  ///< of the last stage
  std::filesystem::path folder;
};

/// Runs a chain of operators. Slabs are pushed upward in z, one at a time, from the source through
/// a window in front of each filter to the last sink; operators use all threads within a slab.
class Pipeline {
 public:
  /// See Chain.
  explicit Pipeline(const std::vector<Step>& steps, const FindOperator& find = findOperator);

  [[nodiscard]] const RunOptions& options() const { return chain_.options(); }
  [[nodiscard]] const OperatorInfo* helpWanted() const { return chain_.helpWanted(); }

  /// Makes the sinks publish pieces of their outputs, each in a folder of its own within
  /// `folder`. Call it before `plan`. Throws UsageError where an output cannot be made in
  /// pieces.
  void makePiece(const std::filesystem::path& folder);

  /// See planJob. `watcher` must outlive the pipeline.
  const JobPlan& plan(Watcher& watcher);

  /// Carries out the plan and publishes. Throws DataError; then nothing half-made remains.
  void run();

  /// Joins the pieces that other runs of the chain made, and publishes; in place of `run`.
  /// \param pieces  of all layers, in rising z
  /// Throws DataError; then nothing half-made remains.
  void join(std::span<const Piece> pieces);

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

  /// Finishes all sinks, then publishes what they made.
  void publish();
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
