#pragma once

#include <string>
#include <vector>

#include "vdbdither/model/lattice.h"

namespace vdbdither {

/// The number of layers around its core that a filter reads.
struct Reach {
  int below = 0;
  int above = 0;
  bool whole = false;  ///< needs every layer at once

  static Reach point() { return {}; }
  static Reach stencil(int radius) { return {radius, radius, false}; }
  static Reach everything() { return {0, 0, true}; }
  friend bool operator==(const Reach&, const Reach&) = default;
};

/// A grid that a filter or a sink reads, and how far around the core.
struct Read {
  std::string grid;
  Reach reach;
  /// Whether a filter makes nothing of it but the same grid anew, so that it is read only where a
  /// later stage reads that one.
  bool if_wanted = false;
};

/// The widest of the reaches.
Reach widest(const std::vector<Read>& reads);

/// `core` and the layers that `reach` adds to it, cut at `layers`.
ZRange reached(ZRange core, const Reach& reach, ZRange layers);

}  // namespace vdbdither
