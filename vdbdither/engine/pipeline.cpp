#include "vdbdither/engine/pipeline.h"

#include <algorithm>
#include <chrono>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <future>
#include <mutex>
#include <set>
#include <sstream>
#include <sys/resource.h>

#include <tbb/global_control.h>
#include <tbb/task_arena.h>

#include "vdbdither/engine/history.h"
#include "vdbdither/engine/registry.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/interrupt.h"
#include "vdbdither/model/known_grids.h"
#include "vdbdither/model/layers.h"
#include "vdbdither/model/openvdb.h"

namespace vdbdither {

namespace {

constexpr const char* source_verb = "read";
constexpr const char* sink_verb = "write";

constexpr int tallest_auto_slab = 64;

/// Runs `function` for a stage; what it throws names the stage.
template <typename Function>
auto inStage(const std::string& name, const Function& function) {
  try {
    return function();
  } catch (const Interrupted&) {
    throw;
  } catch (const UsageError& error) {
    throw UsageError(name + ": " + error.what());
  } catch (const DataError& error) {
    throw DataError(name + ": " + error.what());
  } catch (const std::bad_alloc&) {
    throw DataError(name + ": out of memory; try a smaller --slab or fewer layers");
  } catch (const std::exception& error) {
    throw DataError(name + ": " + error.what());
  }
}

using Names = std::set<std::string, std::less<>>;

Names namesOf(const Schema& schema) {
  Names names;
  for (const auto& [name, grid] : schema.grids) names.insert(name);
  return names;
}

/// What the leaves of some rows (of eight layers) of some grids take at the most.
double bytesOfRows(const Schema& schema, const Names& names, double rows) {
  double bytes = 0;
  for (const auto& [name, grid] : schema.grids) {
    if (names.contains(name)) bytes += leafBytes(grid);
  }
  const double leaves = schema.leaves_per_row * rows;
  return bytes * (schema.leaves > 0 ? std::min(leaves, schema.leaves) : leaves);
}

/// `slab`, of the layers that are `coming`, where a filter wants more of them: at the ends it takes
/// the empty layers of its outermost leaves along, so that the next slab begins with a leaf.
Slab widened(Slab slab, ZRange coming, ZRange wanted) {
  const ZRange core = slab.core;
  if (core.begin == coming.begin) slab.core.begin = alignedToLeaves(core).begin;
  if (core.end == coming.end) slab.core.end = alignedToLeaves(core).end;
  slab.core = intersection(slab.core, wanted);
  slab.valid = slab.core;
  if (slab.core == core) return slab;
  for (auto& [name, grid] : slab.grids) {
    // A range of leaves never equals that of a whole grid, so that the join cuts what is outside.
    const Layers piece{grid, {core.begin - leaf_layers, core.end + leaf_layers}};
    grid = joinLayers({&piece, 1}, core);
  }
  return slab;
}

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

double availableMemoryBytes() {
  std::ifstream file("/proc/meminfo");
  std::string line;
  while (std::getline(file, line)) {
    std::istringstream words(line);
    std::string key;
    double kilobytes = 0;
    words >> key >> kilobytes;
    if (key == "MemAvailable:") return kilobytes * 1024;
  }
  return std::numeric_limits<double>::infinity();
}

int threadsOf(const RunOptions& options) {
  const int all = tbb::this_task_arena::max_concurrency();
  return options.threads > 0 ? std::min(options.threads, all) : all;
}

/// What is left where `path` is to be; infinite where that cannot be told.
double freeDiskBytes(const std::string& path) {
  std::filesystem::path folder = std::filesystem::path(path).parent_path();
  if (folder.empty()) folder = ".";
  std::error_code error;
  const std::filesystem::space_info space = std::filesystem::space(folder, error);
  return error ? std::numeric_limits<double>::infinity() : static_cast<double>(space.available);
}

}  // namespace

double peakMemoryBytes() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) * 1024;
}

/// An operator in its place: its options, what it plans, what stands in front of it, what it
/// reports.
class Pipeline::Stage : public Reporter {
 public:
  explicit Stage(const OperatorInfo& info) : info_(info), operator_(info.make()) {
    operator_->declare(options_);
    operator_->setReporter(this);
    report_.name = info.name;
  }

  void parse(const std::vector<std::string>& arguments, const Options& common) {
    inStage(name(), [&] { options_.parse(arguments, common); });
  }

  void plan(const Schema& in) {
    inStage(name(), [&] {
      if (source()) {
        out_ = source()->plan();
      } else if (filter()) {
        out_ = filter()->plan(in);
        reads_ = filter()->reads();
      } else {
        out_ = in;
        sink()->plan(in);
      }
    });
    if (!info_.transport && !sink()) addToHistory(out_, name(), options_);
  }

  void warn(const std::string& text) override { watcher->warn(name(), text); }

  void count(const std::string& what, double value) override {
    const std::lock_guard lock(count_mutex_);
    report_.counts.emplace_back(what, value);
  }

  void print(const std::string& text) override { watcher->print(text); }

  void progress(double fraction) override {
    throwIfInterrupted();
    watcher->progress(name(), done_layers, total_layers, fraction);
  }

  /// Runs one call of the operator, timed.
  template <typename Function>
  auto timed(const Function& function) {
    throwIfInterrupted();
    struct Timer {
      StageReport& report;
      std::chrono::steady_clock::time_point start = std::chrono::steady_clock::now();
      std::clock_t cpu_start = std::clock();
      ~Timer() {
        report.seconds +=
            std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
        report.cpu_seconds += static_cast<double>(std::clock() - cpu_start) / CLOCKS_PER_SEC;
        report.peak_memory_bytes = peakMemoryBytes();
      }
    } timer{report_};
    return inStage(name(), function);
  }

  /// Counts a slab that leaves the stage.
  void countOutput(const Grids& grids) {
    for (const auto& [grid_name, grid] : grids) {
      const GridSize size = sizeOf(grid);
      report_.active_voxels += size.active_voxels;
      report_.bytes += size.bytes;
    }
  }

  /// Of the grids made, and of those that the schema promises and nobody made, which are empty:
  /// what a later stage looks at.
  void handOn(Grids& grids) const {
    for (const auto& [grid_name, prototype] : out_.grids) grids.try_emplace(grid_name, prototype);
    std::erase_if(grids, [&](const auto& grid) { return !handed_on.contains(grid.first); });
  }

  [[nodiscard]] std::string name() const { return std::string(info_.name); }
  [[nodiscard]] const OperatorInfo& info() const { return info_; }
  [[nodiscard]] const Options& options() const { return options_; }
  [[nodiscard]] const Schema& out() const { return out_; }
  [[nodiscard]] const StageReport& report() const { return report_; }
  [[nodiscard]] const std::vector<Read>& reads() const { return reads_; }
  [[nodiscard]] bool isBarrier() const { return operator_->isBarrier() || widest(reads_).whole; }
  [[nodiscard]] double memoryBytes() const { return operator_->memoryBytes(); }
  /// Expects the operator's work on so many of the layers of `through`.
  void expectWork(const Schema& through, int count_of_layers) {
    const std::optional<Work> work = operator_->work();
    const int all = through.lattice.layers().size();
    if (!work || all == 0) return;
    const bool counts_leaves = work->us_per_leaf > 0 || work->us_per_held_leaf > 0;
    if (counts_leaves && through.leaves == 0) return;
    const double leaves_us =
        work->us_per_leaf * through.surface_leaves + work->us_per_held_leaf * through.leaves;
    report_.expected_cpu_seconds =
        work->seconds + 1e-6 * count_of_layers * (work->us_per_layer + leaves_us / all);
  }
  [[nodiscard]] std::string inputFile() const {
    return inStage(name(), [&] { return operator_->inputFile(); });
  }
  void drain() { operator_->drain(); }
  [[nodiscard]] Source* source() const { return dynamic_cast<Source*>(operator_.get()); }
  [[nodiscard]] Filter* filter() const { return dynamic_cast<Filter*>(operator_.get()); }
  [[nodiscard]] Sink* sink() const { return dynamic_cast<Sink*>(operator_.get()); }
  [[nodiscard]] bool standsAlone() const { return sink() && sink()->standsAlone(); }

  Watcher* watcher = nullptr;
  ZRange cores;   ///< the layers this stage is to give out
  ZRange coming;  ///< of a filter: what the stage before gives
  ZRange layers;  ///< and with it the layers of its own that are empty there
  int next_layer = 0;
  Names handed_on;  ///< the grids that a later stage looks at
  std::optional<Window> window;
  int done_layers = 0;
  int total_layers = 0;

 private:
  const OperatorInfo& info_;
  Options options_;
  std::unique_ptr<Operator> operator_;
  Schema out_;
  std::vector<Read> reads_;
  StageReport report_;
  std::mutex count_mutex_;
};

Pipeline::Pipeline(const std::vector<Step>& steps) {
  options_.declare(run_options_);
  for (const Step& step : steps) {
    addStage(step);
    if (help_) return;
  }
  if (standsAlone()) {
    if (!options_.input.empty() || !options_.output.empty())
      throw UsageError(stages_.front()->name() + ": names its own files, not --input or --output");
    return;
  }
  if (!stages_.front()->source()) {
    std::vector<std::string> arguments;
    const std::string own = stages_.front()->inputFile();
    if (!own.empty() && !options_.input.empty()) {
      throw UsageError("--input: " + stages_.front()->name() + " reads '" + own + "'");
    }
    if (!own.empty()) {
      arguments = {own};
    } else if (!options_.input.empty()) {
      arguments = {options_.input};
    }
    stages_.insert(stages_.begin(), std::make_unique<Stage>(findOperator(source_verb)));
    stages_.front()->parse(arguments, run_options_);
  } else if (!options_.input.empty()) {
    throw UsageError("--input: the chain begins with " + stages_.front()->name() +
                     ", which reads its own input");
  }
  if (!stages_.back()->sink()) {
    std::vector<std::string> arguments{options_.output.empty() ? "-" : options_.output};
    if (options_.overwrite) arguments.emplace_back("--overwrite");
    addStage({sink_verb, arguments});
  } else if (!options_.output.empty()) {
    throw UsageError("--output: the chain ends with " + stages_.back()->name() +
                     ", which names its own output");
  }
}

Pipeline::~Pipeline() = default;

void Pipeline::addStage(const Step& step) {
  const OperatorInfo& info = findOperator(step.verb);
  if (std::any_of(step.arguments.begin(), step.arguments.end(), [](const std::string& argument) {
        return argument == "--help" || argument == "-h";
      })) {
    help_ = &info;
    return;
  }
  auto stage = std::make_unique<Stage>(info);
  if (stage->source() && !stages_.empty()) {
    throw UsageError(stage->name() + ": makes slabs of its own and can only begin a chain");
  }
  stage->parse(step.arguments, run_options_);
  if (const std::string file = stage->inputFile(); !file.empty() && !stages_.empty()) {
    throw UsageError(stage->name() + ": takes what comes to it and cannot read '" + file +
                     "' as well");
  }
  if (!stages_.empty() && (stage->standsAlone() || standsAlone())) {
    const std::string alone = stage->standsAlone() ? stage->name() : stages_.front()->name();
    throw UsageError(alone + ": works on the files it names and is no part of a chain then");
  }
  stages_.push_back(std::move(stage));
}

bool Pipeline::standsAlone() const { return stages_.front()->standsAlone(); }

void Pipeline::plan(Watcher& watcher) {
  watcher_ = &watcher;
  const Schema nothing;
  const Schema* in = &nothing;
  for (const auto& stage : stages_) {
    stage->watcher = &watcher;
    stage->plan(*in);
    in = &stage->out();
  }
  if (options_.stream) {
    for (const auto& stage : stages_) {
      if (stage->isBarrier()) {
        throw UsageError(stage->name() +
                         ": needs the whole volume at once, which --stream forbids");
      }
    }
  }
  if (standsAlone()) return;
  wanted_ = parseLayers(options_.layers, in->lattice.layers());
  planNeeds();
  planRanges();
  planSlabs();
  checkDisk();
  planWork();
}

void Pipeline::planWork() {
  const Stage* before = stages_.front().get();
  for (const auto& stage : stages_) {
    stage->expectWork(before->out(), stage->sink() ? wanted_.size() : stage->cores.size());
    before = stage.get();
  }
}

std::optional<double> Pipeline::expectedSeconds() const {
  double cpu_seconds = 0;
  for (const auto& stage : stages_) {
    if (!stage->report().expected_cpu_seconds) return std::nullopt;
    cpu_seconds += *stage->report().expected_cpu_seconds;
  }
  // What one thread does alone: the first of two was seen to do 70 to 75 % of the work.
  constexpr double alone = 0.4;
  return cpu_seconds * (alone + (1 - alone) / threadsOf(options_));
}

void Pipeline::planNeeds() {
  Names needed;
  for (auto stage = stages_.rbegin(); stage != stages_.rend(); ++stage) {
    (*stage)->handed_on = needed;
    if ((*stage)->sink()) {
      const auto reads = (*stage)->sink()->reads();
      needed.merge(reads ? Names(reads->begin(), reads->end()) : namesOf((*stage)->out()));
    }
    for (const Read& read : (*stage)->reads()) needed.insert(read.grid);
  }
}

void Pipeline::planRanges() {
  ZRange need = wanted_;
  for (auto stage = stages_.rbegin(); stage != stages_.rend(); ++stage) {
    const ZRange all = (*stage)->out().lattice.layers();
    (*stage)->total_layers = wanted_.size();
    if ((*stage)->sink()) continue;
    (*stage)->cores = intersection(alignedToLeaves(need), all);
    if ((*stage)->filter()) need = reached((*stage)->cores, widest((*stage)->reads()), all);
  }
  ZRange coming = stages_.front()->cores;
  for (const auto& stage : stages_) {
    if (!stage->filter()) continue;
    stage->coming = coming;
    // A box that the filter widens has layers that nobody makes: they are empty.
    stage->layers = coming;
    if (!stage->cores.empty()) {
      stage->layers = coming.empty() ? stage->cores
                                     : ZRange{std::min(coming.begin, stage->cores.begin),
                                              std::max(coming.end, stage->cores.end)};
    }
    stage->next_layer = stage->layers.begin;
    stage->window.emplace(stage->reads(), stage->layers, stage->cores, stage->handed_on);
    coming = stage->cores;
  }
}

void Pipeline::planSlabs() {
  const double budget = memoryBudgetBytes();
  if (options_.slab == "all") {
    slab_layers_ = alignedToLeaves(stages_.front()->cores).size();
  } else if (options_.slab == "auto") {
    slab_layers_ = tallest_auto_slab;
    while (slab_layers_ > leaf_layers && expectedMemoryBytes(slab_layers_) > budget)
      slab_layers_ /= 2;
  } else {
    std::istringstream stream(options_.slab);
    if (!(stream >> slab_layers_) || !stream.eof() || slab_layers_ < leaf_layers ||
        slab_layers_ % leaf_layers != 0) {
      throw UsageError("--slab: '" + options_.slab + "' is not a multiple of 8, auto or all");
    }
  }
  const double expected = expectedMemoryBytes(slab_layers_);
  if (expected > budget && !options_.explain) {
    throw DataError("the run needs about " + bytesText(expected) + " of memory and may use " +
                    bytesText(budget) +
                    "; take a smaller --slab, fewer --layers, or more --memory");
  }
}

void Pipeline::checkDisk() const {
  if (options_.explain) return;
  for (const auto& stage : stages_) {
    if (!stage->sink()) continue;
    const OutputEstimate output = expectedOutput(*stage);
    const double free = freeDiskBytes(output.path);
    if (output.bytes > free) {
      throw DataError(stage->name() + ": '" + output.path + "' needs about " +
                      bytesText(output.bytes) + ", and its disk has " + bytesText(free) +
                      " left; name another place, or fewer --layers");
    }
  }
}

OutputEstimate Pipeline::expectedOutput(const Stage& stage) const {
  OutputEstimate output = stage.sink()->output();
  const int all = stage.out().lattice.layers().size();
  if (all > 0) output.bytes *= static_cast<double>(wanted_.size()) / all;
  return output;
}

double Pipeline::memoryBudgetBytes() const {
  return options_.memory == "auto" ? 0.8 * availableMemoryBytes() : parseBytes(options_.memory);
}

double Pipeline::expectedMemoryBytes(int slab_layers) const {
  constexpr double program_bytes = 40e6;
  double bytes = program_bytes;
  const Stage* before = nullptr;
  Names held_before;  // by the windows of earlier stages
  for (const auto& stage : stages_) {
    bytes += stage->memoryBytes();
    const int all = stage->out().lattice.layers().size();
    const auto rows = [&](int layers) {
      return std::min(all, layers) / static_cast<double>(leaf_layers) + 1;
    };
    if (stage->source()) {
      bytes += bytesOfRows(stage->out(), namesOf(stage->out()), rows(slab_layers));
    } else if (before) {
      const Reach reach = widest(stage->reads());
      const int window_layers =
          reach.whole || stage->isBarrier() ? all : slab_layers + reach.below + reach.above;
      bytes += bytesOfRows(before->out(), before->handed_on, rows(window_layers));
      // What somebody else holds too is copied to be joined with its halo; the rest grows by it.
      const int halo_layers = reach.below + reach.above;
      if (halo_layers > 0) {
        for (const Read& read : stage->reads()) {
          const bool copied =
              stage->handed_on.contains(read.grid) || held_before.contains(read.grid);
          bytes +=
              bytesOfRows(before->out(), {read.grid}, rows(copied ? window_layers : halo_layers));
          held_before.insert(read.grid);
        }
      }
    }
    before = stage.get();
  }
  return bytes;
}

double Pipeline::boxVoxels() const {
  const openvdb::CoordBBox& box = stages_.back()->out().lattice.box;
  return static_cast<double>(box.dim().x()) * box.dim().y() * wanted_.size();
}

std::string Pipeline::timeText() const {
  const int threads = threadsOf(options_);
  const std::string on = " on " + std::to_string(threads) + (threads == 1 ? " thread" : " threads");
  if (const auto seconds = expectedSeconds()) return "about " + durationText(*seconds) + on;
  std::string unknown;
  for (const auto& stage : stages_) {
    if (!stage->report().expected_cpu_seconds)
      unknown += (unknown.empty() ? "" : ", ") + stage->name();
  }
  return "unknown of " + unknown;
}

std::string Pipeline::explanation() const {
  const Lattice& lattice = stages_.back()->out().lattice;
  std::ostringstream text;
  text << "lattice   " << shortestText(lattice.pitch_mm[0]) << " x "
       << shortestText(lattice.pitch_mm[1]) << " x " << shortestText(lattice.pitch_mm[2]) << " mm, "
       << lattice.box.dim().x() << " x " << lattice.box.dim().y() << " x " << lattice.box.dim().z()
       << " voxels\n";
  text << "layers    " << wanted_.size() << " of " << lattice.layers().size() << ", in slabs of "
       << slab_layers_ << "\n";
  for (const auto& stage : stages_) {
    text << "stage     " << stage->name();
    if (const std::string arguments = stage->options().canonical(); !arguments.empty())
      text << ' ' << arguments;
    const Reach reach = widest(stage->reads());
    if (stage->isBarrier()) {
      text << "  (barrier: holds the whole volume)";
    } else if (stage->filter()) {
      text << "  (reads " << reach.below << " layers below, " << reach.above << " above)";
    }
    text << "  ->";
    for (const auto& [name, grid] : stage->out().grids) text << ' ' << name;
    if (stage->memoryBytes() > 0) text << ", holds " << bytesText(stage->memoryBytes());
    text << "\n";
  }
  text << "memory    about " << bytesText(expectedMemoryBytes(slab_layers_)) << " of "
       << bytesText(memoryBudgetBytes()) << "\n";
  if (standsAlone()) return text.str();
  text << "time      " << timeText() << "\n";
  for (const auto& stage : stages_) {
    if (!stage->sink()) continue;
    const OutputEstimate output = expectedOutput(*stage);
    if (output.path.empty()) continue;
    text << "disk      " << (output.bytes > 0 ? "about " + bytesText(output.bytes) : "unknown")
         << " of " << bytesText(freeDiskBytes(output.path)) << " for " << output.path << "\n";
  }
  return text.str();
}

void Pipeline::run() {
  std::optional<tbb::global_control> threads;
  if (options_.threads > 0) {
    threads.emplace(tbb::global_control::max_allowed_parallelism, options_.threads);
  }
  Stage& source = *stages_.front();
  if (standsAlone()) return source.timed([&] { source.sink()->finish(); });
  for (int begin = source.cores.begin; begin < source.cores.end;) {
    // Cuts lie at multiples of the height whatever the first layer is, so that slabs of two runs
    // coincide.
    const int cut = begin - ((begin % slab_layers_) + slab_layers_) % slab_layers_ + slab_layers_;
    const ZRange core{begin, std::min(cut, source.cores.end)};
    Grids grids = source.timed([&] { return source.source()->run(core); });
    if (options_.json || options_.verbose) source.countOutput(grids);
    source.handOn(grids);
    push(1, {core, core, std::move(grids)});
    begin = core.end;
  }
  for (std::size_t index = 1; index < stages_.size(); ++index) {
    if (stages_[index]->filter()) pushEmpty(index, stages_[index]->layers.end);
  }
  drain();
  for (const auto& stage : stages_) {
    if (stage->sink()) stage->timed([&] { stage->sink()->finish(); });
  }
}

void Pipeline::drain() {
  // All at once: several pipes may have one writer, who waits where nobody reads.
  std::vector<std::future<void>> drains;
  drains.reserve(stages_.size());
  for (const auto& stage : stages_)
    drains.push_back(
        std::async(std::launch::async, [&] { stage->timed([&] { stage->drain(); }); }));
  for (std::future<void>& drain : drains) drain.get();
}

void Pipeline::push(std::size_t index, Slab slab) {
  if (index == stages_.size()) {
    const ZRange done = intersection(slab.core, wanted_);
    for (const auto& stage : stages_) stage->done_layers += done.size();
    watcher_->progress(stages_.back()->name(), stages_.back()->done_layers, wanted_.size(), 0);
    return;
  }
  Stage& stage = *stages_[index];
  if (stage.sink()) {
    const ZRange core = intersection(slab.core, wanted_);
    if (!core.empty()) stage.timed([&] { stage.sink()->write(cutTo(slab, core)); });
    push(index + 1, std::move(slab));
    return;
  }
  if (stage.layers != stage.coming) {
    slab = widened(std::move(slab), stage.coming, stage.layers);
    pushEmpty(index, slab.core.begin);
  }
  take(index, std::move(slab));
}

/// Hands the filter at `index` layers without voxels up to `end`.
void Pipeline::pushEmpty(std::size_t index, int end) {
  Stage& stage = *stages_[index];
  while (stage.next_layer < end) {
    const int begin = stage.next_layer;
    const int cut = begin - ((begin % slab_layers_) + slab_layers_) % slab_layers_ + slab_layers_;
    const ZRange core{begin, std::min(cut, end)};
    Grids nothing;
    stages_[index - 1]->handOn(nothing);
    take(index, {core, core, std::move(nothing)});
  }
}

void Pipeline::take(std::size_t index, Slab slab) {
  Stage& stage = *stages_[index];
  stage.next_layer = slab.core.end;
  for (Window::Task& task : stage.window->push(std::move(slab))) {
    Grids made = stage.timed([&] { return stage.filter()->run(task.input); });
    if (options_.json || options_.verbose) stage.countOutput(made);
    for (const auto& [name, grid] : task.passing.grids) {
      if (stage.out().grids.contains(name)) made.try_emplace(name, grid);
    }
    stage.handOn(made);
    const ZRange core = task.passing.core;
    task = {};
    push(index + 1, {core, core, std::move(made)});
  }
}

bool Pipeline::writesToStandardOutput() const {
  return std::any_of(stages_.begin(), stages_.end(), [](const auto& stage) {
    return stage->sink() && stage->sink()->writesToStandardOutput();
  });
}

std::vector<StageReport> Pipeline::reports() const {
  std::vector<StageReport> reports;
  for (const auto& stage : stages_) reports.push_back(stage->report());
  return reports;
}

}  // namespace vdbdither
