#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "vdbdither/engine/chain.h"
#include "vdbdither/engine/operator.h"
#include "vdbdither/engine/run_options.h"
#include "vdbdither/engine/window.h"

namespace vdbdither {

/// What the user sees while a pipeline runs.
class Watcher {
 public:
  virtual ~Watcher() = default;
  virtual void warn(const std::string& stage, const std::string& text) = 0;
  /// `done` of `total` layers have reached the end; `fraction` is how far a long step within one
  /// slab is.
  virtual void progress(const std::string& stage, int done, int total, double fraction) = 0;
  /// What an operator is there to tell, in whole lines.
  virtual void print(const std::string& /*text*/) {}
};

/// What a stage did, for --json and --verbose.
struct StageReport {
  std::string name;
  double seconds = 0;
  double cpu_seconds = 0;                      ///< of all threads
  std::optional<double> expected_cpu_seconds;  ///< planned; nothing where unknown
  double active_voxels = 0;                    ///< of all grids it gave out
  double bytes = 0;                            ///< in memory, of all grids it gave out
  double peak_memory_bytes = 0;                ///< of the process, when the stage last returned
  std::vector<std::pair<std::string, double>> counts;  ///< what the operator itself counted
};

/// A chain of operators over slabs: a source, then filters and sinks. Where the steps begin without
/// a source, `read` stands in (a file or standard input); where they end without a sink, `write`
/// does. Slabs are pushed upward in z, one at a time; operators use all threads within a slab.
class Pipeline {
 public:
  /// Makes the operators and reads their arguments. Throws UsageError.
  explicit Pipeline(const std::vector<Step>& steps);
  ~Pipeline();

  [[nodiscard]] const RunOptions& options() const { return options_; }

  /// The operator whose --help was asked for, if any.
  [[nodiscard]] const OperatorInfo* helpWanted() const { return help_; }

  /// Plans every stage and the slabs: all checks that need no voxel. `watcher` outlives the
  /// pipeline.
  void plan(Watcher& watcher);

  /// The plan in words: stages, reach, slab height, expected memory, barriers.
  [[nodiscard]] std::string explanation() const;

  /// Runs to the end and publishes. Throws DataError; nothing half-made remains.
  void run();
  /// Reads the pipes that feed it to their end, which `run` does too: in its place where nothing is
  /// to be made. Asked after `plan`. Throws DataError where a writer fails.
  void drain();

  [[nodiscard]] std::vector<StageReport> reports() const;
  /// Whether the voxels leave by standard output.
  [[nodiscard]] bool writesToStandardOutput() const;
  [[nodiscard]] int layers() const { return wanted_.size(); }
  [[nodiscard]] double boxVoxels() const;
  /// About how long `run` takes; nothing where that is unknown. Asked after `plan`.
  [[nodiscard]] std::optional<double> expectedSeconds() const;

 private:
  class Stage;

  void addStage(const Step& step);
  [[nodiscard]] bool standsAlone() const;
  void planRanges();
  void planNeeds();
  void planSlabs();
  void push(std::size_t index, Slab slab);
  void pushEmpty(std::size_t index, int end);
  void take(std::size_t index, Slab slab);
  [[nodiscard]] double expectedMemoryBytes(int slab_layers) const;
  [[nodiscard]] double memoryBudgetBytes() const;
  void planWork();
  [[nodiscard]] std::string timeText() const;
  [[nodiscard]] OutputEstimate expectedOutput(const Stage& stage) const;
  void checkDisk() const;

  RunOptions options_;
  Options run_options_;
  const OperatorInfo* help_ = nullptr;
  std::vector<std::unique_ptr<Stage>> stages_;
  Watcher* watcher_ = nullptr;
  ZRange wanted_;  ///< the layers that the end of the chain is to have
  int slab_layers_ = 0;
};

/// The largest resident size the process has had.
double peakMemoryBytes();

}  // namespace vdbdither
