#include "vdbdither/engine/pipeline.h"

#include <algorithm>
#include <future>
#include <system_error>

#include <tbb/global_control.h>

#include "vdbdither/engine/planning.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/interrupt.h"
#include "vdbdither/model/layers.h"

namespace vdbdither {

namespace {

/// Returns `slab` for a filter that reads the layers `window`. At both ends of `incoming`, the
/// layers of the job, the core is widened to whole leaves, so that the next slab begins with a
/// leaf. The added layers are empty.
Slab widened(Slab slab, ZRange incoming, ZRange window) {
  const ZRange core = slab.core;
  if (core.begin == incoming.begin) slab.core.begin = alignedToLeaves(core).begin;
  if (core.end == incoming.end) slab.core.end = alignedToLeaves(core).end;
  slab.core = intersection(slab.core, window);
  slab.valid = slab.core;
  if (slab.core == core) return slab;
  for (auto& [name, grid] : slab.grids) {
    // A range of leaves never equals that of a whole grid, so the join cuts what is outside.
    const GridLayers piece{grid, {core.begin - leaf_layers, core.end + leaf_layers}};
    grid = joinLayers({&piece, 1}, core);
  }
  return slab;
}

/// The grids of an input over the part of `core` that it has.
Grids gridsOver(Input& input, ZRange core) {
  const ZRange there = intersection(core, input.schema().lattice.layers());
  return there.empty() ? Grids{} : input.read(there);
}

/// Where the sink at `index` keeps its piece.
std::string outputFolder(std::size_t index, const Stage& stage) {
  return std::to_string(index) + "-" + stage.name();
}

}  // namespace

Pipeline::Pipeline(const std::vector<Step>& steps, const FindOperator& find)
    : chain_(steps, find) {}

void Pipeline::makePiece(const std::filesystem::path& folder) {
  const auto stages = chain_.stages();
  for (std::size_t index = 0; index < stages.size(); ++index) {
    Stage& stage = *stages[index];
    if (!stage.sink()) continue;
    callNamed(stage.name(), [&] { stage.sink()->makePiece(folder / outputFolder(index, stage)); });
  }
}

const JobPlan& Pipeline::plan(Watcher& watcher) {
  watcher_ = &watcher;
  for (const auto& stage : chain_.stages()) stage->monitor().attach(watcher);
  plan_ = planJob(chain_.stages(), options());
  for (std::size_t index = 0; index < plan_.stages.size(); ++index) {
    Stage& stage = *chain_.stages()[index];
    const StagePlan& plan = plan_.stages[index];
    stage.monitor().expectLayers(plan_.layers.size());
    stage.monitor().report().expected_cpu_seconds = plan.cpu_seconds;
    Worker& worker = workers_.emplace_back(Worker{stage, plan, {}, {}, plan.window.begin});
    if (!stage.filter()) continue;
    worker.inputs = stage.inputs();
    worker.window.emplace(plan.reads, plan.window, plan.cores, plan.handed_on);
  }
  return plan_;
}

void Pipeline::run() {
  std::optional<tbb::global_control> threads;
  if (options().threads > 0) {
    threads.emplace(tbb::global_control::max_allowed_parallelism, options().threads);
  }
  Worker& first = workers_.front();
  for (int begin = first.plan.cores.begin; begin < first.plan.cores.end;) {
    const ZRange core = nextSlab(begin, first.plan.cores.end);
    Grids grids = first.stage.monitor().timed([&] { return first.stage.source()->run(core); });
    countOutput(first, grids);
    handOn(first, grids);
    push(1, {core, core, std::move(grids)});
    begin = core.end;
  }
  for (std::size_t index = 1; index < workers_.size(); ++index) {
    if (workers_[index].window) pushEmpty(index, workers_[index].plan.window.end);
  }
  readInputsToEnd();
  publish();
}

void Pipeline::join(std::span<const Piece> pieces) {
  for (const Piece& piece : pieces) {
    for (std::size_t index = 0; index < workers_.size(); ++index) {
      Stage& stage = workers_[index].stage;
      if (Sink* sink = stage.sink()) {
        stage.monitor().timed(
            [&] { sink->takePiece(piece.folder / outputFolder(index, stage), piece.layers); });
      }
      stage.monitor().layersDone(piece.layers.size());
      stage.monitor().progress(0);
    }
  }
  publish();
}

void Pipeline::publish() {
  for (Worker& worker : workers_) {
    if (Sink* sink = worker.stage.sink()) worker.stage.monitor().timed([&] { sink->finish(); });
  }
  throwIfInterrupted();
  // From the end: where that is a pipe, its reader may be gone, and then no file has its name yet.
  std::string published;
  for (auto worker = workers_.rbegin(); worker != workers_.rend(); ++worker) {
    Sink* sink = worker->stage.sink();
    if (sink == nullptr) continue;
    try {
      callNamed(worker->stage.name(), [&] { sink->publish(); });
    } catch (const DataError& error) {
      if (published.empty()) throw;
      throw DataError(std::string(error.what()) + "; of this run there is already " + published);
    }
    const std::string& path = worker->plan.output.path;
    if (!path.empty() && path != "-") published += (published.empty() ? "'" : ", '") + path + "'";
  }
}

void Pipeline::readInputsToEnd() {
  // All at once: several pipes may have one writer, which waits while nobody reads one of them.
  std::vector<std::future<void>> readers;
  for (Worker& worker : workers_) {
    if (worker.plan.inputs.empty()) continue;
    const auto read = [&worker] {
      worker.stage.monitor().timed([&] {
        for (Input* input : worker.stage.inputs()) input->readToEnd();
      });
    };
    try {
      readers.push_back(std::async(std::launch::async, read));
    } catch (const std::system_error& error) {
      throw DataError("cannot start a thread: " + error.code().message());
    }
  }
  for (std::future<void>& reader : readers) reader.get();
}

/// Cuts lie at multiples of the slab's height, whatever the first layer is, so that the slabs of
/// two jobs coincide.
ZRange Pipeline::nextSlab(int begin, int end) const {
  const int height = plan_.slab_layers;
  const int above_cut = ((begin % height) + height) % height;
  return {begin, std::min(begin - above_cut + height, end)};
}

void Pipeline::push(std::size_t index, Slab slab) {
  if (index == workers_.size()) {
    const int done = intersection(slab.core, plan_.layers).size();
    for (Worker& worker : workers_) worker.stage.monitor().layersDone(done);
    workers_.back().stage.monitor().progress(0);
    return;
  }
  Worker& worker = workers_[index];
  if (Sink* sink = worker.stage.sink()) {
    const ZRange core = intersection(slab.core, plan_.layers);
    if (!core.empty()) worker.stage.monitor().timed([&] { sink->write(cutTo(slab, core)); });
    push(index + 1, std::move(slab));
    return;
  }
  if (worker.plan.window != worker.plan.incoming) {
    slab = widened(std::move(slab), worker.plan.incoming, worker.plan.window);
    pushEmpty(index, slab.core.begin);
  }
  take(index, std::move(slab));
}

/// Gives the filter at `index` layers without voxels up to `end`.
void Pipeline::pushEmpty(std::size_t index, int end) {
  Worker& worker = workers_[index];
  while (worker.next_layer < end) {
    const ZRange core = nextSlab(worker.next_layer, end);
    Grids empty;
    handOn(workers_[index - 1], empty);
    take(index, {core, core, std::move(empty)});
  }
}

void Pipeline::take(std::size_t index, Slab slab) {
  Worker& worker = workers_[index];
  worker.next_layer = slab.core.end;
  for (Window::Task& task : worker.window->push(std::move(slab))) {
    Grids made = worker.stage.monitor().timed([&] {
      for (Input* input : worker.inputs)
        task.input.inputs.push_back(gridsOver(*input, task.input.core));
      return worker.stage.filter()->run(task.input);
    });
    countOutput(worker, made);
    for (const auto& [name, grid] : task.passing.grids) {
      if (worker.plan.schema.grids.contains(name)) made.try_emplace(name, grid);
    }
    handOn(worker, made);
    const ZRange core = task.passing.core;
    task = {};
    push(index + 1, {core, core, std::move(made)});
  }
}

void Pipeline::countOutput(Worker& worker, const Grids& grids) const {
  if (!options().json && !options().verbose) return;
  StageReport& report = worker.stage.monitor().report();
  for (const auto& [name, grid] : grids) {
    const GridSize size = sizeOf(grid);
    report.active_voxels += size.active_voxels;
    report.bytes += size.bytes;
  }
}

/// Completes `grids`, which leave a stage, by those that its schema promises and nobody made: they
/// are empty. Drops those that no later stage reads.
void Pipeline::handOn(const Worker& worker, Grids& grids) {
  for (const auto& [name, prototype] : worker.plan.schema.grids) grids.try_emplace(name, prototype);
  std::erase_if(grids,
                [&](const auto& grid) { return !worker.plan.handed_on.contains(grid.first); });
}

JobReport Pipeline::report() const {
  JobReport report{plan_.layers.size(), plan_.boxVoxels(), plan_.seconds, {}};
  for (const auto& stage : chain_.stages()) report.stages.push_back(stage->monitor().report());
  return report;
}

}  // namespace vdbdither
