// Away from the triangles the number is harmonic, and like the field of dipoles it has no flux
// through a surface around any of them. So no piece of the surface at ½ is clear of all triangles:
// it could neither rise nor fall across the piece. From the cells that triangles pass, growing
// across edges whose ends are on both sides finds all of it, and the cost follows the surface.
//
// Cells are cut in eight where one vertex does not tell what the surface does in them: an octree of
// leaves of any size beside each other, whose dual is closed whatever their sizes (Ju, Losasso,
// Schaefer, Warren: "Dual Contouring of Hermite Data", 2002).

#include "ops/kernels/mesh/winding_surface.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <span>
#include <utility>
#include <vector>

#include <openvdb/math/BBox.h>
#include <openvdb/math/Mat3.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_sort.h>

#include "ops/kernels/contour/marching_cubes.h"
#include "ops/kernels/mesh/grid_keys.h"
#include "ops/kernels/mesh/mesh_measures.h"
#include "ops/kernels/mesh/triangle_and_cube.h"
#include "ops/kernels/mesh/winding_cells.h"
#include "vdbdither/model/openvdb.h"

namespace vdbdither {

using openvdb::Coord;
using openvdb::Vec3d;

namespace {

constexpr std::uint32_t none = ~std::uint32_t{0};

/// How often a cell is cut in eight; the smallest have an edge of one unit.
constexpr int most_cuts = 5;
constexpr int coarse_units = WindingCells::units;
static_assert(coarse_units == 1 << most_cuts);
/// What a vertex may miss the tangents at the crossings of its cell by, of the longest side.
constexpr double tolerance = 1e-4;
/// Between two passes that are no wall, of the longest side.
constexpr double least_wall = 4e-4;

/// Tells of a stretch of the whole.
class Stretch {
 public:
  explicit Stretch(const std::function<void(double)>& progress) : progress_(progress) {}
  [[nodiscard]] Stretch part(double from, double to) const {
    Stretch part = *this;
    part.from_ = from_ + (to_ - from_) * from;
    part.to_ = from_ + (to_ - from_) * to;
    return part;
  }
  void operator()(double fraction) const {
    if (progress_) progress_(from_ + (to_ - from_) * fraction);
  }

 private:
  const std::function<void(double)>& progress_;
  double from_ = 0, to_ = 1;
};

/// Calls work(i) for i below `count` on all threads, with a word in between.
template <class Work>
void forAll(std::size_t count, const Stretch& stretch, const Work& work) {
  constexpr std::size_t at_once = 1 << 16;
  for (std::size_t begin = 0; begin < count; begin += at_once) {
    stretch(static_cast<double>(begin) / static_cast<double>(count));
    tbb::parallel_for(begin, std::min(count, begin + at_once), work);
  }
}

/// The set and its surface.
class Octree {
 public:
  /// Of the places where the number exceeds ½, or if `side` is −1 where it is below −½.
  Octree(WindingCells& cells, double side, int most_cuts_here, std::size_t most_leaves)
      : mesh_(cells.mesh()),
        cells_(cells),
        side_(side),
        unit_mm_(cells.unitMm()),
        smallest_(coarse_units >> most_cuts_here),
        most_leaves_(most_leaves),
        tolerance_mm_(tolerance * cells.longestMm()) {}

  /// Finds the leaves that triangles or the surface pass.
  void grow(const Stretch& stretch);
  [[nodiscard]] Mesh surface() const;
  /// The edge of the smallest leaf.
  [[nodiscard]] double leastMm() const { return least_ * unit_mm_; }

 private:
  struct Leaf {
    Coord low;
    int size;  ///< in units
    bool divided = false;
    std::uint8_t inside = 0;             ///< by corner, a bit each
    std::uint32_t cell = 0;              ///< undivided, that it lies in
    std::uint32_t first = 0, count = 0;  ///< the triangles that meet it, in touches_
  };
  /// Of an edge between corners, or a part of one, which no other ends within.
  struct Edge {
    Coord low;
    int axis;
    int size;
  };
  /// Where an edge passes the surface.
  struct Crossing {
    Vec3d at{0.0};
    Vec3d normal{0.0};       ///< unit, in either direction; or zero
    int passes = 0;          ///< 2 for more
    bool is_smooth = false;  ///< clear of triangles
  };

  [[nodiscard]] Vec3d position(const Coord& corner) const { return cells_.position(corner); }
  [[nodiscard]] double numberAt(const Leaf& leaf, const Vec3d& p) const {
    return side_ * cells_.numberAt(leaf.cell, p);
  }
  [[nodiscard]] double judgedAt(const Leaf& leaf, const Vec3d& p) const {
    return side_ * cells_.judgedAt(leaf.cell, p);
  }
  [[nodiscard]] std::span<const std::uint32_t> touchesOf(const Leaf& leaf) const {
    return {touches_.data() + leaf.first, leaf.count};
  }
  static Key leafKey(const Coord& low, int size) {
    return keyOf(low) << 3 | static_cast<Key>(std::countr_zero(static_cast<unsigned>(size)));
  }
  static Key edgeKey(const Edge& edge) {
    return (keyOf(edge.low) << 3 |
            static_cast<Key>(std::countr_zero(static_cast<unsigned>(edge.size))))
               << 2 |
           static_cast<Key>(edge.axis);
  }
  static Edge edgeOf(const Leaf& leaf, int edge);
  static Edge edgeOf(Key key) {
    return {coordOf(key >> 5), static_cast<int>(key & 3), 1 << (key >> 2 & 7)};
  }
  static Coord cornerOf(const Leaf& leaf, int corner) {
    return leaf.low.offsetBy((corner & 1) * leaf.size, (corner >> 1 & 1) * leaf.size,
                             (corner >> 2 & 1) * leaf.size);
  }

  [[nodiscard]] bool isInside(const Coord& corner) const {
    const bool* found = inside_.find(keyOf(corner));
    return found != nullptr && *found;
  }
  [[nodiscard]] std::uint8_t insideOf(const Leaf& leaf) const {
    unsigned inside = 0;
    for (int corner = 0; corner < 8; ++corner)
      if (isInside(cornerOf(leaf, corner))) inside |= 1U << corner;
    return static_cast<std::uint8_t>(inside);
  }
  static bool isCut(const Leaf& leaf, int edge) {
    return (cubeCases()[leaf.inside].edges >> edge & 1) != 0;
  }

  void addTouched();
  std::uint32_t add(const Coord& low, int size);
  void divide(std::uint32_t leaf, std::vector<std::uint32_t>& fresh);
  [[nodiscard]] std::uint32_t leafAt(const Coord& unit) const;
  [[nodiscard]] static Coord beside(const Edge& edge, int turn);
  [[nodiscard]] bool tellsTooLittle(const Leaf& leaf) const;
  [[nodiscard]] Crossing crossing(const Edge& edge, const Leaf& leaf) const;
  [[nodiscard]] double smoothCrossing(const Leaf& leaf, const Vec3d& from, const Vec3d& along,
                                      double low, double high) const;
  [[nodiscard]] Vec3d meet(const Leaf& leaf, std::span<const Crossing> crossings) const;
  [[nodiscard]] Vec3d within(const Leaf& leaf, Vec3d p) const;
  [[nodiscard]] Vec3d vertexOf(const Leaf& leaf, std::span<const Crossing> crossings) const;

  const Mesh& mesh_;
  WindingCells& cells_;
  double side_;
  double unit_mm_;
  int smallest_;  ///< that leaves may become
  std::size_t most_leaves_;
  double tolerance_mm_;
  std::vector<Leaf> leaves_;
  KeyMap<std::uint32_t> leaf_at_;
  std::vector<std::uint32_t> touches_;
  KeyMap<bool> inside_;  ///< by corner
  std::vector<Crossing> crossings_;
  KeyMap<std::uint32_t> crossing_at_;  ///< by edge, of those that are cut or pierced
  int least_ = coarse_units;
};

/// Edges are numbered as in marching_cubes.h.
Octree::Edge Octree::edgeOf(const Leaf& leaf, int edge) {
  Edge made{leaf.low, edge / 4, leaf.size};
  made.low[made.axis == 0 ? 1 : 0] += (edge & 1) * leaf.size;
  made.low[made.axis == 2 ? 1 : 2] += (edge >> 1 & 1) * leaf.size;
  return made;
}

std::uint32_t Octree::add(const Coord& low, int size) {
  const auto [leaf, is_new] =
      leaf_at_.add(leafKey(low, size), static_cast<std::uint32_t>(leaves_.size()));
  if (is_new) leaves_.push_back({low, size});
  return leaf;
}

/// Adds the undivided cells that triangles meet: of the columns across the axis that a triangle
/// faces most those that its box meets, and in each what the slope of its plane leaves.
void Octree::addTouched() {
  struct Touch {
    Key cell;
    std::uint32_t triangle;

    bool operator<(const Touch& other) const {
      return std::pair(cell, triangle) < std::pair(other.cell, other.triangle);
    }
  };
  constexpr std::uint32_t in_a_block = 256;
  const double cell_mm = coarse_units * unit_mm_;
  const Vec3d origin_mm = position(Coord(0));
  const auto count = static_cast<std::uint32_t>(mesh_.triangles.size());
  std::vector<std::vector<Touch>> blocks((count + in_a_block - 1) / in_a_block);
  tbb::parallel_for(std::size_t{0}, blocks.size(), [&](std::size_t block) {
    const auto begin = static_cast<std::uint32_t>(block * in_a_block);
    for (std::uint32_t t = begin; t < std::min(count, begin + in_a_block); ++t) {
      const std::array<Vec3d, 3> at = cornersOf(mesh_, t);
      const Vec3d normal = (at[1] - at[0]).cross(at[2] - at[0]);
      int w = 0;
      for (int axis = 1; axis < 3; ++axis)
        if (std::abs(normal[axis]) > std::abs(normal[w])) w = axis;
      if (normal[w] == 0) continue;  // without area
      const int u = (w + 1) % 3;
      const int v = (w + 2) % 3;
      Vec3d low = at[0];
      Vec3d high = at[0];
      for (const Vec3d& corner : at) {
        low = openvdb::math::minComponent(low, corner);
        high = openvdb::math::maxComponent(high, corner);
      }
      constexpr double rounding = 1e-6;
      const Vec3d first = (low - origin_mm) / cell_mm - rounding;
      const Vec3d last = (high - origin_mm) / cell_mm + rounding;
      const double rise =
          0.5 * (std::abs(normal[u]) + std::abs(normal[v])) / std::abs(normal[w]) + rounding;
      const Vec3d from = (at[0] - origin_mm) / cell_mm;
      Coord cell;
      for (cell[u] = static_cast<int>(std::floor(first[u])); cell[u] <= last[u]; ++cell[u])
        for (cell[v] = static_cast<int>(std::floor(first[v])); cell[v] <= last[v]; ++cell[v]) {
          const double height = from[w] - (normal[u] * (cell[u] + 0.5 - from[u]) +
                                           normal[v] * (cell[v] + 0.5 - from[v])) /
                                              normal[w];
          const double top = std::min(height + rise, last[w]);
          for (cell[w] = static_cast<int>(std::floor(std::max(height - rise, first[w])));
               cell[w] <= top; ++cell[w])
            if (meetsCube(at, origin_mm + (cell.asVec3d() + 0.5) * cell_mm, 0.5 * cell_mm))
              blocks[block].push_back({keyOf(cell), t});
        }
    }
  });
  std::vector<Touch> all;
  for (const std::vector<Touch>& block : blocks) all.insert(all.end(), block.begin(), block.end());
  tbb::parallel_sort(all.begin(), all.end());
  touches_.reserve(all.size());
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (i == 0 || all[i].cell != all[i - 1].cell) {
      const Coord cell = coordOf(all[i].cell);
      add(Coord(cell.x() * coarse_units, cell.y() * coarse_units, cell.z() * coarse_units),
          coarse_units);
      leaves_.back().first = static_cast<std::uint32_t>(i);
    }
    ++leaves_.back().count;
    touches_.push_back(all[i].triangle);
  }
}

void Octree::divide(std::uint32_t leaf, std::vector<std::uint32_t>& fresh) {
  const Leaf whole = leaves_[leaf];
  leaves_[leaf].divided = true;
  const int size = whole.size / 2;
  least_ = std::min(least_, size);
  for (int part = 0; part < 8; ++part) {
    const Coord low =
        whole.low.offsetBy((part & 1) * size, (part >> 1 & 1) * size, (part >> 2 & 1) * size);
    const std::uint32_t made = add(low, size);
    leaves_[made].cell = whole.cell;
    leaves_[made].first = static_cast<std::uint32_t>(touches_.size());
    const double half = 0.5 * size * unit_mm_;
    for (std::uint32_t i = whole.first; i < whole.first + whole.count; ++i) {
      const std::uint32_t triangle = touches_[i];
      if (meetsCube(cornersOf(mesh_, triangle), position(low) + half, half))
        touches_.push_back(triangle);
    }
    leaves_[made].count = static_cast<std::uint32_t>(touches_.size()) - leaves_[made].first;
    fresh.push_back(made);
  }
}

/// The leaf that holds a unit, or none.
std::uint32_t Octree::leafAt(const Coord& unit) const {
  for (int size = coarse_units; size >= least_; size /= 2) {
    const std::uint32_t* found = leaf_at_.find(leafKey(unit & ~(size - 1), size));
    if (found == nullptr) return none;
    if (!leaves_[*found].divided) return *found;
  }
  return none;
}

/// A unit at the edge, on each of its four sides, counter-clockwise seen from its upper end.
Coord Octree::beside(const Edge& edge, int turn) {
  Coord unit = edge.low;
  if (turn == 1 || turn == 2) --unit[(edge.axis + 1) % 3];
  if (turn == 2 || turn == 3) --unit[(edge.axis + 2) % 3];
  return unit;
}

void Octree::grow(const Stretch& stretch) {
  addTouched();
  std::vector<std::uint32_t> fresh(leaves_.size());
  std::iota(fresh.begin(), fresh.end(), 0U);
  std::vector<std::pair<Key, std::uint32_t>> asked;  // corners, and a leaf that has them
  std::vector<char> inside;
  std::vector<std::pair<Key, std::uint32_t>> edges;
  std::vector<Crossing> crossings;
  double done = 0;
  while (!fresh.empty()) {
    // How much is still to come nobody knows.
    const double next = done + 0.25 * (1 - done);
    std::vector<std::uint32_t> undivided;
    std::vector<Coord> lows;
    for (const std::uint32_t leaf : fresh)
      if (leaves_[leaf].size == coarse_units) {
        undivided.push_back(leaf);
        lows.push_back(leaves_[leaf].low);
      }
    const std::vector<std::uint32_t> cells = cells_.at(lows);
    for (std::size_t i = 0; i < cells.size(); ++i) leaves_[undivided[i]].cell = cells[i];

    asked.resize(8 * fresh.size());
    tbb::parallel_for(std::size_t{0}, asked.size(), [&](std::size_t i) {
      const std::uint32_t leaf = fresh[i / 8];
      asked[i] = {keyOf(cornerOf(leaves_[leaf], static_cast<int>(i % 8))), leaf};
    });
    sortUniqueKeys(asked);
    eraseAll(asked, [this](const auto& corner) {
      return !cells_.limits().isInside(coordOf(corner.first)) || inside_.contains(corner.first);
    });
    inside.assign(asked.size(), 0);
    forAll(asked.size(), stretch.part(done, 0.5 * (done + next)), [&](std::size_t i) {
      const auto& [key, leaf] = asked[i];
      inside[i] = judgedAt(leaves_[leaf], position(coordOf(key))) > 0.5 ? 1 : 0;
    });
    for (std::size_t i = 0; i < asked.size(); ++i) inside_.add(asked[i].first, inside[i] != 0);
    tbb::parallel_for(std::size_t{0}, fresh.size(), [&](std::size_t i) {
      leaves_[fresh[i]].inside = insideOf(leaves_[fresh[i]]);
    });

    edges.clear();
    for (const std::uint32_t leaf : fresh)
      for (int e = 0; e < 12; ++e)
        if (leaves_[leaf].count > 0 || isCut(leaves_[leaf], e))
          edges.emplace_back(edgeKey(edgeOf(leaves_[leaf], e)), leaf);
    sortUniqueKeys(edges);
    eraseAll(edges, [this](const auto& edge) { return crossing_at_.contains(edge.first); });
    crossings.assign(edges.size(), {});
    forAll(edges.size(), stretch.part(0.5 * (done + next), next), [&](std::size_t i) {
      crossings[i] = crossing(edgeOf(edges[i].first), leaves_[edges[i].second]);
    });
    for (std::size_t i = 0; i < edges.size(); ++i)
      if (crossings[i].passes > 0) {
        crossing_at_.add(edges[i].first, static_cast<std::uint32_t>(crossings_.size()));
        crossings_.push_back(crossings[i]);
      }
    done = next;

    std::vector<char> divided(fresh.size(), 0);
    tbb::parallel_for(std::size_t{0}, fresh.size(), [&](std::size_t i) {
      const Leaf& leaf = leaves_[fresh[i]];
      divided[i] = leaf.size > smallest_ && tellsTooLittle(leaf) ? 1 : 0;
    });
    // Where there are too many the small ones stay, so that what is found late is not left coarse.
    const auto dividing = static_cast<std::size_t>(std::count(divided.begin(), divided.end(), 1));
    if (leaves_.size() + 8 * dividing > most_leaves_) smallest_ = std::max(smallest_, least_);
    std::vector<std::uint32_t> grown;
    for (std::size_t i = 0; i < fresh.size(); ++i) {
      const Leaf leaf = leaves_[fresh[i]];
      for (int e = 0; e < 12; ++e) {
        if (!isCut(leaf, e)) continue;
        for (int turn = 0; turn < 4; ++turn) {
          const std::size_t before = leaves_.size();
          const Coord low = beside(edgeOf(leaf, e), turn) & ~(coarse_units - 1);
          if (low == (leaf.low & ~(coarse_units - 1))) continue;
          const std::uint32_t made = add(low, coarse_units);
          if (leaves_.size() > before) grown.push_back(made);
        }
      }
      if (divided[i] != 0 && leaf.size > smallest_) divide(fresh[i], grown);
    }
    fresh = std::move(grown);
  }
}

/// Whether one vertex does not tell what the surface does in the leaf.
bool Octree::tellsTooLittle(const Leaf& leaf) const {
  // Between two triangles may be what passes no edge.
  if (leaf.count > 1 && leaf.size > 8) return true;
  std::array<Crossing, 12> own;
  std::size_t count = 0;
  for (int e = 0; e < 12; ++e) {
    if (leaf.count == 0 && !isCut(leaf, e)) continue;
    const std::uint32_t* found = crossing_at_.find(edgeKey(edgeOf(leaf, e)));
    if (found == nullptr) continue;
    own[count++] = crossings_[*found];
    if (own[count - 1].passes > 1) return true;
  }
  if (count == 0) return false;
  // One polygon of n sides has n − 2 triangles.
  const CubeCase& made = cubeCases()[leaf.inside];
  if (made.triangles.size() + 2 != count) return true;
  const std::span<const Crossing> crossings(own.data(), count);
  const Vec3d at = meet(leaf, crossings);
  return std::any_of(crossings.begin(), crossings.end(), [&](const Crossing& crossing) {
    return std::abs(crossing.normal.dot(at - crossing.at)) > tolerance_mm_;
  });
}

/// Where the number passes ½ on a stretch that no triangle cuts: regula falsi, held in by halving
/// the weight of the end that stays (Illinois).
double Octree::smoothCrossing(const Leaf& leaf, const Vec3d& from, const Vec3d& along, double low,
                              double high) const {
  const auto above = [&](double t) { return numberAt(leaf, from + along * t) - 0.5; };
  double at_low = above(low);
  double at_high = above(high);
  int kept = 0;
  for (int step = 0; step < 20 && high - low > 1e-3; ++step) {
    // The ends were judged by the exact number.
    if ((at_low > 0) == (at_high > 0)) return std::abs(at_low) < std::abs(at_high) ? low : high;
    const double t = low + (high - low) * at_low / (at_low - at_high);
    const double at_t = above(t);
    if (std::abs(at_t) < 1e-5) return t;
    if ((at_t > 0) == (at_low > 0)) {
      low = t;
      at_low = at_t;
      if (kept == 1) at_high *= 0.5;
      kept = 1;
    } else {
      high = t;
      at_high = at_t;
      if (kept == -1) at_low *= 0.5;
      kept = -1;
    }
  }
  return 0.5 * (low + high);
}

/// Where the tangents at crossings meet: the point of least squares, where they say nothing the
/// middle of the crossings. Within the leaf.
Vec3d Octree::meet(const Leaf& leaf, std::span<const Crossing> crossings) const {
  Vec3d middle(0.0);
  for (const Crossing& crossing : crossings) middle += crossing.at;
  middle /= static_cast<double>(crossings.size());
  openvdb::Mat3d sum = openvdb::Mat3d::zero();
  Vec3d pull(0.0);
  for (const Crossing& crossing : crossings) {
    const Vec3d& n = crossing.normal;
    const double height = n.dot(crossing.at - middle);
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) sum(i, j) += n[i] * n[j];
    pull += n * height;
  }
  openvdb::Mat3d directions;
  Vec3d strengths;
  if (!openvdb::math::diagonalizeSymmetricMatrix(sum, directions, strengths)) return middle;
  Vec3d at = middle;
  for (int i = 0; i < 3; ++i) {
    const Vec3d direction(directions(0, i), directions(1, i), directions(2, i));
    if (strengths[i] > 0.05 * static_cast<double>(crossings.size()))
      at += direction * (direction.dot(pull) / strengths[i]);
  }
  return within(leaf, at);
}

/// The point of the leaf nearest to p, or nearly.
Vec3d Octree::within(const Leaf& leaf, Vec3d p) const {
  const Vec3d low = position(leaf.low);
  const double size_mm = leaf.size * unit_mm_;
  constexpr double least = 1.0 / 1024;
  for (int axis = 0; axis < 3; ++axis)
    p[axis] = std::clamp(p[axis], low[axis] + least * size_mm, low[axis] + (1 - least) * size_mm);
  return p;
}

/// Where the tangents meet, or near that where the number is ½.
Vec3d Octree::vertexOf(const Leaf& leaf, std::span<const Crossing> crossings) const {
  Vec3d at = meet(leaf, crossings);
  const bool is_smooth = std::all_of(crossings.begin(), crossings.end(),
                                     [](const Crossing& crossing) { return crossing.is_smooth; });
  if (!is_smooth || leaf.count > 0) return at;
  const Vec3d slope = side_ * cells_.gradientAt(leaf.cell, at);
  const Vec3d step = slope * ((0.5 - numberAt(leaf, at)) / slope.dot(slope));
  return step.length() < 0.25 * leaf.size * unit_mm_ ? within(leaf, at + step) : at;
}

/// What an edge of the leaf passes.
Octree::Crossing Octree::crossing(const Edge& edge, const Leaf& leaf) const {
  constexpr double beside = 1e-5;       // of an edge: where a triangle's sides are looked at
  constexpr double least = 1.0 / 1024;  // so that no two crossings are at one place
  const Vec3d from = position(edge.low);
  const double size_mm = edge.size * unit_mm_;
  Vec3d along(0.0);
  along[edge.axis] = size_mm;
  const int u = (edge.axis + 1) % 3;
  const int v = (edge.axis + 2) % 3;
  struct Pierced {
    double t;
    Vec3d normal;

    bool operator<(const Pierced& other) const { return t < other.t; }
  };
  std::vector<Pierced> pierced;
  for (const std::uint32_t triangle : touchesOf(leaf)) {
    const std::array<Vec3d, 3> at = cornersOf(mesh_, triangle);
    const Vec3d normal = (at[1] - at[0]).cross(at[2] - at[0]);
    if (normal[edge.axis] == 0) continue;
    int left = 0;
    for (std::size_t side = 0; side < 3; ++side) {
      const Vec3d& a = at[side];
      const Vec3d& b = at[(side + 1) % 3];
      left += (b[u] - a[u]) * (from[v] - a[v]) - (b[v] - a[v]) * (from[u] - a[u]) >= 0 ? 1 : 0;
    }
    if (left != (normal[edge.axis] > 0 ? 3 : 0)) continue;
    const double t = normal.dot(at[0] - from) / (normal[edge.axis] * size_mm);
    if (t > beside && t < 1 - beside) pierced.push_back({t, normal / normal.length()});
  }
  std::stable_sort(pierced.begin(), pierced.end());
  const bool low_is_inside = isInside(edge.low);
  Coord high_corner = edge.low;
  high_corner[edge.axis] += edge.size;
  const bool high_is_inside = isInside(high_corner);
  // Where the sides of a triangle differ, or the ends of a stretch between triangles.
  struct Pass {
    double low, high;  ///< one place at a triangle
    Vec3d normal;
  };
  std::vector<Pass> passes;
  const auto pass = [&](const Pass& next) {
    // Two that are so near let out, or in, what is no wall.
    const bool is_sliver =
        !passes.empty() &&
        0.5 * (next.low + next.high - passes.back().low - passes.back().high) * size_mm <
            least_wall * cells_.longestMm();
    if (is_sliver) {
      passes.pop_back();
    } else {
      passes.push_back(next);
    }
  };
  double low = 0;
  bool last = low_is_inside;
  for (std::size_t i = 0; i < pierced.size(); ++i) {
    const double t = pierced[i].t;
    // Across a triangle the number jumps by one.
    const double number = judgedAt(leaf, from + along * (t - beside));
    const bool before = number > 0.5;
    const bool after = number - (pierced[i].normal[edge.axis] > 0 ? side_ : -side_) > 0.5;
    if (before != last) pass({low, t - beside, Vec3d(0.0)});
    if (before != after) pass({t, t, pierced[i].normal});
    low = t + beside;
    last = after;
  }
  if (last != high_is_inside) pass({low, 1, Vec3d(0.0)});
  Crossing crossing;
  if (passes.empty()) return crossing;
  crossing.passes = static_cast<int>(std::min<std::size_t>(passes.size(), 2));
  const Pass& first = passes.front();
  const bool is_smooth = first.high > first.low;
  const double t = is_smooth ? smoothCrossing(leaf, from, along, first.low, first.high) : first.low;
  crossing.at = from + along * std::clamp(t, least, 1 - least);
  crossing.is_smooth = is_smooth;
  crossing.normal =
      is_smooth ? cells_.gradientAt(leaf.cell, from + along * t).unitSafe() : first.normal;
  return crossing;
}

Mesh Octree::surface() const {
  // The edges that are cut and have no smaller leaf beside them, each with the leaves around it.
  struct Around {
    Key edge;
    std::array<std::uint32_t, 4> leaves;
  };
  std::vector<Key> edges;
  for (const Leaf& leaf : leaves_) {
    if (leaf.divided) continue;
    for (int e = 0; e < 12; ++e)
      if (isCut(leaf, e)) edges.push_back(edgeKey(edgeOf(leaf, e)));
  }
  sortUnique(edges);
  std::vector<Around> cut(edges.size());
  tbb::parallel_for(std::size_t{0}, edges.size(), [&](std::size_t i) {
    const Edge edge = edgeOf(edges[i]);
    cut[i].edge = edges[i];
    for (int turn = 0; turn < 4; ++turn) {
      const std::uint32_t leaf = leafAt(beside(edge, turn));
      if (leaves_[leaf].size < edge.size) cut[i].edge = 0;
      cut[i].leaves[static_cast<std::size_t>(turn)] = leaf;
    }
  });
  std::erase_if(cut, [](const Around& around) { return around.edge == 0; });

  Mesh mesh;
  mesh.vertices.resize(cut.size());
  std::vector<std::pair<std::uint32_t, std::uint32_t>> of_leaf;  // and which edge
  for (std::uint32_t i = 0; i < cut.size(); ++i) {
    mesh.vertices[i] = crossings_[crossing_at_.at(cut[i].edge)].at;
    for (const std::uint32_t leaf : cut[i].leaves) of_leaf.emplace_back(leaf, i);
  }
  sortUnique(of_leaf);
  std::vector<std::uint32_t> begins;
  std::vector<std::uint32_t> vertex(leaves_.size(), none);
  for (std::uint32_t i = 0; i < of_leaf.size(); ++i)
    if (i == 0 || of_leaf[i].first != of_leaf[i - 1].first) {
      vertex[of_leaf[i].first] = static_cast<std::uint32_t>(mesh.vertices.size() + begins.size());
      begins.push_back(i);
    }
  begins.push_back(static_cast<std::uint32_t>(of_leaf.size()));
  mesh.vertices.resize(cut.size() + begins.size() - 1);
  tbb::parallel_for(std::size_t{0}, begins.size() - 1, [&](std::size_t i) {
    std::vector<Crossing> crossings;
    for (std::uint32_t c = begins[i]; c < begins[i + 1]; ++c)
      crossings.push_back(crossings_[crossing_at_.at(cut[of_leaf[c].second].edge)]);
    mesh.vertices[cut.size() + i] = vertexOf(leaves_[of_leaf[begins[i]].first], crossings);
  });
  mesh.triangles.reserve(4 * cut.size());
  for (std::uint32_t i = 0; i < cut.size(); ++i) {
    std::array<std::uint32_t, 4> around = cut[i].leaves;
    if (!isInside(edgeOf(cut[i].edge).low)) std::swap(around[1], around[3]);
    for (std::size_t turn = 0; turn < 4; ++turn) {
      const std::uint32_t a = vertex[around[turn]];
      const std::uint32_t b = vertex[around[(turn + 1) % 4]];
      if (a != b) mesh.triangles.push_back({i, a, b});
    }
  }
  return mesh;
}

}  // namespace

WindingSurface windingSurface(const Mesh& triangles, const std::function<void(double)>& progress,
                              std::size_t most_leaves) {
  WindingSurface made;
  openvdb::math::BBox<Vec3d> bounds;
  for (const Mesh::Triangle& t : triangles.triangles)
    for (const std::uint32_t v : t) bounds.expand(triangles.vertices[v]);
  if (bounds.empty() || !(bounds.extents().length() > 0)) return made;

  const Stretch stretch(progress);
  WindingCells cells(triangles, bounds);
  const auto volume = [&](double side, const Stretch& told) {
    Octree coarse(cells, side, 0, 0);
    coarse.grow(told);
    return volumeOf(coarse.surface());
  };
  const double outwards = volume(1, stretch.part(0, 0.05));
  made.turned = volume(-1, stretch.part(0.05, 0.1)) > 2 * outwards;
  Octree fine(cells, made.turned ? -1 : 1, most_cuts, most_leaves);
  fine.grow(stretch.part(0.1, 1));
  made.cell_mm = fine.leastMm();
  made.mesh = fine.surface();
  return made;
}

}  // namespace vdbdither
