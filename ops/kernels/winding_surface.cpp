// Away from the triangles the number is harmonic, and like the field of dipoles it has no flux
// through a surface around any of them. So no piece of the surface at ½ is clear of all triangles:
// it could neither rise nor fall across the piece. From the cells that triangles pass, growing
// across edges whose ends are on both sides finds all of it, and the cost follows the surface.
//
// Cells are cut in eight where one vertex does not tell what the surface does in them: an octree of
// leaves of any size beside each other, whose dual is closed whatever their sizes (Ju, Losasso,
// Schaefer, Warren: "Dual Contouring of Hermite Data", 2002).

#include "ops/kernels/winding_surface.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <span>
#include <unordered_map>
#include <utility>
#include <vector>

#include <openvdb/math/BBox.h>
#include <openvdb/math/Mat3.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_sort.h>

#include "ops/kernels/marching_cubes.h"
#include "ops/kernels/surface_error.h"
#include "ops/kernels/winding_number.h"
#include "vdbdither/openvdb.h"

namespace vdbdither {

using openvdb::Coord;
using openvdb::Vec3d;

namespace {

using Bounds = openvdb::math::BBox<Vec3d>;
/// A place in units, in the order of z, y, x; with what an edge or a leaf has besides.
using Key = std::uint64_t;

constexpr int key_bits = 19;
constexpr int key_offset = 1 << (key_bits - 1);
constexpr std::uint32_t none = ~std::uint32_t{0};

/// Undivided cells along the longest side.
constexpr double coarse_cells = 64;
/// How often a cell is cut in eight; the smallest have an edge of one unit.
constexpr int most_cuts = 5;
constexpr int coarse_units = 1 << most_cuts;
/// What a vertex may miss the tangents at the crossings of its cell by, of the longest side.
constexpr double tolerance = 2e-4;

Key keyOf(const Coord& ijk) {
  const auto part = [](int index) { return static_cast<Key>(index + key_offset); };
  return part(ijk.z()) << 2 * key_bits | part(ijk.y()) << key_bits | part(ijk.x());
}
Coord coordOf(Key key) {
  const auto part = [](Key bits) {
    return static_cast<int>(bits & ((1U << key_bits) - 1)) - key_offset;
  };
  return {part(key), part(key >> key_bits), part(key >> 2 * key_bits)};
}

struct Scattered {
  std::size_t operator()(Key key) const {
    key *= 0x9e3779b97f4a7c15ULL;
    return key ^ key >> 32;
  }
};
/// Never walked through, for its order says nothing.
template <class T>
using Map = std::unordered_map<Key, T, Scattered>;

/// Erases what `is_done` says, which is asked on all threads.
template <class T, class IsDone>
void eraseAll(std::vector<T>& values, const IsDone& is_done) {
  std::vector<char> done(values.size());
  tbb::parallel_for(std::size_t{0}, values.size(),
                    [&](std::size_t i) { done[i] = is_done(values[i]) ? 1 : 0; });
  std::size_t kept = 0;
  for (std::size_t i = 0; i < values.size(); ++i)
    if (done[i] == 0) values[kept++] = values[i];
  values.resize(kept);
}

template <class T>
void sortUnique(std::vector<T>& values) {
  tbb::parallel_sort(values.begin(), values.end());
  values.erase(std::unique(values.begin(), values.end()), values.end());
}

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

/// Whether a triangle meets a cube, or nearly: no axis parts them, of the cube's, along the normal,
/// or across a side in one of the planes between the cube's.
bool meets(const std::array<Vec3d, 3>& triangle, const Vec3d& middle, double half) {
  half *= 1 + 1e-6;
  const std::array<Vec3d, 3> at{triangle[0] - middle, triangle[1] - middle, triangle[2] - middle};
  for (int axis = 0; axis < 3; ++axis) {
    const auto [low, high] = std::minmax({at[0][axis], at[1][axis], at[2][axis]});
    if (low > half || high < -half) return false;
  }
  const Vec3d normal = (at[1] - at[0]).cross(at[2] - at[0]);
  if (std::abs(normal.dot(at[0])) >
      half * (std::abs(normal.x()) + std::abs(normal.y()) + std::abs(normal.z())))
    return false;
  for (std::size_t side = 0; side < 3; ++side) {
    const Vec3d along = at[(side + 1) % 3] - at[side];
    for (int axis = 0; axis < 3; ++axis) {
      const int u = (axis + 1) % 3;
      const int v = (axis + 2) % 3;
      const double one = along[u] * at[side][v] - along[v] * at[side][u];
      const Vec3d& opposite = at[(side + 2) % 3];
      const double other = along[u] * opposite[v] - along[v] * opposite[u];
      const double reach = half * (std::abs(along[u]) + std::abs(along[v]));
      if (std::min(one, other) > reach || std::max(one, other) < -reach) return false;
    }
  }
  return true;
}

/// The set and its surface.
class Octree {
 public:
  Octree(const Mesh& triangles, const WindingNumber& winding, const Bounds& bounds, double unit_mm,
         int most_cuts_here, std::size_t most_leaves);

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
    Vec3d normal{0.0};  ///< unit, in either direction; or zero
    int passes = 0;     ///< 2 for more
  };

  [[nodiscard]] Vec3d position(const Coord& corner) const {
    return origin_mm_ + corner.asVec3d() * unit_mm_;
  }
  [[nodiscard]] std::array<Vec3d, 3> corners(std::uint32_t triangle) const {
    const Mesh::Triangle& t = mesh_.triangles[triangle];
    return {mesh_.vertices[t[0]], mesh_.vertices[t[1]], mesh_.vertices[t[2]]};
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

  [[nodiscard]] bool isInside(const Vec3d& p) const { return winding_.judgedAt(p) > 0.5; }
  [[nodiscard]] bool isInside(const Coord& corner) const {
    const auto found = inside_.find(keyOf(corner));
    return found != inside_.end() && found->second;
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
  [[nodiscard]] double smoothCrossing(const Vec3d& from, const Vec3d& along, double low,
                                      double high) const;
  [[nodiscard]] Vec3d gradientAt(const Vec3d& p, double step_mm) const;
  [[nodiscard]] Vec3d meet(const Leaf& leaf, std::span<const Crossing> crossings) const;

  const Mesh& mesh_;
  const WindingNumber& winding_;
  double unit_mm_;
  int smallest_;  ///< that leaves may become
  std::size_t most_leaves_;
  double tolerance_mm_;
  Vec3d origin_mm_;
  openvdb::CoordBBox limits_;  ///< of corners that may be inside
  std::vector<Leaf> leaves_;
  Map<std::uint32_t> leaf_at_;
  std::vector<std::uint32_t> touches_;
  Map<bool> inside_;         ///< by corner
  Map<Crossing> crossings_;  ///< by edge, of those that are cut or pierced
  int least_ = coarse_units;
};

Octree::Octree(const Mesh& triangles, const WindingNumber& winding, const Bounds& bounds,
               double unit_mm, int most_cuts_here, std::size_t most_leaves)
    : mesh_(triangles),
      winding_(winding),
      unit_mm_(unit_mm),
      smallest_(coarse_units >> most_cuts_here),
      most_leaves_(most_leaves),
      tolerance_mm_(tolerance * bounds.extents()[static_cast<int>(bounds.maxExtent())]) {
  // A part of a cell that keeps corners out of planes which designers like.
  origin_mm_ = bounds.min() - coarse_units * unit_mm * Vec3d(0.3819, 0.4142, 0.3028);
  const double around_mm = 0.5 * bounds.extents()[static_cast<int>(bounds.maxExtent())];
  limits_ = {Coord::floor((bounds.min() - around_mm - origin_mm_) / unit_mm),
             Coord::ceil((bounds.max() + around_mm - origin_mm_) / unit_mm)};
}

/// Edges are numbered as in marching_cubes.h.
Octree::Edge Octree::edgeOf(const Leaf& leaf, int edge) {
  Edge made{leaf.low, edge / 4, leaf.size};
  made.low[made.axis == 0 ? 1 : 0] += (edge & 1) * leaf.size;
  made.low[made.axis == 2 ? 1 : 2] += (edge >> 1 & 1) * leaf.size;
  return made;
}

std::uint32_t Octree::add(const Coord& low, int size) {
  const auto [place, is_new] =
      leaf_at_.try_emplace(leafKey(low, size), static_cast<std::uint32_t>(leaves_.size()));
  if (is_new) leaves_.push_back({low, size});
  return place->second;
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
  const auto count = static_cast<std::uint32_t>(mesh_.triangles.size());
  std::vector<std::vector<Touch>> blocks((count + in_a_block - 1) / in_a_block);
  tbb::parallel_for(std::size_t{0}, blocks.size(), [&](std::size_t block) {
    const auto begin = static_cast<std::uint32_t>(block * in_a_block);
    for (std::uint32_t t = begin; t < std::min(count, begin + in_a_block); ++t) {
      const std::array<Vec3d, 3> at = corners(t);
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
      const Vec3d first = (low - origin_mm_) / cell_mm - rounding;
      const Vec3d last = (high - origin_mm_) / cell_mm + rounding;
      const double rise =
          0.5 * (std::abs(normal[u]) + std::abs(normal[v])) / std::abs(normal[w]) + rounding;
      Coord cell;
      for (cell[u] = static_cast<int>(std::floor(first[u])); cell[u] <= last[u]; ++cell[u])
        for (cell[v] = static_cast<int>(std::floor(first[v])); cell[v] <= last[v]; ++cell[v]) {
          const Vec3d from = (at[0] - origin_mm_) / cell_mm;
          const double height = from[w] - (normal[u] * (cell[u] + 0.5 - from[u]) +
                                           normal[v] * (cell[v] + 0.5 - from[v])) /
                                              normal[w];
          const double top = std::min(height + rise, last[w]);
          for (cell[w] = static_cast<int>(std::floor(std::max(height - rise, first[w])));
               cell[w] <= top; ++cell[w])
            if (meets(at, origin_mm_ + (cell.asVec3d() + 0.5) * cell_mm, 0.5 * cell_mm))
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
    leaves_[made].first = static_cast<std::uint32_t>(touches_.size());
    const double half = 0.5 * size * unit_mm_;
    for (std::uint32_t i = whole.first; i < whole.first + whole.count; ++i) {
      const std::uint32_t triangle = touches_[i];
      if (meets(corners(triangle), position(low) + half, half)) touches_.push_back(triangle);
    }
    leaves_[made].count = static_cast<std::uint32_t>(touches_.size()) - leaves_[made].first;
    fresh.push_back(made);
  }
}

/// The leaf that holds a unit, or none.
std::uint32_t Octree::leafAt(const Coord& unit) const {
  for (int size = coarse_units; size >= least_; size /= 2) {
    const auto found = leaf_at_.find(leafKey(unit & ~(size - 1), size));
    if (found == leaf_at_.end()) return none;
    if (!leaves_[found->second].divided) return found->second;
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
  std::vector<Key> asked;
  std::vector<char> inside;
  std::vector<std::pair<Key, std::uint32_t>> edges;
  std::vector<Crossing> crossings;
  bool may_divide = true;
  double done = 0;
  while (!fresh.empty()) {
    // How much is still to come nobody knows.
    const double next = done + 0.25 * (1 - done);
    asked.resize(8 * fresh.size());
    tbb::parallel_for(std::size_t{0}, asked.size(), [&](std::size_t i) {
      asked[i] = keyOf(cornerOf(leaves_[fresh[i / 8]], static_cast<int>(i % 8)));
    });
    sortUnique(asked);
    eraseAll(asked,
             [this](Key key) { return !limits_.isInside(coordOf(key)) || inside_.contains(key); });
    inside.assign(asked.size(), 0);
    forAll(asked.size(), stretch.part(done, 0.5 * (done + next)),
           [&](std::size_t i) { inside[i] = isInside(position(coordOf(asked[i]))) ? 1 : 0; });
    for (std::size_t i = 0; i < asked.size(); ++i) inside_[asked[i]] = inside[i] != 0;
    tbb::parallel_for(std::size_t{0}, fresh.size(), [&](std::size_t i) {
      leaves_[fresh[i]].inside = insideOf(leaves_[fresh[i]]);
    });

    edges.clear();
    for (const std::uint32_t leaf : fresh)
      for (int e = 0; e < 12; ++e)
        if (leaves_[leaf].count > 0 || isCut(leaves_[leaf], e))
          edges.emplace_back(edgeKey(edgeOf(leaves_[leaf], e)), leaf);
    tbb::parallel_sort(edges.begin(), edges.end());
    edges.erase(std::unique(edges.begin(), edges.end(),
                            [](const auto& a, const auto& b) { return a.first == b.first; }),
                edges.end());
    eraseAll(edges, [this](const auto& edge) { return crossings_.contains(edge.first); });
    crossings.assign(edges.size(), {});
    forAll(edges.size(), stretch.part(0.5 * (done + next), next), [&](std::size_t i) {
      crossings[i] = crossing(edgeOf(edges[i].first), leaves_[edges[i].second]);
    });
    for (std::size_t i = 0; i < edges.size(); ++i)
      if (crossings[i].passes > 0) crossings_[edges[i].first] = crossings[i];
    done = next;

    std::vector<char> divided(fresh.size(), 0);
    if (may_divide)
      tbb::parallel_for(std::size_t{0}, fresh.size(), [&](std::size_t i) {
        const Leaf& leaf = leaves_[fresh[i]];
        divided[i] = leaf.size > smallest_ && tellsTooLittle(leaf) ? 1 : 0;
      });
    const auto dividing = static_cast<std::size_t>(std::count(divided.begin(), divided.end(), 1));
    may_divide &= leaves_.size() + 8 * dividing <= most_leaves_;
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
      if (may_divide && divided[i] != 0) divide(fresh[i], grown);
    }
    fresh = std::move(grown);
  }
}

/// Whether one vertex does not tell what the surface does in the leaf.
bool Octree::tellsTooLittle(const Leaf& leaf) const {
  std::array<Crossing, 12> own;
  std::size_t count = 0;
  for (int e = 0; e < 12; ++e) {
    if (leaf.count == 0 && !isCut(leaf, e)) continue;
    const auto found = crossings_.find(edgeKey(edgeOf(leaf, e)));
    if (found == crossings_.end()) continue;
    if (found->second.passes > 1) return true;
    own[count++] = found->second;
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
double Octree::smoothCrossing(const Vec3d& from, const Vec3d& along, double low,
                              double high) const {
  const auto above = [&](double t) { return winding_.closelyAt(from + along * t) - 0.5; };
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

/// The direction in which the number changes, where no triangle is near.
Vec3d Octree::gradientAt(const Vec3d& p, double step_mm) const {
  Vec3d gradient;
  const double here = winding_.closelyAt(p);
  for (int axis = 0; axis < 3; ++axis) {
    Vec3d step(0.0);
    step[axis] = step_mm;
    gradient[axis] = winding_.closelyAt(p + step) - here;
  }
  const double length = gradient.length();
  return length > 0 ? gradient / length : gradient;
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
  const Vec3d low = position(leaf.low);
  const double size_mm = leaf.size * unit_mm_;
  constexpr double least = 1.0 / 1024;
  for (int axis = 0; axis < 3; ++axis)
    at[axis] = std::clamp(at[axis], low[axis] + least * size_mm, low[axis] + (1 - least) * size_mm);
  return at;
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
    const std::array<Vec3d, 3> at = corners(triangle);
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
            2 * tolerance_mm_;
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
    const double number = winding_.judgedAt(from + along * (t - beside));
    const bool before = number > 0.5;
    const bool after = number - (pierced[i].normal[edge.axis] > 0 ? 1 : -1) > 0.5;
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
  const double t = is_smooth ? smoothCrossing(from, along, first.low, first.high) : first.low;
  crossing.at = from + along * std::clamp(t, least, 1 - least);
  crossing.normal = is_smooth ? gradientAt(from + along * t, 0.01 * size_mm) : first.normal;
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
    mesh.vertices[i] = crossings_.at(cut[i].edge).at;
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
      crossings.push_back(crossings_.at(cut[of_leaf[c].second].edge));
    mesh.vertices[cut.size() + i] = meet(leaves_[of_leaf[begins[i]].first], crossings);
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
  Bounds bounds;
  for (const Mesh::Triangle& t : triangles.triangles)
    for (const std::uint32_t v : t) bounds.expand(triangles.vertices[v]);
  const double longest_mm =
      bounds.empty() ? 0 : bounds.extents()[static_cast<int>(bounds.maxExtent())];
  if (!(longest_mm > 0)) return made;
  const double unit_mm = longest_mm / coarse_cells / coarse_units;

  const Stretch stretch(progress);
  Mesh faced = triangles;
  const auto turn = [&faced] {
    for (Mesh::Triangle& t : faced.triangles) std::swap(t[1], t[2]);
  };
  std::array<double, 2> volumes{};
  for (std::size_t turned = 0; turned < 2; ++turned) {
    const WindingNumber winding(faced);
    Octree coarse(faced, winding, bounds, unit_mm, 0, 0);
    coarse.grow(stretch.part(0.05 * static_cast<double>(turned), 0.05 * (1 + turned)));
    volumes[turned] = volumeOf(coarse.surface());
    turn();
  }
  made.turned = volumes[1] > 2 * volumes[0];
  if (made.turned) turn();
  const WindingNumber winding(faced);
  Octree fine(faced, winding, bounds, unit_mm, most_cuts, most_leaves);
  fine.grow(stretch.part(0.1, 1));
  made.cell_mm = fine.leastMm();
  made.mesh = fine.surface();
  return made;
}

}  // namespace vdbdither
