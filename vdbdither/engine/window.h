#pragma once

#include <deque>
#include <set>
#include <string>
#include <vector>

#include "vdbdither/engine/operator.h"
#include "vdbdither/model/slab.h"

namespace vdbdither {

/// Stands in front of a filter: keeps the slabs that the filter's reach still needs and hands out
/// each core with its halo as soon as the layers above have come. A barrier gets all layers in one.
class Window {
 public:
  /// `reads`: the grids the filter reads, each once; `layers`: all layers that will come; `cores`:
  /// the layers whose cores are to be handed out (multiples of eight, or cut at the end of
  /// `layers`); `passing`: the grids that are to pass the filter by.
  Window(std::vector<Read> reads, ZRange layers, ZRange cores,
         std::set<std::string, std::less<>> passing);

  struct Task {
    Slab input;    ///< the core with its halo: what the filter reads
    Slab passing;  ///< the core alone: what passes the filter by
  };

  /// Takes the next slab, which lies on top of those before it. Returns the tasks it completes, in
  /// rising z.
  std::vector<Task> push(Slab slab);

 private:
  [[nodiscard]] ZRange halo(ZRange core) const;
  [[nodiscard]] Slab joined() const;
  Task makeTask(Slab& slab, ZRange core);
  GridConstPtr inputGrid(Slab& slab, const Read& read, ZRange core);

  std::vector<Read> reads_;
  ZRange layers_;
  ZRange cores_;
  std::set<std::string, std::less<>> passing_;
  Reach reach_;  ///< the widest of `reads_`
  std::deque<Slab> slabs_;
  std::size_t next_ = 0;  ///< the first of `slabs_` that was not handed out
};

/// The widest of the reaches.
Reach widest(const std::vector<Read>& reads);

/// `core` and what `reach` adds to it, cut at `layers`.
ZRange reached(ZRange core, const Reach& reach, ZRange layers);

/// The part of `slab` in `core`, which lies within slab.core.
Slab cutTo(const Slab& slab, ZRange core);

}  // namespace vdbdither
