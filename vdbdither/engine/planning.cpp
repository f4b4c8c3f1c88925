#include "vdbdither/engine/planning.h"

#include <algorithm>
#include <filesystem>
#include <sstream>
#include <string>
#include <system_error>
#include <utility>

#include <tbb/task_arena.h>

#include "vdbdither/model/errors.h"
#include "vdbdither/model/known_grids.h"

namespace vdbdither {

namespace {

using Kind = StagePlan::Kind;

/// Taller slabs have fewer seams, where layers are copied and worked on twice. They are chosen only
/// for jobs that take little memory.
constexpr int usual_auto_slab = 64;
constexpr int tallest_auto_slab = 128;
constexpr double tall_slab_bytes = 512.0 * (1 << 20);

/// `text` is A:B, counted from the first of `all`, or empty for all of them.
ZRange parseLayers(const std::string& text, ZRange all) {
  if (text.empty()) return all;
  ZRange range;
  char colon = 0;
  std::istringstream stream(text);
  if (!(stream >> range.begin >> colon >> range.end) || colon != ':' || !stream.eof() ||
      range.begin < 0 || range.empty() || range.end > all.size()) {
    throw UsageError("--layers: '" + text +
                     "' is not A:B with 0 <= A < B <= " + std::to_string(all.size()));
  }
  return {all.begin + range.begin, all.begin + range.end};
}

int threadsOf(const RunOptions& options) {
  const int all = tbb::this_task_arena::max_concurrency();
  return options.threads > 0 ? std::min(options.threads, all) : all;
}

void refuseBarriers(const JobPlan& plan) {
  for (const StagePlan& stage : plan.stages) {
    if (stage.is_barrier)
      throw UsageError(stage.name + ": needs the whole volume at once, which --stream forbids");
  }
}

/// A stage hands on the grids that a later stage reads.
void planGrids(JobPlan& plan) {
  GridNames needed;
  for (auto stage = plan.stages.rbegin(); stage != plan.stages.rend(); ++stage) {
    stage->handed_on = needed;
    std::erase_if(stage->reads,
                  [&](const Read& read) { return read.if_wanted && !needed.contains(read.grid); });
    for (const Read& read : stage->reads) needed.insert(read.grid);
  }
}

/// From the end to the source: a stage gives what the stages behind it need, in whole leaves.
void planCores(JobPlan& plan) {
  ZRange need = plan.layers;
  for (auto stage = plan.stages.rbegin(); stage != plan.stages.rend(); ++stage) {
    stage->cores = plan.layers;
    if (stage->kind == Kind::sink) continue;
    const ZRange all = stage->schema.lattice.layers();
    stage->cores = intersection(alignedToLeaves(need), all);
    if (stage->kind == Kind::filter) need = reached(stage->cores, widest(stage->reads), all);
  }
}

/// From the source to the end: the layers that a filter's window holds. A filter that enlarges the
/// box has layers there that no stage makes: they are empty.
void planWindows(JobPlan& plan) {
  ZRange incoming = plan.stages.front().cores;
  for (StagePlan& stage : plan.stages) {
    if (stage.kind != Kind::filter) continue;
    stage.incoming = stage.window = incoming;
    if (incoming.empty()) {
      stage.window = stage.cores;
    } else if (!stage.cores.empty()) {
      stage.window = {std::min(incoming.begin, stage.cores.begin),
                      std::max(incoming.end, stage.cores.end)};
    }
    incoming = stage.cores;
  }
}

void planSlabs(JobPlan& plan, const RunOptions& options) {
  plan.memory_limit_bytes =
      options.memory == "auto" ? freeMemoryBytes() : parseBytes(options.memory);
  if (options.slab == "all") {
    plan.slab_layers = alignedToLeaves(plan.stages.front().cores).size();
  } else if (options.slab == "auto") {
    plan.slab_layers = tallest_auto_slab;
    const auto fits = [&](int layers) {
      const double limit = plan.memory_limit_bytes;
      return memoryBytes(plan, layers) <=
             (layers > usual_auto_slab ? std::min(limit, tall_slab_bytes) : limit);
    };
    while (plan.slab_layers > leaf_layers && !fits(plan.slab_layers)) plan.slab_layers /= 2;
  } else {
    plan.slab_layers = std::stoi(options.slab);
  }
  plan.memory_bytes = memoryBytes(plan, plan.slab_layers);
  if (plan.memory_bytes > plan.memory_limit_bytes && !options.explain) {
    throw DataError("the job needs about " + bytesText(plan.memory_bytes) +
                    " of memory and may use " + bytesText(plan.memory_limit_bytes) +
                    "; use a smaller --slab, fewer --layers, or more --memory");
  }
}

void planOutputs(JobPlan& plan, const RunOptions& options) {
  for (StagePlan& stage : plan.stages) {
    OutputEstimate& output = stage.output;
    if (output.path.empty() || output.path == "-") continue;
    const int all = stage.schema.lattice.layers().size();
    if (all > 0) output.bytes *= static_cast<double>(plan.layers.size()) / all;
    std::error_code none;
    stage.output_exists = std::filesystem::exists(output.path, none);
    stage.free_disk_bytes = freeDiskBytes(output.path);
    if (output.bytes > stage.free_disk_bytes && !options.explain) {
      throw DataError(stage.name + ": '" + output.path + "' needs about " +
                      bytesText(output.bytes) + ", and its disk has " +
                      bytesText(stage.free_disk_bytes) +
                      " left; choose another place, or fewer --layers");
    }
  }
}

void planTime(JobPlan& plan) {
  const StagePlan* before = &plan.stages.front();
  for (StagePlan& stage : plan.stages) {
    if (stage.work) {
      const Schema& through = before->schema;
      stage.cpu_seconds = cpuSeconds(*stage.work, through.footprint, stage.cores.size(),
                                     through.lattice.layers().size());
    }
    before = &stage;
  }
  plan.seconds = secondsOf(plan);
}

/// Plans what follows from the stages and the wanted layers.
void planLayers(JobPlan& plan, const RunOptions& options) {
  planGrids(plan);
  planCores(plan);
  planWindows(plan);
  planSlabs(plan, options);
  planOutputs(plan, options);
  planTime(plan);
}

/// Plans the stages in order, and tells of the grids that end because a stage changed what they
/// describe and that no later stage makes again.
class StagesInOrder {
 public:
  explicit StagesInOrder(std::span<const std::unique_ptr<Stage>> stages) : stages_(stages) {}

  std::vector<StagePlan> plan() {
    try {
      for (const auto& stage : stages_) add(*stage);
    } catch (const Error&) {
      // The missing grid may be what the stage refuses.
      warn();
      throw;
    }
    warn();
    return std::move(plans_);
  }

 private:
  void add(Stage& stage) {
    const Schema nothing;
    const Schema& before = plans_.empty() ? nothing : plans_.back().schema;
    StagePlan plan = stage.plan(before);
    for (GridNames& names : outdated_)
      std::erase_if(names, [&](const auto& name) { return plan.schema.grids.contains(name); });
    const std::vector<std::string> names = outdatedGrids(before, plan.schema);
    outdated_.emplace_back(names.begin(), names.end());
    plans_.push_back(std::move(plan));
  }

  void warn() {
    for (std::size_t index = 0; index < outdated_.size(); ++index) {
      const GridNames& names = outdated_[index];
      if (names.empty()) continue;
      std::string text;
      for (const std::string& name : names) text += (text.empty() ? "'" : ", '") + name + "'";
      const bool one = names.size() == 1;
      stages_[index]->monitor().warn("drops " + text + ", which " +
                                     (one ? "describes" : "describe") + " the shape before it; " +
                                     "make " + (one ? "it" : "them") + " after " +
                                     stages_[index]->name() + ", not before");
    }
  }

  std::span<const std::unique_ptr<Stage>> stages_;
  std::vector<StagePlan> plans_;
  std::vector<GridNames> outdated_;  ///< of each stage, what it drops
};

}  // namespace

JobPlan planJob(std::span<const std::unique_ptr<Stage>> stages, const RunOptions& options) {
  JobPlan plan;
  plan.threads = threadsOf(options);
  plan.stages = StagesInOrder(stages).plan();
  if (options.stream) refuseBarriers(plan);
  plan.layers = parseLayers(options.layers, plan.lattice().layers());
  planLayers(plan, options);
  return plan;
}

JobPlan planPiece(const JobPlan& whole, ZRange layers, const RunOptions& options) {
  JobPlan plan = whole;
  plan.layers = layers;
  planLayers(plan, options);
  return plan;
}

}  // namespace vdbdither
