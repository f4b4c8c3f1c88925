#include "io/vdb/slab_reader.h"

#include <algorithm>
#include <filesystem>
#include <limits>
#include <unistd.h>

#include "io/vdb/grid_checks.h"
#include "io/vdb/pipe_input.h"
#include "io/vdb/vdb.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/layers.h"
#include "vdbdither/model/openvdb.h"
#include "vdbdither/model/visit_grid.h"

namespace vdbdither {

namespace {

/// Returns the grids of `grids` whose names are in `names`.
void keepNamed(Grids& grids, const std::vector<std::string>& names) {
  if (names.empty()) return;
  Grids kept;
  for (const std::string& name : names) {
    const auto found = grids.find(name);
    if (found == grids.end()) {
      std::string message = "--grids: no grid '" + name + "'; there are";
      for (const auto& [known, grid] : grids) message += " " + known;
      throw UsageError(message);
    }
    kept.insert(*found);
  }
  grids = std::move(kept);
}

/// The leaves of each row of 8 layers, of the grid that has the most there.
std::map<int, double> leavesOfRows(const Grids& grids) {
  std::map<int, double> most;
  for (const auto& [name, grid] : grids) {
    std::map<int, double> rows;
    visitGrid(*grid, [&](const auto& typed) {
      for (auto leaf = typed.tree().cbeginLeaf(); leaf; ++leaf) ++rows[leaf->origin().z()];
    });
    for (const auto& [z, leaves] : rows) most[z] = std::max(most[z], leaves);
  }
  return most;
}

}  // namespace

SlabReader::SlabReader(std::string path, const std::vector<std::string>& names)
    : path_(std::move(path)) {
  std::error_code none;
  const std::filesystem::file_type type = std::filesystem::status(path_, none).type();
  if (path_ == "-") {
    shown_ = "standard input";
    openPipe(STDIN_FILENO);
  } else if (type == std::filesystem::file_type::fifo) {
    shown_ = "'" + path_ + "'";
    descriptor_ = openNamedPipe(path_, shown_);
    openPipe(descriptor_);
  } else {
    shown_ = "'" + path_ + "'";
    openFile(names);
  }
  keepNamed(schema_.grids, names);
}

SlabReader::~SlabReader() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

void SlabReader::openPipe(int descriptor) {
  frames_ = std::make_unique<FrameReader>(descriptor, shown_);
  schema_ = frames_->schema();
}

void SlabReader::openFile(const std::vector<std::string>& names) {
  VdbContents contents = readVdb(path_);
  // Grids that are not wanted may lie on any lattice.
  keepNamed(contents.grids, names);
  admitGrids(contents.grids, shown_);
  schema_ = schemaOf(contents, shown_);
  // A file without that metadata holds all layers, even beyond its box.
  ZRange held{std::numeric_limits<int>::min(), std::numeric_limits<int>::max()};
  if (const auto some = takeHeldLayers(schema_, shown_)) held = *some;
  Footprint& footprint = schema_.footprint;
  for (const auto& [z, leaves] : leavesOfRows(contents.grids)) {
    footprint.total += leaves;
    footprint.fullest_row = std::max(footprint.fullest_row, leaves);
  }
  footprint.at_surface = footprint.total;
  slabs_.push_back({held, held, std::move(contents.grids)});
}

double SlabReader::memoryBytes() const {
  double bytes = 0;
  for (const Slab& slab : slabs_) {
    for (const auto& [name, grid] : slab.grids) bytes += sizeOf(grid).bytes;
  }
  return bytes;
}

GridConstPtr SlabReader::held(const std::string& name) const {
  if (isPipe() || slabs_.empty()) return nullptr;
  const auto found = slabs_.front().grids.find(name);
  return found == slabs_.front().grids.end() ? nullptr : found->second;
}

Grids SlabReader::read(ZRange core) {
  const std::lock_guard lock(mutex_);
  if (isPipe()) takeFrames(core);
  checkCovered(core);
  Grids result;
  for (const auto& [name, prototype] : schema_.grids) {
    std::vector<GridLayers> pieces;
    for (const Slab& slab : slabs_) {
      const auto found = slab.grids.find(name);
      if (found != slab.grids.end()) pieces.push_back({found->second, slab.core});
    }
    if (!pieces.empty()) result[name] = joinLayers(pieces, core);
  }
  return result;
}

void SlabReader::readToEnd() {
  const std::lock_guard lock(mutex_);
  slabs_.clear();
  while (isPipe() && !ended_) ended_ = !frames_->next();
}

/// Frames arrive in rising z, and the cores are requested in rising z: slabs below `core` are
/// dropped, missing ones are read.
void SlabReader::takeFrames(ZRange core) {
  std::erase_if(slabs_, [&](const Slab& slab) { return slab.core.end <= core.begin; });
  while (!ended_ && (slabs_.empty() || slabs_.back().core.end < core.end)) {
    std::optional<Slab> slab = frames_->next();
    ended_ = !slab;
    if (slab && slab->core.end > core.begin) slabs_.push_back(std::move(*slab));
  }
}

/// An archive made with --layers lacks the other layers, which are not empty.
void SlabReader::checkCovered(ZRange core) const {
  int covered = core.begin;
  for (const Slab& slab : slabs_) {
    if (slab.core.begin <= covered) covered = std::max(covered, slab.core.end);
  }
  if (covered < core.end) {
    throw DataError(shown_ + " lacks layer " +
                    std::to_string(covered - schema_.lattice.layers().begin) +
                    "; to make only some layers, give --layers to the last operator of the chain "
                    "alone");
  }
}

}  // namespace vdbdither
