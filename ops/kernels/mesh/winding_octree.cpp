// The number is harmonic away from the triangles, and like the field of dipoles it has no flux
// through a surface around any of them. So no piece of the surface at ½ is clear of all triangles:
// it could neither rise nor fall across the piece. Growing from the cells that triangles pass,
// across edges whose ends are on both sides, finds all of it, at a cost that follows the surface.

#include "ops/kernels/mesh/winding_octree.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include <tbb/parallel_sort.h>

#include "ops/kernels/mesh/triangle_and_cube.h"
#include "ops/kernels/mesh/winding_number.h"

namespace vdbdither {

using openvdb::Coord;
using openvdb::Vec3d;

namespace {

/// How far a leaf's vertex may lie from the tangent planes at its crossings, of the longest side.
constexpr double tolerance = 1e-4;

/// A triangle that meets a cell.
struct Touch {
  Key cell;
  std::uint32_t triangle;

  bool operator<(const Touch& other) const {
    return std::pair(cell, triangle) < std::pair(other.cell, other.triangle);
  }
};

/// Finds the cells that a triangle meets: in each column along the main axis of its normal that its
/// bounding box meets, the cells that its plane passes.
void addTouches(const WindingCells& cells, std::uint32_t triangle, std::vector<Touch>& touches) {
  const double cell_mm = WindingOctree::root_units * cells.unitMm();
  const Vec3d origin_mm = cells.position(Coord(0));
  const std::array<Vec3d, 3> at = cornersOf(cells.mesh(), triangle);
  const Vec3d normal = (at[1] - at[0]).cross(at[2] - at[0]);
  int w = 0;
  for (int axis = 1; axis < 3; ++axis)
    if (std::abs(normal[axis]) > std::abs(normal[w])) w = axis;
  if (normal[w] == 0) return;  // without area
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
          touches.push_back({keyOf(cell), triangle});
    }
}

}  // namespace

WindingOctree::Edge WindingOctree::edgeOf(const Leaf& leaf, int edge) {
  Edge made{leaf.low, edge / 4, leaf.size};
  made.low[made.axis == 0 ? 1 : 0] += (edge & 1) * leaf.size;
  made.low[made.axis == 2 ? 1 : 2] += (edge >> 1 & 1) * leaf.size;
  return made;
}

std::uint32_t WindingOctree::add(const Coord& low, int size) {
  const auto [leaf, is_new] =
      leaf_at_.add(leafKey(low, size), static_cast<std::uint32_t>(leaves_.size()));
  if (is_new) leaves_.push_back({low, size});
  return leaf;
}

/// Adds the cells that triangles meet.
void WindingOctree::addTouched() {
  constexpr std::uint32_t in_a_block = 256;
  const auto count = static_cast<std::uint32_t>(mesh_.triangles.size());
  std::vector<std::vector<Touch>> blocks((count + in_a_block - 1) / in_a_block);
  forAll(blocks.size(), [&](std::size_t block) {
    const auto begin = static_cast<std::uint32_t>(block * in_a_block);
    for (std::uint32_t t = begin; t < std::min(count, begin + in_a_block); ++t)
      addTouches(cells_, t, blocks[block]);
  });
  std::vector<Touch> all;
  for (const std::vector<Touch>& block : blocks) all.insert(all.end(), block.begin(), block.end());
  tbb::parallel_sort(all.begin(), all.end());
  touches_.reserve(all.size());
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (i == 0 || all[i].cell != all[i - 1].cell) {
      const Coord cell = coordOf(all[i].cell);
      add(Coord(cell.x() * root_units, cell.y() * root_units, cell.z() * root_units), root_units);
      leaves_.back().first = static_cast<std::uint32_t>(i);
    }
    ++leaves_.back().count;
    touches_.push_back(all[i].triangle);
  }
}

void WindingOctree::divide(std::uint32_t leaf, std::vector<std::uint32_t>& fresh) {
  const Leaf whole = leaves_[leaf];
  leaves_[leaf].divided = true;
  const int size = whole.size / 2;
  smallest_made_ = std::min(smallest_made_, size);
  for (int part = 0; part < 8; ++part) {
    const Coord low =
        whole.low.offsetBy((part & 1) * size, (part >> 1 & 1) * size, (part >> 2 & 1) * size);
    const std::uint32_t made = add(low, size);
    leaves_[made].cell = whole.cell;
    leaves_[made].first = static_cast<std::uint32_t>(touches_.size());
    const double half = 0.5 * size * unit_mm_;
    for (std::uint32_t i = whole.first; i < whole.first + whole.count; ++i) {
      const std::uint32_t triangle = touches_[i];
      if (meetsCube(cornersOf(mesh_, triangle), cells_.position(low) + half, half))
        touches_.push_back(triangle);
    }
    leaves_[made].count = static_cast<std::uint32_t>(touches_.size()) - leaves_[made].first;
    fresh.push_back(made);
  }
}

/// The leaf that holds a unit, or none.
std::uint32_t WindingOctree::leafAt(const Coord& unit) const {
  for (int size = root_units; size >= smallest_made_; size /= 2) {
    const std::uint32_t* found = leaf_at_.find(leafKey(unit & ~(size - 1), size));
    if (found == nullptr) return none;
    if (!leaves_[*found].divided) return *found;
  }
  return none;
}

/// A unit at the edge, on each of its four sides, counter-clockwise seen from its upper end.
Coord WindingOctree::unitBeside(const Edge& edge, int turn) {
  Coord unit = edge.low;
  if (turn == 1 || turn == 2) --unit[(edge.axis + 1) % 3];
  if (turn == 2 || turn == 3) --unit[(edge.axis + 2) % 3];
  return unit;
}

std::uint8_t WindingOctree::insideOf(const Leaf& leaf) const {
  unsigned inside = 0;
  for (int corner = 0; corner < 8; ++corner)
    if (isInside(cornerOf(leaf, corner))) inside |= 1U << corner;
  return static_cast<std::uint8_t>(inside);
}

EdgeCrossing WindingOctree::crossing(const Edge& edge, const Leaf& leaf) const {
  Coord high = edge.low;
  high[edge.axis] += edge.size;
  return crossingOf(solid_, {cells_.position(edge.low),
                             edge.axis,
                             edge.size * unit_mm_,
                             isInside(edge.low),
                             isInside(high),
                             leaf.cell,
                             {touches_.data() + leaf.first, leaf.count}});
}

/// Finds the cells of roots. Returns false if that is too much work.
bool WindingOctree::findCells(std::span<const std::uint32_t> fresh, std::size_t most_work) {
  std::vector<std::uint32_t> roots;
  std::vector<Coord> lows;
  for (const std::uint32_t leaf : fresh)
    if (leaves_[leaf].size == root_units) {
      roots.push_back(leaf);
      lows.push_back(leaves_[leaf].low);
    }
  work_ += cells_.workOfMaking(lows);
  if (work_ > most_work) return false;
  const std::vector<std::uint32_t> cells = cells_.at(lows);
  for (std::size_t i = 0; i < cells.size(); ++i) leaves_[roots[i]].cell = cells[i];
  return true;
}

/// Finds the corners of the leaves that are inside. Corners beyond the limits are outside.
void WindingOctree::judgeCorners(std::span<const std::uint32_t> fresh,
                                 const ProgressPart& progress) {
  std::vector<std::pair<Key, std::uint32_t>> corners(8 * fresh.size());  // and a leaf with each
  forAll(corners.size(), [&](std::size_t i) {
    const std::uint32_t leaf = fresh[i / 8];
    corners[i] = {keyOf(cornerOf(leaves_[leaf], static_cast<int>(i % 8))), leaf};
  });
  sortUniqueKeys(corners);
  eraseAll(corners, [this](const auto& corner) {
    return !cells_.limits().isInside(coordOf(corner.first)) || inside_.contains(corner.first);
  });
  std::vector<double> numbers(corners.size());
  forAll(corners.size(), progress, [&](std::size_t i) {
    const auto& [key, leaf] = corners[i];
    numbers[i] = solid_.judgedAt(leaves_[leaf].cell, cells_.position(coordOf(key)));
  });
  for (std::size_t i = 0; i < corners.size(); ++i) {
    inside_.add(corners[i].first, numbers[i] > 0.5);
    work_ += cells_.workOfJudging(leaves_[corners[i].second].cell, numbers[i]);
  }
  forAll(fresh.size(),
         [&](std::size_t i) { leaves_[fresh[i]].inside = insideOf(leaves_[fresh[i]]); });
}

/// Finds the crossings of the leaves' edges that are cut or may be pierced.
void WindingOctree::findCrossings(std::span<const std::uint32_t> fresh,
                                  const ProgressPart& progress) {
  std::vector<std::pair<Key, std::uint32_t>> edges;  // and a leaf with each
  for (const std::uint32_t leaf : fresh)
    for (int e = 0; e < 12; ++e)
      if (leaves_[leaf].count > 0 || isCut(leaves_[leaf], e))
        edges.emplace_back(edgeKey(edgeOf(leaves_[leaf], e)), leaf);
  sortUniqueKeys(edges);
  eraseAll(edges, [this](const auto& edge) { return crossing_at_.contains(edge.first); });
  std::vector<EdgeCrossing> crossings(edges.size());
  forAll(edges.size(), progress, [&](std::size_t i) {
    crossings[i] = crossing(edgeOf(edges[i].first), leaves_[edges[i].second]);
  });
  for (std::size_t i = 0; i < edges.size(); ++i) {
    const Leaf& leaf = leaves_[edges[i].second];
    work_ += leaf.count + crossings[i].looks * cells_.workOfJudging(leaf.cell, 0);
    if (crossings[i].passes > 0) {
      crossing_at_.add(edges[i].first, static_cast<std::uint32_t>(crossings_.size()));
      crossings_.push_back(crossings[i]);
    }
  }
}

/// Adds the cells across cut edges and divides the leaves that need it. Returns the new leaves.
/// \param work_of_fresh  that the leaves `fresh` took
std::vector<std::uint32_t> WindingOctree::spread(std::span<const std::uint32_t> fresh,
                                                 std::size_t work_of_fresh) {
  std::vector<char> divided(fresh.size(), 0);
  forAll(fresh.size(), [&](std::size_t i) {
    const Leaf& leaf = leaves_[fresh[i]];
    divided[i] = leaf.size > smallest_ && needsDivision(leaf) ? 1 : 0;
  });
  // Where there are too many, small leaves stay, so that leaves found late are divided as well.
  const auto dividing = static_cast<std::size_t>(std::count(divided.begin(), divided.end(), 1));
  const std::size_t work_of_parts = 8 * dividing * (work_of_fresh / fresh.size());
  if (leaves_.size() + 8 * dividing > max_leaves_ || work_ + work_of_parts > max_work_)
    smallest_ = std::max(smallest_, smallest_made_);
  std::vector<std::uint32_t> grown;
  for (std::size_t i = 0; i < fresh.size(); ++i) {
    const Leaf leaf = leaves_[fresh[i]];
    for (int e = 0; e < 12; ++e) {
      if (!isCut(leaf, e)) continue;
      for (int turn = 0; turn < 4; ++turn) {
        const std::size_t before = leaves_.size();
        const Coord low = unitBeside(edgeOf(leaf, e), turn) & ~(root_units - 1);
        if (low == (leaf.low & ~(root_units - 1))) continue;
        const std::uint32_t made = add(low, root_units);
        if (leaves_.size() > before) grown.push_back(made);
      }
    }
    if (divided[i] != 0 && leaf.size > smallest_) divide(fresh[i], grown);
  }
  return grown;
}

bool WindingOctree::grow(const ProgressPart& progress, std::size_t most_work) {
  addTouched();
  std::vector<std::uint32_t> fresh(leaves_.size());
  std::iota(fresh.begin(), fresh.end(), 0U);
  double done = 0;
  while (!fresh.empty()) {
    // The number of rounds is unknown: each counts as a quarter of what is left.
    const double next = done + 0.25 * (1 - done);
    const double middle = 0.5 * (done + next);
    if (!findCells(fresh, most_work)) return false;
    const std::size_t before = work_;
    judgeCorners(fresh, progress.part(done, middle));
    findCrossings(fresh, progress.part(middle, next));
    done = next;
    fresh = spread(fresh, work_ - before);
  }
  return true;
}

/// Whether one vertex cannot represent the surface in the leaf.
bool WindingOctree::needsDivision(const Leaf& leaf) const {
  // Surface between two triangles may cross no edge.
  if (leaf.count > 1 && leaf.size > 8) return true;
  std::array<EdgeCrossing, 12> own;
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
  const std::span<const EdgeCrossing> crossings(own.data(), count);
  const Vec3d at = meetingPoint(cubeOf(leaf), crossings);
  return std::any_of(crossings.begin(), crossings.end(), [&](const EdgeCrossing& crossing) {
    return std::abs(crossing.normal.dot(at - crossing.at)) > tolerance * cells_.longestMm();
  });
}

/// The meeting point of the tangent planes, or on a smooth surface near it where the number is ½.
Vec3d WindingOctree::vertexOf(const Leaf& leaf, std::span<const EdgeCrossing> crossings) const {
  const LeafCube cube = cubeOf(leaf);
  const Vec3d at = meetingPoint(cube, crossings);
  const bool is_smooth =
      std::all_of(crossings.begin(), crossings.end(),
                  [](const EdgeCrossing& crossing) { return crossing.is_smooth; });
  if (!is_smooth || leaf.count > 0) return at;
  const Vec3d slope = solid_.side() * cells_.gradientAt(leaf.cell, at);
  const Vec3d step = slope * ((0.5 - solid_.numberAt(leaf.cell, at)) / slope.dot(slope));
  return step.length() < 0.25 * cube.size_mm ? cube.within(at + step) : at;
}

}  // namespace vdbdither
