// A wall is surface where the winding number is zero on one of its sides alone. Away from where
// triangles intersect that does not change, so that a look at one triangle tells of all that hang
// together; triangles that others pass through are cut along their planes first.

#include "ops/kernels/mesh/swallowed_walls.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

#include <openvdb/math/BBox.h>
#include <tbb/parallel_for.h>

#include "ops/kernels/mesh/mesh_edges.h"
#include "ops/kernels/mesh/winding_number.h"

namespace vdbdither {

using openvdb::Vec3d;

namespace {

using Box = openvdb::math::BBox<Vec3d>;
using Pair = std::pair<std::uint32_t, std::uint32_t>;

/// Nearer than this a corner counts as in a plane: far above rounding, far below a voxel.
constexpr double in_plane_mm = 1e-7;
/// How far from a wall its sides are looked at.
constexpr double beside_mm = 1e-5;
constexpr std::uint32_t triangles_per_leaf = 6;

/// Pairs of triangles whose boxes overlap.
class BoxTree {
 public:
  explicit BoxTree(std::vector<Box> boxes) : boxes_(std::move(boxes)), order_(boxes_.size()) {
    std::iota(order_.begin(), order_.end(), 0U);
    nodes_.reserve(boxes_.size());
    if (!boxes_.empty()) build(0, static_cast<std::uint32_t>(boxes_.size()));
  }

  template <class Visit>
  void visitPairs(const Visit& visit) const {
    if (!nodes_.empty()) within(0, visit);
  }

 private:
  struct Node {
    Box box;
    std::uint32_t begin, end, second;
  };

  std::uint32_t build(std::uint32_t begin, std::uint32_t end) {
    const auto index = static_cast<std::uint32_t>(nodes_.size());
    nodes_.push_back({{}, begin, end, 0});
    Box middles;
    for (std::uint32_t i = begin; i < end; ++i) {
      nodes_[index].box.expand(boxes_[order_[i]]);
      middles.expand(boxes_[order_[i]].getCenter());
    }
    if (end - begin <= triangles_per_leaf) return index;
    const auto axis = static_cast<int>(middles.maxExtent());
    const std::uint32_t half = begin + (end - begin) / 2;
    const auto key = [&](std::uint32_t i) { return boxes_[i].min()[axis] + boxes_[i].max()[axis]; };
    std::nth_element(order_.begin() + begin, order_.begin() + half, order_.begin() + end,
                     [&](std::uint32_t a, std::uint32_t b) {
                       return std::pair(key(a), a) < std::pair(key(b), b);
                     });
    build(begin, half);
    const std::uint32_t second = build(half, end);
    nodes_[index].second = second;
    return index;
  }

  template <class Visit>
  void within(std::uint32_t node, const Visit& visit) const {
    const Node& own = nodes_[node];
    if (own.second != 0) {
      within(node + 1, visit);
      within(own.second, visit);
      between(node + 1, own.second, visit);
      return;
    }
    for (std::uint32_t i = own.begin; i < own.end; ++i)
      for (std::uint32_t j = i + 1; j < own.end; ++j) meet(order_[i], order_[j], visit);
  }
  template <class Visit>
  void between(std::uint32_t a, std::uint32_t b, const Visit& visit) const {
    const Node& one = nodes_[a];
    const Node& two = nodes_[b];
    if (!one.box.hasOverlap(two.box)) return;
    if (one.second == 0 && two.second == 0) {
      for (std::uint32_t i = one.begin; i < one.end; ++i)
        for (std::uint32_t j = two.begin; j < two.end; ++j) meet(order_[i], order_[j], visit);
    } else if (two.second == 0 || (one.second != 0 && one.end - one.begin > two.end - two.begin)) {
      between(a + 1, b, visit);
      between(one.second, b, visit);
    } else {
      between(a, b + 1, visit);
      between(a, two.second, visit);
    }
  }
  template <class Visit>
  void meet(std::uint32_t a, std::uint32_t b, const Visit& visit) const {
    if (boxes_[a].hasOverlap(boxes_[b])) visit(a, b);
  }

  std::vector<Box> boxes_;
  std::vector<std::uint32_t> order_;
  std::vector<Node> nodes_;
};

struct Plane {
  Vec3d normal;  ///< unit
  double offset;

  [[nodiscard]] double at(const Vec3d& p) const { return normal.dot(p) - offset; }
};

using Polygon = std::vector<Vec3d>;

/// Triangles that hang together, each group known by its lowest.
class Groups {
 public:
  explicit Groups(std::uint32_t triangles) : lower_(triangles) {
    std::iota(lower_.begin(), lower_.end(), 0U);
  }

  /// Joins those that meet, two alone, at an edge, unless `parted` tells one of them from the rest.
  template <class Parted>
  void join(const MeshEdges& edges, const Parted& parted) {
    for (std::uint32_t e = 0; e < edges.size(); ++e) {
      const auto halves = edges.halves(e);
      if (halves.size() != 2 || parted(halves[0] / 3) || parted(halves[1] / 3)) continue;
      const std::uint32_t a = of(halves[0] / 3);
      const std::uint32_t b = of(halves[1] / 3);
      lower_[std::max(a, b)] = std::min(a, b);
    }
  }

  [[nodiscard]] std::uint32_t of(std::uint32_t triangle) {
    while (lower_[triangle] != triangle) triangle = lower_[triangle] = lower_[lower_[triangle]];
    return triangle;
  }

 private:
  std::vector<std::uint32_t> lower_;
};

class Walls {
 public:
  explicit Walls(const Mesh& mesh) : mesh_(mesh), edges_(mesh) {}

  SwallowedWalls find();

 private:
  [[nodiscard]] const Vec3d& corner(std::uint32_t triangle, std::size_t corner) const {
    return mesh_.vertices[mesh_.triangles[triangle][corner]];
  }
  [[nodiscard]] Plane planeOf(std::uint32_t triangle) const {
    const Vec3d& a = corner(triangle, 0);
    Vec3d normal = (corner(triangle, 1) - a).cross(corner(triangle, 2) - a);
    const double length = normal.length();
    if (length > 0) normal /= length;
    return {normal, normal.dot(a)};
  }
  [[nodiscard]] std::vector<Pair> intersections() const;
  [[nodiscard]] bool mayIntersect(std::uint32_t a, std::uint32_t b) const;
  [[nodiscard]] bool isSurface(const WindingNumber& winding, const Vec3d& p,
                               const Vec3d& normal) const;
  void cut(std::uint32_t triangle, const Pair* first, const Pair* last,
           std::vector<Polygon>& pieces) const;

  const Mesh& mesh_;
  MeshEdges edges_;
  std::vector<std::uint32_t> shell_;  ///< by triangle
  std::vector<Plane> planes_;
  std::vector<Box> boxes_;
};

/// False where a plane parts them: one of theirs, one along a side of each, or in one plane one
/// through a side; touching is not meeting. Of triangles of one shell that share a vertex nothing
/// else is expected.
bool Walls::mayIntersect(std::uint32_t a, std::uint32_t b) const {
  bool joined = false;
  for (const std::uint32_t v : mesh_.triangles[a])
    for (const std::uint32_t w : mesh_.triangles[b]) joined |= v == w;
  if (joined && shell_[a] == shell_[b]) return false;
  bool one_plane = true;
  for (const auto& [by, other] : {Pair(a, b), Pair(b, a)}) {
    if (planes_[by].normal == Vec3d(0, 0, 0)) return false;
    int above = 0;
    int below = 0;
    for (std::size_t c = 0; c < 3; ++c) {
      const double height = planes_[by].at(corner(other, c));
      above += height > in_plane_mm;
      below += height < -in_plane_mm;
    }
    if (above == 3 || below == 3) return false;
    one_plane &= above + below == 0;
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

/// Every pair both ways, sorted.
std::vector<Pair> Walls::intersections() const {
  std::vector<Pair> pairs;
  BoxTree(boxes_).visitPairs([&](std::uint32_t a, std::uint32_t b) {
    if (!mayIntersect(a, b)) return;
    pairs.emplace_back(a, b);
    pairs.emplace_back(b, a);
  });
  std::sort(pairs.begin(), pairs.end());
  return pairs;
}

bool Walls::isSurface(const WindingNumber& winding, const Vec3d& p, const Vec3d& normal) const {
  const bool inside = std::abs(winding.at(p - normal * beside_mm)) > 0.5;
  const bool outside = std::abs(winding.at(p + normal * beside_mm)) > 0.5;
  return inside != outside;
}

/// Parts polygons by a plane.
void part(std::vector<Polygon>& polygons, const Plane& plane, const Box& near) {
  std::vector<Polygon> parted;
  for (const Polygon& polygon : polygons) {
    Box box;
    bool above = false;
    bool below = false;
    for (const Vec3d& p : polygon) {
      box.expand(p);
      above |= plane.at(p) > in_plane_mm;
      below |= plane.at(p) < -in_plane_mm;
    }
    if (!above || !below || !box.hasOverlap(near)) {
      parted.push_back(polygon);
      continue;
    }
    std::array<Polygon, 2> halves;
    for (std::size_t i = 0; i < polygon.size(); ++i) {
      const Vec3d& p = polygon[i];
      const Vec3d& q = polygon[(i + 1) % polygon.size()];
      const double at_p = plane.at(p);
      const double at_q = plane.at(q);
      if (at_p >= 0) halves[0].push_back(p);
      if (at_p <= 0) halves[1].push_back(p);
      if ((at_p > 0 && at_q < 0) || (at_p < 0 && at_q > 0)) {
        const Vec3d between = p + (q - p) * (at_p / (at_p - at_q));
        halves[0].push_back(between);
        halves[1].push_back(between);
      }
    }
    for (Polygon& half : halves)
      if (half.size() > 2) parted.push_back(std::move(half));
  }
  polygons = std::move(parted);
}

/// The pieces of a triangle between the planes of the triangles [first, last) that cut it.
void Walls::cut(std::uint32_t triangle, const Pair* first, const Pair* last,
                std::vector<Polygon>& pieces) const {
  pieces.assign(1, {corner(triangle, 0), corner(triangle, 1), corner(triangle, 2)});
  for (const Pair* pair = first; pair != last; ++pair) {
    const std::uint32_t other = pair->second;
    Box near = boxes_[other];
    near.expand(in_plane_mm);
    const Plane& plane = planes_[other];
    if (planes_[triangle].normal.cross(plane.normal).length() > 1e-6) {
      part(pieces, plane, near);
      continue;
    }
    for (std::size_t side = 0; side < 3; ++side) {  // in one plane
      const Vec3d& a = corner(other, side);
      Vec3d across = plane.normal.cross(corner(other, (side + 1) % 3) - a);
      across.normalize();
      part(pieces, {across, across.dot(a)}, near);
    }
  }
}

SwallowedWalls Walls::find() {
  const auto count = static_cast<std::uint32_t>(mesh_.triangles.size());
  planes_.resize(count);
  boxes_.resize(count);
  for (std::uint32_t t = 0; t < count; ++t) {
    planes_[t] = planeOf(t);
    for (std::size_t c = 0; c < 3; ++c) boxes_[t].expand(corner(t, c));
    boxes_[t].expand(in_plane_mm);  // flat ones in one plane overlap
  }
  Groups shells(count);
  shells.join(edges_, [](std::uint32_t) { return false; });
  shell_.resize(count);
  for (std::uint32_t t = 0; t < count; ++t) shell_[t] = shells.of(t);
  const std::vector<Pair> pairs = intersections();
  std::vector<bool> crossed(count, false);
  for (const Pair& pair : pairs) crossed[pair.first] = true;

  // What hangs together without a crossing, each with its largest triangle.
  constexpr std::uint32_t none = std::numeric_limits<std::uint32_t>::max();
  Groups patch(count);
  patch.join(edges_, [&](std::uint32_t t) { return crossed[t]; });
  std::vector<std::uint32_t> largest(count, none);
  std::vector<double> area(count, 0);
  std::vector<std::uint32_t> patches;
  for (std::uint32_t t = 0; t < count; ++t) {
    if (crossed[t]) continue;
    const double own = (corner(t, 1) - corner(t, 0)).cross(corner(t, 2) - corner(t, 0)).length();
    const std::uint32_t of = patch.of(t);
    if (of == t) patches.push_back(t);
    if (largest[of] == none || own > area[of]) {
      largest[of] = t;
      area[of] = own;
    }
  }
  SwallowedWalls walls;
  if (pairs.empty() && patches.size() == 1) return walls;

  const WindingNumber winding(mesh_);
  const auto middleOf = [](const Polygon& polygon) {
    return std::accumulate(polygon.begin(), polygon.end(), Vec3d(0, 0, 0)) /
           static_cast<double>(polygon.size());
  };
  std::vector<char> surface(count, 1);  // of patches, by their root
  tbb::parallel_for(std::size_t{0}, patches.size(), [&](std::size_t i) {
    const std::uint32_t t = largest[patches[i]];
    surface[patches[i]] =
        isSurface(winding, middleOf({corner(t, 0), corner(t, 1), corner(t, 2)}), planes_[t].normal);
  });
  struct Left {
    std::vector<Polygon> pieces;
    std::size_t of = 0;  ///< so many
  };
  std::vector<std::size_t> begins;  // of every crossed triangle's pairs
  for (std::size_t i = 0; i < pairs.size(); ++i)
    if (i == 0 || pairs[i].first != pairs[i - 1].first) begins.push_back(i);
  begins.push_back(pairs.size());
  std::vector<Left> left(begins.size() - 1);
  tbb::parallel_for(std::size_t{0}, left.size(), [&](std::size_t i) {
    const std::uint32_t t = pairs[begins[i]].first;
    std::vector<Polygon>& pieces = left[i].pieces;
    cut(t, pairs.data() + begins[i], pairs.data() + begins[i + 1], pieces);
    left[i].of = pieces.size();
    std::erase_if(pieces, [&](const Polygon& piece) {
      return !isSurface(winding, middleOf(piece), planes_[t].normal);
    });
  });

  walls.hidden.assign(count, false);
  for (std::uint32_t t = 0; t < count; ++t) {
    if (crossed[t] || surface[patch.of(t)] != 0) continue;
    walls.hidden[t] = true;
    ++walls.swallowed;
  }
  for (std::size_t i = 0; i < left.size(); ++i) {
    const std::uint32_t t = pairs[begins[i]].first;
    if (left[i].pieces.size() == left[i].of) continue;
    walls.hidden[t] = true;
    ++(left[i].pieces.empty() ? walls.swallowed : walls.cut);
    for (const Polygon& piece : left[i].pieces) {
      const auto first = static_cast<std::uint32_t>(walls.pieces.vertices.size());
      walls.pieces.vertices.insert(walls.pieces.vertices.end(), piece.begin(), piece.end());
      for (std::uint32_t corner = 2; corner < piece.size(); ++corner) {
        walls.pieces.triangles.push_back({first, first + corner - 1, first + corner});
        walls.piece_of.push_back(t);
      }
    }
  }
  if (walls.swallowed + walls.cut == 0) walls = {};
  return walls;
}

}  // namespace

SwallowedWalls swallowedWalls(const Mesh& mesh) { return Walls(mesh).find(); }

}  // namespace vdbdither
