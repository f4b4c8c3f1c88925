#include <algorithm>
#include <cmath>
#include <filesystem>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "io/file/file_name.h"
#include "io/file/staged_output.h"
#include "io/file/text_bytes.h"
#include "io/job/job.h"
#include "io/job/job_scripts.h"
#include "vdbdither/engine/option_groups.h"
#include "vdbdither/engine/pipeline.h"
#include "vdbdither/engine/planning.h"
#include "vdbdither/engine/tool.h"
#include "vdbdither/engine/tool_watcher.h"
#include "vdbdither/engine/version.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/printable.h"

namespace vdbdither {

namespace {

namespace fs = std::filesystem;

/// An array of Slurm has at most 1,001 tasks unless its administrator allows more.
constexpr int most_pieces = 1000;

/// Cuts a chain into pieces that runs on many machines make, and writes what starts them.
class Plan : public Tool {
 public:
  void declare(Options& options) override {
    options.positional("chain", chain_, "The chain, in quotes");
    options.positional("job", folder_, "Folder to write the job into; by default job", false);
    options.integer("pieces", pieces_, {1, most_pieces}, "Number of pieces");
    options.parsed(
        "piece-memory", "SIZE",
        [this](const std::string& text) {
          parseBytes(text);
          piece_memory_ = text;
        },
        [this] { return piece_memory_; },
        "Memory that a piece may use, such as 1GiB: there are as many pieces as that takes");
    options.parsed(
        "piece-time", "TIME",
        [this](const std::string& text) {
          piece_seconds_ = parseSeconds(text);
          piece_time_ = text;
        },
        [this] { return piece_time_; },
        "Time that a piece may take, such as 10min: there are as many pieces as that takes. By "
        "default 10min, unless one of the options above is given");
    overwrite_.declare(options, "the job");
  }

  void run() override {
    if (folder_.empty()) folder_ = "job";
    checkOptions();
    const std::vector<std::string> words = splitWords(chain_);
    const std::vector<Step> steps = parseChain(words);
    checkCanBeCut(steps);
    StagedOutput::checkFolder(folder_, overwrite_.overwrite, ownFiles,
                              [this](const std::string& text) { report().warn(text); });

    Pipeline pipeline(steps);
    const RunOptions& options = pipeline.options();
    ToolWatcher watcher(report());
    const JobPlan& whole = pipeline.plan(watcher);
    checkPlan(whole);
    Job job = jobOf(words, whole, options);
    checkNames(job);
    cut(job, whole, options);
    write(job);
    tell(job);
  }

 private:
  static std::set<std::string> ownFiles(const fs::path& folder) {
    requireJob(folder);
    std::set<std::string> names{job_name};
    Job any;
    any.pieces.emplace_back();
    for (const auto& [name, text] : jobScripts(any)) names.insert(name);
    std::error_code none;
    const fs::path pieces = folder / pieces_name;
    if (fs::is_empty(pieces, none)) {
      names.insert(std::string(pieces_name) + "/");
    } else if (fs::is_directory(pieces, none)) {
      throw UsageError("'" + folder.string() + "' holds pieces that took time to make; remove '" +
                       pieces.string() + "' to plan it again, or name another folder");
    }
    // What Slurm writes by the job's script.
    for (const fs::directory_entry& entry : fs::directory_iterator(folder, none)) {
      const std::string name = entry.path().filename().string();
      if (name.starts_with("job-") && name.ends_with(".log")) names.insert(name);
    }
    return names;
  }

  static void requireJob(const fs::path& folder) {
    std::error_code none;
    if (!fs::exists(folder / job_name, none)) {
      throw UsageError("'" + folder.string() + "' holds no " + job_name +
                       ", so it is not a job to overwrite; name another folder");
    }
  }

  void checkOptions() const {
    const int given =
        (pieces_ ? 1 : 0) + (piece_memory_.empty() ? 0 : 1) + (piece_time_.empty() ? 0 : 1);
    if (given > 1) throw UsageError("give one of --pieces, --piece-memory and --piece-time");
  }

  /// Sinks that look at the whole cannot be cut.
  static void checkCanBeCut(const std::vector<Step>& steps) {
    Pipeline trial(steps);
    if (trial.helpWanted()) throw UsageError("the chain asks for --help; leave it out");
    if (!trial.options().layers.empty())
      throw UsageError("--layers: plan cuts the layers; leave it out of the chain");
    if (trial.options().explain)
      throw UsageError("--explain: plan runs nothing; leave it out of the chain");
    trial.makePiece(pieces_name);
  }

  void checkPlan(const JobPlan& whole) const {
    for (const StagePlan& stage : whole.stages) {
      if (!stage.output.path.empty() && liesWithin(stage.output.path, folder_)) {
        throw UsageError(stage.name + ": '" + stage.output.path +
                         "' lies in the folder of the job; name another place");
      }
      for (const InputPlan& input : stage.inputs) {
        if (input.is_pipe) {
          throw UsageError(stage.name +
                           ": reads a pipe, which other machines cannot; save it as a "
                           ".vdb first");
        }
      }
      if (stage.kind == StagePlan::Kind::filter && stage.is_barrier) {
        throw UsageError(stage.name +
                         ": needs the whole volume at once, so every piece would make all of it; "
                         "run the chain up to there first, and cut the rest");
      }
    }
    if (whole.layers.empty())
      throw DataError("there is nothing to make: the lattice has no voxels");
  }

  [[nodiscard]] Job jobOf(const std::vector<std::string>& words, const JobPlan& whole,
                          const RunOptions& options) const {
    Job job;
    job.version = version;
    job.chain = words;
    const fs::path here = fs::current_path();
    // Behind links, because the system takes `..` from where a link leads.
    fs::path folder = fs::weakly_canonical(fs::absolute(folder_));
    if (!folder.has_filename()) folder = folder.parent_path();
    job.folder = here.lexically_relative(folder).string();
    job.lattice = whole.lattice();
    job.threads = options.threads > 0 ? options.threads : whole.threads;
    for (const StagePlan& stage : whole.stages) {
      if (stage.kind == StagePlan::Kind::sink) job.outputs.push_back(stage.output.path);
    }
    job.inputs = inputsRead(job.outputs);
    return job;
  }

  /// job.json is JSON, which holds no other bytes than those of UTF-8.
  static void checkNames(const Job& job) {
    std::vector<std::string> names{job.folder};
    names.insert(names.end(), job.chain.begin(), job.chain.end());
    names.insert(names.end(), job.outputs.begin(), job.outputs.end());
    for (const JobInput& input : job.inputs) names.push_back(input.file);
    for (const std::string& name : names) {
      if (validUtf8(name) != name) {
        throw UsageError("'" + name +
                         "' is not UTF-8, and a job keeps names as UTF-8; rename the file");
      }
    }
  }

  /// Divides the layers evenly, at cuts between leaves, into at most `count` pieces.
  static std::vector<ZRange> divided(ZRange all, int count) {
    std::vector<ZRange> pieces;
    int begin = all.begin;
    for (int i = 1; i <= count; ++i) {
      const double even = all.begin + static_cast<double>(all.size()) * i / count;
      const int cut = i == count
                          ? all.end
                          : static_cast<int>(std::floor(even / leaf_layers + 0.5)) * leaf_layers;
      if (cut <= begin || cut > all.end) continue;
      pieces.push_back({begin, cut});
      begin = cut;
    }
    return pieces;
  }

  void cut(Job& job, const JobPlan& whole, const RunOptions& given) const {
    RunOptions options = given;
    options.explain = true;  // sizes are told, and refused below
    if (!piece_memory_.empty()) options.memory = piece_memory_;
    const auto plansOf = [&](int count) {
      std::vector<JobPlan> plans;
      for (const ZRange layers : divided(whole.layers, count))
        plans.push_back(planPiece(whole, layers, options));
      return plans;
    };
    const auto largest = [](const std::vector<JobPlan>& plans) {
      double bytes = 0;
      for (const JobPlan& plan : plans) bytes = std::max(bytes, plan.memory_bytes);
      return bytes;
    };
    std::vector<JobPlan> plans;
    if (!piece_memory_.empty()) {
      const double limit = parseBytes(piece_memory_);
      int count = 1;
      for (plans = plansOf(count); largest(plans) > limit && count < most_pieces;)
        plans = plansOf(count = std::min(2 * count, most_pieces));
      if (largest(plans) > limit) {
        throw DataError("--piece-memory: the smallest piece takes about " +
                        bytesText(largest(plans)) + "; allow more");
      }
    } else if (pieces_) {
      plans = plansOf(*pieces_);
    } else {
      if (!whole.seconds) {
        throw UsageError(
            "--piece-time: nobody has measured how long this chain takes; give --pieces");
      }
      const double count = std::ceil(*whole.seconds / piece_seconds_);
      plans = plansOf(static_cast<int>(std::clamp<double>(count, 1, most_pieces)));
    }
    for (const JobPlan& plan : plans) {
      JobPiece piece{{plan.layers.begin - whole.layers.begin, plan.layers.end - whole.layers.begin},
                     plan.seconds,
                     std::ceil(plan.memory_bytes),
                     0};
      // Estimates are about so much.
      if (piece.seconds) piece.seconds = std::ceil(10 * *piece.seconds) / 10;
      for (const StagePlan& stage : plan.stages) piece.disk_bytes += std::ceil(stage.output.bytes);
      job.pieces.push_back(piece);
    }
    job.slab_layers = plans.front().slab_layers;
    for (const JobPlan& plan : plans) job.slab_layers = std::min(job.slab_layers, plan.slab_layers);
  }

  void write(const Job& job) const {
    StagedOutput output(folder_, StagedOutput::Kind::folder, ownFiles);
    output.write(job_name, textBytes(textOf(job)));
    for (const auto& [name, text] : jobScripts(job)) output.write(name, textBytes(text));
    output.commit();
  }

  void tell(const Job& job) {
    const JobPiece largest = largestPiece(job);
    double disk_bytes = 0;
    for (const JobPiece& piece : job.pieces) disk_bytes += piece.disk_bytes;
    std::string text = "'" + folder_ + "': " + std::to_string(job.pieces.size()) +
                       (job.pieces.size() == 1 ? " piece of " : " pieces, each of at most ");
    text += "about " + bytesText(largest.memory_bytes) + " of memory" +
            (largest.seconds ? " and " + durationText(*largest.seconds) : std::string()) +
            "; in all about " + bytesText(disk_bytes) + " on the disk\n";
    report().print(text);
    report().count("pieces", static_cast<double>(job.pieces.size()));
  }

  /// Reads `90s`, `10min`, `2h`, or a number of seconds.
  static double parseSeconds(const std::string& text) {
    std::size_t digits = 0;
    double value = 0;
    try {
      value = std::stod(text, &digits);
    } catch (const std::exception&) {
      digits = 0;
    }
    const std::string unit = text.substr(digits);
    const double factor = unit.empty() || unit == "s" ? 1
                          : unit == "min"             ? 60
                          : unit == "h"               ? 3600
                                                      : 0;
    if (digits == 0 || factor == 0 || !(value > 0) || !std::isfinite(value))
      throw UsageError("'" + text + "' is not accepted; give a time such as 90s, 10min or 2h");
    return value * factor;
  }

  std::string chain_;
  std::string folder_;
  std::optional<int> pieces_;
  std::string piece_memory_;
  std::string piece_time_;
  double piece_seconds_ = 600;
  OverwriteOption overwrite_;
};

}  // namespace

extern const ToolInfo plan;
const ToolInfo plan{
    .name = "plan",
    .summary = "Cuts a chain into pieces for many machines, as a job of Slurm and others",
    .example =
        "plan \"mesh2sdf part.stl --printer mimaki-3duj-553 ! dither ! slice-export out\" "
        "--pieces 2",
    .make = []() -> std::unique_ptr<Tool> { return std::make_unique<Plan>(); }};

}  // namespace vdbdither
