#include "vdbdither/window.h"

#include <algorithm>

#include "vdbdither/layers.h"

namespace vdbdither {

Reach widest(const std::vector<Read>& reads) {
  Reach reach;
  for (const Read& read : reads) {
    reach.below = std::max(reach.below, read.reach.below);
    reach.above = std::max(reach.above, read.reach.above);
    reach.whole |= read.reach.whole;
  }
  return reach;
}

ZRange reached(ZRange core, const Reach& reach, ZRange layers) {
  if (reach.whole) return layers;
  return intersection({core.begin - reach.below, core.end + reach.above}, layers);
}

Slab cutTo(const Slab& slab, ZRange core) {
  if (core == slab.core) return slab;
  Slab cut{core, core, {}};
  for (const auto& [name, grid] : slab.grids) {
    const Layers piece{grid, slab.core};
    cut.grids[name] = joinLayers({&piece, 1}, core);
  }
  return cut;
}

Window::Window(std::vector<Read> reads, ZRange layers, ZRange cores)
    : reads_(std::move(reads)), layers_(layers), cores_(cores), reach_(widest(reads_)) {}

ZRange Window::halo(ZRange core) const { return reached(core, reach_, layers_); }

Window::Task Window::makeTask(const Slab& slab, ZRange core) const {
  Task task{{core, halo(core), {}}, cutTo(slab, core)};
  for (const Read& read : reads_) {
    // Leaves are copied whole or not at all.
    const ZRange wanted =
        intersection(alignedToLeaves(reached(core, read.reach, layers_)), layers_);
    std::vector<Layers> pieces;
    for (const Slab& piece : slabs_) {
      if (intersection(piece.core, wanted).empty()) continue;
      if (const auto found = piece.grids.find(read.grid); found != piece.grids.end()) {
        pieces.push_back({found->second, piece.core});
      }
    }
    if (!pieces.empty()) task.input.grids[read.grid] = joinLayers(pieces, wanted);
  }
  return task;
}

Slab Window::joined() const {
  Slab all{layers_, layers_, {}};
  for (const auto& [name, first] : slabs_.front().grids) {
    std::vector<Layers> pieces;
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
