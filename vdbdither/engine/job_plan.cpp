#include "vdbdither/engine/job_plan.h"

#include <algorithm>
#include <cmath>
#include <sstream>

#include <nlohmann/json.hpp>

#include "vdbdither/engine/json_text.h"
#include "vdbdither/engine/options.h"
#include "vdbdither/engine/run_options.h"
#include "vdbdither/engine/version.h"
#include "vdbdither/model/printable.h"

namespace vdbdither {

namespace {

using nlohmann::ordered_json;

bool isFile(const OutputEstimate& output) { return !output.path.empty() && output.path != "-"; }

std::string timeText(const JobPlan& plan) {
  if (plan.seconds) {
    return "about " + durationText(*plan.seconds) + " on " + std::to_string(plan.threads) +
           (plan.threads == 1 ? " thread" : " threads");
  }
  std::string unknown;
  for (const StagePlan& stage : plan.stages) {
    if (!stage.cpu_seconds) unknown += (unknown.empty() ? "" : ", ") + stage.name;
  }
  return "unknown of " + unknown;
}

std::string stageText(const StagePlan& stage) {
  std::string text = "stage     " + stage.name;
  if (!stage.arguments.empty()) text += ' ' + stage.arguments;
  if (stage.is_barrier) {
    text += "  (barrier: holds the whole volume)";
  } else if (stage.kind == StagePlan::Kind::filter) {
    const Reach reach = widest(stage.reads);
    text += "  (reads " + std::to_string(reach.below) + " layers below, " +
            std::to_string(reach.above) + " above)";
  }
  text += "  ->";
  for (const auto& [name, grid] : stage.schema.grids) text += ' ' + name;
  if (stage.memory_bytes > 0) text += ", holds " + bytesText(stage.memory_bytes);
  text += '\n';
  for (const InputPlan& input : stage.inputs) {
    text += "input     " + (input.path == "-" ? "standard input" : printable(input.path)) +
            " for " + stage.name + ", a " + (input.is_pipe ? "pipe" : "file") + " of " +
            std::to_string(input.layers.size()) + " layers\n";
  }
  return text;
}

/// Null for what is unknown or without limit.
ordered_json known(double value) {
  return value > 0 && std::isfinite(value) ? ordered_json(value) : ordered_json();
}
ordered_json known(const std::optional<double>& value) {
  return value ? ordered_json(*value) : ordered_json();
}

template <typename Vector>
ordered_json triple(const Vector& v) {
  return {v[0], v[1], v[2]};
}

ordered_json json(const Lattice& lattice) {
  ordered_json entry{{"pitch_mm", triple(lattice.pitch_mm)},
                     {"origin_mm", triple(lattice.origin_mm)}};
  if (!lattice.box.empty()) {
    entry["min"] = triple(lattice.box.min());
    entry["max"] = triple(lattice.box.max());
  }
  return entry;
}

/// Layers are counted as by --layers: from the bottom of the box, the end exclusive.
ordered_json json(ZRange layers, int bottom) {
  return {{"begin", layers.begin - bottom}, {"end", layers.end - bottom}};
}

ordered_json json(const Footprint& footprint) {
  if (!footprint.known()) return {};
  return {{"fullest_row", footprint.fullest_row},
          {"total", footprint.total},
          {"at_surface", footprint.at_surface}};
}

const char* kindName(StagePlan::Kind kind) {
  switch (kind) {
    case StagePlan::Kind::source:
      return "source";
    case StagePlan::Kind::filter:
      return "filter";
    default:
      return "sink";
  }
}

ordered_json json(const StagePlan& stage, int bottom) {
  ordered_json entry{{"name", stage.name},
                     {"kind", kindName(stage.kind)},
                     {"arguments", stage.arguments},
                     {"lattice", json(stage.schema.lattice)},
                     {"layers", json(stage.cores, bottom)},
                     {"barrier", stage.is_barrier}};
  entry["grids"] = ordered_json::array();
  for (const auto& [name, grid] : stage.schema.grids) entry["grids"].push_back(name);
  entry["handed_on"] = stage.handed_on;
  entry["reads"] = ordered_json::array();
  for (const Read& read : stage.reads) {
    entry["reads"].push_back({{"grid", read.grid},
                              {"below", read.reach.below},
                              {"above", read.reach.above},
                              {"whole", read.reach.whole}});
  }
  entry["inputs"] = ordered_json::array();
  for (const InputPlan& input : stage.inputs) {
    entry["inputs"].push_back({{"path", input.path},
                               {"pipe", input.is_pipe},
                               {"layers", json(input.layers, bottom)},
                               {"memory_bytes", input.memory_bytes}});
  }
  entry["leaves"] = json(stage.schema.footprint);
  entry["memory_bytes"] = stage.memory_bytes;
  entry["cpu_seconds"] = known(stage.cpu_seconds);
  entry["output"] = nullptr;
  if (isFile(stage.output)) {
    entry["output"] = {{"path", stage.output.path},
                       {"exists", stage.output_exists},
                       {"bytes", known(stage.output.bytes)},
                       {"free_bytes", known(stage.free_disk_bytes)}};
  }
  return entry;
}

}  // namespace

double JobPlan::boxVoxels() const {
  const openvdb::Coord size = lattice().box.dim();
  return static_cast<double>(size.x()) * size.y() * layers.size();
}

bool JobPlan::writesToStandardOutput() const {
  return std::any_of(stages.begin(), stages.end(),
                     [](const StagePlan& stage) { return stage.output.path == "-"; });
}

std::string toText(const JobPlan& plan) {
  const Lattice& lattice = plan.lattice();
  const openvdb::Coord size = lattice.box.dim();
  std::ostringstream text;
  text << "lattice   " << shortestText(lattice.pitch_mm[0]) << " x "
       << shortestText(lattice.pitch_mm[1]) << " x " << shortestText(lattice.pitch_mm[2]) << " mm, "
       << size.x() << " x " << size.y() << " x " << size.z() << " voxels\n"
       << "layers    " << plan.layers.size() << " of " << lattice.layers().size()
       << ", in slabs of " << plan.slab_layers << "\n";
  for (const StagePlan& stage : plan.stages) text << stageText(stage);
  text << "memory    about " << bytesText(plan.memory_bytes) << " of "
       << bytesText(plan.memory_limit_bytes) << "\n"
       << "time      " << timeText(plan) << "\n";
  for (const StagePlan& stage : plan.stages) {
    const OutputEstimate& output = stage.output;
    if (!isFile(output)) continue;
    text << "disk      " << (output.bytes > 0 ? "about " + bytesText(output.bytes) : "unknown")
         << " of " << bytesText(stage.free_disk_bytes) << " for " << printable(output.path)
         << (stage.output_exists ? ", which exists: --overwrite replaces it" : "") << "\n";
  }
  return text.str();
}

std::string toJson(const JobPlan& plan) {
  const ZRange all = plan.lattice().layers();
  ordered_json entry{{"version", version},
                     {"lattice", json(plan.lattice())},
                     {"layers", json(plan.layers, all.begin)},
                     {"slab_layers", plan.slab_layers},
                     {"threads", plan.threads},
                     {"seconds", known(plan.seconds)},
                     {"memory_bytes", plan.memory_bytes},
                     {"memory_limit_bytes", known(plan.memory_limit_bytes)},
                     {"stages", ordered_json::array()}};
  for (const StagePlan& stage : plan.stages) entry["stages"].push_back(json(stage, all.begin));
  return jsonText(entry) + "\n";
}

}  // namespace vdbdither
