#include "vdbdither/engine/reach.h"

#include <algorithm>

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

}  // namespace vdbdither
