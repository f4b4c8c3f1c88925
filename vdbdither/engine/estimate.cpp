#include "vdbdither/engine/estimate.h"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <limits>
#include <sstream>

#include "vdbdither/engine/job_plan.h"
#include "vdbdither/model/layers.h"

namespace vdbdither {

namespace {

/// The program itself, without any slab.
constexpr double program_bytes = 40e6;

/// The share of the work that one thread does alone: the first of two was seen to do 70 to 75 %.
constexpr double serial_share = 0.4;

GridNames namesOf(const Schema& schema) {
  GridNames names;
  for (const auto& [name, grid] : schema.grids) names.insert(name);
  return names;
}

/// The most that the leaves of `layers` layers of some grids take. Rows at both ends may be cut.
double bytesOf(const Schema& schema, const GridNames& names, int layers) {
  double leaf_bytes = 0;
  for (const auto& [name, grid] : schema.grids) {
    if (names.contains(name)) leaf_bytes += leafBytes(grid);
  }
  const double rows = layers / static_cast<double>(leaf_layers) + 1;
  const double leaves = schema.footprint.fullest_row * rows;
  return leaf_bytes *
         (schema.footprint.known() ? std::min(leaves, schema.footprint.total) : leaves);
}

/// What a window holds in front of `stage`, which follows `before`. `shared`: the grids that
/// windows of earlier stages hold; those of this one are added.
double windowBytes(const StagePlan& stage, const StagePlan& before, int slab_layers,
                   GridNames& shared) {
  // A sink takes the layers of the job only.
  const int all = stage.kind == StagePlan::Kind::sink ? stage.cores.size()
                                                      : stage.schema.lattice.layers().size();
  const Reach reach = widest(stage.reads);
  const int halo_layers = reach.below + reach.above;
  const int window_layers =
      reach.whole || stage.is_barrier ? all : std::min(all, slab_layers + halo_layers);
  double bytes = bytesOf(before.schema, before.handed_on, window_layers);
  if (halo_layers == 0) return bytes;
  for (const Read& read : stage.reads) {
    // A grid that others hold is copied to be joined with its halo; any other grows by it.
    const bool copied = stage.handed_on.contains(read.grid) || shared.contains(read.grid);
    bytes +=
        bytesOf(before.schema, {read.grid}, copied ? window_layers : std::min(all, halo_layers));
    shared.insert(read.grid);
  }
  return bytes;
}

}  // namespace

std::optional<double> cpuSeconds(const Work& work, const Footprint& footprint, int layers,
                                 int all) {
  if (all == 0) return std::nullopt;
  const bool counts_leaves = work.us_per_surface_leaf > 0 || work.us_per_held_leaf > 0;
  if (counts_leaves && !footprint.known()) return std::nullopt;
  const double leaves_us =
      work.us_per_surface_leaf * footprint.at_surface + work.us_per_held_leaf * footprint.total;
  return work.seconds + 1e-6 * layers * (work.us_per_layer + leaves_us / all);
}

double memoryBytes(const JobPlan& plan, int slab_layers) {
  double bytes = program_bytes;
  const StagePlan* before = nullptr;
  GridNames shared;
  for (const StagePlan& stage : plan.stages) {
    bytes += stage.memory_bytes;
    if (before) {
      bytes += windowBytes(stage, *before, slab_layers, shared);
    } else {
      const int all = stage.schema.lattice.layers().size();
      bytes += bytesOf(stage.schema, namesOf(stage.schema), std::min(all, slab_layers));
    }
    before = &stage;
  }
  return bytes;
}

std::optional<double> secondsOf(const JobPlan& plan) {
  double cpu_seconds = 0;
  for (const StagePlan& stage : plan.stages) {
    if (!stage.cpu_seconds) return std::nullopt;
    cpu_seconds += *stage.cpu_seconds;
  }
  return cpu_seconds * (serial_share + (1 - serial_share) / plan.threads);
}

double freeMemoryBytes() {
  constexpr double share = 0.8;
  std::ifstream file("/proc/meminfo");
  std::string line;
  while (std::getline(file, line)) {
    std::istringstream words(line);
    std::string key;
    double kilobytes = 0;
    words >> key >> kilobytes;
    if (key == "MemAvailable:") return share * kilobytes * 1024;
  }
  return std::numeric_limits<double>::infinity();
}

double freeDiskBytes(const std::string& path) {
  std::filesystem::path folder = std::filesystem::path(path).parent_path();
  if (folder.empty()) folder = ".";
  std::error_code error;
  const std::filesystem::space_info space = std::filesystem::space(folder, error);
  return error ? std::numeric_limits<double>::infinity() : static_cast<double>(space.available);
}

}  // namespace vdbdither
