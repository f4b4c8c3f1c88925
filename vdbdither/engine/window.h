#pragma once

#include <deque>
#include <vector>

#include "vdbdither/engine/reach.h"
#include "vdbdither/model/slab.h"

namespace vdbdither {

/// Stands in front of a filter: keeps the slabs that the filter's reach still needs and gives out
/// each core with its halo as soon as the layers above have come. A barrier gets all layers at
/// once.
class Window {
 public:
  /// \param reads    the grids the filter reads, each once
  /// \param layers   all layers that will come
  /// \param cores    those to be given out as cores: multiples of 8, or cut at the end of `layers`
  /// \param passing  the grids that pass the filter by
  Window(std::vector<Read> reads, ZRange layers, ZRange cores, GridNames passing);

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
  GridNames passing_;
  Reach reach_;  ///< the widest of `reads_`
  std::deque<Slab> slabs_;
  std::size_t next_ = 0;  ///< the first of `slabs_` that was not given out
};

/// The part of `slab` in `core`, which lies within slab.core.
Slab cutTo(const Slab& slab, ZRange core);

}  // namespace vdbdither
