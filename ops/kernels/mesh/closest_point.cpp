// The nearest point of a triangle: Ericson: "Real-Time Collision Detection", 2005, section
// 5.1.5. The sign: Bærentzen, Aanæs: "Signed Distance Computation Using the Angle Weighted
// Pseudonormal", IEEE Transactions on Visualization and Computer Graphics 11(3), 2005.

#include "ops/kernels/mesh/closest_point.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "ops/kernels/mesh/mesh_edges.h"

namespace vdbdither {

using openvdb::Vec3d;

namespace {

constexpr std::uint32_t leaf_triangles = 4;

double squaredDistance(const std::array<float, 3>& low, const std::array<float, 3>& high,
                       const Vec3d& p) {
  double sum = 0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double at = p[static_cast<int>(axis)];
    const double beyond = std::max({low[axis] - at, at - high[axis], 0.0});
    sum += beyond * beyond;
  }
  return sum;
}

float roundedDown(double value) {
  const auto rounded = static_cast<float>(value);
  return rounded <= value ? rounded
                          : std::nextafter(rounded, -std::numeric_limits<float>::infinity());
}
float roundedUp(double value) { return -roundedDown(-value); }

}  // namespace

PlaceOnTriangle nearestPlace(const Vec3d& a, const Vec3d& b, const Vec3d& c, const Vec3d& p) {
  const Vec3d ab = b - a;
  const Vec3d ac = c - a;
  const Vec3d ap = p - a;
  const double d1 = ab.dot(ap);
  const double d2 = ac.dot(ap);
  if (d1 <= 0 && d2 <= 0) return {0, {1, 0, 0}};
  const Vec3d bp = p - b;
  const double d3 = ab.dot(bp);
  const double d4 = ac.dot(bp);
  if (d3 >= 0 && d4 <= d3) return {1, {0, 1, 0}};
  const double vc = d1 * d4 - d3 * d2;
  if (vc <= 0 && d1 >= 0 && d3 <= 0) {
    const double along = d1 / (d1 - d3);
    return {3, {1 - along, along, 0}};
  }
  const Vec3d cp = p - c;
  const double d5 = ab.dot(cp);
  const double d6 = ac.dot(cp);
  if (d6 >= 0 && d5 <= d6) return {2, {0, 0, 1}};
  const double vb = d5 * d2 - d1 * d6;
  if (vb <= 0 && d2 >= 0 && d6 <= 0) {
    const double along = d2 / (d2 - d6);
    return {5, {1 - along, 0, along}};
  }
  const double va = d3 * d6 - d5 * d4;
  if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0) {
    const double along = (d4 - d3) / ((d4 - d3) + (d5 - d6));
    return {4, {0, 1 - along, along}};
  }
  const double sum = va + vb + vc;
  if (!(sum > 0)) return {6, {1, 0, 0}};  // a triangle without an area
  return {6, {va / sum, vb / sum, vc / sum}};
}

PointOnTriangle nearestOnTriangle(const Vec3d& a, const Vec3d& b, const Vec3d& c, const Vec3d& p) {
  const PlaceOnTriangle place = nearestPlace(a, b, c, p);
  switch (place.where) {
    case 0:
      return {a, place};
    case 1:
      return {b, place};
    case 2:
      return {c, place};
    case 4:
      return {b + (c - b) * place.weights[2], place};
    default:
      return {a + (b - a) * place.weights[1] + (c - a) * place.weights[2], place};
  }
}

struct ClosestPoints::Candidate {
  double squared = std::numeric_limits<double>::infinity();
  std::uint32_t triangle = 0;
  PointOnTriangle at{};
};

ClosestPoints::ClosestPoints(Mesh mesh) : mesh_(std::move(mesh)) {
  findNormals();
  std::vector<Vec3d> centres;
  centres.reserve(mesh_.triangles.size());
  for (const Mesh::Triangle& t : mesh_.triangles)
    centres.push_back((mesh_.vertices[t[0]] + mesh_.vertices[t[1]] + mesh_.vertices[t[2]]) / 3.0);
  order_.resize(mesh_.triangles.size());
  std::iota(order_.begin(), order_.end(), 0U);
  nodes_.reserve(order_.size());
  build(0, static_cast<std::uint32_t>(order_.size()), centres);
}

void ClosestPoints::findNormals() {
  normals_.reserve(mesh_.triangles.size());
  vertex_normals_.assign(mesh_.vertices.size(), Vec3d(0.0));
  for (const Mesh::Triangle& t : mesh_.triangles) {
    const std::array<Vec3d, 3> corners{mesh_.vertices[t[0]], mesh_.vertices[t[1]],
                                       mesh_.vertices[t[2]]};
    Vec3d normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
    const double length = normal.length();
    normal = length > 0 ? normal / length : Vec3d(0.0);
    normals_.push_back(normal);
    for (std::size_t n = 0; n < 3; ++n) {
      const Vec3d to = corners[(n + 1) % 3] - corners[n];
      const Vec3d from = corners[(n + 2) % 3] - corners[n];
      vertex_normals_[t[n]] += std::atan2(to.cross(from).length(), to.dot(from)) * normal;
    }
  }
  edge_normals_.assign(3 * mesh_.triangles.size(), Vec3d(0.0));
  const MeshEdges edges(mesh_);
  for (std::uint32_t edge = 0; edge < edges.size(); ++edge) {
    Vec3d sum(0.0);
    for (const std::uint32_t half : edges.halves(edge)) sum += normals_[half / 3];
    for (const std::uint32_t half : edges.halves(edge)) edge_normals_[half] = sum;
  }
}

std::uint32_t ClosestPoints::build(std::uint32_t begin, std::uint32_t end,
                                   const std::vector<Vec3d>& centres) {
  Vec3d low(std::numeric_limits<double>::infinity());
  Vec3d high = -low;
  Vec3d centre_low = low;
  Vec3d centre_high = high;
  for (std::uint32_t n = begin; n < end; ++n) {
    for (const std::uint32_t vertex : mesh_.triangles[order_[n]]) {
      low = openvdb::math::minComponent(low, mesh_.vertices[vertex]);
      high = openvdb::math::maxComponent(high, mesh_.vertices[vertex]);
    }
    centre_low = openvdb::math::minComponent(centre_low, centres[order_[n]]);
    centre_high = openvdb::math::maxComponent(centre_high, centres[order_[n]]);
  }
  const auto node = static_cast<std::uint32_t>(nodes_.size());
  nodes_.emplace_back();
  for (int axis = 0; axis < 3; ++axis) {
    nodes_[node].low[static_cast<std::size_t>(axis)] = roundedDown(low[axis]);
    nodes_[node].high[static_cast<std::size_t>(axis)] = roundedUp(high[axis]);
  }
  if (end - begin <= leaf_triangles) {
    nodes_[node].begin = begin;
    nodes_[node].count = end - begin;
    return node;
  }
  const Vec3d extent = centre_high - centre_low;
  const int axis = extent.x() >= extent.y() && extent.x() >= extent.z() ? 0
                   : extent.y() >= extent.z()                           ? 1
                                                                        : 2;
  const std::uint32_t middle = begin + (end - begin) / 2;
  std::nth_element(order_.begin() + begin, order_.begin() + middle, order_.begin() + end,
                   [&](std::uint32_t a, std::uint32_t b) {
                     return std::pair(centres[a][axis], a) < std::pair(centres[b][axis], b);
                   });
  build(begin, middle, centres);
  const std::uint32_t second = build(middle, end, centres);
  nodes_[node].begin = second;
  return node;
}

void ClosestPoints::consider(std::uint32_t triangle, const Vec3d& p, Candidate& best) const {
  const Mesh::Triangle& t = mesh_.triangles[triangle];
  const PointOnTriangle at =
      nearestOnTriangle(mesh_.vertices[t[0]], mesh_.vertices[t[1]], mesh_.vertices[t[2]], p);
  const double squared = (p - at.point).lengthSqr();
  if (squared < best.squared || (squared == best.squared && triangle < best.triangle))
    best = {squared, triangle, at};
}

ClosestPoint ClosestPoints::operator()(const Vec3d& p, std::uint32_t hint) const {
  Candidate best;
  consider(hint, p, best);
  struct Open {
    std::uint32_t node;
    double squared;
  };
  std::array<Open, 96> open;  // the tree is balanced: two for each of 32 levels at most
  std::size_t count = 0;
  open[count++] = {0, squaredDistance(nodes_[0].low, nodes_[0].high, p)};
  while (count > 0) {
    const Open next = open[--count];
    // Nodes as near as the best one count too: they may hold a lower triangle.
    if (next.squared > best.squared) continue;
    const Node& node = nodes_[next.node];
    if (node.count > 0) {
      for (std::uint32_t n = 0; n < node.count; ++n) consider(order_[node.begin + n], p, best);
      continue;
    }
    const std::uint32_t first = next.node + 1;
    Open near{first, squaredDistance(nodes_[first].low, nodes_[first].high, p)};
    Open far{node.begin, squaredDistance(nodes_[node.begin].low, nodes_[node.begin].high, p)};
    if (far.squared < near.squared) std::swap(near, far);
    open[count++] = far;
    open[count++] = near;
  }

  const Mesh::Triangle& t = mesh_.triangles[best.triangle];
  const auto corner = best.at.place.corner();
  const auto side = best.at.place.side();
  const Vec3d& normal = corner ? vertex_normals_[t[*corner]]
                        : side ? edge_normals_[3 * std::size_t{best.triangle} + *side]
                               : normals_[best.triangle];
  const double distance = std::sqrt(best.squared);
  return {normal.dot(p - best.at.point) < 0 ? -distance : distance, best.at.point, best.triangle};
}

}  // namespace vdbdither
