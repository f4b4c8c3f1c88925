#include "ops/kernels/measure/print_regions.h"

#include <algorithm>
#include <optional>
#include <tuple>
#include <utility>

#include <tbb/parallel_for.h>

#include "ops/kernels/leaf/disjoint_sets.h"
#include "ops/kernels/measure/touching_spans.h"

namespace vdbdither {

namespace {

/// Columns [begin, end) of a row, all printed or all empty, and the piece they belong to.
struct Run {
  std::uint32_t begin = 0, end = 0;
  std::uint32_t piece = 0;
};

/// A connected set of pixels of one layer.
struct Piece {
  Region region;
  bool at_edge = false;  ///< whether it has pixels at the edge of the slice
  bool below = false;    ///< whether it touches a piece of the layer below
  bool above = false;    ///< the same of the layer above
};

/// All pieces of one kind in a layer, in the order of their first pixels.
struct Pieces {
  std::vector<Run> runs;
  std::vector<std::size_t> rows{0};  ///< where the runs of each row begin
  std::vector<Piece> pieces;

  [[nodiscard]] std::span<const Run> row(std::size_t y) const {
    return std::span(runs).subspan(rows[y], rows[y + 1] - rows[y]);
  }
};

struct Plane {
  int number = 0;
  std::uint32_t width = 0, height = 0;
  Pieces printed, empty;
  /// The empty pieces of the plane below and of this one that touch, without repetition.
  std::vector<std::pair<std::uint32_t, std::uint32_t>> links;
};

bool isEarlier(const Region& a, const Region& b) {
  return std::tie(a.layer, a.row, a.column) < std::tie(b.layer, b.row, b.column);
}

/// Numbers the pieces that the runs form.
void findPieces(Pieces& all, const Plane& plane) {
  DisjointSets sets(all.runs.size());
  for (std::uint32_t y = 1; y < plane.height; ++y) {
    forEachTouching(all.row(y - 1), all.row(y), 0, [&](std::size_t i, std::size_t j) {
      sets.join(static_cast<std::uint32_t>(all.rows[y - 1] + i),
                static_cast<std::uint32_t>(all.rows[y] + j));
    });
  }
  for (std::uint32_t y = 0; y < plane.height; ++y) {
    for (std::size_t i = all.rows[y]; i < all.rows[y + 1]; ++i) {
      Run& run = all.runs[i];
      const std::uint32_t root = sets.find(static_cast<std::uint32_t>(i));
      if (root == i) {
        run.piece = static_cast<std::uint32_t>(all.pieces.size());
        all.pieces.push_back({{0, plane.number, run.begin, y}});
      } else {
        run.piece = all.runs[root].piece;
      }
      Piece& piece = all.pieces[run.piece];
      piece.region.voxels += run.end - run.begin;
      piece.at_edge = piece.at_edge || y == 0 || y + 1 == plane.height || run.begin == 0 ||
                      run.end == plane.width;
    }
  }
}

Plane planeOf(const PrintRegions::Layer& layer) {
  Plane plane{.number = layer.number,
              .width = layer.image.width,
              .height = layer.image.height,
              .printed = {},
              .empty = {},
              .links = {}};
  for (std::uint32_t y = 0; y < plane.height; ++y) {
    std::uint32_t begin = 0;
    const std::span<const Span> spans = layer.image.row(y);
    for (std::size_t i = 0; i < spans.size(); ++i) {
      const bool is_printed = spans[i].value != 0;
      // Materials do not matter.
      if (i + 1 < spans.size() && (spans[i + 1].value != 0) == is_printed) continue;
      (is_printed ? plane.printed : plane.empty).runs.push_back({begin, spans[i].end, 0});
      begin = spans[i].end;
    }
    for (Pieces* pieces : {&plane.printed, &plane.empty})
      pieces->rows.push_back(pieces->runs.size());
  }
  for (Pieces* pieces : {&plane.printed, &plane.empty}) findPieces(*pieces, plane);
  return plane;
}

/// Notes what touches between two planes.
void meet(Plane& below, Plane& above) {
  for (std::uint32_t y = 0; y < above.height; ++y) {
    const std::span<const Run> lower = below.printed.row(y);
    const std::span<const Run> upper = above.printed.row(y);
    forEachTouching(lower, upper, 0, [&](std::size_t i, std::size_t j) {
      below.printed.pieces[lower[i].piece].above = true;
      above.printed.pieces[upper[j].piece].below = true;
    });
    const std::span<const Run> empty_lower = below.empty.row(y);
    const std::span<const Run> empty_upper = above.empty.row(y);
    forEachTouching(empty_lower, empty_upper, 0, [&](std::size_t i, std::size_t j) {
      const std::pair link(empty_lower[i].piece, empty_upper[j].piece);
      if (above.links.empty() || above.links.back() != link) above.links.push_back(link);
    });
  }
  std::sort(above.links.begin(), above.links.end());
  above.links.erase(std::unique(above.links.begin(), above.links.end()), above.links.end());
}

/// An empty region up to the present layer.
struct OpenRegion {
  Region region;
  bool is_outside = false;  ///< whether it reaches the edge of a slice
  bool on_plate = false;    ///< whether it has voxels in the lowest printed layer

  void join(const OpenRegion& other) {
    const std::uint64_t voxels = region.voxels + other.region.voxels;
    if (region.voxels == 0 || isEarlier(other.region, region)) region = other.region;
    region.voxels = voxels;
    is_outside = is_outside || other.is_outside;
    on_plate = on_plate || other.on_plate;
  }
};

}  // namespace

void Regions::add(const Region& region) {
  ++count;
  voxels += region.voxels;
  const auto place = std::find_if(largest.begin(), largest.end(), [&](const Region& other) {
    return region.voxels != other.voxels ? region.voxels > other.voxels : isEarlier(region, other);
  });
  if (largest.size() == listed && place == largest.end()) return;
  largest.insert(place, region);
  if (largest.size() > listed) largest.pop_back();
}

struct PrintRegions::State {
  Least least;
  PrintFindings found;
  std::optional<Plane> last;
  std::vector<OpenRegion> open;        ///< the empty regions that have voxels in `last`
  std::vector<std::uint32_t> open_of;  ///< which of them each empty piece of `last` belongs to
  bool is_lowest = true;               ///< whether `last` is the lowest printed layer
  ZRange empty_layers;                 ///< below `last`, or it too

  /// Counts the printed pieces of `last`, whose neighbours above are known by now.
  void countPrinted() {
    for (const Piece& piece : last->printed.pieces) {
      if (!piece.below && !piece.above && piece.region.voxels == 1) {
        found.specks.add(piece.region);
      } else if (!piece.below && !is_lowest) {
        (piece.region.voxels >= least.island ? found.islands : found.small_islands)
            .add(piece.region);
      }
    }
  }

  void addCup(const Region& region) {
    if (region.voxels >= least.cup) found.cups.add(region);
  }

  void countEmpty(const Plane& plane) {
    if (!plane.printed.pieces.empty()) {
      if (!empty_layers.empty()) found.empty_layers.push_back(empty_layers);
      empty_layers = {};
    } else if (empty_layers.empty()) {
      empty_layers = {plane.number, plane.number + 1};
    } else {
      empty_layers.end = plane.number + 1;
    }
  }

  void begin(Plane&& plane) {
    for (const Piece& piece : plane.empty.pieces) {
      open_of.push_back(static_cast<std::uint32_t>(open.size()));
      open.push_back({piece.region, piece.at_edge, true});
    }
    last = std::move(plane);
  }

  /// Goes on to the next plane, which has met the last one.
  void advance(Plane&& plane) {
    countPrinted();
    countEmpty(plane);
    joinEmpty(plane);
    last = std::move(plane);
    is_lowest = false;
  }

  /// Goes on with the empty regions: those of the last plane come first, then the pieces of the
  /// next one.
  void joinEmpty(const Plane& plane) {
    const auto before = static_cast<std::uint32_t>(open.size());
    const std::vector<Piece>& pieces = plane.empty.pieces;
    DisjointSets sets(before + pieces.size());
    for (const auto& [below, above] : plane.links) sets.join(open_of[below], before + above);
    constexpr auto none = ~std::uint32_t{0};
    std::vector<std::uint32_t> renamed(before + pieces.size(), none);
    std::vector<OpenRegion> next;
    open_of.clear();
    for (std::uint32_t n = 0; n < pieces.size(); ++n) {
      const std::uint32_t root = sets.find(before + n);
      if (renamed[root] == none) {
        renamed[root] = static_cast<std::uint32_t>(next.size());
        next.emplace_back();
      }
      open_of.push_back(renamed[root]);
      next[renamed[root]].join({pieces[n].region, pieces[n].at_edge, false});
    }
    for (std::uint32_t n = 0; n < before; ++n) {
      const std::uint32_t to = renamed[sets.find(n)];
      if (to != none) next[to].join(open[n]);
    }
    for (std::uint32_t n = 0; n < before; ++n) {
      if (open[n].is_outside) continue;
      const std::uint32_t to = renamed[sets.find(n)];
      if (to == none) {
        open[n].on_plate ? addCup(open[n].region) : found.cavities.add(open[n].region);
      } else if (next[to].is_outside) {
        addCup(open[n].region);
      }
    }
    open = std::move(next);
  }
};

PrintRegions::PrintRegions(const Least& least) : state_(std::make_unique<State>()) {
  state_->least = least;
}
PrintRegions::~PrintRegions() = default;

void PrintRegions::add(std::span<const Layer> layers) {
  std::vector<Plane> planes(layers.size());
  tbb::parallel_for(std::size_t{0}, layers.size(),
                    [&](std::size_t i) { planes[i] = planeOf(layers[i]); });
  // The part begins with its lowest printed layer.
  std::size_t first = 0;
  while (!state_->last && first < planes.size() && planes[first].printed.pieces.empty()) ++first;
  tbb::parallel_for(first, planes.size(), [&](std::size_t i) {
    if (i > first) {
      meet(planes[i - 1], planes[i]);
    } else if (state_->last) {
      meet(*state_->last, planes[i]);
    }
  });
  for (std::size_t i = first; i < planes.size(); ++i) {
    if (state_->last) {
      state_->advance(std::move(planes[i]));
    } else {
      state_->begin(std::move(planes[i]));
    }
  }
}

PrintFindings PrintRegions::finish() {
  State& state = *state_;
  if (!state.last) return {};
  state.countPrinted();
  for (const OpenRegion& region : state.open) {
    if (!region.is_outside) state.addCup(region.region);
  }
  return std::exchange(state.found, {});
}

}  // namespace vdbdither
