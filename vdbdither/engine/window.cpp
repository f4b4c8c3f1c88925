#include "vdbdither/engine/window.h"

#include "vdbdither/model/layers.h"

namespace vdbdither {

Slab cutTo(const Slab& slab, ZRange core) {
  if (core == slab.core) return slab;
  Slab cut{core, core, {}};
  for (const auto& [name, grid] : slab.grids) {
    const GridLayers piece{grid, slab.core};
    cut.grids[name] = joinLayers({&piece, 1}, core);
  }
  return cut;
}

Window::Window(std::vector<Read> reads, ZRange layers, ZRange cores, GridNames passing)
    : reads_(std::move(reads)),
      layers_(layers),
      cores_(cores),
      passing_(std::move(passing)),
      reach_(widest(reads_)) {}

ZRange Window::halo(ZRange core) const { return reached(core, reach_, layers_); }

Window::Task Window::makeTask(Slab& slab, ZRange core) {
  Slab passing{slab.core, slab.core, {}};
  for (const auto& [name, grid] : slab.grids) {
    if (passing_.contains(name)) passing.grids[name] = grid;
  }
  Task task{{core, halo(core), {}}, cutTo(passing, core)};
  passing.grids.clear();
  for (const Read& read : reads_) {
    if (GridConstPtr grid = inputGrid(slab, read, core))
      task.input.grids[read.grid] = std::move(grid);
  }
  return task;
}

/// What `read` says of a grid around `core`, a part of `slab`. A grid that nobody else holds is not
/// copied but grows by its halo, and the window keeps a copy of the layers that later cores reach.
GridConstPtr Window::inputGrid(Slab& slab, const Read& read, ZRange core) {
  // Leaves are copied whole or not at all.
  const auto wanted_around = [&](ZRange range) {
    return intersection(alignedToLeaves(reached(range, read.reach, layers_)), layers_);
  };
  const ZRange wanted = wanted_around(core);
  std::vector<GridLayers> halo;
  for (const Slab& piece : slabs_) {
    const auto found = piece.grids.find(read.grid);
    if (found == piece.grids.end() || intersection(piece.core, wanted).empty()) continue;
    if (&piece != &slab) halo.push_back({found->second, piece.core});
  }
  const auto own = slab.grids.find(read.grid);
  if (own == slab.grids.end()) return halo.empty() ? nullptr : joinLayers(halo, wanted);

  const int kept_begin =
      core.end < cores_.end ? wanted_around({core.end, core.end + 1}).begin : core.end;
  if (core == slab.core && kept_begin > core.begin && own->second.use_count() == 1 &&
      !halo.empty()) {
    const GridLayers whole{own->second, core};
    const GridConstPtr kept = joinLayers({&whole, 1}, {kept_begin, core.end});
    const auto grid = std::const_pointer_cast<openvdb::GridBase>(own->second);
    if (addLayers(*grid, core, halo, wanted)) {
      own->second = kept;
      return grid;
    }
  }
  halo.push_back({own->second, slab.core});
  return joinLayers(halo, wanted);
}

Slab Window::joined() const {
  Slab all{layers_, layers_, {}};
  for (const auto& [name, first] : slabs_.front().grids) {
    std::vector<GridLayers> pieces;
    for (const Slab& slab : slabs_) pieces.push_back({slab.grids.find(name)->second, slab.core});
    all.grids[name] = joinLayers(pieces, layers_);
  }
  return all;
}

std::vector<Window::Task> Window::push(Slab slab) {
  std::vector<Task> tasks;
  const int top = slab.core.end;
  slabs_.push_back(std::move(slab));
  if (reach_.whole) {
    if (top < layers_.end) return tasks;
    slabs_ = {joined()};
  }
  while (next_ < slabs_.size()) {
    const ZRange core = intersection(slabs_[next_].core, cores_);
    if (!core.empty()) {
      if (halo(core).end > top) break;
      tasks.push_back(makeTask(slabs_[next_], core));
    }
    ++next_;
  }
  // What the next core reaches down to stays.
  while (next_ > 0) {
    const int next_begin = next_ < slabs_.size() ? slabs_[next_].core.begin : top;
    if (slabs_.front().core.end > halo({next_begin, next_begin + 1}).begin &&
        next_begin < layers_.end)
      break;
    slabs_.pop_front();
    --next_;
  }
  return tasks;
}

}  // namespace vdbdither
