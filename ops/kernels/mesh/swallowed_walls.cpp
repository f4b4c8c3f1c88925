// A wall is surface where the winding number is zero on one of its sides alone. Away from where
// triangles intersect that does not change, so that a look at one triangle tells of all that hang
// together; triangles that others pass through are cut where these pass.

#include "ops/kernels/mesh/swallowed_walls.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <optional>
#include <utility>

#include "ops/kernels/leaf/disjoint_sets.h"
#include "ops/kernels/mesh/box_tree.h"
#include "ops/kernels/mesh/line_winding.h"
#include "ops/kernels/mesh/mesh_bodies.h"
#include "ops/kernels/mesh/mesh_edges.h"
#include "ops/kernels/mesh/progress_part.h"
#include "ops/kernels/mesh/wall_cutter.h"

namespace vdbdither {

using openvdb::Vec3d;

namespace {

class Walls {
 public:
  explicit Walls(const Mesh& mesh);

  SwallowedWalls find();

 private:
  struct Left {
    std::uint32_t triangle;
    WallCutter::Surface surface = WallCutter::Surface::all;
    std::vector<WallPiece> pieces{};
  };

  [[nodiscard]] const Vec3d& corner(std::uint32_t triangle, std::size_t corner) const {
    return mesh_.vertices[mesh_.triangles[triangle][corner]];
  }
  [[nodiscard]] WallPiece wholeOf(std::uint32_t triangle) const {
    return {corner(triangle, 0), corner(triangle, 1), corner(triangle, 2)};
  }
  [[nodiscard]] WallPlane planeOf(std::uint32_t triangle) const {
    const Vec3d& a = corner(triangle, 0);
    Vec3d normal = (corner(triangle, 1) - a).cross(corner(triangle, 2) - a);
    const double length = normal.length();
    if (length > 0) normal /= length;
    return {normal, normal.dot(a)};
  }
  [[nodiscard]] DisjointSets findPatches() const;
  /// Calls visit(other) for each triangle near one, until it returns false.
  template <class Visit>
  void visitNear(std::uint32_t triangle, const Visit& visit) const;
  [[nodiscard]] bool mayIntersect(std::uint32_t a, std::uint32_t b) const;
  [[nodiscard]] bool passes(std::uint32_t triangle, const Vec3d& from, const Vec3d& to) const;
  /// Whether triangles lie in one plane as far as their direction tells.
  [[nodiscard]] bool isParallel(std::uint32_t a, std::uint32_t b) const {
    return planes_[a].normal.cross(planes_[b].normal).length() <= 1e-6;
  }
  void addCuts(std::uint32_t triangle, std::uint32_t by, std::vector<WallCut>& cuts) const;
  void findCrossed();
  [[nodiscard]] std::vector<std::uint32_t> largestOfPatches(DisjointSets& patches) const;
  [[nodiscard]] std::vector<Left> cutCrossed(const LineWinding& winding) const;

  const Mesh& mesh_;
  MeshEdges edges_;
  std::uint32_t count_;
  std::vector<WallPlane> planes_;
  std::vector<BoxTree::Box> boxes_;
  BoxTree tree_;
  std::vector<char> crossed_;  ///< by triangle
  MeshBodies bodies_;
  std::vector<int> lowest_;  ///< the lowest numbers of the bodies
};

Walls::Walls(const Mesh& mesh)
    : mesh_(mesh),
      edges_(mesh),
      count_(static_cast<std::uint32_t>(mesh.triangles.size())),
      planes_(count_),
      boxes_(count_),
      crossed_(count_, 0),
      bodies_(mesh, edges_) {
  for (std::uint32_t t = 0; t < count_; ++t) {
    planes_[t] = planeOf(t);
    for (std::size_t c = 0; c < 3; ++c) boxes_[t].expand(corner(t, c));
    boxes_[t].expand(in_plane_mm);  // flat ones in one plane overlap
  }
  std::vector<std::uint32_t> all(count_);
  std::iota(all.begin(), all.end(), 0U);
  tree_ = BoxTree(boxes_, std::move(all));
}

/// Joins the triangles that meet, two alone, at an edge, unless one of them is crossed.
DisjointSets Walls::findPatches() const {
  DisjointSets patches(count_);
  for (std::uint32_t e = 0; e < edges_.size(); ++e) {
    const auto halves = edges_.halves(e);
    if (halves.size() == 2 && crossed_[halves[0] / 3] == 0 && crossed_[halves[1] / 3] == 0)
      patches.join(halves[0] / 3, halves[1] / 3);
  }
  return patches;
}

template <class Visit>
void Walls::visitNear(std::uint32_t triangle, const Visit& visit) const {
  const BoxTree::Box& own = boxes_[triangle];
  tree_.visit([&](const BoxTree::Box& box) { return own.hasOverlap(box); },
              [&](std::uint32_t other) { return other == triangle || visit(other); });
}

/// Whether a segment in the plane of a triangle passes through it, not along a side.
bool Walls::passes(std::uint32_t triangle, const Vec3d& from, const Vec3d& to) const {
  double first = 0;
  double last = 1;
  for (std::size_t side = 0; side < 3; ++side) {
    const Vec3d& a = corner(triangle, side);
    Vec3d inwards = planes_[triangle].normal.cross(corner(triangle, (side + 1) % 3) - a);
    inwards.normalize();
    const double at_from = inwards.dot(from - a);
    const double at_to = inwards.dot(to - a);
    if (std::max(at_from, at_to) <= in_plane_mm) return false;
    if (at_from < 0) first = std::max(first, at_from / (at_from - at_to));
    if (at_to < 0) last = std::min(last, at_from / (at_from - at_to));
  }
  return (last - first) * (to - from).length() > in_plane_mm;
}

/// False where a plane parts them: one of theirs, one along a side of each, or in one plane one
/// through a side. Touching is not meeting, unless a side lies in the plane of the other triangle
/// and passes through it: the neighbour at that side may go on beyond the plane.
bool Walls::mayIntersect(std::uint32_t a, std::uint32_t b) const {
  if (a > b) std::swap(a, b);  // the same for both
  bool one_plane = true;
  for (const auto& [by, other] : {std::pair(a, b), std::pair(b, a)}) {
    if (planes_[by].normal == Vec3d(0, 0, 0)) return false;
    int above = 0;
    int below = 0;
    std::array<Vec3d, 3> in;
    std::size_t in_plane = 0;
    for (std::size_t c = 0; c < 3; ++c) {
      const double height = planes_[by].at(corner(other, c));
      above += height > in_plane_mm;
      below += height < -in_plane_mm;
      if (std::abs(height) <= in_plane_mm) in[in_plane++] = corner(other, c);
    }
    if (in_plane == 3) continue;
    one_plane = false;
    if (above == 0 || below == 0) return in_plane == 2 && passes(by, in[0], in[1]);
  }
  const auto parts = [&](const Vec3d& axis) {
    const double length = axis.length();
    if (!(length > 1e-12)) return false;
    const auto span = [&](std::uint32_t t) {
      return std::minmax({axis.dot(corner(t, 0)), axis.dot(corner(t, 1)), axis.dot(corner(t, 2))});
    };
    const auto one = span(a);
    const auto two = span(b);
    return std::max(one.first - two.second, two.first - one.second) > -in_plane_mm * length;
  };
  for (std::size_t i = 0; i < 3; ++i) {
    const Vec3d side = corner(a, (i + 1) % 3) - corner(a, i);
    const Vec3d other = corner(b, (i + 1) % 3) - corner(b, i);
    if (one_plane &&
        (parts(side.cross(planes_[a].normal)) || parts(other.cross(planes_[a].normal))))
      return false;
    for (std::size_t j = 0; j < 3 && !one_plane; ++j)
      if (parts(side.cross(corner(b, (j + 1) % 3) - corner(b, j)))) return false;
  }
  return true;
}

/// Adds the segments on which a triangle meets another: a stretch through it, or sides in its
/// plane.
void Walls::addCuts(std::uint32_t triangle, std::uint32_t by, std::vector<WallCut>& cuts) const {
  const WallPlane& own = planes_[triangle];
  std::array<double, 3> height;
  std::array<bool, 3> is_in;
  double sum = 0;
  for (std::size_t c = 0; c < 3; ++c) {
    height[c] = own.at(corner(by, c));
    is_in[c] = std::abs(height[c]) <= in_plane_mm;
    sum += height[c];
  }
  const bool is_flat = isParallel(triangle, by) || (is_in[0] && is_in[1] && is_in[2]);
  std::array<Vec3d, 3> ends;
  std::size_t count = 0;
  for (std::size_t c = 0; c < 3; ++c) {
    const std::size_t next = (c + 1) % 3;
    const Vec3d& a = corner(by, c);
    const Vec3d& b = corner(by, next);
    if (is_flat) {
      Vec3d across = own.normal.cross(b - a);
      across.normalize();
      cuts.push_back({a, b, {across, across.dot(a)}, false, false, bodies_.of(by)});
    } else if (is_in[c] && is_in[next]) {
      cuts.push_back({a, b, planes_[by], sum > 0, sum < 0, bodies_.of(by)});
    } else if (is_in[c]) {
      ends[count++] = a;
    } else if (!is_in[next] && (height[c] > 0) != (height[next] > 0)) {
      ends[count++] = a + (b - a) * (height[c] / (height[c] - height[next]));
    }
  }
  if (count == 2) cuts.push_back({ends[0], ends[1], planes_[by], true, true, bodies_.of(by)});
}

/// Finds the triangles that others may intersect, and the numbers of the bodies.
void Walls::findCrossed() {
  enum : char { by_none, by_other_bodies, by_its_own };
  forAll(count_, [&](std::size_t i) {
    const auto t = static_cast<std::uint32_t>(i);
    crossed_[t] = by_none;
    visitNear(t, [&](std::uint32_t other) {
      const bool is_own = bodies_.of(other) == bodies_.of(t);
      if ((is_own || crossed_[t] == by_none) && mayIntersect(t, other))
        crossed_[t] = is_own ? by_its_own : by_other_bodies;
      return crossed_[t] != by_its_own;
    });
  });
  std::vector<char> crosses_itself(bodies_.count(), 0);
  for (std::uint32_t t = 0; t < count_; ++t)
    if (crossed_[t] == by_its_own) crosses_itself[bodies_.of(t)] = 1;
  lowest_ = bodies_.lowestNumbers(mesh_, edges_, crosses_itself);
}

/// Returns the largest triangle of each patch: of what hangs together without being crossed.
std::vector<std::uint32_t> Walls::largestOfPatches(DisjointSets& patches) const {
  constexpr std::uint32_t none = std::numeric_limits<std::uint32_t>::max();
  std::vector<std::uint32_t> largest;
  std::vector<std::uint32_t> place(count_, none);
  std::vector<double> area;
  for (std::uint32_t t = 0; t < count_; ++t) {
    if (crossed_[t] != 0) continue;
    const double own = (corner(t, 1) - corner(t, 0)).cross(corner(t, 2) - corner(t, 0)).length();
    std::uint32_t& at = place[patches.find(t)];
    if (at == none) {
      at = static_cast<std::uint32_t>(largest.size());
      largest.push_back(t);
      area.push_back(own);
    } else if (own > area[at]) {
      largest[at] = t;
      area[at] = own;
    }
  }
  return largest;
}

/// Cuts all triangles that are crossed.
std::vector<Walls::Left> Walls::cutCrossed(const LineWinding& winding) const {
  std::vector<Left> left;
  for (std::uint32_t t = 0; t < count_; ++t)
    if (crossed_[t] != 0) left.push_back({t});
  forAll(left.size(), [&](std::size_t i) {
    const std::uint32_t t = left[i].triangle;
    const Vec3d& normal = planes_[t].normal;
    std::vector<WallCut> cuts;
    bool is_opposed = false;
    visitNear(t, [&](std::uint32_t other) {
      if (!mayIntersect(t, other)) return true;
      addCuts(t, other, cuts);
      is_opposed |= isParallel(t, other) && normal.dot(planes_[other].normal) < 0;
      return true;
    });
    left[i].surface = WallCutter(winding, lowest_, normal, is_opposed)
                          .cut(wholeOf(t), std::move(cuts), left[i].pieces);
  });
  return left;
}

SwallowedWalls Walls::find() {
  SwallowedWalls walls;
  findCrossed();
  DisjointSets patches = findPatches();
  const std::vector<std::uint32_t> largest = largestOfPatches(patches);
  const bool none_crossed =
      std::all_of(crossed_.begin(), crossed_.end(), [](char by) { return by == 0; });
  if (none_crossed && largest.size() < 2) return walls;

  const LineWinding winding(mesh_, bodies_, boxes_);
  std::vector<char> surface(count_, 1);  // of patches, by their root
  std::vector<char> is_surface(largest.size());
  forAll(largest.size(), [&](std::size_t i) {
    const std::uint32_t t = largest[i];
    is_surface[i] =
        WallCutter(winding, lowest_, planes_[t].normal, true).isSurface(middleOf(wholeOf(t))) ? 1
                                                                                              : 0;
  });
  for (std::size_t i = 0; i < largest.size(); ++i)
    surface[patches.find(largest[i])] = is_surface[i];

  walls.hidden.assign(count_, false);
  for (std::uint32_t t = 0; t < count_; ++t) {
    if (crossed_[t] != 0 || surface[patches.find(t)] != 0) continue;
    walls.hidden[t] = true;
    ++walls.swallowed;
  }
  for (const Left& left : cutCrossed(winding)) {
    if (left.surface == WallCutter::Surface::all) continue;
    walls.hidden[left.triangle] = true;
    ++(left.surface == WallCutter::Surface::none ? walls.swallowed : walls.cut);
    for (const WallPiece& piece : left.pieces) {
      const auto first = static_cast<std::uint32_t>(walls.pieces.vertices.size());
      walls.pieces.vertices.insert(walls.pieces.vertices.end(), piece.begin(), piece.end());
      for (std::uint32_t corner = 2; corner < piece.size(); ++corner) {
        walls.pieces.triangles.push_back({first, first + corner - 1, first + corner});
        walls.piece_of.push_back(left.triangle);
      }
    }
  }
  if (walls.swallowed + walls.cut == 0) walls = {};
  return walls;
}

}  // namespace

SwallowedWalls swallowedWalls(const Mesh& mesh) { return Walls(mesh).find(); }

}  // namespace vdbdither
