// Triangulation by ear clipping: G. H. Meisters, "Polygons Have Ears", American Mathematical
// Monthly 82(6), 1975; quadratic as in H. ElGindy, H. Everett, G. Toussaint, "Slicing an Ear Using
// Prune-and-Search", Pattern Recognition Letters 14(9), 1993.

#include "io/mesh/polygon.h"

#include <cmath>

namespace vdbdither {

using openvdb::Vec2d;
using openvdb::Vec3d;

namespace {

/// Twice the signed area of a triangle, positive where it turns to the left.
double turn(const Vec2d& a, const Vec2d& b, const Vec2d& c) {
  return (b.x() - a.x()) * (c.y() - a.y()) - (b.y() - a.y()) * (c.x() - a.x());
}

/// The polygon seen along the axis closest to its mean normal (Newell), so that it turns to the
/// left.
std::vector<Vec2d> flattened(const std::vector<Vec3d>& vertices,
                             std::span<const std::uint32_t> polygon) {
  const Vec3d origin = vertices[polygon[0]];
  Vec3d normal(0.0);
  for (std::size_t i = 1; i + 1 < polygon.size(); ++i) {
    normal += (vertices[polygon[i]] - origin).cross(vertices[polygon[i + 1]] - origin);
  }
  int axis = 0;
  for (int other = 1; other < 3; ++other) {
    if (std::abs(normal[other]) > std::abs(normal[axis])) axis = other;
  }
  const int u = normal[axis] < 0 ? (axis + 2) % 3 : (axis + 1) % 3;
  const int v = 3 - axis - u;
  std::vector<Vec2d> points;
  points.reserve(polygon.size());
  for (const std::uint32_t vertex : polygon) {
    points.emplace_back(vertices[vertex][u] - origin[u], vertices[vertex][v] - origin[v]);
  }
  return points;
}

/// The polygon that is left while ears are clipped: a ring of corners.
class Ring {
 public:
  explicit Ring(const std::vector<Vec2d>& points)
      : points_(points), before_(points.size()), after_(points.size()), ear_(points.size()) {
    const auto count = static_cast<std::uint32_t>(points.size());
    for (std::uint32_t i = 0; i < count; ++i) {
      before_[i] = (i + count - 1) % count;
      after_[i] = (i + 1) % count;
    }
    for (std::uint32_t i = 0; i < count; ++i) {
      if (turnAt(i) < 0) reflex_.push_back(i);
    }
    for (std::uint32_t i = 0; i < count; ++i) ear_[i] = isEar(i);
  }

  [[nodiscard]] std::uint32_t before(std::uint32_t i) const { return before_[i]; }
  [[nodiscard]] std::uint32_t after(std::uint32_t i) const { return after_[i]; }

  /// The next ear from `i` on, of `left` corners; where there is none, a corner without area, or
  /// else `i` itself.
  [[nodiscard]] std::uint32_t earFrom(std::uint32_t i, std::size_t left) const {
    std::uint32_t flat = i;
    for (std::size_t step = 0; step < left; ++step, i = after_[i]) {
      if (ear_[i]) return i;
      if (turnAt(i) == 0) flat = i;
    }
    return flat;
  }

  void clip(std::uint32_t i) {
    after_[before_[i]] = after_[i];
    before_[after_[i]] = before_[i];
    std::erase_if(reflex_, [&](std::uint32_t j) { return j == i || turnAt(j) >= 0; });
    ear_[before_[i]] = isEar(before_[i]);
    ear_[after_[i]] = isEar(after_[i]);
  }

 private:
  [[nodiscard]] double turnAt(std::uint32_t i) const {
    return turn(points_[before_[i]], points_[i], points_[after_[i]]);
  }

  /// Only reflex corners can lie in the way of a convex corner's diagonal.
  [[nodiscard]] bool isEar(std::uint32_t i) const {
    const Vec2d& a = points_[before_[i]];
    const Vec2d& b = points_[i];
    const Vec2d& c = points_[after_[i]];
    if (turn(a, b, c) <= 0) return false;
    for (const std::uint32_t j : reflex_) {
      const Vec2d& point = points_[j];
      if (point == a || point == b || point == c) continue;
      if (turn(a, b, point) >= 0 && turn(b, c, point) >= 0 && turn(c, a, point) >= 0) return false;
    }
    return true;
  }

  const std::vector<Vec2d>& points_;
  std::vector<std::uint32_t> before_;
  std::vector<std::uint32_t> after_;
  std::vector<bool> ear_;
  std::vector<std::uint32_t> reflex_;
};

/// Whether the triangles of the fan around the first corner all turn to the left: then they are a
/// cover.
bool isFan(const std::vector<Vec2d>& points) {
  for (std::size_t i = 1; i + 1 < points.size(); ++i) {
    if (turn(points[0], points[i], points[i + 1]) < 0) return false;
  }
  return true;
}

}  // namespace

void triangulate(const std::vector<Vec3d>& vertices, std::span<const std::uint32_t> polygon,
                 std::vector<Mesh::Triangle>& triangles, std::vector<Mesh::Triangle>* places) {
  const auto add = [&](std::uint32_t a, std::uint32_t b, std::uint32_t c) {
    triangles.push_back({polygon[a], polygon[b], polygon[c]});
    if (places != nullptr) places->push_back({a, b, c});
  };
  if (polygon.size() == 3) return add(0, 1, 2);
  const std::vector<Vec2d> points = flattened(vertices, polygon);
  if (isFan(points)) {
    for (std::uint32_t i = 1; i + 1 < polygon.size(); ++i) add(0, i, i + 1);
    return;
  }
  Ring ring(points);
  std::uint32_t at = 0;
  for (std::size_t left = polygon.size(); left > 2; --left) {
    const std::uint32_t ear = ring.earFrom(at, left);
    add(ring.before(ear), ear, ring.after(ear));
    at = ring.after(ear);
    ring.clip(ear);
  }
}

void PolygonCollector::add(std::span<const std::uint32_t> corners, const char* position) {
  places_.clear();
  if (corners.size() < 3) {
    ++incomplete_;
  } else if (corners.size() > most_corners) {
    file_.refuseAtByte(position, "a face has " + std::to_string(corners.size()) +
                                     " corners, at most " + std::to_string(most_corners) +
                                     " are read; export triangles");
  } else {
    triangulate(mesh_.vertices, corners, mesh_.triangles, keeps_places_ ? &places_ : nullptr);
  }
}

void PolygonCollector::finish() const {
  if (incomplete_ > 0) {
    file_.warn("ignored " + std::to_string(incomplete_) + " faces with fewer than 3 corners");
  }
}

}  // namespace vdbdither
