#pragma once

#include <optional>
#include <string>
#include <vector>

#include "vdbdither/engine/estimate.h"
#include "vdbdither/engine/reach.h"
#include "vdbdither/model/schema.h"

namespace vdbdither {

/// A file or pipe that a stage reads while the chain runs.
struct InputPlan {
  std::string path;  ///< as the user named it; `-` is standard input
  bool is_pipe = false;
  ZRange layers;            ///< of its box
  double memory_bytes = 0;  ///< that it holds
};

/// What one stage of a job will do.
struct StagePlan {
  enum class Kind { source, filter, sink };

  std::string name;       ///< the verb
  std::string arguments;  ///< canonical, without defaults
  Kind kind = Kind::filter;
  Schema schema;            ///< of the slabs that leave the stage
  std::vector<Read> reads;  ///< the grids it reads
  GridNames handed_on;      ///< the grids that leave it because a later stage reads them
  bool is_barrier = false;  ///< holds the whole volume at once
  std::vector<InputPlan> inputs;

  ZRange cores;     ///< the layers it gives, or takes if it is a sink
  ZRange incoming;  ///< of a filter: the layers that the stage before gives
  ZRange window;    ///< of a filter: `incoming` and the empty layers that it adds to the box

  double memory_bytes = 0;  ///< besides slabs, inputs included
  std::optional<Work> work;
  std::optional<double> cpu_seconds;  ///< nothing if unknown
  OutputEstimate output;              ///< of the wanted layers
  bool output_exists = false;         ///< before the run, which needs --overwrite then
  double free_disk_bytes = 0;         ///< where the output goes
};

/// What a job will do: made by `planJob` before the first voxel, shown by --explain, carried out by
/// `Pipeline::run`.
struct JobPlan {
  std::vector<StagePlan> stages;
  ZRange layers;  ///< the layers that the end of the chain gets
  int slab_layers = 0;
  int threads = 1;
  double memory_bytes = 0;
  double memory_limit_bytes = 0;
  std::optional<double> seconds;  ///< nothing if the cost of a stage is unknown

  /// Of the last stage.
  [[nodiscard]] const Lattice& lattice() const { return stages.back().schema.lattice; }
  /// The voxels of the box in the wanted layers.
  [[nodiscard]] double boxVoxels() const;
  [[nodiscard]] bool writesToStandardOutput() const;
};

/// The plan for people: the text of --explain.
std::string toText(const JobPlan& plan);

/// The plan for programs: the JSON of --explain --json (docs/job-plan.md), one line.
std::string toJson(const JobPlan& plan);

}  // namespace vdbdither
